"""WireRobot: a robot on the wire, in the place of one in the program."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nuno.errors import NunoError, RefusedError, RobotModelError, RobotTimeoutError
from nuno.robot.goal import Goal, GoalStatus, ResultCode, Tolerances
from nuno.robot.humanoid import Humanoid
from nuno.robot.interface import BASE, RobotInterface
from nuno.robot.joint_interface import Controller
from nuno.robot.readings import ImuReading, JointState
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.wire import messages as ros
from nuno.robot.wire.clock import WireClock
from nuno.robot.wire.connection import Connection, SentGoal
from nuno.robot.wire.names import ADVANCE, GO_VELOCITY, Names
from nuno.robot.wire.protocol import ABORTED, CANCELED, EXECUTING, SUCCEEDED
from nuno.robot.wire.velocity import VelocityStream
from nuno.shapes.coordinates import Coordinates
from nuno.validation import number

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

LOOK = 0.05
"""[s] Of real time, after which a waiting program looks even if nothing came."""
STEP, STEP_TIMEOUT = 1.0, 300.0
"""[s] The longest piece that a simulation is asked to go on by, and the real time that this may take."""


class WireRobot(RobotInterface):
    """A robot behind the rosbridge protocol: a ``RobotServer``, or a real one with ROS 2 and rosbridge_suite.

    It waits by the robot's clock: the topic "/clock" where there is one, else the times of its joint states. A
    server that lets time pass only while someone waits is let go on by what waits here.

    When the connection ends, for whatever reason, all calls raise ``ConnectionLostError``.

    Args:
        url: Where it listens.
        robot: Its model, or the name of one.
        default_controller: The name of all controllers together.
        controllers: Their joints by name, as the robot has them; None for those that the model shows.
        names: Of topics and actions.
        timeout: How long the robot has for any answer [s] of real time.
        alive: A robot that is silent for so long [s], not answering pings either, is lost.
        controller_timeout: How long a controller is waited for at the beginning [s]; None for ever.

    Raises:
        MissingPackageError: websockets is not installed.
        NotConnectedError: nobody listens there.
        RobotTimeoutError: no joint state came.
    """

    def __init__(
        self, url: str = "ws://127.0.0.1:9090", robot: Humanoid | str = "talos",
        default_controller: str = "default_controller", *, controllers: Mapping[str, Sequence[str]] | None = None,
        names: Names | None = None, timeout: float = 5.0, alive: float = 20.0, controller_timeout: float | None = 3.0,
    ) -> None:  # fmt: skip
        self.names, self._controllers = names or Names(), controllers
        self._news = threading.Condition()
        self._count = 0  # of all that came
        self._state: JointState | None = None
        self._told: dict[str, float] = {}  # by joint, when a state last told of it [s]
        self._latest: dict[str, Any] = {}  # by topic
        self._status: dict[str, bool] = {}  # by controller
        self._sent: dict[str, tuple[Goal, SentGoal]] = {}  # by controller, and "base"
        self._stream: VelocityStream | None = None
        self._known: dict[str, list[str] | None] = {}  # what there is; None where that is not told
        self._has_odometry: bool | None = None
        model = Humanoid(robot) if isinstance(robot, str) else robot
        self.connection = Connection(url, timeout=timeout, alive=alive)
        try:
            self._clock = WireClock(self.connection, self.names, self._tell)
            self.connection.subscribe(self.names.full(self.names.joint_states), ros.JOINT_STATE, self._take_state)
            if not self._wait(lambda: self._state is not None, timeout):
                topic = self.names.full(self.names.joint_states)
                raise RobotTimeoutError(f"{url} sent no {topic} within {timeout:g} s")
            super().__init__(
                model, default_controller, controller_timeout=controller_timeout,
                namespace=self.names.namespace or None,
            )  # fmt: skip
            for client in self.controller_actions:
                self._watch(client.controller)
        except BaseException:
            self.connection.close()
            raise

    def __enter__(self) -> WireRobot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<WireRobot {self.robot.name!r} at {self.connection.url}>"

    def close(self) -> None:
        """Disconnect; the robot stops what it was asked for, as when the connection is lost."""
        if self._stream is not None:
            self._stream.cancel()
        self.connection.close()

    # Time

    def now(self) -> float:
        """Return the time of the robot's clock [s]."""
        self.connection.check()
        return self._clock.now()

    def sleep(self, seconds: float) -> None:
        """Let the robot's clock go on by ``seconds`` [s]; the place of ``time.sleep`` in a program for robots."""
        end = self.now() + number("seconds", seconds, low=0.0)
        if not self._clock.is_stepped:
            self.wait_until(lambda: self.now() >= end)
            return
        while (left := end - self.now()) > 1e-9:
            span = ros.time_fields(min(left, STEP))
            answer = self.connection.call(ADVANCE, ros.ADVANCE, {"duration": span}, STEP_TIMEOUT)
            self._clock.set(ros.seconds(answer, "time"))

    def wait_until(self, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait until a condition holds, up to ``timeout`` [s] of the robot's clock, None or 0 for ever.

        Returns:
            Whether it holds.

        Raises:
            ConnectionLostError: there is no connection any more.
            RobotTimeoutError: the robot's clock stands still.
        """
        end = None if not timeout else self.now() + timeout
        moved, last = time.monotonic(), self.now()
        while True:
            count, now = self._count, self.now()
            if condition():
                self.connection.check()  # a goal that is lost has ended too
                return True
            if end is not None and now >= end:
                return False
            if self._clock.is_stepped:
                self.sleep(self._clock.tick)
                continue
            with self._news:
                self._news.wait_for(lambda count=count: self._count != count, LOOK)  # type: ignore[misc]
            if now != last:
                moved, last = time.monotonic(), now
            elif time.monotonic() - moved > self.connection.timeout:
                raise RobotTimeoutError(f"the clock of {self.connection.url} stands still at {now:.3f} s")

    # Joints

    def default_controller(self) -> list[Controller]:
        """Return the controllers of the robot, as ROS 2 has them."""
        own = super().default_controller() if self._controllers is None else [
            {
                "controller_type": name, "controller_action": f"{name}/follow_joint_trajectory",
                "controller_state": f"{name}/controller_state", "joint_names": list(joints),
            }
            for name, joints in self._controllers.items()
        ]  # fmt: skip
        return [controller | {"action_type": ros.FOLLOW} for controller in own]

    def has_controller(self, controller: Controller) -> bool:
        """Return whether the robot has a controller, once that is known or ``controller_timeout`` has passed."""
        action = self.names.full(controller["controller_action"])
        begin = time.monotonic()
        while not self._is_there("action_servers", action):
            if self.controller_timeout is not None and time.monotonic() - begin > self.controller_timeout:
                return False
            time.sleep(0.1)
        return True

    def read_joint_state(self) -> JointState | None:
        """Return the newest joint state there is; it may lack joints."""
        self.connection.check()
        return self._state

    def read_reference(self) -> JointState | None:
        """Return where the controllers want the joints now, None until all of them have told."""
        parts = [self._peek(self.names.state_of(own.controller), ros.CONTROLLER_STATE, _read_reference)
                 for own in self.controller_actions]  # fmt: skip
        if not parts or any(part is None for part in parts):
            return None
        joints = tuple(joint for part in parts for joint in part.names)
        still = np.zeros(len(joints))
        positions = np.concatenate([part.positions for part in parts])
        return JointState(min(part.time for part in parts), joints, positions, still, still)

    def send_trajectory(
        self, controller: Controller, trajectory: JointTrajectory, start_time: float, tolerances: Tolerances | None
    ) -> Goal:
        """Send a trajectory to a controller, to start ``start_time`` [s] from now, and return the goal.

        A Nuno server tells at once whether it takes the trajectory; others do when they refuse it, some time later.
        """
        start = self.now() + start_time if start_time > 0.0 else None
        action = self.names.full(controller["controller_action"])
        fields = ros.follow_fields(trajectory, start, tolerances)
        return self._send_goal(controller["controller_type"], Goal(trajectory), action, ros.FOLLOW, fields)

    def cancel_trajectories(self, controller: Controller) -> None:
        """Let a controller give up what it does; its goal ends as preempted, and the joints hold where they are."""
        self.connection.check()
        name = controller["controller_type"]
        if self._cancel(name) or not self._status.get(name):
            return
        service = f"{self.names.full(controller['controller_action'])}/_action/cancel_goal"
        try:  # another program's goal: an id of zeros stands for all
            self.connection.call(service, "action_msgs/srv/CancelGoal", {"goal_info": {"goal_id": {"uuid": [0] * 16}}})
        except RefusedError as error:
            logger.warning("what another program asked of %s goes on: %s", name, error)

    def is_busy(self, controller: Controller) -> bool:
        """Return whether a controller follows a goal, whoever sent it."""
        self.connection.check()
        name = controller["controller_type"]
        goal, _ = self._sent.get(name, (None, None))
        return self._status.get(name, False) or (goal is not None and not goal.is_done)

    # Base and hands

    def read_base(self) -> Coordinates:
        """Return where the base link is in the world, as odometry tells; of a robot without, where the model has it.

        Raises:
            RobotTimeoutError: the robot has odometry, and nothing came of it.
        """
        topic = self.names.full(self.names.odometry)
        told = self._peek(topic, ros.ODOMETRY, lambda m: ros.read_coordinates(ros.field(m, "pose.pose")))
        if told is None and self._has_odometry is None:
            self._has_odometry = topic in (self._listed("topics", topic) or ())
            if self._has_odometry and not self._wait(lambda: self._latest[topic] is not None, self.connection.timeout):
                raise RobotTimeoutError(f"nothing came on {topic} within {self.connection.timeout:g} s")
        return self._latest[topic] or Coordinates(*self.robot.pose())

    def send_base(self, x: float, y: float, yaw: float, seconds: float | None, stop: bool) -> Goal:
        """Let the robot go to a place seen from where it is, and return the goal at once; see ``RobotInterface``.

        A real robot is told velocities for so long as ``seconds`` says; without it, where to go.
        """
        goal = Goal((x, y, yaw))
        if seconds is None:
            fields: Fields = {"pose": ros.pose_fields(0.0, BASE, x, y, yaw), "behavior_tree": ""}
            return self._send_goal("base", goal, self.names.full(self.names.navigate), ros.NAVIGATE, fields)
        twist = ros.twist_fields(x / seconds, y / seconds, yaw / seconds)
        if self._clock.is_nuno:
            fields = {"twist": twist, "duration": ros.time_fields(seconds), "stop": stop}
            return self._send_goal("base", goal, GO_VELOCITY, ros.GO_VELOCITY, fields)
        if self._stream is not None:
            self._stream.cancel(rest=False)
        topic = self.names.full(self.names.velocity)
        self._stream = VelocityStream(self.connection, self._clock, topic, twist, seconds, stop, goal, self._tell)
        return goal

    def cancel_base(self) -> None:
        """Let the robot stop going, as soon as it safely can; its goal ends as preempted."""
        self.connection.check()
        if self._stream is not None:
            self._stream.cancel()
        self._cancel("base", wait=False)

    def send_gripper(self, hand: str, position: float, effort: float) -> Goal:
        """Let a hand open or close, and return the goal at once; see ``RobotInterface.send_gripper``."""
        known = self.robot.description.hands.get(hand)
        width = (known.width if known is not None else 0.0) or 1.0
        fields = {"command": {"position": position * width, "max_effort": effort}}
        action = self.names.full(self.names.gripper, hand=hand)
        return self._send_goal(hand, Goal(position), action, ros.GRIPPER, fields)

    # Sensors

    def read_wrench(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) [N] and torque (3,) [N m] of what is beyond a sensor; see ``RobotInterface``.

        Raises:
            RobotModelError: the robot publishes no such forces.
            RobotTimeoutError: nothing came.
        """
        return self._read(self.names.wrench.format(frame=frame), ros.WRENCH, ros.read_wrench)

    def read_imu(self) -> ImuReading:
        """Return what the inertial measurement unit tells.

        Raises:
            RobotModelError: the robot publishes nothing of it.
            RobotTimeoutError: nothing came.
        """
        return self._read(self.names.imu, ros.IMU, ros.read_imu)

    # Inside

    def _take_state(self, fields: Fields) -> None:
        state = ros.read_joint_state(fields)
        self._clock.hear(state.time)
        before = self._state
        self._told.update(dict.fromkeys(state.names, state.time))
        if before is not None and not set(before.names) <= set(state.names):  # several topics' worth in one
            kept = [k for k, name in enumerate(before.names) if name not in state.names]
            joined = [np.append(getattr(state, what), getattr(before, what)[kept])
                      for what in ("positions", "velocities", "efforts")]  # fmt: skip
            names = (*state.names, *(before.names[k] for k in kept))
            # as old as the oldest joint in it: who waits for a fresh state waits for all topics
            state = JointState(min(self._told[name] for name in names), names, *joined)
        self._state = state
        self._tell()

    def _tell(self) -> None:
        """Wake those that wait."""
        with self._news:
            self._count += 1
            self._news.notify_all()

    def _wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition holds, up to ``timeout`` [s] of real time, and return whether it does."""
        end = time.monotonic() + timeout
        while not condition():
            self.connection.check()
            count, left = self._count, end - time.monotonic()
            if left <= 0.0:
                return condition()
            if condition():
                return True
            with self._news:
                self._news.wait_for(lambda count=count: self._count != count, min(left, LOOK))  # type: ignore[misc]
        return True

    def _watch(self, controller: Controller) -> None:
        name = controller["controller_type"]

        def take(fields: Fields) -> None:
            goals = ros.field(fields, "status_list", list, default=[])
            self._status[name] = any(ros.field(goal, "status", int, default=0) <= EXECUTING + 1 for goal in goals)
            self._tell()

        self.connection.subscribe(self.names.status_of(controller), ros.STATUS, take)

    def _send_goal(self, who: str, goal: Goal, action: str, kind: str, fields: Fields) -> Goal:
        accepted = threading.Event()

        def feedback(values: Fields) -> None:
            goal.feedback = values
            accepted.set()
            self._tell()

        def done(sent: SentGoal) -> None:
            _finish(goal, sent)
            self._tell()

        sent = self.connection.send_goal(action, kind, fields, feedback)
        self._sent[who] = goal, sent
        if not goal.is_done:
            goal.status = GoalStatus.ACTIVE
        sent.when_done(done)
        if self._clock.is_nuno:
            self._wait(lambda: accepted.is_set() or goal.is_done, self.connection.timeout)
        return goal

    def _cancel(self, who: str, wait: bool = True) -> bool:
        """Cancel what was sent from here; returns whether anything was under way."""
        goal, sent = self._sent.get(who, (None, None))
        if goal is None or sent is None or goal.is_done:
            return False
        sent.cancel()
        if wait:
            self._wait(lambda: goal.is_done, self.connection.timeout)
        return True

    def _is_there(self, what: str, name: str) -> bool:
        """Return whether the robot has an action or a topic; true where it does not tell."""
        known = self._listed(what, name)
        return known is None or name in known

    def _listed(self, what: str, name: str) -> list[str] | None:
        """Return the robot's actions or topics, None where untold; asked for again if a name is not among them."""
        if what not in self._known or name not in (self._known[what] or (name,)):
            try:
                answer = self.connection.call(f"/rosapi/{what}", "", {})
                self._known[what] = [str(own) for own in ros.field(answer, what, list, default=[])]
            except (RefusedError, RobotTimeoutError) as error:
                logger.warning("it cannot be known which %s there are: %s", what.replace("_", " "), error)
                self._known[what] = None
        return self._known[what]

    def _peek(self, topic: str, kind: str, read: Callable[[Fields], Any]) -> Any:
        """Return what was last heard on a topic, None before that; it is subscribed to when it is first asked for."""
        self.connection.check()
        if topic not in self._latest:
            self._latest[topic] = None

            def take(fields: Fields) -> None:
                self._latest[topic] = read(fields)
                self._tell()

            self.connection.subscribe(topic, kind, take)
        return self._latest[topic]

    def _read(self, name: str, kind: str, read: Callable[[Fields], Any]) -> Any:
        topic = self.names.full(name)
        if self._latest.get(topic) is None:
            if not self._is_there("topics", topic):
                raise RobotModelError(f"{self.connection.url} has no topic {topic!r}")
            self._peek(topic, kind, read)
            if not self._wait(lambda: self._latest[topic] is not None, self.connection.timeout):
                raise RobotTimeoutError(f"nothing came on {topic} within {self.connection.timeout:g} s")
        return self._peek(topic, kind, read)


def _finish(goal: Goal, sent: SentGoal) -> None:
    """Let a goal end as its result says."""
    try:
        status, values, accepted = sent.result(0.0)
    except NunoError as error:
        goal.finish(GoalStatus.LOST, text=str(error))
        return
    fields = values if isinstance(values, Mapping) else {}
    code = fields.get("error_code")
    text = str(fields.get("error_string") or fields.get("error_msg") or ("" if fields else values or ""))
    code = code if isinstance(code, int) else None
    ends = {SUCCEEDED: GoalStatus.SUCCEEDED, CANCELED: GoalStatus.PREEMPTED, ABORTED: GoalStatus.ABORTED}
    if not accepted:
        goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_GOAL if code is None else code, text)
    elif status == SUCCEEDED and fields.get("reached_goal") is False:
        goal.finish(GoalStatus.ABORTED, code, "the hand was stopped")
    else:
        goal.finish(ends.get(status, GoalStatus.LOST), code, text)


def _read_reference(fields: Fields) -> JointState:
    """Return where a controller wants its joints, of control_msgs/msg/JointTrajectoryControllerState, new or old."""
    joints = ros.names(fields, "joint_names")
    path = "reference.positions" if "reference" in fields else "desired.positions"
    positions = np.array(ros.field(fields, path, list), dtype=float)
    still = np.zeros(len(joints))
    return JointState(ros.seconds(fields, "header.stamp", 0.0), joints, positions, still, still)
