"""Plans of walks: from footsteps to a checked walk, and from a walk that is under way to another."""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, WalkError
from nuno.robot.footsteps import SOLE_GAP, Footstep, sole_gap
from nuno.robot.gravity import EARTH, take_gravity, walking_gravity
from nuno.robot.leg_motion import LegMotion, Targets
from nuno.robot.pinocchio import pin
from nuno.robot.preview_control import GRAVITY, HORIZON, TICK, PreviewControl
from nuno.robot.stride import Stride, two_feet
from nuno.robot.timeline import Schedule, Timeline, smooth, timeline
from nuno.robot.trajectory import JointTrajectory, Spline
from nuno.robot.walk import States, Walk
from nuno.robot.walk_check import check_measures, measure_walk, motion_of, zero_moments
from nuno.validation import finite_array, number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

Arms = Mapping[str, float] | JointTrajectory | None
LEVEL = 0.01
"""[rad] What a sole may be tilted when a walk begins."""
SAME_HEIGHT = 0.002
"""[m] By which soles may then differ in height."""
MARGIN = 0.02
"""[m] By which the zero moment point stays inside the soles that stand, unless asked otherwise."""
TRIES = 3
"""Further steps that may be made as they were planned, when a walk is changed."""


@dataclass(frozen=True, eq=False)
class WalkPlan:
    """The plan of a walk: what it was made from, and the states of both passes at its ticks."""

    planner: WalkPlanner
    schedule: Schedule
    states: tuple[tuple[np.ndarray, np.ndarray], ...]


