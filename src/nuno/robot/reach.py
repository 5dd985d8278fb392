"""Reaching: whole-body inverse kinematics with the feet where they are, on pink.

Each step is a quadratic program (pink, solved by daqp): the frames go to their targets and the joints back towards the
start in the least squares sense, while the feet keep their places as equalities, and the joint limits and the support
polygon bound the step as inequalities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError, MissingPackageError, RobotModelError
from nuno.robot.pinocchio import pin
from nuno.robot.support import distance_inside, edges_of
from nuno.shapes.coordinates import Coordinates
from nuno.validation import count, finite_array, number

if TYPE_CHECKING:
    from nuno.robot.robot import Robot

STEPS = 60
"""Steps of one attempt. A target in reach takes 5 to 20."""
LONGEST_STEP = 0.4
"""[rad, m] A longer step is scaled as a whole, which keeps its direction, and so the feet where they are."""
DAMPING = 1e-4
"""Weight of standing still: at 1e-8 the program sticks at joint limits."""
POSTURE_WEIGHTS = (1e-2, 1e-3)
"""Of staying near the start, first and when the hands are near: 1e-2 holds them 1 mm away, 1e-3 does not."""
TRUNK_SHARE = 3.0
"""Factor of that weight for joints that carry the stance or a fourth of the mass: the arms move first."""
MAX_RETURN = 0.005
"""[m] By which a step may have to take the centre of mass back inside."""
STEADY_FEET = 1e-4
"""[m, rad] What a foot may have moved, of a solution."""


@dataclass(frozen=True, eq=False)
class Reach:
    """The result of reaching; true in a condition where all targets are reached.

    Attributes:
        reached: Whether a configuration was found that keeps all conditions.
        angles: (n,) float [rad], in the order of ``joint_names``; None where nothing was found.
        configuration: Pinocchio's (nq,), the base with it; None where nothing was found.
        position_errors: By frame [m], of the solution or of the nearest that was come to.
        angle_errors: By frame [rad], of targets with an orientation.
        reason: What kept the robot from reaching; empty where it reached.
        steps: Steps taken, of all attempts.
    """

    reached: bool
    angles: np.ndarray | None
    configuration: np.ndarray | None
    position_errors: dict[str, float]
    angle_errors: dict[str, float]
    reason: str
    steps: int

    def __bool__(self) -> bool:
        return self.reached


def reach(
    robot: Robot, targets: Mapping[str, Any], *, stance: Sequence[str] | None = None, tolerance: float = 5e-4,
    angle_tolerance: float = 5e-3, margin: float = 0.02, check_collisions: bool = True, attempts: int = 10,
    move: bool = True,
) -> Reach:  # fmt: skip
    """Find a configuration near the present one with frames at their targets, and take it.

    Where none is found the robot stays as it is, and the result says why.

    Args:
        robot: The robot.
        targets: By frame ("left_hand" ...): ``Coordinates`` for position and orientation, or a point (3,) [m].
        stance: Frames that keep their places; None are both feet.
        tolerance: [m] within which a position is reached.
        angle_tolerance: [rad] within which an orientation is.
        margin: [m] by which the centre of mass stays inside the support polygon, where the stance is the feet. A robot
            that stands nearer to an edge than that may not come nearer still.
        check_collisions: Whether links must not run into each other.
        attempts: How often to start: from the present configuration, moving the arms before the trunk, then all joints
            alike, then from others of the joints that do not carry the stance.
        move: Whether the robot takes the configuration.

    Raises:
        UnknownNameError: no frame of a name that was given.
        RobotModelError: ``stance`` is None, and the robot has no legs.
        InvalidInputError: no targets, or one that cannot be used.
        MissingPackageError: pink or daqp is not installed.
    """
    goals = {frame: _goal(robot, frame, target) for frame, target in _checked_targets(targets).items()}
    held = robot.feet if stance is None else tuple(stance)
    if not held:
        raise RobotModelError("stance must name at least one frame that keeps its place")
    for frame in held:
        robot.frame_index(frame)
        if frame in goals:
            raise InvalidInputError(f"{frame!r} is in the stance and cannot go to a target")
    number("margin", margin, low=0.0)
    number("tolerance", tolerance, above=0.0)
    number("angle_tolerance", angle_tolerance, above=0.0)
    balanced = set(held) == set(robot.description.feet)
    outline = robot.support_polygon() if balanced else None
    solver = _Solver(robot, goals, held, outline, margin, tolerance, angle_tolerance)
    start = robot.configuration()
    random = np.random.default_rng(0)  # the same starts for the same call
    best: tuple[float, str, np.ndarray] | None = None
    for attempt in range(count("attempts", attempts)):
        q = start if attempt < 2 else _other_start(robot, start, held, random)
        q, error = solver.solve(q, spare_trunk=attempt == 0)
        reason = solver.problem(q)
        if not reason and check_collisions and (pairs := robot.geometry.collisions(q, first_only=True)):
            reason = f"{pairs[0][0]} runs into {pairs[0][1]}"
        if best is None or not reason or error < best[0]:
            best = (error, reason, q)
        if not reason:
            break
    assert best is not None
    _, reason, q = best
    errors = solver.errors(q)
    distances = {frame: float(position) for frame, (position, _) in errors.items()}
    turns = {frame: float(turn) for frame, (_, turn) in errors.items() if goals[frame][1]}
    if reason:
        return Reach(False, None, None, distances, turns, reason, solver.steps)
    kept = robot.configuration()
    robot.take_configuration(q)
    angles = robot.angle_vector()
    if not move:
        robot.take_configuration(kept)
    return Reach(True, angles, q, distances, turns, "", solver.steps)


Goal = tuple[Any, bool]  # pin.SE3, and whether its orientation counts


class _Solver:
    """Attempts at one set of targets."""

    def __init__(
        self, robot: Robot, goals: Mapping[str, Goal], held: Sequence[str], outline: np.ndarray | None,
        margin: float, tolerance: float, angle_tolerance: float,
    ) -> None:  # fmt: skip
        self.robot, self.goals, self.outline = robot, goals, outline
        self.tolerance, self.angle_tolerance = tolerance, angle_tolerance
        self.steps = 0
        pink = _pink()
        data = robot.update()
        self._places = {frame: data.oMf[robot.frame_index(frame)].copy() for frame in held}
        self._data = robot.scratch
        self._holds = [_task(pink, frame, place, True) for frame, place in self._places.items()]
        self._tasks = [_task(pink, frame, *goal) for frame, goal in goals.items()]
        self._posture = pink.tasks.PostureTask(cost=POSTURE_WEIGHTS[0])
        self._shares = _shares(robot, held)
        self._limits: list[Any] = [pink.limits.ConfigurationLimit(robot.model, config_limit_gain=0.95)]
        self._inside = 0.0
        if outline is not None:
            centre = robot.centre_of_mass[:2]
            self._inside = min(margin, max(0.0, distance_inside(outline, centre)))
            self._limits.append(_support_limit(pink, outline, self._inside))

    def solve(self, q: np.ndarray, spare_trunk: bool) -> tuple[np.ndarray, float]:
        """Return where the steps from q lead, and the largest error relative to its tolerance."""
        shares = self._shares if spare_trunk else np.ones_like(self._shares)
        import qpsolvers

        pink = _pink()
        model = self.robot.model
        now = pink.Configuration(model, self._data, q, copy_data=False)
        self._posture.set_target(q)  # else another start would end where the first did
        best, best_error, stage, slow = q, np.inf, 0, 0
        for _ in range(STEPS):
            error = self._error(now.data)
            slow = 0 if error < 0.9 * best_error else slow + 1
            if error < best_error:
                best, best_error = now.q.copy(), error
            if stage == 1 and (best_error < 0.1 or slow > 4):
                break
            # the posture has done its part once the hands are near or come no nearer
            if stage == 0 and (error < 20.0 or slow > 2):
                stage, slow = 1, 0
            self._posture.cost = POSTURE_WEIGHTS[stage] * shares
            problem = pink.build_ik(
                now, [*self._tasks, self._posture], 1.0, DAMPING, limits=self._limits, constraints=self._holds
            )
            found = qpsolvers.solve_problem(problem, solver="daqp")
            self.steps += 1
            if not found.found or found.x is None or not np.isfinite(found.x).all():
                break
            step = found.x * min(1.0, LONGEST_STEP / max(np.abs(found.x).max(), 1e-12))
            now.integrate_inplace(step, 1.0)
        return best, best_error

    def errors(self, q: np.ndarray) -> dict[str, tuple[float, float]]:
        """Return how far each frame is from its target [m] and turned [rad], in a configuration (nq,)."""
        pin.framesForwardKinematics(self.robot.model, self._data, q)
        return {frame: self._error_of(self._data, frame, goal) for frame, (goal, _) in self.goals.items()}

    def problem(self, q: np.ndarray) -> str:
        """Return what a configuration (nq,) does not keep, "" where it keeps all."""
        robot = self.robot
        for frame, (position, turn) in self.errors(q).items():
            if position > self.tolerance:
                return f"{frame} comes no nearer than {1000.0 * position:.1f} mm to its target"
            if self.goals[frame][1] and turn > self.angle_tolerance:
                return f"{frame} stays turned by {turn:.3f} rad from its target"
        for frame, place in self._places.items():
            if max(self._error_of(self._data, frame, place)) > STEADY_FEET:
                return f"{frame} does not keep its place"
        lower, upper = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
        if ((q[7:] < lower - 1e-6) | (q[7:] > upper + 1e-6)).any():
            return "a joint is beyond its limit"
        if self.outline is not None:
            centre = pin.centerOfMass(robot.model, self._data, q)[:2]
            inside = distance_inside(self.outline, centre)
            if inside < self._inside - 1e-3:
                return f"the centre of mass comes within {1000.0 * inside:.0f} mm of the edge of the support"
        return ""

    def _error(self, data: Any) -> float:
        worst = 0.0
        for frame, (goal, oriented) in self.goals.items():
            position, turn = self._error_of(data, frame, goal)
            worst = max(worst, position / self.tolerance, turn / self.angle_tolerance if oriented else 0.0)
        return worst

    def _error_of(self, data: Any, frame: str, goal: Any) -> tuple[float, float]:
        place = data.oMf[self.robot.frame_index(frame)]
        turn = np.linalg.norm(pin.log3(goal.rotation.T @ place.rotation))
        return float(np.linalg.norm(place.translation - goal.translation)), float(turn)


def _pink() -> Any:
    try:
        import daqp  # noqa: F401  qpsolvers finds it by its name
        import pink
        import pink.limits
        import pink.tasks
    except ImportError as error:
        name = "daqp" if error.name == "daqp" else "pin-pink"
        raise MissingPackageError(name, "robot", "inverse kinematics") from error
    return pink


def _task(pink: Any, frame: str, place: Any, oriented: bool) -> Any:
    task = pink.tasks.FrameTask(frame, position_cost=1.0, orientation_cost=1.0 if oriented else 0.0)
    task.set_target(place)
    return task


def _support_limit(pink: Any, outline: np.ndarray, margin: float) -> Any:
    """Return a limit of pink's: the centre of mass stays by ``margin`` [m] inside an outline (k, 2)."""
    normals, offsets = edges_of(outline)

    class SupportLimit(pink.limits.Limit):
        def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[np.ndarray, np.ndarray]:
            jacobian = pin.jacobianCenterOfMass(configuration.model, configuration.data, configuration.q)
            centre = configuration.data.com[0][:2]
            # what a step overshot, to second order, the next one takes back, if not so much that none could
            return normals @ jacobian[:2], np.maximum(offsets - normals @ centre - margin, -MAX_RETURN)

    return SupportLimit()


