"""Frames of a robot's hands, feet, eyes and sensors, guessed from its limbs, its shapes and the names of its links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.limb_tree import Limb, tokens
from nuno.robot.pinocchio import pin
from nuno.robot.placement import frame_called, quaternion_of
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

TIPS = ({"tcp"}, {"grasp", "grasping"}, {"ee", "eef", "effector"}, {"tool"}, {"palm"}, {"hand"}, {"gripper"})
"""Words in names of links that an arm ends in, the surest first; up to the fourth the origin is the hand's own."""
AT_ORIGIN = 4
NO_TIP = {"ft", "finger", "fingers", "fingertip", "thumb", "camera", "optical", "imu", "motor", "sensor"}
OPTICAL = np.array([0.5, -0.5, 0.5, -0.5])
"""From a camera's link, x forward and z up, to its pixels' axes."""
PALM = np.array([0.04, 0.04, 0.05])
"""[m] Half the volume that a hand closes on of which nothing is known."""
FINGER = np.array([0.02, 0.0, 0.03])
"""[m] Likewise of one with fingers, which close along y."""
SOLE = 0.01
"""[m] Points of a foot that are no higher above its lowest one touch a floor."""
TOE = 0.02
"""[m] The least size of a sole: a ball foot touches at a point."""


@dataclass(frozen=True, eq=False)
class Guess:
    """A frame on a link, with what else is guessed of it.

    Attributes:
        link: The link's name.
        position: (3,) float [m], in the link's frame.
        quaternion: (4,) float, likewise.
        size: (2,) float [m] of a sole.
        low: (3,) float [m] of a hand's volume, in the guessed frame.
        high: (3,) float [m].
        closing: Of a hand with fingers: the joint, where it is open and closed, and the width.
    """

    link: str
    position: np.ndarray
    quaternion: np.ndarray
    size: np.ndarray | None = None
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    closing: tuple[str, float, float, float] | None = None


def shape_points(robot: Humanoid) -> dict[int, np.ndarray]:
    """Return corners of a robot's shapes where it is, (k, 3) float [m] in the world, by joint."""
    shapes = robot.geometry.shapes("collision") or robot.geometry.shapes("visual")
    placed = robot.update().oMi
    found: dict[int, list[np.ndarray]] = {}
    for own in shapes:
        local = quat.rotate(own.quaternion, own.shape.mesh()[0]) + own.position
        joint = placed[own.joint]
        found.setdefault(own.joint, []).append(local @ joint.rotation.T + joint.translation)
    return {joint: np.concatenate(parts) for joint, parts in found.items()}


def links_of(model: Any, joint: int) -> list[str]:
    """Return the names of the links that a joint carries, the first its own."""
    return [own.name for own in model.frames if own.parentJoint == joint and own.type == pin.FrameType.BODY]


def guess_hand(robot: Humanoid, limb: Limb, points: dict[int, np.ndarray], ends: tuple[str, ...]) -> Guess:
    """Return a hand's frame: between its fingertips or in its palm, z out of it, y along the way of its fingers."""
    model, data = robot.model, robot.update()
    link, is_tip = _tip(model, limb, ends)
    frame = data.oMf[frame_called(model, link)]
    cloud = [points[j] for j in (limb.end, *limb.beyond) if j in points]
    local = (np.concatenate(cloud) - frame.translation) @ frame.rotation if cloud else np.zeros((1, 3))
    wrist = frame.actInv(data.oMi[limb.end]).translation
    out = -wrist if is_tip and np.linalg.norm(wrist) > 1e-3 else local.mean(axis=0) - wrist
    if np.linalg.norm(out) < 1e-3 and len(limb.chain) > 1:
        out = wrist - frame.actInv(data.oMi[limb.chain[-2]]).translation
    z = _nearest_axis(out)
    fingers = [j for j in limb.beyond if model.parents[j] == limb.end]
    across = _closing_axis(robot, frame, fingers, points, z)
    up = _up(frame.rotation, z)
    x = (
        _nearest_axis(up)
        if across is None
        else np.cross(across, z) * (1.0 if up @ np.cross(across, z) >= 0.0 else -1.0)
    )
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    position = np.zeros(3)
    if not is_tip:
        far = float((local @ z).max(initial=0.0))
        position = z * (max(far - FINGER[2], 0.0) if fingers else 0.5 * far)
    closing = _closing(robot, frame, fingers, points, turn[:, 1]) if across is not None and len(fingers) <= 2 else None
    half = PALM if closing is None else FINGER + np.array([0.0, 0.5 * closing[3], 0.0])
    return Guess(link, position, quaternion_of(turn), low=-half, high=half, closing=closing)


def guess_foot(robot: Humanoid, limb: Limb, points: dict[int, np.ndarray]) -> Guess:
    """Return a sole's frame: in the middle of what touches a floor, x forward and z up as the robot stands."""
    model, data = robot.model, robot.update()
    names = links_of(model, limb.end)
    link = next((name for name in names if "sole" in tokens([name])), names[0])
    frame = data.oMf[frame_called(model, link)]
    cloud = [points[j] for j in (limb.end, *limb.beyond) if j in points]
    every = np.concatenate(cloud) if cloud else frame.translation[None]
    floor = every[every[:, 2] <= every[:, 2].min() + SOLE]
    low, high = floor.min(axis=0), floor.max(axis=0)
    middle = np.array([*(0.5 * (low + high))[:2], low[2]])
    position = frame.rotation.T @ (middle - frame.translation)
    return Guess(link, position, quaternion_of(frame.rotation.T), size=np.maximum((high - low)[:2], TOE))


