"""Marks: what a viewer draws besides bodies: held points, contact forces, the frusta of cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nuno.camera.camera import Camera
from nuno.joints.held_points import held_points
from nuno.shapes.coordinates import Pose

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

FRUSTUM = np.array([0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 7, 8, 9, 10, 11, 12], dtype=np.uint32)
"""Edges of ``frustum``: from the pinhole to the corners, round the image, a stroke where up is, and the axes."""


@dataclass(frozen=True, eq=False)
class DrawnCamera:
    """A camera whose frustum is drawn.

    Attributes:
        camera: The camera, where it was when it was added.
        carrier: The body that carries it, or None.
        pose: Where it is: in the frame of its carrier, or in the world.
        depth: How far the frustum is drawn [m].
    """

    camera: Camera
    carrier: Body | None
    pose: Pose
    depth: float


def all_held_points(world: Simulation, index: int) -> np.ndarray:
    """Return where the grips of one world hold, (k, 3) float [m]."""
    found = [held_points(grip, index) for dynamics in world._attached() for grip in dynamics.grips]
    return np.concatenate([np.empty((0, 3)), *found])


def contact_arrows(world: Simulation, scale: float, indices: list[int]) -> list[np.ndarray]:
    """Return the contact forces on dynamic bodies, of some worlds: (2 k, 3) float [m] each, where and whereto.

    Args:
        world: The world.
        scale: Length [m/N].
        indices: Which worlds.
    """
    from nuno.world.contact_points import contact_points

    rows: list[list[np.ndarray]] = [[] for _ in indices]
    for body in list(world._bodies.values()):
        if not body.is_dynamic:
            continue
        found = contact_points(world, body)
        ends = np.stack([found.points, found.points + scale * found.forces], axis=1)
        for k, index in enumerate(indices):
            rows[k].append(ends[found.worlds == index].reshape(-1, 3))
    return [np.concatenate(row) if row else np.empty((0, 3)) for row in rows]


def grip_arrows(world: Simulation, scale: float, indices: list[int]) -> list[np.ndarray]:
    """Return the forces that grips bear, of some worlds: (2 k, 3) float [m] each, from the mean of the held points.

    Args:
        world: The world.
        scale: Length [m/N].
        indices: Which worlds.
    """
    rows: list[list[np.ndarray]] = [[] for _ in indices]
    for dynamics in world._attached():
        for grip in dynamics.grips:
            force = world._wrench(grip)[0]
            for row, index in zip(rows, indices, strict=True):
                held = held_points(grip, index)
                if len(held):
                    middle = held.mean(axis=0)
                    row.append(np.stack([middle, middle + scale * force[index]]))
    return [np.concatenate(row) if row else np.empty((0, 3)) for row in rows]


def frustum(camera: Camera, depth: float) -> np.ndarray:
    """Return the corners of a camera's frustum and axes in its own frame, (13, 3) float [m]; see ``FRUSTUM``."""
    w, h = camera.width - 0.5, camera.height - 0.5
    pixels = np.array([(-0.5, -0.5), (w, -0.5), (w, h), (-0.5, h)])
    rays = (pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    corners = depth * np.column_stack([rays, np.ones(4)])
    middle = corners[:2].mean(axis=0)
    up = middle + 0.3 * (middle - corners[2:].mean(axis=0))
    axes = np.insert(0.4 * depth * np.eye(3), [0, 1, 2], 0.0, axis=0)  # from the pinhole along x, y and z
    return np.vstack([np.zeros(3), corners, middle, up, axes])


def frustum_colors() -> np.ndarray:
    """Return the colours of ``frustum``, (13, 3) uint8: x is red, y green, z blue, as everywhere in robotics."""
    axes = np.repeat([(214, 39, 40), (44, 160, 44), (31, 90, 230)], 2, axis=0)
    return np.vstack([np.tile((31, 79, 160), (7, 1)), axes]).astype(np.uint8)


def camera_pose(camera: Camera) -> Pose:
    """Return where a camera is: (3,) [m] and (4,)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(camera.camera_to_world[:3, :3]).as_quat()
    return camera.camera_to_world[:3, 3], np.array((w, x, y, z))
