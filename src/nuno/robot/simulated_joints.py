"""SimulatedJoints: controllers of all joints, and joints that follow them as far as their limits let them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nuno.errors import InvalidInputError
from nuno.robot.goal import Goal, GoalStatus, ResultCode, Tolerances
from nuno.robot.trajectory import JointTrajectory, Motion, evaluate, resting_at, with_derivatives
from nuno.robot.trajectory_controller import Later, TrajectoryController

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

ROUNDING = 1.0 + 1e-9
"""Of a step at the velocity limit."""


class Sent(NamedTuple):
    """A trajectory that was sent to a controller.

    Attributes:
        clock: When [s] of the joints' clock.
        controller: The controller's name.
        trajectory: What; None where something else is sent to it then, which takes the place of what was to come.
    """

    clock: float
    controller: str
    trajectory: JointTrajectory | None


class SimulatedJoints:
    """The joints of a robot, in the order of ``robot.joint_names``, and the controllers that move them.

    Joints are where their controllers want them; one that is asked to be faster than its limit lags behind at that
    velocity until it has caught up. A step is worked out first and taken after that, so that one which fails elsewhere
    leaves all as it was.

    Args:
        robot: Whose limits and present angles count.
        groups: Joint names by controller; joints in none hold.

    Raises:
        InvalidInputError: a joint in two groups.

    Attributes:
        controllers: By name.
        clock: [s], how long they have been moving.
        positions: (n,) float [rad; m for slides].
        velocities: (n,) float.
        accelerations: (n,) float.
        desired: Positions, velocities and accelerations (n,) as the controllers want them.
        commands: How often anything was asked of them, or taken back.
    """

    def __init__(self, robot: Humanoid, groups: Mapping[str, Sequence[str]]) -> None:
        self.limits, self.velocity_limits = robot.joint_limits, robot.velocity_limits
        count = len(robot.joint_names)
        self.clock, self.commands = 0.0, 0
        self.positions = robot.angle_vector()
        self.velocities, self.accelerations = np.zeros(count), np.zeros(count)
        self.desired: Motion = (self.positions, self.velocities, self.accelerations)
        self._polynomials = with_derivatives(resting_at(self.positions))
        self._begin = np.zeros(count)
        self._holds: bool | None = None  # whether those are constant; None is not known
        self.controllers: dict[str, TrajectoryController] = {}
        self.rows: dict[str, np.ndarray] = {}
        self._pending: tuple[float, Motion, Motion] | None = None
        self._rested: tuple[Any, ...] = ()  # how they were when they were last found to rest
        self._quiet: tuple[int, float] = (-1, 0.0)  # commands, and the clock before which nothing comes of them
        self._busy: list[tuple[TrajectoryController, np.ndarray]] = []  # whose goals are told how it goes until then
        taken: set[str] = set()
        for name, joints in groups.items():
            if taken & set(joints):
                raise InvalidInputError(f"{min(taken & set(joints))!r} is moved by two controllers, one is {name!r}")
            taken |= set(joints)
            rows = np.array([robot.joint_index(joint) for joint in joints], dtype=int)
            limits = (self.limits[0][rows], self.limits[1][rows])
            self.rows[name] = rows
            self.controllers[name] = TrajectoryController(joints, self.positions[rows], limits)

    @property
    def is_resting(self) -> bool:
        """Return True if nothing is asked of the joints, and they are where they are wanted."""
        if self._still_rests:
            return True
        if any([own.is_busy for own in self.controllers.values()]):
            return False
        if not (self.desired[0] == self.positions).all() or self.velocities.any():
            return False
        self._rested = (self.commands, self.positions, self.velocities, self.desired)
        return True

    @property
    def _still_rests(self) -> bool:
        """Return True if they rested when asked last and are as they were: no array of theirs is ever written to."""
        rested = self._rested
        return (
            bool(rested) and rested[0] == self.commands and rested[1] is self.positions
            and rested[2] is self.velocities and rested[3] is self.desired
        )  # fmt: skip

    @property
    def _is_quiet(self) -> bool:
        return self._quiet[0] == self.commands and self.clock < self._quiet[1]

    @property
    def followed(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the polynomials (6, 3, n) that the joints follow, with derivatives, and since when (n,) [s]."""
        return self._polynomials, self._begin

    def ahead(self, times: np.ndarray, given: np.ndarray | None = None, rows: Any = ()) -> np.ndarray:
        """Return where the joints will be (k, n) at times (k,) [s] from now on, evenly spaced; nothing changes.

        Args:
            times: Of their clock, the first is now.
            given: (k, m) where something else moves some joints.
            rows: Those joints, (m,).
        """
        found = np.tile(self.desired[0], (len(times), 1))
        for name, controller in self.controllers.items():
            found[:, self.rows[name]] = controller.ahead(times)
        if given is not None:
            found[:, rows] = given
        found[0] = self.positions
        far = self.velocity_limits * (float(times[1] - times[0]) * ROUNDING)
        lower, upper = self.limits
        late = (np.abs(np.diff(found, axis=0)) > far).any(axis=0)
        for joint in np.flatnonzero(late):  # they lag behind at their greatest velocity
            wanted, at, most = found[:, joint].tolist(), float(self.positions[joint]), float(far[joint])
            for k in range(1, len(times)):
                at += min(max(wanted[k] - at, -most), most)
                found[k, joint] = at
        return np.clip(found, lower, upper)

    @property
    def end(self) -> float:
        """The time when the joints come to rest [s] as far as is known now; that of their clock where they rest."""
        end = max([self.clock, *(controller.end for controller in self.controllers.values())])
        lag = np.abs(self.desired[0] - self.positions) / np.maximum(self.velocity_limits, 1e-9)
        return end + float(lag.max(initial=0.0))

    def stop(self, name: str, text: str) -> None:
        """Let a controller give up its goal, which ends as aborted, and hold the joints where they are."""
        own = self.controllers[name]
        own.hold(self.positions[self.rows[name]], GoalStatus.ABORTED, ResultCode.PATH_TOLERANCE_VIOLATED, text)
        self._ask(name)

    def step(self, duration: float, rows: np.ndarray | None = None, given: Motion | None = None) -> Motion:
        """Return positions, velocities and accelerations (n,) that the joints have ``duration`` [s] later.

        They take them with ``take_step``.

        Args:
            duration: [s].
            rows: Joints that something else moves, (k,).
            given: Their motion then, (k,) each.
        """
        time = self.clock + duration
        motion = (self.positions, self.velocities, self.accelerations)
        if duration <= 0.0 or (rows is None and self.is_resting):
            self._pending = (time, self.desired, motion)
            return motion
        if self._quiet[0] != self.commands or time >= self._quiet[1]:
            for name, controller in self.controllers.items():
                if controller.advance(time):
                    self._follow(name)
            controllers = self.controllers.values()
            self._quiet = (self.commands, min((own.next_event for own in controllers), default=np.inf))
            self._busy = [(own, self.rows[name]) for name, own in self.controllers.items() if own.is_busy]
        desired = self._desired_at(time)
        if rows is not None and given is not None:
            desired = _with(desired, rows, given)
        actual = limited(desired, motion, duration, self.velocity_limits, self.limits)
        if actual is not desired and rows is not None and given is not None:
            actual = _with(actual, rows, given)
        self._pending = (time, desired, actual)
        return actual

    def _desired_at(self, time: float) -> Motion:
        """Return what the controllers want at a time [s], (n,) each."""
        if self._holds is None:
            constant = self._polynomials[0, 0]
            self._holds = bool(np.count_nonzero(self._polynomials) == np.count_nonzero(constant))
        if self._holds:  # as the polynomials give it, to the bit
            return self._polynomials[0, 0] + 0.0, np.zeros(len(self._begin)), np.zeros(len(self._begin))
        return evaluate(self._polynomials, time - self._begin)

    def put(self, positions: np.ndarray) -> None:
        """Be at rest at positions (n,); controllers give up what they do, and hold."""
        self.positions, nothing = positions, np.zeros(len(positions))
        self.velocities, self.accelerations = nothing, nothing
        self.desired = (positions, nothing, nothing)
        for name in self.controllers:
            self.cancel(name)

    def put_rows(self, rows: np.ndarray, positions: np.ndarray) -> None:
        """Be at rest in some joints (k,), at positions of all (n,); what moves them is to be told of it."""
        now, nothing = [self.positions, self.velocities, self.accelerations], np.zeros(len(positions))
        self.positions, self.velocities, self.accelerations = _with(
            (now[0], now[1], now[2]), rows, (positions[rows], nothing[rows], nothing[rows])
        )
        self.desired = _with(self.desired, rows, (positions[rows], nothing[rows], nothing[rows]))

    def take_step(self, actual: Motion | None = None) -> None:
        """Take the step that was worked out last, and tell the goals of it.

        Args:
            actual: Positions, velocities and accelerations (n,) that the joints have now, where motors move them.
        """
        assert self._pending is not None
        self.clock, self.desired, (self.positions, self.velocities, self.accelerations) = self._pending
        self._pending = None
        if self._still_rests:  # of goals that have ended
            return
        actual = actual or (self.positions, self.velocities, self.accelerations)
        if self._is_quiet:
            for controller, rows in self._busy:
                controller.tell(self.clock, self.desired, actual, rows)
            return
        for name, controller in self.controllers.items():
            if controller.check(self.clock, self.desired, actual, self.rows[name]):
                self._follow(name)

    def cancel(self, name: str) -> None:
        """Let a controller give up its goal and hold the joints where they are."""
        self.controllers[name].cancel(self.positions[self.rows[name]])
        self._ask(name)

    def take_over(self, name: str, after: float = np.inf) -> None:
        """Let something else move a controller's joints, or give them back: it holds them where they are now.

        What it was sent for later than ``after`` [s] comes all the same.
        """
        self.controllers[name].move_rest(self.positions[self.rows[name]], after)
        self._ask(name)

    def send(
        self, name: str, trajectory: JointTrajectory, start_time: float = 0.0, tolerances: Tolerances | None = None,
        among_others: bool = False,
    ) -> Goal:  # fmt: skip
        """Send a trajectory to a controller, to start ``start_time`` [s] from now; see ``TrajectoryController``."""
        goal = self.controllers[name].accept(trajectory, self.clock, start_time, tolerances, among_others)
        self._ask(name)
        return goal

    def are_as(self, saved: tuple[Any, ...]) -> bool:
        """Return True if time and positions are what they were when ``save`` returned that."""
        own, _ = saved
        return self.clock == own[0] and np.array_equal(self.positions, own[1])

    def follow(self, saved: tuple[Any, ...], sent: Sequence[Sent]) -> bool:
        """Do from now on what other joints of these names did from a time on; return whether that is anything.

        Args:
            saved: What they were then, as ``save`` tells it.
            sent: What their controllers were sent from then on.
        """
        then, goes_on = saved[0][0], self.are_as(saved)
        for name, controller in self.controllers.items():
            own = [Later(each.clock, each.trajectory) for each in sent if each.controller == name]  # type: ignore[arg-type]
            if goes_on:
                controller.go_on(saved[1][name], own)
            else:
                positions = self.positions[self.rows[name]]
                controller.begin_anew(saved[1][name], own, then, self.clock, positions)
            self._ask(name)
        return any(controller.end > self.clock for controller in self.controllers.values())

    def save(self) -> tuple[Any, ...]:
        """Return all that they are, for ``load``."""
        own = (self.clock, self.positions, self.velocities, self.accelerations, self.desired)
        return own, {name: controller.save() for name, controller in self.controllers.items()}

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what they were."""
        own, controllers = saved
        self.clock, self.positions, self.velocities, self.accelerations, self.desired = own
        self._pending = None
        for name, controller in self.controllers.items():
            controller.load(controllers[name])
            self._ask(name)

    def _ask(self, name: str) -> None:
        self.commands += 1
        self._follow(name)

    def _follow(self, name: str) -> None:
        rows, piece = self.rows[name], self.controllers[name].piece
        self._polynomials[:, :, rows] = with_derivatives(piece.coefficients)
        self._begin[rows] = piece.start
        self._holds = None


def limited(desired: Motion, now: Motion, duration: float, speeds: np.ndarray, limits: Any) -> Motion:
    """Return the motion that joints have ``duration`` [s] later, which are wanted to have another.

    Args:
        desired: Positions, velocities and accelerations that are wanted, (n,) each, or (copies, n).
        now: Those of now.
        duration: [s].
        speeds: (n,) [rad/s; m/s], the greatest.
        limits: The lowest and the highest positions, (n,) each.
    """
    positions, velocities, accelerations = desired
    far = speeds * (duration * ROUNDING)
    change = positions - now[0]
    lower, upper = limits
    held = (np.abs(change) > far) | (np.abs(velocities) * duration > far) | (positions < lower) | (positions > upper)
    if not np.count_nonzero(held):
        return desired
    reached = np.clip(now[0] + np.clip(change, -far, far), lower, upper)
    speed = (reached - now[0]) / duration
    return (
        np.where(held, reached, positions),
        np.where(held, speed, velocities),
        np.where(held, (speed - now[1]) / duration, accelerations),
    )


def _with(motion: Motion, rows: np.ndarray, given: Motion) -> Motion:
    positions, velocities, accelerations = (part.copy() for part in motion)
    for part, own in zip((positions, velocities, accelerations), given, strict=True):
        part[rows] = own
    return positions, velocities, accelerations


def joined(
    rows: np.ndarray | None, given: Motion | None, more_rows: np.ndarray, more: Motion
) -> tuple[np.ndarray, Motion]:
    """Return the joints of two givers and their motions; the second has those that both give."""
    if rows is None or given is None:
        return more_rows, more
    a, b, c = (np.concatenate(pair) for pair in zip(given, more, strict=True))
    return np.concatenate([rows, more_rows]), (a, b, c)
