"""Driven motion: where kinematic bodies are, and where grips take what they hold, at instants of a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nuno.engines.world_view import schedule_of
from nuno.joints.grip import Grip, GripSpec
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld


def kinematic_poses(world: EngineWorld, body: Body, start: float, end: float, times: np.ndarray) -> Pose:
    """Return where a static body is at ``times`` (k,) [s] of a step: (worlds, k, 3) [m] and (worlds, k, 4)."""
    shape = (world.world_count, len(times))
    schedule = schedule_of(world)
    if schedule is None or body.key not in schedule.poses:
        place, turn = (part[..., None, :] for part in body.pose())
        return np.broadcast_to(place, (*shape, 3)), np.broadcast_to(turn, (*shape, 4))
    return _between(*schedule.in_frame(body.key, 0), (times - start) / (end - start), shape)


def kinematic_velocity(world: EngineWorld, body: Body, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity [m/s] of a static body's point in the last step, and its spin [rad/s], (worlds, 3) each."""
    schedule, still = schedule_of(world), np.zeros_like(point)
    if schedule is None or body.key not in schedule.poses or schedule.times[-1] < world.time - 1e-9:
        return still, still
    start, end = schedule.in_frame(body.key, 0)
    duration = float(schedule.times[-1] - schedule.times[0])
    turn = np.broadcast_to(quat.multiply(end[1], quat.inverse(start[1])), (len(point), 4))
    turn = np.where(turn[:, :1] < 0.0, -turn, turn)
    sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    axis = np.divide(turn[:, 1:], sine, out=np.zeros_like(still), where=sine > 0.0)
    spin = axis * 2.0 * np.arctan2(sine, turn[:, :1]) / duration
    return (end[0] - start[0]) / duration + np.cross(spin, point - end[0]), spin


def driven_points(grip: Grip, start: float, frame: float, times: np.ndarray) -> np.ndarray:
    """Return where a grip of points leads them at ``times`` (k,) [s]: (worlds, points, k, 3) [m].

    It must be asked once a step, as a leading body's last place is where the next step begins.
    """
    spec = grip.spec_for(start, frame)
    assert isinstance(spec, GripSpec)
    return spec.at(times)


def driven_hold(grip: Grip, start: float, end: float, times: np.ndarray, worlds: int) -> Pose:
    """Return where a grip leads a rigid body's frame at ``times`` (k,) [s]: (worlds, k, 3) [m] and (worlds, k, 4)."""
    if grip.target is None or grip.offsets is None:
        found = [grip.spec.at(float(time)) for time in times]
        return np.stack([place for place, _ in found], axis=1), np.stack([turn for _, turn in found], axis=1)
    before, goal = grip.lead(start, worlds)
    return _between(before, goal, (times - start) / (end - start), (worlds, len(times)))


def _between(first: Pose, last: Pose, share: np.ndarray, shape: tuple[int, int]) -> Pose:
    """Return poses (worlds, k, 3) and (worlds, k, 4) at shares (k,) of the way from one to the next."""
    a, b = (np.broadcast_to(pose[0][..., None, :], (*shape, 3)) for pose in (first, last))
    c, d = (np.broadcast_to(pose[1][..., None, :], (*shape, 4)) for pose in (first, last))
    return a + share[:, None] * (b - a), quat.slerp(c, d, share)