def _shares(robot: Robot, held: Sequence[str]) -> np.ndarray:
    """Return the relative weight (n,) of each joint's staying where it is."""
    pin.computeSubtreeMasses(robot.model, robot.scratch)
    carrying = _carrying(robot, held)
    heavy = [j in carrying or robot.scratch.mass[j] > 0.25 * robot.mass for j in range(2, robot.model.njoints)]
    return np.where(heavy, TRUNK_SHARE, 1.0)


def _carrying(robot: Robot, held: Sequence[str]) -> set[int]:
    """Return the joints between the base and the frames of the stance."""
    feet = [robot.model.frames[robot.frame_index(frame)].parentJoint for frame in held]
    return {j for foot in feet for j in robot.model.supports[foot]}


def _other_start(robot: Robot, q: np.ndarray, held: Sequence[str], random: np.random.Generator) -> np.ndarray:
    """Return a configuration with the joints that carry no held frame anywhere but near their limits."""
    carrying = _carrying(robot, held)
    other = q.copy()
    for j in range(2, robot.model.njoints):
        joint = robot.model.joints[j]
        low, high = robot.model.lowerPositionLimit[joint.idx_q], robot.model.upperPositionLimit[joint.idx_q]
        if j not in carrying and joint.nq == 1 and np.isfinite([low, high]).all():
            other[joint.idx_q] = low + (high - low) * random.uniform(0.1, 0.9)
    return other


def _checked_targets(targets: Any) -> Mapping[str, Any]:
    if not isinstance(targets, Mapping) or not targets:
        raise InvalidInputError(f"targets must be a mapping of frames to places, at least one, got {targets!r}")
    return targets


def _goal(robot: Robot, frame: str, target: Any) -> Goal:
    robot.frame_index(frame)
    if not isinstance(target, Coordinates):
        return pin.SE3(np.eye(3), finite_array(f"the target of {frame!r}", target, (3,))), False
    if target.position.ndim != 1 or target.quaternion.ndim != 1:
        raise InvalidInputError(f"the target of {frame!r} must be one pose, not one for each world")
    return pin.SE3(target.rotation, target.position), True
