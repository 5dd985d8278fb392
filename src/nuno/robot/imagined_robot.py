"""ImaginedRobot: the copies of a simulated robot in a batch of imagined worlds, each with its own commands."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError, RobotModelError
from nuno.robot.goal import Goal
from nuno.robot.imagined_base import ImaginedBase
from nuno.robot.imagined_hands import ImaginedHands
from nuno.robot.imagined_loads import ImaginedLoads
from nuno.robot.imagined_sensors import ImaginedReadings, ImaginedSensors
from nuno.robot.link_batch import LinkBatch
from nuno.robot.motion_batch import MotionBatch
from nuno.robot.motion_guard import MotionGuard
from nuno.robot.robot_state import RobotState, RobotStates
from nuno.robot.simulated_joints import Sent
from nuno.robot.trajectory import JointTrajectory, passing_velocities
from nuno.robot.walk_order import WalkOrder
from nuno.robot.wanted_motion import WantedMotion
from nuno.validation import checked, finite_array, number

if TYPE_CHECKING:
    from nuno.robot.balance import Balance
    from nuno.robot.gait import Gait
    from nuno.robot.grip_order import GripOrder
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.robot.reported_joints import Angles
    from nuno.robot.sensors import Sensors
    from nuno.robot.simulated_gripper import SimulatedGripper
    from nuno.robot.simulated_joints import SimulatedJoints
    from nuno.world.world import World


logger = logging.getLogger(__name__)

STILL = 1e-6
"""[rad] What is asked of a leg's joint that is to stay where it is."""


class OriginalRobot(Protocol):
    """The robot that is imagined, as its copies see it; `SimulatedRobot` says what each member is."""

    actual: Humanoid
    wanted: Humanoid
    links: Links
    joints: SimulatedJoints
    gait: Gait
    guard: MotionGuard
    balance: Balance | None
    sensors: Sensors
    grippers: dict[str, SimulatedGripper]
    collisions: str

    @property
    def is_dynamic(self) -> bool:
        """True where its links are moved by forces."""

    def grip_orders(self) -> tuple[GripOrder, ...]:
        """Return what its hands are to do later."""

    def saved(self) -> tuple[RobotState, Any, Any, Any, Any]:
        """Return its state, what is wanted, its servo command, what was found of its way, and what it feels."""

    def angle_vector_duration(self, start_av: Angles, end_av: Angles) -> Any:
        """Return the shortest time [s] from one posture to another."""

    def sub_angle_vector(self, a: Angles, b: Angles) -> np.ndarray:
        """Return the difference of two postures."""


