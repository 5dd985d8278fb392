"""SimulatedRobot: a robot in a world, behind the interface that a real one has."""

from __future__ import annotations

import time as wall_clock
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError, UnknownNameError
from nuno.robot.balance import Balance
from nuno.robot.burden import Burden
from nuno.robot.felt_loads import FeltLoads
from nuno.robot.goal import Goal, GoalStatus, ResultCode, Tolerances
from nuno.robot.grip_order import GripOrder, GripQueue
from nuno.robot.hands import hands_of
from nuno.robot.humanoid import Humanoid
from nuno.robot.joint_interface import Controller
from nuno.robot.motion_guard import MotionGuard
from nuno.robot.overlapping_robots import warn_of_overlaps
from nuno.robot.readings import JointState
from nuno.robot.robot_state import RobotState
from nuno.robot.sensor_model import SensorModel
from nuno.robot.sensors import Readings, Sensors
from nuno.robot.servo import Servo, ServoCommand, external_forces
from nuno.robot.simulated_base import SimulatedBase
from nuno.robot.simulated_cameras import SimulatedCameras
from nuno.robot.simulated_gripper import SimulatedGripper
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.wanted_motion import WantedMotion
from nuno.validation import checked, number
from nuno.world.grips_of_worlds import drop_empty_grips, grips_by_key
from nuno.world.pace import LATE

if TYPE_CHECKING:
    from nuno.robot.head_cameras import HeadCameras
    from nuno.robot.imagined_robot import ImaginedRobot
    from nuno.robot.links import Links
    from nuno.world.world import World


