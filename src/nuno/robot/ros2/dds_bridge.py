"""DdsBridge: topics of ROS 2 over DDS, to which a program publishes fields by name; nothing of robots."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from typing import Any

from nuno.errors import InvalidInputError, NotConnectedError
from nuno.robot.ros2.dds_types import dds_type, from_dds, import_cyclonedds, to_dds
from nuno.robot.ros2.definitions import DEFINITIONS

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

KEPT = 10
"""Messages of a topic that wait for a slow reader; the oldest go first. ROS' own default."""
MAX_SAMPLES = 200
"""Messages that are read of one topic at once."""
MAX_DOMAIN = 232
LOCAL = """<CycloneDDS><Domain id="any"><General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
"""Settings of CycloneDDS that keep to this machine, as ROS_LOCALHOST_ONLY asks for."""


class DdsBridge:
    """A participant of a DDS domain, with writers and readers whose names and types are those of ROS 2.

    Args:
        domain: [0, 232]; None takes ROS_DOMAIN_ID, else 0. ROS_LOCALHOST_ONLY=1 keeps to this machine.

    Raises:
        MissingPackageError: cyclonedds is not installed.
        InvalidInputError: another domain.
        NotConnectedError: DDS cannot start: no network interface, or settings in CYCLONEDDS_URI that cannot be read.
    """

    def __init__(self, domain: int | None = None) -> None:
        import_cyclonedds()
        from cyclonedds.core import DDSException
        from cyclonedds.domain import Domain, DomainParticipant

        self.domain = _checked_domain(domain)
        self._domain: Any = None
        if os.environ.get("ROS_LOCALHOST_ONLY") == "1":
            try:
                self._domain = Domain(self.domain, LOCAL)
            except DDSException:
                logger.debug("the domain %d has its settings already", self.domain)
        try:
            self._participant: Any = DomainParticipant(self.domain)
        except DDSException as error:
            raise NotConnectedError(f"cannot join the DDS domain {self.domain}: {error}") from error
        self._writers: dict[str, tuple[str, Any]] = {}
        self._readers: dict[str, tuple[str, Any]] = {}
        self._latched: dict[str, Fields] = {}

    def close(self) -> None:
        """Leave the domain; others learn of it."""
        self._writers, self._readers, self._participant, self._domain = {}, {}, None, None

    def advertise(self, topic: str, kind: str, latched: bool = False) -> bool:
        """Make a topic known that this program publishes, and return whether its type is known here.

        Args:
            topic: "/joint_states".
            kind: "sensor_msgs/msg/JointState".
            latched: Whether those that subscribe later get the last message.
        """
        if kind not in DEFINITIONS:
            logger.info("%s is not published: %s is not defined here", topic, kind)
            return False
        self._writers[topic] = kind, self._writer(f"rt{topic}", kind, latched)
        if topic in self._latched:
            self.publish(topic, self._latched.pop(topic))
        return True

    def listen(self, topic: str, kind: str) -> None:
        """Read a topic from now on; ``take`` returns what has come."""
        self._readers[topic] = kind, self._reader(f"rt{topic}", kind)

    def serve(self, service: str, kind: str) -> None:
        """Answer a service from now on: "action_msgs/srv/CancelGoal"; ``take`` returns requests, ``answer`` answers."""
        self._readers[service] = f"{kind}_Request", self._reader(f"rq{service}Request", f"{kind}_Request")
        self._writers[service] = f"{kind}_Response", self._writer(f"rr{service}Reply", f"{kind}_Response", False)

    def answer(self, service: str, request: Fields, fields: Fields) -> None:
        """Answer a request of a service that ``take`` returned."""
        self._write(service, {"guid": request["guid"], "seq": request["seq"], **fields})

    def has_subscribers(self, topic: str) -> bool:
        """Return True if anyone would get what is published."""
        own = self._writers.get(topic)
        return own is not None and own[1].get_publication_matched_status().current_count > 0

    def has_publishers(self, topic: str) -> bool:
        """Return True if anyone publishes to a topic, or asks a service, that is read here."""
        return bool(self._readers[topic][1].get_subscription_matched_status().current_count > 0)

    def publish(self, topic: str, message: Fields, latched: bool = False) -> None:
        """Send a message to all that have subscribed to its topic, without waiting; unknown topics are left out.

        Args:
            topic: Its name.
            message: The message's fields; those that are left out are zero or empty.
            latched: Whether it is kept until the topic is advertised.
        """
        if topic in self._writers:
            self._write(topic, message)
        elif latched:
            self._latched[topic] = message

    def take(self, topic: str) -> list[Fields]:
        """Return the messages, or requests of a service, that have come since the last call; faulty ones are logged."""
        kind, reader = self._readers[topic]
        try:
            samples = reader.take(N=MAX_SAMPLES)
        except Exception as error:  # what a program sent that has the type's name and another layout
            logger.warning("a message on %s could not be read: %s: %s", topic, type(error).__name__, error)
            return []
        own = dds_type(kind)
        return [from_dds(kind, sample) for sample in samples if isinstance(sample, own)]

    def _write(self, topic: str, message: Mapping[str, Any]) -> None:
        from cyclonedds.core import DDSException

        kind, writer = self._writers[topic]
        try:
            writer.write(to_dds(kind, message))
        except DDSException as error:  # a reader that wants every message and takes none
            logger.debug("%s was not published: %s", topic, error)

    def _writer(self, name: str, kind: str, latched: bool) -> Any:
        from cyclonedds.pub import DataWriter

        return DataWriter(self._participant, self._topic(name, kind), qos=_quality(latched, 1 if latched else KEPT))

    def _reader(self, name: str, kind: str) -> Any:
        from cyclonedds.sub import DataReader

        return DataReader(self._participant, self._topic(name, kind), qos=_quality(False, MAX_SAMPLES))

    def _topic(self, name: str, kind: str) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, name, dds_type(kind))


def _quality(latched: bool, kept: int) -> Any:
    """Return qualities of service as ROS 2 has them by default: reliable, the last ones kept, nothing blocks."""
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(0), Policy.History.KeepLast(kept),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),  # ROS 2 calls the field "sec" also "sec_"
    )  # fmt: skip


def _checked_domain(domain: int | None) -> int:
    given: Any = domain
    if domain is None:
        text = os.environ.get("ROS_DOMAIN_ID") or "0"
        given = int(text) if text.isdecimal() else text
    if isinstance(given, bool) or not isinstance(given, int) or not 0 <= given <= MAX_DOMAIN:
        what = "ROS_DOMAIN_ID" if domain is None else "domain"
        raise InvalidInputError(f"{what} must be a whole number in [0, {MAX_DOMAIN}], got {given!r}")
    return given
