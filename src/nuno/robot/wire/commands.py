"""Commands: what clients ask of a robot, and what becomes of it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from nuno.errors import MessageError, NunoError
from nuno.robot.base_interface import BASE
from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.interface import RobotInterface
from nuno.robot.joint_interface import Controller
from nuno.robot.wire import messages as ros
from nuno.robot.wire.bridge_client import Client, identity_of
from nuno.robot.wire.broadcast import Broadcast, motion_fields
from nuno.robot.wire.names import GO_VELOCITY, Names
from nuno.robot.wire.protocol import ABORTED, CANCELED, SUCCEEDED, UNKNOWN, Message
from nuno.robot.wire.rosapi import RosApi
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose, invert

logger = logging.getLogger(__name__)

Fields = dict[str, Any]
Started = tuple[Goal, Callable[[Goal], Fields], Callable[[], None]]
"""A goal, what returns its result's fields, and what cancels it."""

END_STATUSES = {
    GoalStatus.SUCCEEDED: SUCCEEDED, GoalStatus.PREEMPTED: CANCELED, GoalStatus.RECALLED: CANCELED,
    GoalStatus.ABORTED: ABORTED, GoalStatus.LOST: ABORTED,
}  # fmt: skip
"""Ends of goals, in the words of the wire."""
FEEDBACK_INTERVAL = 0.05
"""[s] Between two feedbacks of a goal."""
DRIVE = 1.0
"""[s] A velocity holds so long, unless another comes."""


@dataclass(eq=False)
class Running:
    """A goal that a client waits for.

    Attributes:
        client: Who.
        identity: What the client calls it.
        action: The action's name.
        goal: The robot's handle on it.
        result: Returns the result's fields once it is done.
        cancel: Ends it.
        feedback: Returns the feedback's fields; None where the client wants none.
        feedback_time: When feedback was last sent [s] of the robot's clock.
    """

    client: Client
    identity: str | int | None
    action: str
    goal: Goal
    result: Callable[[Goal], Fields]
    cancel: Callable[[], None]
    feedback: Callable[[], Fields] | None = None
    feedback_time: float = -np.inf


