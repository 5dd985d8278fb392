"""Plans of carrying: the walks, and where the arms' shapes are at every half frame of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.body import Body
from nuno.materials import Material
from nuno.tasks.arms import ArmMotion, ArmShape, arm_shapes, half_sides
from nuno.tasks.carry_trials import FRAME_RATE, NEAR, CarryPlan, mat_size

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid


def key_times(settle: float, seconds: float) -> np.ndarray:
    """Return the times (k,) [s] of a trial at which the arms' poses are known, two a frame, 0 where the walk begins."""
    before, after = (round(span * FRAME_RATE) for span in (settle, seconds))
    return np.arange(-2 * before, 2 * after + 1) * (0.5 / FRAME_RATE)


def plan_motion(robot: Humanoid, stance: np.ndarray, goal: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return what a robot does from a stance: configurations (k, nq) at times (k,) [s].

    Args:
        robot: The robot, which is left as it was.
        stance: (nq,), standing; the arms stay as they are in it.
        goal: (3,), where it walks: ahead and to the left [m], turned by [rad].
        times: (k,) [s] from the start of the walk; before it the robot stands.

    Raises:
        WalkError: the robot cannot walk there.
    """
    from nuno.robot.walking import plan_walk

    kept = robot.configuration()
    try:
        robot.take_configuration(stance)
        x, y, yaw = (float(value) for value in goal)
        return motion_along(plan_walk(robot, x, y, yaw), times)
    finally:
        robot.take_configuration(kept)


def motion_along(walk: Any, times: np.ndarray) -> np.ndarray:
    """Return configurations (k, nq) along a walk at times (k,) [s] from its start; before it the robot stands."""
    start = float(np.asarray(getattr(walk, "times", (0.0,)))[0])
    first = np.asarray(walk.configuration_at(start))
    return np.array([first if time <= 0.0 else walk.configuration_at(start + float(time)) for time in times])


def make_plan(
    robot: Humanoid, mat: Body, material: Material, motions: Sequence[np.ndarray], distances: np.ndarray, *,
    hold: str, arms: str, arm_friction: float, settle: float, seconds: float,
) -> CarryPlan:  # fmt: skip
    """Return what trials have in common.

    Args:
        robot: The robot.
        mat: The mat.
        material: Its material.
        motions: (k, nq) each, configurations at ``key_times``, one motion for each distance.
        distances: (walks,) [m] between the hands.
        hold: "support" or "grip".
        arms: "boxes" or "hulls".
        arm_friction: Coulomb's coefficient of the arms.
        settle: Seconds before the walk.
        seconds: Seconds of the walk and after it.
    """
    moved = [ArmMotion.of(robot, configurations) for configurations in motions]
    boxes, shapes = arm_shapes(robot, "boxes"), arm_shapes(robot, arms)
    size = mat_size(mat.shape, False)
    turned = bool(size[0] > size[1])
    near = _near(boxes, moved, 0.5 * mat_size(mat.shape, turned))
    boxes, shapes = tuple(boxes[k] for k in near), tuple(shapes[k] for k in near)
    own, around = ([motion.poses(chosen) for motion in moved] for chosen in (shapes, boxes))
    return CarryPlan(
        mat.shape, turned, material, tuple(shape.part for shape in shapes), half_sides(boxes),
        np.array([shape.side for shape in shapes]), arm_friction, distances,
        np.array([places for places, _ in own]), np.array([turns for _, turns in own]),
        np.array([places for places, _ in around]), np.array([turns for _, turns in around]),
        np.array([motion.base for motion in moved]), np.array([motion.hands for motion in moved]),
        np.array(motions), settle, seconds, hold,
    )  # fmt: skip


def _near(boxes: Sequence[ArmShape], motions: Sequence[ArmMotion], half: np.ndarray) -> list[int]:
    """Return which shapes come near the mat wherever it is laid."""
    reach = np.array([np.linalg.norm(sides) for sides in half_sides(boxes)]) + NEAR
    close = np.zeros(len(boxes), dtype=bool)
    for motion in motions:
        hands = motion.hands[0].mean(axis=0)
        places = motion.poses(boxes)[0][:, 0]
        # the mat's middle is behind the hands, and by at most half its own size beside them
        low, high = hands - 2.0 * half * (1, 1, 0), hands + half * (1, 2, 0)
        apart = np.maximum(np.maximum(low - places, places - high), 0.0)
        close |= np.linalg.norm(apart, axis=1) < reach
    return [int(k) for k in np.flatnonzero(close)]