class SimulatedRobot(SimulatedBase):
    """A robot whose links stand in a world and move there in every frame, as its controllers want.

    All waiting steps the world: at full speed, or paced by ``real_time_factor``; where the world runs in the background
    (``world.start()``), whoever waits sleeps on its clock. Everything else also works while somebody else steps it.

    Args:
        robot: The model, which stays the program's own; the simulated one starts where it is, in its posture.
        world: Where it stands; no batch. Worlds that are imagined from it hold the links as they are then.
        links: Links that are in the world already; the simulated robot is theirs then. None lets it enter.
        real_time_factor: Simulated over real time while waiting; None is as fast as possible.
        sensors: By channel, how its sensors depart from the truth; see ``nuno.robot.sensors.Sensors``.
        cameras: How its cameras see: light, looks, noise, rate; None sees each as the description has it, without
            noise. Cameras that are not among these see so, too.
        seed: Of the sensors' noise.
        default_controller: The name of all controllers together.
        namespace: What the names of actions and topics begin with.
        dynamics: Whether its links have dynamics from the start: masses, motors with limits, contact, balance; they
            are one body for each joint then. Without, its joints and its walk go exactly where they are sent, and
            nothing pushes them. ``attach`` and ``detach`` change it at any time.
        collisions: Without dynamics, what becomes of motions that would take links through static shapes: they "stop"
            before that, and their goals end as aborted, are told as a warning ("warn"), or pass ("ignore").

    Raises:
        InvalidInputError: the links are in another world, the world is a batch, or ``collisions`` is something else.
        BodyStateError: a robot moves these links already.

    Attributes:
        actual: The robot that is simulated, as it truly is.
        wanted: The robot as its controllers want it; without dynamics, ``actual``.
        robot: What the program knows of it; as of a real one, it is brought up to date by ``update_robot_state``.
        joints: Its joints and controllers.
        hands: Its hands, by name.
    """

    @checked
    def __init__(
        self, robot: Humanoid, world: World, *, links: Links | None = None, real_time_factor: float | None = None,
        sensors: Mapping[str, SensorModel] | None = None, cameras: HeadCameras | None = None, seed: int = 0,
        default_controller: str = "default_controller", namespace: str | None = None, dynamics: bool = False,
        collisions: str = "stop",
    ) -> None:  # fmt: skip
        if links is not None and links.world is not world:
            raise InvalidInputError("the links are in another world than the robot is to be in")
        if cameras is not None and cameras.links is not links:
            raise InvalidInputError("the cameras must be of the links that are given")
        if any(isinstance(other, SimulatedRobot) and other.links is links for other in world.drivers):
            raise BodyStateError(f"another robot moves the links of {robot.name!r} already")
        MotionGuard.check_mode(collisions)
        self.pace = None if real_time_factor is None else number("real_time_factor", real_time_factor, above=0.0)
        world.engine.require(*(["robots with dynamics"] if dynamics else []))
        self.world, self._entered = world, links is None
        meshes = "joints" if dynamics else "collision"
        self.links: Links = robot.copy().enter(world, meshes) if links is None else links
        self.actual: Humanoid = self.links.robot  # type: ignore[assignment]  # no other robot enters a world
        self.balance = Balance(self.links) if self.links.are_joints else None
        # with dynamics, the robot as its controllers want it, else the actual one
        self.wanted = self.actual if self.balance is None else self.actual.copy()
        super().__init__(self.actual, default_controller, namespace=namespace)
        groups = {own["controller_type"]: own["joint_names"] for own in self.default_controller()}
        self._motion = WantedMotion(self.wanted, groups, world.time)
        self.joints, self.gait = self._motion.joints, self._motion.gait
        self.hands = hands_of(self.links)
        fingers = None if self.balance is None else self.balance.dynamics.fingers
        self.grippers = {name: SimulatedGripper(hand, self.joints, fingers) for name, hand in self.hands.items()}
        self._grip_queue = GripQueue(self.grippers, self.joints)
        self.sensors = Sensors(self.actual, self.links, models=sensors, seed=seed)
        self._readings: tuple[float, Readings] | None = None
        self._cameras = SimulatedCameras(self.links, cameras)
        self._felt = FeltLoads(self.links)
        self.guard, self._burden = MotionGuard(self.links, collisions), Burden(self.actual, self.links)
        self.gait.gravity = lambda: self.world.gravity
        self.gait.looks, self.gait.bears = self.guard.velocities_of(self._motion), self._carried
        self._servo: Servo | None = None
        self._before: RobotState | None = None  # its state when the frame began
        self._due = wall_clock.perf_counter()
        self._state = self._motion.aim
        warn_of_overlaps(self.links, [own.links for own in world.drivers if isinstance(own, SimulatedRobot)])
        if dynamics:
            self.attach()
        with world.lock:
            world.drivers.append(self)

    def __repr__(self) -> str:
        return f"<SimulatedRobot {self.actual.name!r} at t = {self.now():.3f} s>"

    # What is true

    def state(self) -> RobotState:
        """Return where the robot truly is and how it moves, at the world's time."""
        with self.world.lock:
            return self._state

    # Time

    def now(self) -> float:
        """Return the world's time [s]."""
        return float(self.world.time)

    @checked
    def sleep(self, seconds: float) -> None:
        """Let the world's clock go on by ``seconds`` [s]."""
        self._let_pass(number("seconds", seconds, low=0.0))

    @checked
    def wait_until(self, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        """Step the world until a condition holds, up to ``timeout`` [s], None or 0 for ever; return whether it does."""
        end = None if not timeout else self.now() + timeout - 1e-9
        while not condition():
            if end is not None and self.now() >= end:
                return False
            self._let_pass(1.0 / self.world.frame_rate)
        return True

    def _let_pass(self, seconds: float) -> None:
        self._check_there()
        if self.pace is None or self.world.is_running:
            self.world.run(seconds)
            return
        end = self.now() + seconds
        while (rest := end - self.now()) > 1e-9:
            span = min(rest, 1.0 / self.world.frame_rate)
            self.world.run(span)
            now = wall_clock.perf_counter()
            self._due = max(self._due + span / self.pace, now - LATE)
            if self._due > now:
                wall_clock.sleep(self._due - now)

    # Joints

    def read_joint_state(self) -> JointState:
        """Return the joints as their sensors tell."""
        read = self.read()
        return JointState(
            read.sampled["positions"], self.actual.joint_names, read.positions, read.velocities, read.torques
        )

    def read_reference(self) -> JointState:
        """Return where the controllers want the joints now."""
        with self.world.lock:
            positions, velocities, _ = self.joints.desired
            return JointState(self.now(), self.actual.joint_names, positions, velocities, np.zeros_like(positions))

    def send_trajectory(
        self, controller: Controller, trajectory: JointTrajectory, start_time: float, tolerances: Tolerances | None
    ) -> Goal:
        """Send a trajectory to a controller, to start ``start_time`` [s] from now; see ``RobotInterface``."""
        with self.world.lock:
            self._check_there()
            name = self._controller_name(controller)
            taken = "the robot walks" if self.gait.moves(name) else "its joints are under a servo command"
            if self.gait.moves(name) or self._servo_has(name):
                goal = Goal(trajectory)
                goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_GOAL, f"{name} takes no goals now: {taken}")
                return goal
            return self.joints.send(name, trajectory, start_time, tolerances)

    def cancel_trajectories(self, controller: Controller) -> None:
        """Let a controller give up what it does, and hold the joints where they are."""
        with self.world.lock:
            self.joints.cancel(self._controller_name(controller))

    def is_busy(self, controller: Controller) -> bool:
        """Return True if a controller follows a goal."""
        with self.world.lock:
            return self.joints.controllers[self._controller_name(controller)].is_busy

    @checked
    def servo(self, command: ServoCommand | None) -> None:
        """Put joints under a torque law, at once and until another command; see ``Servo``.

        Their controllers give up what they do and take no goals meanwhile. None gives the joints back, which hold.

        Raises:
            UnknownNameError: no joint of a name.
        """
        with self.world.lock:
            wanted = None if command is None else Servo(self.actual, command, self.world.gravity)
            before = self._servo
            if wanted is not None and not self.is_dynamic:
                self._felt.begin()
            if before is None or wanted is None or not np.array_equal(before.rows, wanted.rows):
                moved = [own.rows for own in (before, wanted) if own is not None]
                for name, rows in self.joints.rows.items():
                    if any(np.isin(rows, own).any() for own in moved):
                        self.joints.take_over(name)
            self._servo = wanted

    def _servo_has(self, name: str) -> bool:
        return self._servo is not None and bool(np.isin(self.joints.rows[name], self._servo.rows).any())

    def _external(self) -> Any:
        """Return what bodies do to the links, None where there is nothing."""
        loads = self._felt.read()
        return external_forces(self.links, loads, self.links.robot.update().oMi) if loads else None

    def _controller_name(self, controller: Controller) -> str:
        name = controller["controller_type"]
        if name not in self.joints.controllers:
            raise UnknownNameError("controller", name, list(self.joints.controllers))
        return str(name)

    # Hands

    def send_gripper(self, hand: str, position: float, effort: float) -> Goal:
        """Open or close a hand; see ``RobotInterface``.

        The effort limits how hard fingers with dynamics press; without, what is between them is held.

        Raises:
            UnknownNameError: the robot has no such hand.
        """
        with self.world.lock:
            self._check_there()
            if hand not in self.grippers:
                raise UnknownNameError("hand", hand, list(self.grippers))
            self._grip_queue.forget(hand)
            return self.grippers[hand].send(position, effort)

    # What the world asks of it

    def begin_frame(self, start: float, end: float) -> None:
        """Send the links to where the robot is at the end of the frame, or, with dynamics, set their motors."""
        self.gait.take_up()
        self._grip_queue.take_up()
        span, before, self._before = end - start, self._motion.aim, self._state
        servo = None if self._servo is None or self.is_dynamic else self._serve
        if span > 0.0 and not self.is_dynamic:
            self.guard.before_frame(self._motion, span)
        aim = self._motion.begin(end, span, servo)
        if span <= 0.0:
            return
        if servo is not None and self.guard.after_step(self._motion, before.q) and self.collisions == "stop":
            self._motion.cancel()
            self.servo(None)
            aim = self._motion.begin(end, span)
        if self.is_dynamic:
            self._drive(aim, span)
            return
        self._state = aim
        if aim.q is not before.q and np.count_nonzero(aim.q != before.q):
            if self.actual is not self.wanted:
                self.actual.move_to(self.wanted._angles, aim.q[:7])
            self.links.follow(span)

    def end_frame(self) -> None:
        """Take the frame's motion as done."""
        actual = None
        if self.balance is not None and self.is_dynamic:
            ended = self.balance.ended(max(self.world.time - self._state.time, 1e-9))
            self._state = self.balance.judge([self._state], [self._motion.aim], ended, self.world.time)[0]
            self._motion.take_footing(self._state)
            self._tell_torn()
            angles = self.actual.angles_of(self._state.q)
            self.actual.move_to(angles, self._state.q[:7])
            actual = (angles, self._state.v[6:], self._state.a[6:])
        else:
            if self._servo is not None:
                self._felt.take()
            self._state = self._burden.after_frame(self._state, self.guard.met)
        self.joints.take_step(actual)
        for gripper in self.grippers.values():
            gripper.end_frame(self._state.contacts, self.joints.desired[0])
        self.gait.end_frame()

    def cancel_frame(self) -> None:
        """Go back to where the robot was when the frame began."""
        assert self._before is not None
        self._state = self._before
        self._motion.cancel()

    def save(self) -> Any:
        """Return all that it is, for a snapshot."""
        joints = () if self.balance is None else self.balance.dynamics.save()
        hands, guard = self._save_hands(), self.guard.save()
        felt = self._felt.save()
        return self._state, self._motion.save(), joints, hands, self._servo, guard, self._burden.save(), felt

    def _save_hands(self) -> Any:
        return {name: gripper.save() for name, gripper in self.grippers.items()}, self._grip_queue.waiting

    def load(self, saved: Any) -> None:
        """Become what it was when a snapshot was taken; goals that came since are given up."""
        self._state, motion, joints, (grippers, self._grip_queue.waiting), self._servo, guard, burden, felt = saved
        self._motion.load(motion)
        if self.balance is not None:
            self.balance.dynamics.load(joints)
        self._set_tolerance()
        if self.actual is not self.wanted:
            self.actual.move_to(self.actual.angles_of(self._state.q), self._state.q[:7])
        for name, gripper in self.grippers.items():
            gripper.load(grippers[name])
        self._readings = None
        self.guard.load(guard)
        self._burden.load(burden)
        self._felt.load(felt)

    def grip_orders(self) -> tuple[GripOrder, ...]:
        """Return what its hands are to do later, for its copies."""
        return self._grip_queue.waiting

    def follow_grips(self, waiting: Sequence[GripOrder], given: Sequence[GripOrder], later: float) -> bool:
        """Let its hands do from now on what those of a copy were told; see ``GripQueue.follow``."""
        self._grip_queue.follow(waiting, given, later)
        return bool(self._grip_queue.waiting)

    def saved(self) -> tuple[RobotState, Any, Any, Any, Any]:
        """Return its state, what is wanted, its servo command, what was found of its way, and what it feels."""
        return self._state, self._motion.save(), self._servo, self.guard.save(), self._felt.save()

    def imagined(self, futures: World, world: int) -> ImaginedRobot:
        """Return the driver of this robot's copies in a batch that was imagined from its world."""
        from nuno.robot.imagined_robot import ImaginedRobot

        return ImaginedRobot(self, futures)

    def take_future(self, futures: World, k: int) -> None:
        """Go on as the copy in one world of a batch does, which the robot's world has just become."""
        for other in futures.drivers:
            if getattr(other, "original", None) is self:
                if self.balance is not None:
                    copies = other.balance  # type: ignore[attr-defined]
                    self.balance.dynamics.take(None if copies is None else copies.dynamics)
                joints = () if self.balance is None else self.balance.dynamics.save()
                state, motion, servo, guard, felt = other.saved_of(k)  # type: ignore[attr-defined]
                self.load((state, motion, joints, self._save_hands(), servo, guard, self._burden.save(), felt))
                goals = self._motion.disown()
                self._base_goal = self.gait.goal
                drop_empty_grips(self.world, self.links.bodies)
                copied, self._grip_queue.waiting = other.grippers_of(k)  # type: ignore[attr-defined]
                grips = grips_by_key(self.world)
                for name, gripper in self.grippers.items():
                    gripper.take_over(copied[name], goals, grips)

    def future_commands(self, futures: World, k: int) -> Callable[[], None]:
        """Return what lets the robot do from now on what its copy in one world of a batch was told to."""
        from nuno.robot.future_commands import future_commands

        return future_commands(self, futures, k)

    def _serve(self, before: RobotState, others: Any, base: Any, span: float) -> tuple[np.ndarray, Any]:
        assert self._servo is not None
        self._servo.take_gravity(self.world.gravity)
        return self._servo.rows, self._servo.step(before, others, base, span, self._external())