def guess_camera(robot: Humanoid, heads: list[Limb]) -> Guess | None:
    """Return the frame of the head's camera in its pixels' axes, or of another camera where the head has none."""
    model = robot.model
    carried = {j for limb in heads for j in (*limb.chain[-len(limb.own) :], *limb.beyond)}
    found = []
    for own in model.frames:
        words = tokens([own.name]) if own.type == pin.FrameType.BODY else set()
        if not words & {"camera", "optical", "rgbd", "realsense"} or words & {"depth", "ir", "infra"}:
            continue
        is_optical = "optical" in words
        rank = (own.parentJoint not in carried, not is_optical, not words & {"rgb", "color"}, len(own.name))
        found.append((rank, own.name, quat.IDENTITY if is_optical else OPTICAL))
    if not found:
        return None
    _, link, turn = min(found, key=lambda own: own[0])
    return Guess(link, np.zeros(3), np.array(turn))


def guess_sensor(robot: Humanoid, limb: Limb | None, words: set[str]) -> str | None:
    """Return a link with one of some words in its name, that a limb's end carries, or the shortest name of all."""
    model = robot.model
    joints = range(1, model.njoints) if limb is None else (limb.end,)
    found = [name for j in joints for name in links_of(model, j) if tokens([name]) & words]
    return min(found, key=len, default=None)


def _tip(model: Any, limb: Limb, ends: tuple[str, ...]) -> tuple[str, bool]:
    names = links_of(model, limb.end)
    for name in ends:
        if name in names:
            return name, True
    for rank, words in enumerate(TIPS):
        found = [name for name in names if tokens([name]) & words and not tokens([name]) & NO_TIP]
        if found:
            return found[0], rank < AT_ORIGIN
    return names[0], False


def _nearest_axis(direction: np.ndarray) -> np.ndarray:
    k = int(np.abs(direction).argmax())
    return np.eye(3)[k] * (1.0 if direction[k] >= 0.0 else -1.0)


def _up(rotation: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the direction across z, in a link's frame, that is up once the hand is turned the short way forward."""
    out = rotation @ z
    if out[0] < -0.999:
        turned = np.diag([-1.0, -1.0, 1.0])  # about the vertical
    else:
        v = np.cross(out, (1.0, 0.0, 0.0))
        cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        turned = np.eye(3) + cross + cross @ cross / (1.0 + out[0])
    up = rotation.T @ turned.T @ (0.0, 0.0, 1.0)
    return np.where(np.abs(z) > 0.5, 0.0, up)


def _closing_axis(
    robot: Humanoid, frame: Any, fingers: list[int], points: dict[int, np.ndarray], z: np.ndarray
) -> np.ndarray | None:
    """Return the axis of a link along which its fingers close; None of a hand with none or many."""
    if not 1 <= len(fingers) <= 2:
        return None
    j = fingers[0]
    moved = frame.rotation.T @ _motion(robot, j, points.get(j))
    across = np.where(np.abs(z) > 0.5, 0.0, moved)
    return _nearest_axis(across) if np.linalg.norm(across) > 1e-6 else None


def _motion(robot: Humanoid, j: int, cloud: np.ndarray | None) -> np.ndarray:
    """Return which way a finger's middle goes in the world as its joint does."""
    placed = robot.update().oMi[j]
    axis = placed.rotation @ _axis(robot, j)
    if robot.is_slide[j - 2]:
        return axis
    middle = placed.translation if cloud is None else cloud.mean(axis=0)
    return np.cross(axis, middle - placed.translation)


def _axis(robot: Humanoid, j: int) -> np.ndarray:
    jacobian = pin.computeJointJacobian(robot.model, robot.scratch, robot.configuration(), j)
    column = jacobian[:, robot.model.joints[j].idx_v]
    return np.array(column[:3] if robot.is_slide[j - 2] else column[3:])


def _closing(
    robot: Humanoid, frame: Any, fingers: list[int], points: dict[int, np.ndarray], across: np.ndarray
) -> tuple[str, float, float, float] | None:
    """Return the joint of a finger, where it is open and closed, and how far apart fingers are then."""
    j = fingers[0]
    name = robot.joint_names[j - 2]
    low, high = (float(limit[j - 2]) for limit in robot.joint_limits)
    if j not in points or not np.isfinite([low, high]).all() or high - low < 1e-6:
        return None
    placed = robot.update().oMi[j].copy()
    own = (points[j] - placed.translation) @ placed.rotation
    seen = []
    moved = robot.copy()
    for angle in (low, high):
        moved.angle_vector({name: angle})
        there = moved.update().oMi[j]
        seen.append(float(((own @ there.rotation.T + there.translation - frame.translation) @ frame.rotation
                           @ across).mean()))  # fmt: skip
    opened, closed = (low, high) if abs(seen[0]) > abs(seen[1]) else (high, low)
    return name, opened, closed, 2.0 * abs(seen[0] - seen[1])
