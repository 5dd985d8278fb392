"""Ros2Server: a robot, most often a simulated one, in a ROS 2 graph."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

from nuno.robot.interface import RobotInterface
from nuno.robot.ros2.dds_bridge import DdsBridge
from nuno.robot.ros2.definitions import DEFINITIONS
from nuno.robot.ros2.follow_action import FollowAction
from nuno.robot.serving import Serving
from nuno.robot.wire import messages as ros
from nuno.robot.wire.broadcast import Broadcast
from nuno.robot.wire.commands import Commands
from nuno.robot.wire.names import Names
from nuno.robot.wire.protocol import Message
from nuno.validation import checked, number

logger = logging.getLogger(__name__)

LATE = 0.25
"""[s] A simulation that is later than this behind real time gives the lost time up."""
YIELD = 1e-4
"""[s] In which a program that wants the robot's lock gets its turn, though the simulation is late."""


class TopicClient:
    """Those who publish to a topic that the robot takes, as one client of ``Commands``.

    Args:
        topic: Its name.
        kind: Its type.
    """

    def __init__(self, topic: str, kind: str) -> None:
        self.name, self.topic, self.kind, self.is_there = f"the ROS 2 topic {topic}", topic, kind, False

    def send(self, message: Message) -> None:
        """Nothing: who publishes to a topic hears of no answer."""

    def complain(self, text: str, identity: Any = None) -> None:
        """Log what was wrong."""
        logger.warning("%s: %s", self.name, text)


class Ros2Server(Serving):
    """A participant in a ROS 2 graph: programs of ROS 2 on the same domain see the robot's topics and actions.

    It needs no installation of ROS: CycloneDDS comes with pip. As with ``RobotServer`` the robot belongs to a thread of
    the server, and a program that uses it besides holds ``lock`` meanwhile. When all who publish to a topic, or send
    goals to an action, are gone, what they asked for stops, and the joints hold where they are.

    Args:
        robot: The robot, whose ``sleep`` lets its simulation go on, as fast as it can.
        domain: [0, 232]; None takes ROS_DOMAIN_ID, else 0. All machines of the network on the same domain may move the
            robot, unless ROS_LOCALHOST_ONLY is 1.
        real_time_factor: Simulated over real time; ``inf`` is as fast as possible.
        names: Of topics and actions.
        tick: Between two looks at the robot [s]; None takes the frames of the robot's world, else 0.01 s.
        image_rate: Images a second of the robot's time, of every camera that somebody looks through.

    Raises:
        MissingPackageError: cyclonedds is not installed.
        NotConnectedError: DDS cannot start.
        InvalidInputError: a value out of range.
    """

    @checked
    def __init__(
        self, robot: RobotInterface, domain: int | None = None, *, real_time_factor: float = 1.0,
        names: Names | None = None, tick: float | None = None, image_rate: float = 10.0,
    ) -> None:  # fmt: skip
        rate = real_time_factor
        self._factor = rate if rate == float("inf") else number("real_time_factor", rate, above=0.0)
        interval = number("image_rate", image_rate, above=0.0)
        super().__init__(robot, tick)
        self._bridge = DdsBridge(domain)
        chosen = names or Names()
        controllers = [client.controller for client in robot.controller_actions]
        self._broadcast = Broadcast(robot, self._bridge, chosen, controllers, interval)
        self._commands = Commands(robot, self._broadcast, chosen, controllers, {})
        self._begin(chosen)

    def __repr__(self) -> str:
        return f"<Ros2Server of {self.robot.robot.name!r} in the domain {self.domain}>"

    @property
    def domain(self) -> int:
        """The domain that it is in."""
        return self._bridge.domain

    def close(self) -> None:
        """Stop what others have asked for and leave the graph; a second time does nothing."""
        self._closing.set()
        self._thread.join()

    def _begin(self, names: Names) -> None:
        topics = {topic: kind for topic, kind in self._broadcast.topics.items() if kind != ros.STATUS}
        for topic, kind in topics.items():
            self._bridge.advertise(topic, kind, latched=topic == names.full(names.description))
        self._topics = [TopicClient(topic, kind) for topic, kind in self._commands.taken.items() if kind in DEFINITIONS]
        for client in self._topics:
            self._bridge.listen(client.topic, client.kind)
        follow = [names.full(own["controller_action"]) for own in self._broadcast.controllers]
        self._actions = [FollowAction(self._bridge, action) for action in follow]
        self._are_there = dict.fromkeys(follow, False)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="nuno-ros2", daemon=True)
        self._thread.start()

    # In the server's own thread

    def _run(self) -> None:
        try:
            due = time.perf_counter()
            while not self._closing.is_set():
                with self.lock:
                    self._step()
                due = max(due, time.perf_counter() - LATE) + self.tick / self._factor
                self._closing.wait(max(YIELD, due - time.perf_counter()))
            with self.lock:
                self._commands.stop()
        except Exception as error:
            logger.error("the robot's simulation failed", exc_info=error)
            self.error = error
        finally:
            self._bridge.close()

    def _step(self) -> None:
        for client in self._topics:
            self._hear(client)
        for action in self._actions:
            self._hear_action(action)
        self.robot.sleep(self.tick)
        self._broadcast.publish()
        self._commands.settle()

    def _hear(self, client: TopicClient) -> None:
        came = self._bridge.take(client.topic)
        if came:
            self._handle(client, {"op": "publish", "topic": client.topic, "msg": came[-1]})  # the newest counts
        is_there = self._bridge.has_publishers(client.topic)
        if client.is_there and not is_there:
            self._commands.leave(client)  # type: ignore[arg-type]
        client.is_there = is_there

    def _hear_action(self, action: FollowAction) -> None:
        for message in action.requests(self.robot.now()):
            if message["op"] == "send_action_goal":
                action.begin(message)
                self._handle(action, message)
                action.accept(message)
            else:
                self._handle(action, message)
        is_there = action.has_clients
        if self._are_there[action.action] and not is_there:
            self._commands.leave(action)  # type: ignore[arg-type]
            action.abandon()
        self._are_there[action.action] = is_there

    def _handle(self, client: Any, message: Message) -> None:
        self._commands.handle(client, message)
