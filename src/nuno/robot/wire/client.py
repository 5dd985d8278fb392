"""WireRobot: a robot on the wire, in the place of one in the program."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.errors import RefusedError, RobotTimeoutError
from nuno.robot.base_interface import BASE
from nuno.robot.goal import Goal, Tolerances
from nuno.robot.humanoid import Humanoid
from nuno.robot.interface import RobotInterface
from nuno.robot.joint_interface import Controller
from nuno.robot.readings import ImageReading, ImuReading, JointState
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.wire import image_messages as images
from nuno.robot.wire import messages as ros
from nuno.robot.wire.clock import WireClock
from nuno.robot.wire.connection import Connection
from nuno.robot.wire.names import ADVANCE, GO_VELOCITY, Names
from nuno.robot.wire.newest import Newest
from nuno.robot.wire.protocol import EXECUTING
from nuno.robot.wire.velocity import VelocityStream
from nuno.robot.wire.wire_goals import WireGoals
from nuno.shapes.coordinates import Coordinates
from nuno.validation import checked, number

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

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

    @checked
    def __init__(
        self, url: str = "ws://127.0.0.1:9090", robot: Humanoid | str = "talos",
        default_controller: str = "default_controller", *, controllers: Mapping[str, Sequence[str]] | None = None,
        names: Names | None = None, timeout: float = 5.0, alive: float = 20.0, controller_timeout: float | None = 3.0,
    ) -> None:  # fmt: skip
        self.names, self._controllers = names or Names(), controllers
        self._state: JointState | None = None
        self._reported: dict[str, float] = {}  # by joint, when a state last told of it [s]
        self._status: dict[str, bool] = {}  # by controller
        self._stream: VelocityStream | None = None
        self._has_odometry: bool | None = None
        self._pixels: dict[str, Fields | None] = {}  # by camera, what is published of it
        model = Humanoid(robot) if isinstance(robot, str) else robot
        self.connection = Connection(url, timeout=timeout, alive=alive)
        self._newest = Newest(self.connection)
        self._goals = WireGoals(self._newest)
        try:
            self._clock = WireClock(self.connection, self.names, self._newest.tell)
            self.connection.subscribe(self.names.full(self.names.joint_states), ros.JOINT_STATE, self._take_state)
            if not self._newest.wait(lambda: self._state is not None, timeout):
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
            count, now = self._newest.count, self.now()
            if condition():
                self.connection.check()  # a goal that is lost has ended too
                return True
            if end is not None and now >= end:
                return False
            if self._clock.is_stepped:
                self.sleep(self._clock.tick)
                continue
            self._newest.wait_for_news(count)
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
        """Return True if the robot has a controller, once that is known or ``controller_timeout`` has passed."""
        action = self.names.full(controller["controller_action"])
        begin = time.monotonic()
        while not self._newest.is_there("action_servers", action):
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
        parts = [self._newest.peek(self.names.state_of(own.controller), ros.CONTROLLER_STATE, _read_reference)
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
        if self._goals.cancel(name) or not self._status.get(name):
            return
        service = f"{self.names.full(controller['controller_action'])}/_action/cancel_goal"
        try:  # another program's goal: an id of zeros stands for all
            self.connection.call(service, "action_msgs/srv/CancelGoal", {"goal_info": {"goal_id": {"uuid": [0] * 16}}})
        except RefusedError as error:
            logger.warning("what another program asked of %s goes on: %s", name, error)

    def is_busy(self, controller: Controller) -> bool:
        """Return True if a controller follows a goal, whoever sent it."""
        self.connection.check()
        name = controller["controller_type"]
        return self._status.get(name, False) or self._goals.is_under_way(name)

    # Base and hands

    def read_base(self) -> Coordinates:
        """Return where the base link is in the world, as odometry tells; of a robot without, where the model has it.

        Raises:
            RobotTimeoutError: the robot has odometry, and nothing came of it.
        """
        topic = self.names.full(self.names.odometry)
        if self._has_odometry is None:
            self._has_odometry = topic in (self._newest.names_of("topics", topic) or ())
        if not self._has_odometry:
            return self._newest.peek(topic, ros.ODOMETRY, _read_odometry) or Coordinates(*self.robot.pose())
        place: Coordinates = self._newest.read(topic, ros.ODOMETRY, _read_odometry)
        return place

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
        self._stream = VelocityStream(
            self.connection, self._clock, topic, twist, seconds, stop, goal, self._newest.tell
        )
        return goal

    def cancel_base(self) -> None:
        """Let the robot stop going, as soon as it safely can; its goal ends as preempted."""
        self.connection.check()
        if self._stream is not None:
            self._stream.cancel()
        self._goals.cancel("base", wait=False)

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
        topic = self.names.full(self.names.wrench, frame=frame)
        force, torque = self._newest.read(topic, ros.WRENCH, ros.read_wrench)
        return force, torque

    def read_imu(self) -> ImuReading:
        """Return what the inertial measurement unit tells.

        Raises:
            RobotModelError: the robot publishes nothing of it.
            RobotTimeoutError: nothing came.
        """
        reading: ImuReading = self._newest.read(self.names.full(self.names.imu), ros.IMU, ros.read_imu)
        return reading

    @property
    def shown_cameras(self) -> tuple[str, ...]:
        """The cameras that the robot publishes images of; all where it does not tell."""
        topics = {name: self.names.full(self.names.compressed, camera=name) for name in self.camera_names}
        return tuple(name for name, topic in topics.items() if self._newest.is_there("topics", topic))

    def read_image(self, camera: str) -> ImageReading:
        """Return the first image of a camera that comes from now on; see ``CameraInterface``.

        It is asked for compressed; nothing comes of a camera that nobody looks through. The camera's pixels are those
        that the robot publishes, where it does; where it is, the model tells.
        """
        topic = self.names.full(self.names.compressed, camera=self._checked_camera(camera))
        time, image = self._newest.take(topic, images.COMPRESSED_IMAGE, images.read_compressed)
        return ImageReading(time, self.camera_info(camera), image)

    def read_depth(self, camera: str) -> ImageReading:
        """Return the first depth image of a camera that comes from now on; see ``CameraInterface``."""
        topic = self.names.full(self.names.depth, camera=self._checked_camera(camera))
        time, image = self._newest.take(topic, images.IMAGE, images.read_image)
        return ImageReading(time, self.camera_info(camera), image)

    def camera_info(self, camera: str = "head") -> Camera:
        """Return a camera: its pixels as the robot publishes them, else by the description, where it is now."""
        own = super().camera_info(camera)
        topic = self.names.full(self.names.camera_info, camera=camera)
        if camera not in self._pixels:  # they do not change
            known = topic in (self._newest.names_of("topics", topic) or ())
            self._pixels[camera] = self._newest.take(topic, images.CAMERA_INFO, dict) if known else None
        reported = self._pixels[camera]
        return own if reported is None else images.read_camera_info(reported, own)

    # Inside

    def _take_state(self, fields: Fields) -> None:
        state = ros.read_joint_state(fields)
        self._clock.hear(state.time)
        before = self._state
        self._reported.update(dict.fromkeys(state.names, state.time))
        if before is not None and not set(before.names) <= set(state.names):  # several topics' worth in one
            kept = [k for k, name in enumerate(before.names) if name not in state.names]
            joined = [np.append(getattr(state, what), getattr(before, what)[kept])
                      for what in ("positions", "velocities", "efforts")]  # fmt: skip
            names = (*state.names, *(before.names[k] for k in kept))
            # as old as the oldest joint in it: who waits for a fresh state waits for all topics
            state = JointState(min(self._reported[name] for name in names), names, *joined)
        self._state = state
        self._newest.tell()

    def _watch(self, controller: Controller) -> None:
        name = controller["controller_type"]

        def take(fields: Fields) -> None:
            goals = ros.field(fields, "status_list", list, default=[])
            self._status[name] = any(ros.field(goal, "status", int, default=0) <= EXECUTING + 1 for goal in goals)
            self._newest.tell()

        self.connection.subscribe(self.names.status_of(controller), ros.STATUS, take)

    def _send_goal(self, who: str, goal: Goal, action: str, kind: str, fields: Fields) -> Goal:
        return self._goals.send(who, goal, action, kind, fields, self._clock.is_nuno)


def _read_reference(fields: Fields) -> JointState:
    """Return where a controller wants its joints, of control_msgs/msg/JointTrajectoryControllerState, new or old."""
    joints = ros.names(fields, "joint_names")
    path = "reference.positions" if "reference" in fields else "desired.positions"
    positions = np.array(ros.field(fields, path, list), dtype=float)
    still = np.zeros(len(joints))
    return JointState(ros.seconds(fields, "header.stamp", 0.0), joints, positions, still, still)


def _read_odometry(fields: Fields) -> Coordinates:
    return ros.read_coordinates(ros.field(fields, "pose.pose"))
