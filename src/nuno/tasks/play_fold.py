"""Playing a fold: a humanoid's hands do to a cloth what a person's were seen to do."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import BodyStateError, EstimationError, InvalidInputError
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.tasks.arm_plan import ArmPlan, plan_arms
from nuno.tasks.fold_comparison import FoldComparison, compare_fold
from nuno.tasks.fold_motion import SETTLE, FoldMotion
from nuno.validation import checked

log = logging.getLogger(__name__)

ARMS = {"left_hand": "larm", "right_hand": "rarm"}
APPROACH, DOWN, UP = 1.5, 0.2, 0.2
"""[s] To each stop on the way to the cloth; of each of the steps down to it and up from it."""

SOON = 1e-6
"""[s] A shorter time is none."""


@dataclass(frozen=True, eq=False)
class PlayedFold:
    """A fold as a robot has played it on a cloth.

    Attributes:
        motion: What it was to do.
        plan: How it moved.
        vertices: (n, 3) float [m], how the cloth lies.
        held: By hand of the motion, how many vertices the hand had taken.
        strayed: (hands,) float [m], how far the held point was from its way at most.
        comparison: Against what was taught.
    """

    motion: FoldMotion
    plan: ArmPlan
    vertices: np.ndarray = field(repr=False)
    held: tuple[int, ...]
    strayed: np.ndarray
    comparison: FoldComparison = field(repr=False)

    @property
    def errors(self) -> np.ndarray:
        """(hands,) float [m], how far the carried corners lie beside those that they cover, seen from above.

        Raises:
            InvalidInputError: the fold does not carry corners onto corners.
        """
        return self.motion.corner_errors(self.vertices)


@checked
def play_fold(
    robot: SimulatedRobot, cloth: Body, motion: FoldMotion, *, obstacles: Sequence[Body] | None = None,
    settle: float = SETTLE, watch: Callable[[str], None] | None = None,
) -> PlayedFold:  # fmt: skip
    """Let a robot fold a cloth in its own world, through its driver's interface.

    The hands open, go over the cloth and down to it, close on the points that are to be carried, carry them along their
    ways, open, and go up.

    Args:
        robot: The robot, in the world of the cloth; feet and base stay where they are.
        cloth: The cloth, dynamic.
        motion: What to do, from ``TaughtFold.on`` or an ``ImprovedFold``.
        obstacles: What the arms must not run into; None is all static bodies but the robot's own and planes.
        settle: How long the cloth is given to come to rest, from when it was let go [s].
        watch: Is told "above", "taken", "carried halfway", "laid", "folded" as that is so.

    Raises:
        ReachError: the arms cannot do it; nothing has moved then.
        BodyStateError: the cloth is static, in another world, or lies elsewhere than the motion has it.
        InvalidInputError: a motion that needs more hands.
        EstimationError: a hand closed on nothing.
    """
    world = robot.world
    if not isinstance(motion, FoldMotion):
        raise InvalidInputError(f"motion must be a FoldMotion, from TaughtFold.on, got {type(motion).__name__}")
    if cloth._world is not world:
        raise BodyStateError(f"{cloth.name!r} is not in the robot's world")
    motion.check_place(cloth)
    if obstacles is None:
        obstacles = [b for b in world.bodies if not b.is_dynamic and b._links is None]
    robot.update_robot_state()
    plan = plan_arms(robot.robot, motion, obstacles=obstacles)
    if plan.stretch > 1.0:
        log.warning("the fold is played %.2f times as slowly as it was to be: the joints are no faster", plan.stretch)
    tell = watch or (lambda _: None)

    def go(angles: np.ndarray, seconds: float) -> None:
        robot.angle_vector_sequence([dict(zip(plan.joints, row, strict=True)) for row in angles], seconds)
        robot.wait_interpolation()

    arms = [ARMS[hand] for hand in plan.hands]
    both = "arms" if len(arms) > 1 else arms[0]
    robot.stop_grasp(both)
    go(plan.approach, APPROACH)
    tell("above")
    go(plan.take, DOWN)
    robot.start_grasp(both)
    held = tuple(_held(robot, hand, cloth) for hand in plan.hands)
    if 0 in held:
        raise EstimationError(f"the {plan.hands[held.index(0)]} closed on nothing of {cloth.name!r}")
    tell("taken")
    strayed, released = _carry(robot, cloth, motion, plan, arms, tell)
    go(plan.leave, UP)
    rest = settle - (robot.now() - released)
    if rest > SOON:
        robot.sleep(rest)
    tell("folded")
    vertices = np.asarray(cloth.vertices)
    return PlayedFold(motion, plan, vertices, held, strayed, compare_fold(motion, vertices))


def _carry(
    robot: SimulatedRobot, cloth: Body, motion: FoldMotion, plan: ArmPlan, arms: list[str], tell: Callable[[str], None]
) -> tuple[np.ndarray, float]:
    """Carry the held points along their ways, and let each go when it is due; see ``play_fold``.

    Returns:
        How far each point was from its way at most (hands,) [m], and when the last was let go [s].
    """
    begin, strayed = robot.now(), np.zeros(motion.hand_count)
    rows = [dict(zip(plan.joints, row, strict=True)) for row in plan.carry[1:]]
    robot.angle_vector_sequence(rows, list(np.diff(plan.times)))
    ends = sorted((float(time), hand) for hand, time in enumerate(plan.releases))
    halfway: float | None = 0.5 * ends[0][0]
    while ends:
        due = begin + ends[0][0]
        if halfway is not None and robot.now() >= begin + halfway:
            tell("carried halfway")
            halfway = None
        if robot.now() >= due - SOON:
            if len(ends) == motion.hand_count:
                tell("laid")
            robot.stop_grasp(arms[ends.pop(0)[1]], wait=False)
            continue
        robot.sleep(min(1.0 / robot.world.frame_rate, due - robot.now()))
        at = (robot.now() - begin) / plan.stretch
        for _, hand in ends:
            way = [np.interp(at, motion.times, motion.ways[hand, :, axis]) for axis in range(3)]
            off = np.linalg.norm(np.asarray(cloth.vertices)[motion.held[hand]] - way)
            strayed[hand] = max(strayed[hand], off)
    released = robot.now()
    robot.wait_interpolation()
    return strayed, released


def _held(robot: SimulatedRobot, hand: str, cloth: Body) -> int:
    """Return how many points of the cloth a hand holds."""
    grips = [grip for grip in robot.hands[hand].grips if grip.body is cloth]
    return sum(int(np.shape(g.spec.vertices if g.spec.vertices is not None else g.spec.corners)[1]) for g in grips)