class Commands:
    """Goals, services and velocities; all in the thread that the robot belongs to.

    Args:
        robot: The robot.
        broadcast: Its topics.
        names: Of topics and actions.
        controllers: Of the robot.
        services: Further services by name, which answer by themselves.

    Attributes:
        taken: Types of the topics that the robot takes, by name.
    """

    def __init__(
        self, robot: RobotInterface, broadcast: Broadcast, names: Names, controllers: list[Controller],
        services: Mapping[str, Callable[[Client, Message], None]],
    ) -> None:  # fmt: skip
        self.robot, self.broadcast, self.names = robot, broadcast, names
        self._running: list[Running] = []
        self._drive: tuple[Client, Goal] | None = None
        self._actions: dict[str, Callable[[Fields], Started]] = {
            names.full(names.navigate): self._navigate,
            GO_VELOCITY: self._go_velocity,
        }
        self._joints: dict[str, list[str]] = {}
        self._further = dict(services)
        self._services: dict[str, Callable[[Fields], Fields]] = {
            "/controller_manager/list_controllers": lambda _: {"controller": _controller_states(controllers)},
        }
        for controller in controllers:
            action = names.full(controller["controller_action"])
            self._joints[action] = controller["joint_names"]
            self._actions[action] = partial(self._follow, controller)
            self._services[f"{action}/_action/cancel_goal"] = partial(self._cancel_all, controller)
        self._streams = {names.trajectory_of(controller): controller for controller in controllers}
        self._followed: dict[str, tuple[Client, Goal]] = {}  # by topic
        taken = {names.full(names.velocity): ros.TWIST} | dict.fromkeys(self._streams, ros.TRAJECTORY)
        self.taken = taken
        for hand in robot.robot.description.hands:
            self._actions[names.full(names.gripper, hand=hand)] = partial(self._grip, hand)
        rosapi = RosApi(robot, broadcast.topics, taken, self._service_names, self._actions.keys)
        self._services |= rosapi.services

    def handle(self, client: Client, message: Message) -> None:
        """Do what a message asks; what cannot be done is answered, and changes nothing."""
        try:
            {
                "subscribe": lambda _, own: self.broadcast.publish(own["topic"]), "advertise": self._advertise,
                "publish": self._publish, "call_service": self._call, "send_action_goal": self._send,
                "cancel_action_goal": self._cancel,
            }[message["op"]](client, message)  # fmt: skip
        except NunoError as error:
            self._refuse(client, message, str(error), error)
        except Exception as error:
            logger.exception("%s of %s failed", message["op"], client.name)
            self._refuse(client, message, f"the server failed: {type(error).__name__}: {error}", error)

    @property
    def has_ended(self) -> bool:
        """Return True if a goal has ended that its client does not know of yet."""
        return any(own.goal.is_done for own in self._running)

    def settle(self) -> None:
        """Tell clients what has become of their goals."""
        now = self.robot.now()
        self.broadcast.publish_status()  # first: who waits for a result may then ask whether the robot moves
        for own in tuple(self._running):
            if own.goal.is_done:
                self._running.remove(own)
                self._answer(own)
            elif own.feedback is not None and now >= own.feedback_time + FEEDBACK_INTERVAL - 1e-9:
                self._tell(own, now)

    def leave(self, client: Client) -> None:
        """End what a client that is gone has asked for: the robot holds where it is."""
        for own in [own for own in self._running if own.client is client]:
            self._running.remove(own)
            if not own.goal.is_done:
                logger.warning("%s is gone; %s is stopped", client.name, own.action)
                own.cancel()
        for topic, (whose, goal) in list(self._followed.items()):
            if whose is client:
                del self._followed[topic]
                if not goal.is_done:
                    logger.warning("%s is gone; what it sent to %s is stopped", client.name, topic)
                    self.robot.cancel_trajectories(self._streams[topic])
        if self._drive is not None and self._drive[0] is client:
            self._stop_driving()

    def stop(self) -> None:
        """End what all clients have asked for."""
        drivers = {client for client, _ in self._followed.values()} | ({self._drive[0]} if self._drive else set())
        for client in {own.client for own in self._running} | drivers:
            self.leave(client)

    # Goals

    def _send(self, client: Client, message: Message) -> None:
        action, identity = message["action"], message.get("id")
        if action not in self._actions:
            raise MessageError(f"no action {action!r}; there are: {', '.join(sorted(self._actions))}")
        if any(own.client is client and own.identity == identity for own in self._running):
            raise MessageError(f"a goal with the id {identity!r} is under way already")
        goal, result, cancel = self._actions[action](ros.field(message, "args", Mapping, default={}))
        own = Running(client, identity, action, goal, result, cancel)
        if message.get("feedback"):
            own.feedback = lambda: self._motion(action)
        if goal.is_done:
            self._answer(own)
            return
        self._running.append(own)
        if own.feedback is not None:  # at once, which tells the client that it was accepted
            self._tell(own, self.robot.now())

    def _cancel(self, client: Client, message: Message) -> None:
        identity = message.get("id")
        found = [own for own in self._running if own.client is client and own.identity == identity]
        if not found:
            logger.info("%s cancels %r, which is not under way", client.name, identity)
        for own in found:
            own.cancel()

    def _cancel_all(self, controller: Controller, fields: Fields) -> Fields:
        self.robot.cancel_trajectories(controller)
        return {"return_code": 0, "goals_canceling": []}

    def _tell(self, own: Running, now: float) -> None:
        assert own.feedback is not None
        own.feedback_time = now
        feedback = {"op": "action_feedback", "action": own.action, "values": own.feedback()}
        own.client.send(feedback | identity_of({"id": own.identity}))

    def _answer(self, own: Running) -> None:
        accepted = own.goal.status != GoalStatus.REJECTED
        own.client.send({
            "op": "action_result", "action": own.action, "values": own.result(own.goal),
            "status": END_STATUSES[own.goal.status] if accepted else UNKNOWN, "result": accepted,
        } | identity_of({"id": own.identity}))  # fmt: skip

    def _motion(self, action: str) -> Fields:
        joints = self._joints.get(action)
        if joints is None:
            return {}
        return motion_fields(joints, self.robot.read_reference(), self.robot.read_joint_state(), self.robot.now())

    def _follow(self, controller: Controller, fields: Fields) -> Started:
        trajectory, start, tolerances = ros.read_follow(fields)
        delay = 0.0 if start is None else max(0.0, start - self.robot.now())
        goal = self.robot.send_trajectory(controller, trajectory, delay, tolerances)
        return goal, _follow_result, lambda: self.robot.cancel_trajectories(controller)

    def _grip(self, hand: str, fields: Fields) -> Started:
        width = self.robot.robot.description.hands[hand].width or 1.0
        position = ros.real(fields, "command.position", 0.0)
        effort = ros.real(fields, "command.max_effort", 0.0)
        if not -1e-9 <= position <= width + 1e-9:
            raise MessageError(f"command.position must lie in [0, {width}], got {position}")
        goal = self.robot.send_gripper(hand, float(np.clip(position / width, 0.0, 1.0)), effort)

        def result(goal: Goal) -> Fields:
            stalled = goal.status == GoalStatus.ABORTED if goal.holds is None else goal.holds
            return {"position": position, "effort": effort, "stalled": stalled, "reached_goal": goal.succeeded}

        return goal, result, lambda: None  # a hand that lets go, as its client is gone, would drop what it holds

    def _navigate(self, fields: Fields) -> Started:
        frame, given = ros.read_pose(ros.field(fields, "pose", Mapping))
        if frame not in ("", BASE, "odom"):
            raise MessageError(f"pose.header.frame_id must be '{BASE}' or 'odom', got {frame!r}")
        place = given.pose() if frame != "odom" else compose(invert(self.robot.footprint().pose()), given.pose())
        forward = quat.rotate(place[1], np.array([1.0, 0.0, 0.0]))
        x, y, yaw = float(place[0][0]), float(place[0][1]), float(np.arctan2(forward[1], forward[0]))
        goal = self.robot.send_base(x, y, yaw, None, True)
        return goal, _base_result, self.robot.cancel_base

    def _go_velocity(self, fields: Fields) -> Started:
        velocity = np.array(ros.read_twist(ros.field(fields, "twist", Mapping)))
        span = ros.seconds(fields, "duration")
        if span <= 0.0:
            raise MessageError(f"duration must be above 0, got {span} s")
        x, y, yaw = (float(value) for value in velocity * span)
        stop = ros.field(fields, "stop", bool, default=True)
        return self.robot.send_base(x, y, yaw, span, stop), _base_result, self.robot.cancel_base

    # Topics and services

    def _advertise(self, client: Client, message: Message) -> None:
        topic, kind = message["topic"], message["type"]
        wanted = self.taken.get(topic)
        if wanted is not None and kind not in (wanted, wanted.replace("/msg/", "/")):
            raise MessageError(f"{topic} takes {wanted}, not {kind}")

    def _publish(self, client: Client, message: Message) -> None:
        topic = message["topic"]
        if topic in self._streams:
            self._follow_topic(client, topic, message["msg"])
            return
        if topic != self.names.full(self.names.velocity):
            raise MessageError(f"nobody listens to {topic!r}, only to: {', '.join(sorted(self.taken))}")
        velocity = ros.read_twist(message["msg"])
        if not any(velocity):
            self._stop_driving()
            return
        goal = self.robot.send_velocity(*velocity, DRIVE)
        self._drive = (client, goal)
        if goal.is_done and not goal.succeeded:
            raise MessageError(f"the robot cannot go so: {goal.text}")

    def _follow_topic(self, client: Client, topic: str, fields: Fields) -> None:
        """Send a trajectory that came on a controller's topic: nobody is told of its end, but of a refusal."""
        controller = self._streams[topic]
        trajectory, start = ros.read_trajectory(fields)
        delay = 0.0 if start is None else max(0.0, start - self.robot.now())
        goal = self.robot.send_trajectory(controller, trajectory, delay, None)
        if goal.status == GoalStatus.REJECTED:
            raise MessageError(f"the trajectory was refused: {goal.text}")
        self._followed[topic] = client, goal

    def _stop_driving(self) -> None:
        if self._drive is not None and not self._drive[1].is_done:
            self.robot.cancel_base()
        self._drive = None

    def _service_names(self) -> list[str]:
        return [*self._services, *self._further]

    def _call(self, client: Client, message: Message) -> None:
        service = "/" + message["service"].lstrip("/")  # roslibjs asks for "rosapi/topics"
        if service in self._further:
            self._further[service](client, message)
        elif service in self._services:
            fields = ros.field(message, "args", (Mapping, list), default={})  # ROS 1 has lists, empty ones in effect
            client.answer(message, self._services[service](fields))
        else:
            known = ", ".join(sorted(self._service_names()))
            raise MessageError(f"no service {service!r}; there are: {known}")

    def _refuse(self, client: Client, message: Message, text: str, error: Exception) -> None:
        """Answer what cannot be done in the way that its asker waits for."""
        if message["op"] == "call_service":
            client.answer(message, text, False)
        elif message["op"] == "send_action_goal":
            logger.info("%s: the goal was refused: %s", client.name, text)
            code = ResultCode.INVALID_JOINTS if isinstance(error, KeyError) else ResultCode.INVALID_GOAL
            values = {"error_code": int(code), "error_string": text}
            result = {"op": "action_result", "action": message["action"], "values": values, "status": UNKNOWN}
            client.send(result | {"result": False} | identity_of(message))
        else:
            client.complain(text, message.get("id"))


def _follow_result(goal: Goal) -> Fields:
    return {"error_code": int(goal.code or 0), "error_string": goal.text}


def _base_result(goal: Goal) -> Fields:
    return {"error_code": 0 if goal.succeeded else 1, "error_msg": goal.text}


def _controller_states(controllers: list[Controller]) -> list[Fields]:
    return [
        {
            "name": own["controller_type"], "state": "active",
            "type": "joint_trajectory_controller/JointTrajectoryController",
            "claimed_interfaces": [f"{joint}/position" for joint in own["joint_names"]],
        }
        for own in controllers
    ]  # fmt: skip
