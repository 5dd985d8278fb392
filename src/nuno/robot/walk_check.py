"""Checks of a walk by inverse dynamics: does the robot stand on its soles, and can its joints do it?"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import WalkError
from nuno.robot.ground import Soles, moment
from nuno.robot.pinocchio import pin
from nuno.robot.stride import two_feet
from nuno.robot.support import convex_outline, edges_of
from nuno.robot.timeline import BOTH, LEFT_STANDS, Timeline
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

TORQUE_EVERY, COLLISION_EVERY = 4, 20
"""Ticks between two looks: torques and places of links change little in 20 ms and in 100 ms."""
STEADY = 1e-5
"""[m, rad] What a foot that stands may move."""
FLOOR_FRICTION = 0.6
"""Of rubber soles on a usual floor, at least: what a walk may need of it."""


@dataclass(frozen=True)
class WalkMeasures:
    """Margins of a walk to what a robot cannot do.

    Attributes:
        margin: How far inside the outline of the soles that stand the zero moment point stays [m].
        margin_time: When it is nearest to the edge [s].
        zmp_rms: (x, y) by which it misses where it was to be [m], in the world's axes.
        drift: By how much a foot that stands moves at most [m].
        drift_turn: Likewise, turns [rad].
        angle_margin: How far the joints that move stay inside their limits [rad].
        velocity_share: Largest share of a joint's velocity limit; 1 is all of it.
        velocity_joint: Of which joint.
        torque_share: Largest share of a joint's effort limit.
        torque_joint: Of which joint.
        friction: Coefficient of friction that the floor must have.
        collision: First pair of links that run into each other, or None.
    """

    margin: float
    margin_time: float
    zmp_rms: tuple[float, float]
    drift: float
    drift_turn: float
    angle_margin: float
    velocity_share: float
    velocity_joint: str
    torque_share: float
    torque_joint: str
    friction: float
    collision: tuple[str, str] | None


def motion_of(model: Any, configurations: np.ndarray, tick: float) -> tuple[np.ndarray, np.ndarray]:
    """Return velocities and accelerations (n, nv) of configurations (n, nq), by central differences.

    At both ends the robot keeps its velocity.
    """
    n = len(configurations)
    ahead = np.empty((n - 1, model.nv))
    for k in range(n - 1):
        ahead[k] = pin.difference(model, configurations[k], configurations[k + 1])
    ahead /= tick
    velocities, accelerations = np.empty((n, model.nv)), np.zeros((n, model.nv))
    velocities[0], velocities[-1] = ahead[0], ahead[-1]
    velocities[1:-1] = 0.5 * (ahead[:-1] + ahead[1:])
    accelerations[1:-1] = np.diff(ahead, axis=0) / tick
    return velocities, accelerations


def zero_moments(
    model: Any, data: Any, motion: tuple[np.ndarray, np.ndarray, np.ndarray], floor: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the zero moment points (n, 2) [m] on the floor, and what the floor does: force and torque (n, 3) each.

    Args:
        model: Pinocchio's, with what the robot carries.
        data: Its data.
        motion: Configurations (n, nq), velocities and accelerations (n, nv).
        floor: Height [m].
    """
    wrenches = np.empty((len(motion[0]), 6))  # on the base, in its frame, if nothing else carried the robot
    for k, (q, v, a) in enumerate(zip(*motion, strict=True)):
        wrenches[k] = pin.rnea(model, data, q, v, a)[:6]
    x, y, z, w = motion[0][:, 3:7].T
    turns = quat.to_matrix(np.stack([w, x, y, z], axis=1))
    forces = np.einsum("nij,nj->ni", turns, wrenches[:, :3])
    torques = np.einsum("nij,nj->ni", turns, wrenches[:, 3:]) + np.cross(motion[0][:, :3], forces)
    upward = np.where(forces[:, 2] > 1e-9, forces[:, 2], np.nan)[:, None]
    moments = np.stack([floor * forces[:, 0] - torques[:, 1], torques[:, 0] + floor * forces[:, 1]], axis=1)
    return moments / upward, forces, torques