class WalkPlanner:
    """A planner of walks that may change under way; arguments are those of ``plan_walk``.

    Attributes:
        robot: A copy of the robot, as it stands when the walk begins.
        stride: How it walks.
        soles: Sizes (2,) of the left and the right sole [m].
        feet: (2, 4) float, where they are: x, y, z [m], yaw [rad].
        floor: Height of the floor [m].
        height: Of the centre of mass above the floor, walking [m].

    Raises: as ``plan_walk``.
    """

    def __init__(
        self, robot: Humanoid, stride: Stride | None, arms: Arms, load: tuple[float, ArrayLike] | None, margin: float,
        look_for_collisions: bool, gravity: Sequence[float] = EARTH,
    ) -> None:  # fmt: skip
        pull = walking_gravity(finite_array("gravity", gravity, (3,)).tolist())
        self.robot = robot.copy()
        self.working = threading.RLock()  # it has one place to work in, and copies in other threads share its walks
        self.stride = Stride.of(robot) if stride is None else stride
        self.margin, self.look_for_collisions = number("margin", margin), look_for_collisions
        self.model = _under(gravity, _loaded(robot.model, load))
        self.legs = LegMotion(robot, self.model)
        self.soles = [np.asarray(robot.description.frames[foot].size) for foot in two_feet(robot)]
        self._take_arms(arms)
        self.start = self.robot.configuration()
        model, data = self.model, self.model.createData()
        pin.forwardKinematics(model, data, self.start)
        soles = [pin.updateFramePlacement(model, data, frame).copy() for frame in self.legs.frames]
        self.feet = np.array([[*sole.translation, np.arctan2(*sole.rotation[1::-1, 0])] for sole in soles])
        self.feet[1, 3] = self.feet[0, 3] + np.remainder(self.feet[1, 3] - self.feet[0, 3] + np.pi, 2 * np.pi) - np.pi
        self.floor = float(self.feet[:, 2].mean())
        tilt = max(float(np.arccos(np.clip(sole.rotation[2, 2], -1.0, 1.0))) for sole in soles)
        if tilt > LEVEL or np.ptp(self.feet[:, 2]) > SAME_HEIGHT:
            raise WalkError(
                f"a walk begins with both soles on the floor; they are tilted by {tilt:.3f} rad, and one is "
                f"{1000.0 * np.ptp(self.feet[:, 2]):.1f} mm above the other: stand() puts them down"
            )
        turn = _about_z(-self.feet[:, 3].mean())
        self._base = turn @ pin.Quaternion(self.start[3:7]).toRotationMatrix()  # as it is, seen from the feet
        self.centre = np.array(pin.centerOfMass(model, data, self.start))
        self._stand_nominally(data)
        # a slower pendulum must know more of what comes
        self.control = PreviewControl(self.height, TICK, HORIZON * float(np.sqrt(GRAVITY / pull)), pull)
        self.lead = max(1, round(self.stride.shift / TICK))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out meshes and Pinocchio's data: walks go from one process to another, and have them made again."""
        robot, legs = copy.copy(self.robot), copy.copy(self.legs)
        robot.__dict__.pop("geometry", None)
        robot.data = robot.scratch = legs.data = None
        return {**self.__dict__, "robot": robot, "legs": legs, "working": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.legs.data = self.model.createData()
        self.robot = self.robot.copy()
        self.working = threading.RLock()

    def first(self, steps: tuple[Footstep, ...]) -> Walk:
        """Return the walk over steps, from standing."""
        return self._walk(self.standing(steps), 0, self.start, self.standing_states())

    def standing(self, steps: tuple[Footstep, ...]) -> Schedule:
        """Return the schedule of steps from where the robot stands."""
        return Schedule(steps, self.feet, self.floor, self.centre[:2], 0, self.lead, self.stride)

    def standing_states(self) -> States:
        """Return the states of both passes of a robot that stands, and their sums of errors."""
        still = np.zeros((3, 2))
        moving = still.copy()
        moving[0] = self.centre[:2]
        return (moving, np.zeros(2)), (still, np.zeros(2))

    def changed(self, walk: Walk, time: float, steps: Any, may_follow: bool) -> Walk:
        """Return how a walk goes on over other steps, of which ``steps(feet, next foot)`` tells.

        Steps that have not begun are given up if the robot can still do so, else the next is made as planned.

        Args:
            walk: The walk.
            time: From when [s].
            steps: From feet (2, 3) and the foot that is next (None: any) to footsteps.
            may_follow: Whether they may also follow the last step that was planned, while that is under way.
        """
        schedule: Schedule = walk.plan.schedule
        low, high = float(walk.times[0]), float(walk.times[-1])
        at = round(number("time", time, low=low - 0.5 * TICK, high=high + 0.5 * TICK) / TICK)
        count = len(schedule.steps)
        begun = sum(schedule.lift_off(k) <= at for k in range(count))
        end = count + (may_follow and begun > 0 and at < schedule.landing(count - 1))
        own = schedule.at(max(begun - 1, 0))  # a step that has landed is over
        earlier = max(begun - 1, 0)
        problem: WalkError | None = None
        for kept in range(begun, min(begun + TRIES, end)):
            made = schedule.steps[earlier:kept]
            feet = own.feet[:, [0, 1, 3]].copy()
            for step in made:
                feet[step.foot] = step.pose
            foot = schedule.steps[kept].foot if kept < count else 1 - schedule.steps[-1].foot
            for choice in (foot,) if kept else (None, foot):
                try:
                    return self._go_on(walk, at, own.with_steps((*made, *steps(feet, choice))))
                except WalkError as error:
                    problem = error
        if problem is not None and begun < count:
            raise problem
        return rest_of(walk, at)

    def _go_on(self, walk: Walk, at: int, schedule: Schedule) -> Walk:
        k = at - round(walk.times[0] / TICK)
        states = tuple((state[k], sums[k]) for state, sums in walk.plan.states)
        moving = walk.velocities[k], walk.accelerations[k]
        return self._walk(schedule, at, walk.configurations[k], states, moving)

    def _walk(
        self, schedule: Schedule, begin: int, q: np.ndarray, states: Any,
        moving: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Walk:  # fmt: skip
        """Return the walk of a schedule from a tick on, or raise.

        Args:
            schedule: Its steps.
            begin: The tick.
            q: Configuration (nq,) then.
            states: Of the controllers of both passes then, and their sums of errors.
            moving: Velocity and acceleration (nv,) then; None is at rest.
        """
        self.check_gaps(schedule)
        wanted = timeline(schedule).after(begin)
        wanted = replace(wanted, point=self.control.joined(wanted.point, states[0][0]))
        first = self.control.follow(wanted.point, *states[0])
        targets = self.targets(wanted)
        near = self.legs.follow(targets(first[0][:, 0]), q, None, begin * TICK)
        motion = (near, *motion_of(self.model, near, TICK))
        missed = wanted.point - zero_moments(self.model, self.legs.data, motion, self.floor)[0]
        missed[0], missed[-1] = missed[1], missed[-2]  # accelerations there are not known
        second = self.control.follow(self.control.joined(missed, states[1][0]), *states[1])
        found = self.legs.follow(targets(first[0][:, 0] + second[0][:, 0]), near[0].copy(), near, begin * TICK)
        velocities, accelerations = motion_of(self.model, found, TICK)
        velocities[0], accelerations[0] = (0.0, 0.0) if moving is None else moving
        velocities[-1] = accelerations[-1] = 0.0
        motion = (found, velocities, accelerations)
        reaction = zero_moments(self.model, self.legs.data, motion, self.floor)
        measures = measure_walk(self.robot, self.model, motion, reaction, wanted, TICK, self.look_for_collisions)
        check_measures(measures, self.margin)
        centre = targets(first[0][:, 0] + second[0][:, 0]).centre
        return Walk(
            TICK, (begin + np.arange(len(found))) * TICK, found, velocities, accelerations, schedule.steps,
            wanted.support, wanted.feet, centre, reaction[0], wanted.point, measures,
            WalkPlan(self, schedule, (first, second)),
        )  # fmt: skip

    def targets(self, wanted: Timeline) -> Callable[[np.ndarray], Targets]:
        """Return what makes the legs' targets of a timeline from the centre of mass (n, 2) that a pass asks for [m]."""
        others = self._others(wanted)
        base, height = self._base_and_height(wanted)
        middle, rest = wanted.point[-1], share_of_rest(len(wanted.point), self.stride)[:, None]

        def made(centre: np.ndarray) -> Targets:
            # what is still missing when the robot comes to rest (1 to 3 mm) is made up for on the way
            still = middle + (1.0 - rest) * (centre - middle)
            return Targets(wanted.feet, np.column_stack([still, height]), base, others)

        return made

    def check_gaps(self, schedule: Schedule) -> None:
        """Raise a ``WalkError`` where soles come too near to each other."""
        feet = schedule.feet[:, [0, 1, 3]].copy()
        for k, step in enumerate(schedule.steps):
            feet[step.foot] = step.pose
            gap = sole_gap(feet, self.soles)
            if gap < SOLE_GAP:
                raise WalkError(
                    f"step {k} puts one sole within {1000.0 * gap:.0f} mm of the other, at least "
                    f"{1000.0 * SOLE_GAP:.0f} mm are needed", time=schedule.landing(k) * TICK,
                )  # fmt: skip

    def _take_arms(self, arms: Arms) -> None:
        self._spline: Spline | None = None
        own = self.robot
        if not isinstance(arms, JointTrajectory | Mapping | None):
            raise InvalidInputError(f"arms must be angles by joint, a JointTrajectory or None, got {arms!r}")
        if arms is None:
            return
        names = arms.names if isinstance(arms, JointTrajectory) else arms
        legs = {int(row) for row in self.legs.leg_rows}
        rows = [self.model.joints[own.joint_index(name) + 2].idx_q for name in names]
        for name, row in zip(names, rows, strict=True):
            if row in legs:
                raise InvalidInputError(f"{name!r} is a joint of a leg: the walk decides what it does")
        if isinstance(arms, JointTrajectory):
            for positions in arms.positions:
                own.checked_angles(dict(zip(names, positions, strict=True)))
            k = [own.joint_index(name) for name in names]
            still = np.zeros(len(k))
            self._spline = Spline(0.0, 0.0, (own.angle_vector()[k], still, still), arms)
        else:
            own.angle_vector(arms)

    def _others(self, wanted: Timeline) -> np.ndarray:
        n, others = len(wanted.point), self.legs.others
        found = np.repeat(self.start[None, others], n, axis=0)
        if self._spline is None:
            return found
        place = {int(row): k for k, row in enumerate(others)}
        joints = [self.model.joints[self.robot.joint_index(name) + 2] for name in self._spline.trajectory.names]
        for k in range(n):
            angles = self._spline.at((wanted.begin + k) * TICK)[0]
            for joint, angle in zip(joints, angles, strict=True):
                if joint.nq == 1:
                    found[k, place[joint.idx_q]] = angle
                else:
                    found[k, place[joint.idx_q]], found[k, place[joint.idx_q + 1]] = np.cos(angle), np.sin(angle)
        return found

    def _stand_nominally(self, data: Any) -> None:
        """Set how the robot stands in its posture, with its other joints as they are: that is how it walks."""
        model, q = self.model, self.start.copy()
        posture = self.robot.posture_configuration()
        q[self.legs.leg_rows] = posture[self.legs.leg_rows]
        pin.forwardKinematics(model, data, q)
        soles = [pin.updateFramePlacement(model, data, frame).copy() for frame in self.legs.frames]
        centre = pin.centerOfMass(model, data, q)
        up = soles[0].rotation[:, 2]
        self.height = float(up @ (centre - 0.5 * (soles[0].translation + soles[1].translation)))
        self._base_walking = soles[0].rotation.T @ data.oMi[1].rotation

    def _base_and_height(self, wanted: Timeline) -> tuple[np.ndarray, np.ndarray]:
        """Return rotations (n, 3, 3) of the base and heights (n,) [m] of the centre of mass in the world."""
        share = smooth((wanted.begin + np.arange(len(wanted.point))) / self.lead)
        height = (1.0 - share) * self.centre[2] + share * (self.floor + self.height)
        change = pin.log3(self._base.T @ self._base_walking)
        tilted = [self._base_walking if s == 1.0 else self._base @ pin.exp3(s * change) for s in share]
        yaw = wanted.feet[:, :, 3].mean(axis=1)
        return np.array([_about_z(angle) @ own for angle, own in zip(yaw, tilted, strict=True)]), height


def share_of_rest(count: int, stride: Stride) -> np.ndarray:
    """Return how far (count,) a robot has come to rest at each tick of a walk: 0 on the way, 1 at the end."""
    settle = max(1, round(stride.settle / TICK))
    return smooth((np.arange(count) - count + 1 + settle) / settle)


def rest_of(walk: Walk, at: int) -> Walk:
    """Return a walk from a tick on, as it is."""
    k = at - round(walk.times[0] / TICK)
    parts = {name: getattr(walk, name)[k:] for name in (
        "times", "configurations", "velocities", "accelerations", "support", "feet", "centre", "zmp", "zmp_wanted"
    )}  # fmt: skip
    states = tuple((state[k:], sums[k:]) for state, sums in walk.plan.states)
    return replace(walk, **parts, plan=replace(walk.plan, states=states))


def _about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _loaded(model: Any, load: tuple[float, ArrayLike] | None) -> Any:
    """Return a model that carries a load at its base."""
    if load is None:
        return model
    try:
        mass, place = load
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"load must be a mass [kg] and a point (3,) [m], got {load!r}") from error
    made = model.copy()
    inertia = pin.Inertia(number("the mass of the load", mass, low=0.0), np.zeros(3), np.zeros((3, 3)))
    made.appendBodyToJoint(1, inertia, pin.SE3(np.eye(3), finite_array("the place of the load", place, (3,))))
    return made


def _under(gravity: Sequence[float], model: Any) -> Any:
    """Return a model that reckons with a gravity (3,) [m/s2]; the one that is given stays as it is."""
    if model.gravity.linear.tolist() == [*gravity]:
        return model
    made = model.copy()
    take_gravity(made, gravity)
    return made
