"""Broadcast: what a robot's server publishes of the robot."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any, Protocol

from nuno.errors import RobotModelError
from nuno.robot.interface import WRENCHES, RobotInterface
from nuno.robot.joint_interface import Controller
from nuno.robot.readings import JointState
from nuno.robot.wire import image_messages as images
from nuno.robot.wire import messages as ros
from nuno.robot.wire.names import Names
from nuno.robot.wire.protocol import EXECUTING
from nuno.robot.wire.transforms import camera_frame, link_transforms

logger = logging.getLogger(__name__)

Fields = dict[str, Any]


class Publisher(Protocol):
    """The part of a bridge that publishes."""

    def has_subscribers(self, topic: str) -> bool:
        """Return True if anyone would get what is published."""

    def publish(self, topic: str, message: Fields, latched: bool = False) -> None:
        """Send a message to all that have subscribed to its topic; latched, to those that come later too."""


class Broadcast:
    """The topics of a robot: clock, joints, controllers, base, forces.

    What nobody has subscribed to is not read from the robot.

    Args:
        robot: The robot.
        bridge: Where it is published.
        names: Of the topics.
        controllers: Of the robot.
        image_rate: Images a second of the robot's time, of every camera that somebody looks through.

    Attributes:
        seconds: The last publication took [s], its images aside.
    """

    def __init__(
        self, robot: RobotInterface, bridge: Publisher, names: Names, controllers: list[Controller], image_rate: float,
    ) -> None:  # fmt: skip
        self.robot, self.bridge, self.names, self.controllers = robot, bridge, names, controllers
        self._busy: dict[str, bool] = {}
        self._asked: str | None = None
        self.seconds = 0.0
        self._image_interval = 1.0 / image_rate
        self._wrenches = [frame for frame in WRENCHES.values() if self._has(robot.read_wrench, frame)]
        self._has_imu = self._has(robot.read_imu)
        self._cameras = robot.shown_cameras
        self._shown: dict[str, float] = {}  # by topic, when an image was last published [s]
        self._base_link = robot.robot.model.frames[2].name  # after the universe and the free joint
        urdf = robot.robot.description.urdf.read_text(encoding="utf-8")
        bridge.publish(names.full(names.description), {"data": urdf}, latched=True)

    @property
    def topics(self) -> dict[str, str]:
        """The types of all topics, by name."""
        own = self.names
        found = {
            own.full(own.clock): ros.CLOCK, own.full(own.joint_states): ros.JOINT_STATE,
            own.full(own.odometry): ros.ODOMETRY, own.full(own.description): ros.STRING,
        }  # fmt: skip
        for controller in self.controllers:
            found[own.state_of(controller)] = ros.CONTROLLER_STATE
            found[own.status_of(controller)] = ros.STATUS
        found |= {own.full(own.wrench, frame=frame): ros.WRENCH for frame in self._wrenches}
        found[own.full(own.transforms)] = ros.TRANSFORMS
        for camera in self._cameras:
            found[own.full(own.image, camera=camera)] = images.IMAGE
            found[own.full(own.compressed, camera=camera)] = images.COMPRESSED_IMAGE
            found[own.full(own.depth, camera=camera)] = images.IMAGE
            found[own.full(own.camera_info, camera=camera)] = images.CAMERA_INFO
        return found | ({own.full(own.imu): ros.IMU} if self._has_imu else {})

    def publish(self, asked: str | None = None) -> None:
        """Publish everything as it is now, images where they are due.

        Args:
            asked: A topic that is due as somebody has just subscribed to it, which alone is published.
        """
        own, time = self.names, self.robot.now()
        self._asked = asked
        self._publish_images(time, asked)
        begin = perf_counter()
        self._send(own.transforms, lambda: {"transforms": link_transforms(self.robot, time)})
        self._send(own.clock, lambda: {"clock": ros.time_fields(time)})
        state = self.robot.read_joint_state()
        if state is not None:
            self._send(own.joint_states, lambda: ros.joint_state_fields(state))
        self._send(own.odometry, lambda: self._odometry(time))
        watched = [c for c in self.controllers if self._is_wanted(own.state_of(c))]
        reference = self.robot.read_reference() if watched else None
        for controller in watched:
            fields = motion_fields(controller["joint_names"], reference, state, time)
            self.bridge.publish(own.state_of(controller), fields)
        for frame in self._wrenches:
            self._send(own.wrench.format(frame=frame), partial(self._wrench, time, frame))
        if self._has_imu:
            self._send(own.imu, lambda: ros.imu_fields(self.robot.read_imu(), "imu"))
        self.seconds = perf_counter() - begin

    def publish_status(self) -> None:
        """Publish which controllers follow goals, where that has changed."""
        for controller in self.controllers:
            name, busy = controller["controller_type"], self.robot.is_busy(controller)
            if busy != self._busy.get(name):
                self._busy[name] = busy
                info = {"goal_id": {"uuid": list(uuid.uuid4().bytes)}, "stamp": ros.time_fields(self.robot.now())}
                goals = [{"goal_info": info, "status": EXECUTING}] if busy else []
                self.bridge.publish(self.names.status_of(controller), {"status_list": goals}, latched=True)

    def _publish_images(self, time: float, asked: str | None) -> None:
        own = self.names
        for camera in self._cameras:
            frame, topics = camera_frame(camera), [
                own.full(name, camera=camera) for name in (own.image, own.compressed, own.depth, own.camera_info)
            ]  # fmt: skip
            due = [self._is_wanted(topic) and (topic == asked or self._is_due(topic, time)) for topic in topics]
            self._shown |= {topic: time for topic, now in zip(topics, due, strict=True) if now}
            if due[0] or due[1]:
                reading = self.robot.read_image(camera)
                if due[0]:
                    self.bridge.publish(topics[0], images.image_fields(reading, frame))
                if due[1]:
                    self.bridge.publish(topics[1], images.compressed_fields(reading, frame))
            if due[2]:
                self.bridge.publish(topics[2], images.image_fields(self.robot.read_depth(camera), frame))
            if due[3]:
                fields = images.camera_info_fields(time, self.robot.camera_info(camera), frame)
                self.bridge.publish(topics[3], fields)

    def _is_due(self, topic: str, time: float) -> bool:
        last = self._shown.get(topic)
        return last is None or not last <= time < last + self._image_interval - 1e-9  # time may go back

    def _send(self, name: str, fields: Callable[[], Fields]) -> None:
        topic = self.names.full(name)
        if self._is_wanted(topic):
            self.bridge.publish(topic, fields())

    def _is_wanted(self, topic: str) -> bool:
        return self._asked in (None, topic) and self.bridge.has_subscribers(topic)

    def _wrench(self, time: float, frame: str) -> Fields:
        return ros.wrench_fields(time, self.robot.read_wrench(frame), frame)

    def _odometry(self, time: float) -> Fields:
        base = self.robot.read_base()
        pose = {"position": ros.vector_fields(base.position), "orientation": ros.quaternion_fields(base.quaternion)}
        still = {"linear": ros.vector_fields((0, 0, 0)), "angular": ros.vector_fields((0, 0, 0))}
        return {
            "header": ros.header_fields(time, "odom"), "child_frame_id": self._base_link, "pose": {"pose": pose},
            "twist": {"twist": still},
        }  # fmt: skip

    def _has(self, read: Any, *arguments: Any) -> bool:
        try:
            read(*arguments)
        except RobotModelError as error:
            logger.info("not published: %s", error)
            return False
        return True


def motion_fields(joints: list[str], reference: JointState | None, state: JointState | None, time: float) -> Fields:
    """Return what a controller tells of its joints: where they are to be, where they are, and the difference.

    Args:
        joints: The controller's.
        reference: Where joints are to be, None where that is not known.
        state: Where they are, likewise.
        time: [s].
    """
    wanted, actual = _positions(joints, reference), _positions(joints, state)
    error = [a - b for a, b in zip(wanted, actual, strict=True)] if wanted and actual else []
    return {
        "header": ros.header_fields(time), "joint_names": list(joints),
        "reference": {"positions": wanted}, "feedback": {"positions": actual}, "error": {"positions": error},
        "desired": {"positions": wanted}, "actual": {"positions": actual},
    }  # fmt: skip


def _positions(joints: list[str], state: JointState | None) -> list[float]:
    if state is None:
        return []
    known = dict(zip(state.names, state.positions.tolist(), strict=True))
    return [known[joint] for joint in joints] if all(joint in known for joint in joints) else []