def measure_walk(
    robot: Humanoid, model: Any, motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    reaction: tuple[np.ndarray, np.ndarray, np.ndarray], wanted: Timeline, tick: float,
    look_for_collisions: bool = True,
) -> WalkMeasures:  # fmt: skip
    """Measure a walk.

    Args:
        robot: The robot.
        model: Its model, with what it carries.
        motion: Configurations (n, nq), velocities and accelerations (n, nv).
        reaction: Zero moment points (n, 2), forces and torques (n, 3) of the floor, as ``zero_moments`` has them.
        wanted: Where feet and zero moment points were to be.
        tick: Between two configurations [s].
        look_for_collisions: Whether to look for links that run into each other.
    """
    points, forces, _ = reaction
    corners, drift, turn = _soles(robot, model, motion[0], wanted)
    margins = _margins(points, corners, wanted.support)
    nearest = int(np.argmin(margins))
    torques = _joint_torques(robot, model, motion, reaction, corners, wanted.support)
    limits = np.maximum(robot.effort_limits, 1e-9)
    loads = np.abs(torques) / limits
    speeds = np.abs(motion[1][:, 6:]) / np.maximum(robot.velocity_limits, 1e-9)
    rows = np.array([model.joints[j].idx_q for j in range(2, model.njoints) if model.joints[j].nq == 1], dtype=int)
    rows = rows[(np.ptp(motion[0][:, rows], axis=0) > 0.0)]
    angles = motion[0][:, rows]
    inside = np.minimum(angles - model.lowerPositionLimit[rows], model.upperPositionLimit[rows] - angles)
    collision = None
    if look_for_collisions:
        for q in motion[0][::COLLISION_EVERY]:
            if pairs := robot.geometry.collisions(q, first_only=True):
                collision = pairs[0]
                break
    fastest, hardest = int(speeds.max(axis=0).argmax()), int(loads.max(axis=0).argmax())
    along = np.linalg.norm(forces[:, :2], axis=1) / np.maximum(forces[:, 2], 1e-9)
    rms = np.sqrt(np.mean((points - wanted.point) ** 2, axis=0))
    return WalkMeasures(
        float(margins[nearest]), (wanted.begin + nearest) * tick, (float(rms[0]), float(rms[1])), drift, turn,
        float(inside.min(initial=np.inf)), float(speeds.max()), robot.joint_names[fastest], float(loads.max()),
        robot.joint_names[hardest], float(along.max()), collision,
    )  # fmt: skip


def check_measures(measures: WalkMeasures, margin: float) -> None:
    """Raise where a robot cannot do a walk.

    Args:
        measures: Of the walk.
        margin: By which the zero moment point must stay inside the soles [m].

    Raises:
        WalkError: it cannot.
    """
    own, problem, time = measures, "", None
    if not own.margin >= margin:  # not a number where the feet would leave the floor
        problem = (f"the zero moment point comes within {1000.0 * own.margin:.1f} mm of the edge of the support, at "
                   f"{own.margin_time:.2f} s; at least {1000.0 * margin:.0f} mm are asked for")  # fmt: skip
        time = own.margin_time
    elif own.drift > STEADY or own.drift_turn > STEADY:
        problem = f"a foot that stands would move by {1000.0 * own.drift:.3f} mm and {own.drift_turn:.5f} rad"
    elif own.angle_margin < -1e-6:
        problem = f"a joint would go {-own.angle_margin:.3f} rad beyond its limit"
    elif own.velocity_share > 1.0:
        problem = f"{own.velocity_joint!r} would need {own.velocity_share:.2f} times its largest velocity"
    elif own.torque_share > 1.0:
        problem = f"{own.torque_joint!r} would need {own.torque_share:.2f} times its largest torque"
    elif own.friction > FLOOR_FRICTION:
        problem = f"the floor would need a coefficient of friction of {own.friction:.2f}, more than {FLOOR_FRICTION}"
    elif own.collision is not None:
        problem = f"{own.collision[0]} would run into {own.collision[1]}"
    if problem:
        raise WalkError(f"the robot cannot walk so: {problem}; shorter or slower steps help", time, measures)


