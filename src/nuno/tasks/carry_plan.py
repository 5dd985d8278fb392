"""Plans of carrying: the walks, where the arms' shapes are at every half frame of each, and the mat on them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.materials import Material
from nuno.tasks.arm_tracks import FRAME_RATE, ArmTracks
from nuno.tasks.carry_trials import CarryPlan, mat_size

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

NEAR = 0.15
"""[m] Links farther than this from where the mat begins are left out."""


def key_times(settle: float, seconds: float) -> np.ndarray:
    """Return the times (k,) [s] of a trial at which the arms' poses are known, two a frame, 0 where the walk begins."""
    before, after = (round(span * FRAME_RATE) for span in (settle, seconds))
    return np.arange(-2 * before, 2 * after + 1) * (0.5 / FRAME_RATE)


def plan_motions(
    robot: Humanoid, stances: Sequence[np.ndarray], goal: np.ndarray, times: np.ndarray,
    executor: Executor | None = None,
) -> list[np.ndarray]:  # fmt: skip
    """Return what a robot does from some stances: for each, configurations (k, nq) at times (k,) [s].

    Args:
        robot: The robot, which is left as it was.
        stances: (nq,) each, standing; the arms stay as they are in it.
        goal: (3,), where it walks: ahead and to the left [m], turned by [rad].
        times: (k,) [s] from the start of the walk; before it the robot stands.
        executor: Of processes among which the walks are shared out; None plans one after the other.

    Raises:
        WalkError: the robot cannot walk there.
    """
    if executor is None:
        return _walked(robot, stances, goal, times)
    # a robot is 14 MB to send, so a job is more than one walk where there are fewer cores
    shares = np.array_split(np.array(stances), min(len(stances), os.cpu_count() or 1))
    lean = robot.copy()
    vars(lean).pop("geometry", None)  # Pinocchio's tables of collisions cannot be sent
    jobs = [executor.submit(_walked, lean, share, goal, times) for share in shares]
    return [motion for job in jobs for motion in job.result()]


def motion_along(walk: Any, times: np.ndarray) -> np.ndarray:
    """Return configurations (k, nq) along a walk at times (k,) [s] from its start; before it the robot stands."""
    start = float(np.asarray(getattr(walk, "times", (0.0,)))[0])
    first = np.asarray(walk.configuration_at(start))
    return np.array([first if time <= 0.0 else walk.configuration_at(start + float(time)) for time in times])


def track_arms(
    robot: Humanoid, motions: Sequence[np.ndarray], distances: np.ndarray, *, arms: str, settle: float, seconds: float
) -> ArmTracks:
    """Return where the arms are along motions.

    Args:
        robot: The robot.
        motions: (k, nq) each, configurations at ``key_times``, one motion for each distance.
        distances: (walks,) [m] between the hands.
        arms: "hulls" or "boxes".
        settle: Seconds before the walk.
        seconds: Seconds of the walk and after it.
    """
    from nuno.tasks.arms import ArmMotion, arm_shapes

    shapes = arm_shapes(robot, arms)
    moved = [ArmMotion.of(robot, configurations) for configurations in motions]
    placed = [motion.poses(shapes) for motion in moved]
    return ArmTracks(
        robot.name, tuple(shape.part.shape for shape in shapes), np.array([shape.side for shape in shapes]), distances,
        np.array([places for places, _ in placed]), np.array([turns for _, turns in placed]),
        np.array([motion.base for motion in moved]), np.array([motion.hands for motion in moved]), np.array(motions),
        settle, seconds,
    )  # fmt: skip


def make_plan(tracks: ArmTracks, mat: Body, material: Material, *, hold: str, arm_friction: float) -> CarryPlan:
    """Return what trials have in common.

    Args:
        tracks: Of the arms, of which shapes far from the mat are left out.
        mat: The mat.
        material: Its material.
        hold: "support" or "grip".
        arm_friction: Coulomb's coefficient of the arms.
    """
    size = mat_size(mat.shape, False)
    turned = bool(size[0] > size[1])
    tracks = tracks.of_shapes(_near(tracks, 0.5 * mat_size(mat.shape, turned)))
    own = {item.name: getattr(tracks, item.name) for item in fields(ArmTracks)}
    return CarryPlan(**own, mat=mat.shape, turned=turned, material=material, friction=arm_friction, hold=hold)


def _near(tracks: ArmTracks, half: np.ndarray) -> list[int]:
    """Return which shapes come near the mat wherever it is laid."""
    reach = np.array([np.linalg.norm(part.mesh()[0], axis=1).max() for part in tracks.parts]) + NEAR
    close = np.zeros(len(tracks.parts), dtype=bool)
    for walk in range(len(tracks.distances)):
        hands = tracks.hands[walk, 0].mean(axis=0)
        places = tracks.positions[walk, :, 0]
        # the mat's middle is behind the hands, and by at most half its own size beside them
        low, high = hands - 2.0 * half * (1, 1, 0), hands + half * (1, 2, 0)
        apart = np.maximum(np.maximum(low - places, places - high), 0.0)
        close |= np.linalg.norm(apart, axis=1) < reach
    return [int(k) for k in np.flatnonzero(close)]


def _walked(
    robot: Humanoid, stances: Iterable[np.ndarray], goal: np.ndarray, times: np.ndarray
) -> list[np.ndarray]:  # fmt: skip
    from nuno.robot.walking import plan_walk

    kept = robot.configuration()
    x, y, yaw = (float(value) for value in goal)
    motions = []
    try:
        for stance in stances:
            robot.take_configuration(stance)
            motions.append(motion_along(plan_walk(robot, x, y, yaw), times))
    finally:
        robot.take_configuration(kept)
    return motions