class ImaginedRobot(ImaginedBase, ImaginedHands):
    """A robot in every world of a batch: ``world.imagine(n).robot``.

    What is under way in the robot's world goes on in each of them. Commands may differ from world to world. Sensors are
    exact, whatever models the original's have; cameras are the original's alone.

    Args:
        original: The robot.
        world: A batch that was imagined from its world.
        of: The copies that these are copies of, and which of them; None where the original is copied.

    Attributes:
        original: The robot.
        world: The batch.
        joint_names: Names of its joints, n of them.
    """

    def __init__(
        self, original: OriginalRobot, world: World, of: tuple[ImaginedRobot, int] | None = None
    ) -> None:  # fmt: skip
        self.original, self.world = original, world
        self.joint_names = original.actual.joint_names
        state, motion, self._servo, found, felt = original.saved() if of is None else of[0].saved_of(of[1])
        # what is under way as the robot itself is imagined, and what each copy was sent since
        self._under_way: Any = motion if of is None else of[0]._under_way
        self._sent: list[tuple[Any, ...]] = [() if of is None else of[0]._sent[of[1]]] * world.world_count
        self._warned_of_legs = False
        self._base_goals: list[Goal | None] = [None] * world.world_count  # of walks that were refused
        self._links = [world.find(body.name) for body in original.links.bodies]
        balance = (original.balance if original.is_dynamic else None) if of is None else of[0].balance
        self.balance: Balance | None = None if balance is None else balance.imagined(world)
        self._states: list[RobotState] = [state] * world.world_count
        groups = {name: own.names for name, own in original.joints.controllers.items()}
        self._motions, goals = [], []
        for k in range(world.world_count):
            own = WantedMotion(original.wanted.copy(), groups, world.time)
            own.load(motion)
            goals.append(own.disown())
            own.gait.plans, own.gait.bears = original.gait.plans, partial(self._carried, k)
            own.gait.gravity = lambda: self.world.gravity
            for name, controller in own.joints.controllers.items():
                controller.near = original.joints.controllers[name].near
            self._motions.append(own)
        whole = self._is_whole() and self.balance is None
        self._guards: list[MotionGuard] = []
        for k, own in enumerate(self._motions if whole else []):
            above = self._guards[0] if self._guards else original.guard
            self._guards.append(MotionGuard(original.links, original.collisions, world, above, k))
            self._guards[k].load(found)
            own.gait.looks = self._guards[k].velocities_of(own)
        self._sensors: ImaginedSensors | None = None  # made when they are first read
        self._make_hands(of, goals)
        self._loads: ImaginedLoads | None = None
        if self._servo is not None and whole:
            self._loads = ImaginedLoads(original.links, world, self._links, [felt] * world.world_count)
        closing = [name for name, own in original.grippers.items() if own.will_hold and name not in self.hands]
        if closing and of is None:
            logger.warning(
                "%s of %r closes: its copies' fingers go on, but grip nothing there; imagine when it holds",
                " and ".join(closing), original.actual.name,
            )  # fmt: skip
        self._before = self._states
        self._ground = original.sensors.ground
        self._read: ImaginedReadings | None = None
        self._batch = LinkBatch(original.links, world, self._links)
        self._together = MotionBatch(original.actual, self._motions, self._guards)

    def __repr__(self) -> str:
        return f"<ImaginedRobot {self.original.actual.name!r} in {self.world.world_count} worlds>"

    # What it does

    def state(self) -> tuple[RobotState, ...]:
        """Return where the robot is and how it moves, and whether it fell, of each world."""
        with self.world.lock:
            return tuple(self._states)

    def state_arrays(self) -> RobotStates:
        """Return what ``state`` tells as arrays over worlds."""
        with self.world.lock:
            return RobotStates.of(self._states, self.original.actual)

    def read(self) -> ImaginedReadings:
        """Return what all sensors tell in each world, read once a frame; they are exact.

        As of the robot itself, without dynamics forces follow by inverse dynamics with what the bodies of each world do
        to the links there; with dynamics from what the joints bore in the last frame.

        Raises:
            BodyStateError: a link was removed from the batch.
        """
        with self.world.lock:
            self._check_whole()
            if self._read is None or self._read.time != self.world.time:
                if self._sensors is None:
                    own = self.original
                    self._sensors = ImaginedSensors(own.actual, own.links, self.world, self._links, self._ground)
                self._read = self._sensors.read_worlds(self._states, self.world.time)
            return self._read

    @checked
    def read_wrench(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return forces [N] and torques [N m] of what lies beyond a sensor, (worlds, 3) each; see ``RobotInterface``.

        Raises:
            RobotModelError: the robot has no such sensor.
            BodyStateError: a link was removed from the batch.
        """
        found = self.read().wrenches.get(frame)
        if found is None:
            raise RobotModelError(f"{self.original.actual.name!r} has no force sensor in {frame!r}")
        return found[:, :3].copy(), found[:, 3:].copy()

    def angle_vector(
        self, angles: ArrayLike | Mapping[str, ArrayLike] | None = None, seconds: float = 1.0
    ) -> np.ndarray:
        """Send joints to angles in ``seconds`` [s] where they are given, and return where they are, (worlds, n).

        Args:
            angles: (n,) for all worlds or (worlds, n) [rad; m for slides], or by name a number or (worlds,), others
                staying where they are.
            seconds: [s].

        Raises:
            InvalidInputError: angles of other shapes, or not finite.
            UnknownNameError: no joint of that name.
            BodyStateError: the robot is under a servo command.
        """
        with self.world.lock:
            worlds = self.world.world_count
            if angles is not None:
                span = number("seconds", seconds, above=0.0)
                wanted = self._present()
                if isinstance(angles, Mapping):
                    for name, value in angles.items():
                        k = self.original.actual.joint_index(name)
                        wanted[:, k] = finite_array(f"the angle of {name!r}", value, (), (worlds,))
                else:
                    count = len(self.joint_names)
                    wanted = np.array(
                        np.broadcast_to(finite_array("angles", angles, (count,), (worlds, count)), wanted.shape)
                    )
                self._send(wanted[:, None], np.array([span]))
            robot = self.original.actual
            return np.array([robot.angles_of(state.q) for state in self._states])

    def angle_vector_sequence(self, avs: ArrayLike, times: ArrayLike = 1.0) -> None:
        """Send joints through many angles, as the robot's own ``angle_vector_sequence`` does in its world.

        Args:
            avs: (k, n) for all worlds or (worlds, k, n) [rad; m for slides].
            times: How long each takes [s] from the one before, (k,), or one number for all; what is too fast for the
                joints is stretched, in each world by itself.

        Raises:
            InvalidInputError: other shapes, not finite, or times that are not positive.
            BodyStateError: the robot is under a servo command.
        """
        with self.world.lock:
            worlds, count = self.world.world_count, len(self.joint_names)
            given = finite_array("avs", avs, ("k", count), (worlds, "k", count))
            spans = np.array(np.broadcast_to(finite_array("times", times, (), given.shape[-2:-1]), given.shape[-2]))
            if (spans <= 0.0).any():
                raise InvalidInputError(f"times must be above 0, got {spans.min():g}")
            self._send(np.broadcast_to(given, (worlds, *given.shape[-2:])), spans)

    def _send(self, wanted: np.ndarray, spans: np.ndarray) -> None:
        """Send each world's joints through angles (worlds, k, n), each of which takes a span (k,) [s]."""
        if self._servo is not None:
            raise BodyStateError(f"{self.original.actual.name!r} is under a servo command there")
        self._together.bring()
        shortest, kept = self.original.angle_vector_duration, []
        for k, (own, begin, goals) in enumerate(zip(self._motions, self._present(), wanted, strict=True)):
            steps = np.array([self.original.sub_angle_vector(b, a) for a, b in pairwise((begin, *goals))])
            needed = [shortest(a, b) for a, b in pairwise((begin, *goals))]
            longer = np.maximum(spans, needed)  # as the driver stretches what is too fast
            speeds, times = passing_velocities(steps, longer), np.cumsum(longer)
            for name, rows in own.joints.rows.items():
                if own.gait.moves(name):
                    if np.abs(goals[:, rows] - begin[rows]).max() > STILL:
                        kept.append(k)
                    continue
                names = own.joints.controllers[name].names
                trajectory = JointTrajectory(names, times, goals[:, rows], speeds[:, rows])
                own.joints.send(name, trajectory)
                self._sent[k] += (Sent(own.joints.clock, name, trajectory),)
        if kept and not self._warned_of_legs:
            self._warned_of_legs = True
            logger.warning(
                "%r walks in worlds %s: its legs are the walk's there, and go nowhere else before it stands (go_stop)",
                self.original.actual.name, sorted(set(kept)),
            )  # fmt: skip

    def _present(self) -> np.ndarray:
        """Return where the joints are (worlds, n), as encoders tell the driver, which plans from there."""
        robot = self.original.actual
        return np.clip([robot.angles_of(state.q) for state in self._states], *robot.joint_limits)

    def saved_of(self, world: int) -> tuple[RobotState, Any, Any, Any, Any]:
        """Return of one world what ``SimulatedRobot.saved`` does of the robot."""
        if not 0 <= world < len(self._motions):
            raise InvalidInputError(f"world must be in 0 to {len(self._motions) - 1}, got {world}")
        self._together.bring()
        found = self._guards[world].save() if self._guards else None
        felt = None if self._loads is None else self._loads.save()[world]
        return self._states[world], self._motions[world].save(), self._servo, found, felt

    def commanded_in(self, world: int) -> tuple[Any, Any, tuple[Sent | WalkOrder, ...]]:
        """Return what was under way as the robot was imagined, its servo command, and what a copy was sent since."""
        return self._under_way, self._servo, self._sent[world]

    # What the world asks of it

    def frames_ahead(self, start: float, ends: Sequence[float]) -> int:
        """Return how many of the frames that end at ``ends`` [s] may be begun at once."""
        if not self._is_whole():
            return len(ends)
        if self.balance is not None or self._servo is not None:
            return 1
        return self._hands_ahead(self._together.look_ahead(start, ends))

    def begin_frame(self, start: float, end: float) -> None:
        """Set the motors for a frame, or send the links on their way; in all frames that were looked ahead to."""
        if not self._is_whole():
            return
        span, self._before = end - start, list(self._states)
        self._take_up_grips()
        if self.balance is None:
            found = self._together.begin_ahead(start, end)
            if found is None:
                servo = None if self._servo is None else self._serve
                aims, angles = self._together.begin(end, span, servo)
                found = aims, np.array([end]), np.array([[aim.q for aim in aims]]), angles[None]
            aims, *frames = found
            self._angles = frames[2][-1]
            if span > 0.0:
                if (frames[1] != np.array([state.q for state in self._states])).any():
                    self._batch.lead(start, *frames)
                self._states = list(aims)
            return
        aims, _ = self._together.begin(end, span, states=self._states)
        if span > 0.0:
            self.balance.dynamics.drive(*self.balance.command(self._states, aims, span, self._servo))
            self.balance.dynamics.lead_fingers(self.original.actual.angles_of(np.array([aim.q for aim in aims])))

    def end_frame(self) -> None:
        """Take the frame's motion as done."""
        if not self._is_whole():
            return
        if self.balance is None:
            if self._loads is not None:
                self._loads.take()
            self._together.end()
            self._end_hands(self._angles)
            self._states = [
                state if guard.met is None else replace(state, collision=guard.met)
                for guard, state in zip(self._guards, self._states, strict=True)
            ]
            return
        ended = self.balance.ended(max(self.world.time - self._before[0].time, 1e-9))
        self._states = self.balance.judge(self._states, self._together.aims, ended, self.world.time)
        self._together.end(self._states)
        self._end_hands()

    def cancel_frame(self) -> None:
        """Go back to where the robot was when the frame began."""
        self._states = list(self._before)
        self._together.cancel()

    def save(self) -> Any:
        """Return all that it is, for a snapshot."""
        joints = () if self.balance is None else self.balance.dynamics.save()
        found = [guard.save() for guard in self._guards]
        self._together.bring()
        motions, given = [own.save() for own in self._motions], (list(self._sent), list(self._base_goals))
        felt = None if self._loads is None else self._loads.save()
        return list(self._states), motions, joints, self._servo, found, given, self._save_hands(), felt

    def load(self, saved: Any) -> None:
        """Become what it was when a snapshot was taken."""
        states, motions, joints, self._servo, found, (sent, refused), hands, felt = saved
        self._states, self._read, self._sent, self._base_goals = list(states), None, list(sent), list(refused)
        self._together.forget()
        for own, motion in zip(self._motions, motions, strict=True):
            own.load(motion)
        for guard, own in zip(self._guards, found, strict=True):
            guard.load(own)
        if self.balance is not None:
            self.balance.dynamics.load(joints)
        self._load_hands(hands)
        if self._loads is not None:
            self._loads.load(felt)

    def imagined(self, futures: World, world: int) -> ImaginedRobot | None:
        """Return the copies of one world's robot in a batch that was imagined from that world; None without links."""
        if not self._is_whole():
            return None
        return ImaginedRobot(self.original, futures, (self, world))

    def _is_whole(self) -> bool:
        """Return True as long as no link was removed from the batch; without all of them the robot does nothing."""
        return all(body._world is self.world for body in self._links)

    def _serve(self, world: int, before: RobotState, others: Any, base: Any, span: float) -> tuple[np.ndarray, Any]:
        assert self._loads is not None
        if world == 0:
            self._loads.renew()
        self._servo.take_gravity(self.world.gravity)
        external = self._loads.on_joints(world, before.q)
        return self._servo.rows, self._servo.step(before, others, base, span, external)