def _soles(
    robot: Humanoid, model: Any, configurations: np.ndarray, wanted: Timeline
) -> tuple[np.ndarray, float, float]:
    """Return where corners of the soles are, (n, 2, 4, 3) [m], and how far feet that stand move [m] and turn [rad]."""
    data = model.createData()
    feet = two_feet(robot)
    frames = [robot.frame_index(foot) for foot in feet]
    flat = []
    for foot in feet:
        half = 0.5 * np.asarray(robot.description.frames[foot].size)
        flat.append(np.array([(sx * half[0], sy * half[1], 0.0) for sx, sy in ((1, 1), (1, -1), (-1, 1), (-1, -1))]))
    n = len(configurations)
    corners = np.empty((n, 2, 4, 3))
    drift = turn = 0.0
    stood: list[Any] = [None, None]  # where each foot was put down
    for k, q in enumerate(configurations):
        pin.forwardKinematics(model, data, q)
        for i, frame in enumerate(frames):
            place = pin.updateFramePlacement(model, data, frame)
            corners[k, i] = flat[i] @ place.rotation.T + place.translation
            if wanted.support[k] not in (BOTH, LEFT_STANDS + i):
                stood[i] = None
            elif stood[i] is None:
                stood[i] = place.copy()
            else:
                moved = place.translation - stood[i].translation
                drift = max(drift, float(np.sqrt(moved @ moved)))
                turn = max(turn, float(np.abs(place.rotation - stood[i].rotation).max()))
    return corners, drift, turn


def _margins(points: np.ndarray, corners: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Return how far (n,) [m] points are inside the soles that stand."""
    margins = np.empty(len(points))
    breaks = [0, *(np.flatnonzero(np.diff(support)) + 1), len(points)]
    for begin, end in itertools.pairwise(breaks):
        standing = [0, 1] if support[begin] == BOTH else [support[begin] - LEFT_STANDS]
        # feet that stand do not move, which is checked: the outline of one tick is that of all
        normals, offsets = edges_of(convex_outline(corners[begin, standing].reshape(-1, 3)[:, :2]))
        margins[begin:end] = (offsets - points[begin:end] @ normals.T).min(axis=1)
    return margins


def _joint_torques(
    robot: Humanoid, model: Any, motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    reaction: tuple[np.ndarray, np.ndarray, np.ndarray], corners: np.ndarray, support: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return torques (k, joints) [N m] of every few ticks."""
    data = model.createData()
    joints = [model.frames[robot.frame_index(foot)].parentJoint for foot in two_feet(robot)]
    ticks = range(0, len(motion[0]), TORQUE_EVERY)
    found = np.empty((len(ticks), model.nv - 6))
    phases = np.concatenate([[0], np.cumsum(np.diff(support) != 0)])
    soles, phase = None, -1
    for row, k in enumerate(ticks):
        standing = [0, 1] if support[k] == BOTH else [int(support[k]) - LEFT_STANDS]
        if soles is None or phases[k] != phase:  # feet that stand do not move
            soles, phase = Soles(corners[k, standing]), int(phases[k])
        shares, moments = soles.share(reaction[1][k], reaction[2][k])
        external = pin.StdVec_Force([pin.Force.Zero()] * model.njoints)
        q, v, a = (part[k] for part in motion)
        pin.forwardKinematics(model, data, q)
        for i, middle, share, own in zip(standing, soles.middles, shares, moments, strict=True):
            in_world = pin.Force(share, own + moment(middle, share))
            external[joints[i]] = data.oMi[joints[i]].actInv(in_world)
        found[row] = pin.rnea(model, data, q, v, a, external)[6:]
    return found
