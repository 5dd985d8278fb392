"""Triangle meshes of the primitive shapes, centred at the origin, faces counter-clockwise from outside.

Each function returns vertices (n, 3) float64 [m] and faces (m, 3) int32.
"""

from __future__ import annotations

import numpy as np

MeshArrays = tuple[np.ndarray, np.ndarray]

AROUND = 32  # segments of a full circle: silhouettes within 0.5 % of the radius
PLANE_HALF = 5.0  # half the side [m] of the square that stands for an endless plane in drawings


def box_mesh(size: tuple[float, float, float]) -> MeshArrays:
    """Return a box with edges ``size`` [m] along x, y, z: 8 vertices, 12 faces."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners * np.asarray(size), np.array(faces, dtype=np.int32)


def plane_mesh() -> MeshArrays:
    """Return a square in the xy plane, normal +z, that stands for an endless plane."""
    vertices, faces = sheet_mesh((2.0 * PLANE_HALF, 2.0 * PLANE_HALF), (1, 1))
    return vertices, faces


def sphere_mesh(radius: float, around: int = AROUND) -> MeshArrays:
    """Return a sphere of rings of latitude, poles on z, of ``around`` segments."""
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, around // 2 + 1)
    return _turned(radius * np.cos(latitude), radius * np.sin(latitude), around)


def cylinder_mesh(radius: float, height: float, around: int = AROUND) -> MeshArrays:
    """Return a closed cylinder along z, of ``around`` segments."""
    half = 0.5 * height
    return _turned(np.array([0.0, radius, radius, 0.0]), np.array([-half, -half, half, half]), around)


def capsule_mesh(radius: float, height: float, around: int = AROUND) -> MeshArrays:
    """Return a capsule along z: a cylinder of ``height`` [m] between the centres of two half spheres."""
    latitude = np.linspace(0.0, 0.5 * np.pi, around // 4 + 1)
    across, up = radius * np.cos(latitude), radius * np.sin(latitude) + 0.5 * height
    return _turned(np.concatenate([across[::-1], across]), np.concatenate([-up[::-1], up]), around)


def sheet_mesh(size: tuple[float, float], cells: tuple[int, int]) -> MeshArrays:
    """Return a flat grid in the xy plane, normal +z.

    Vertex (i, j) has the index j (nx + 1) + i, i along x. Cell (i, j) has the faces (a, b, d) and (a, d, c)
    at 2 (j nx + i), with a = (i, j), b = (i + 1, j), c = (i, j + 1), d = (i + 1, j + 1).
    """
    nx, ny = cells
    x = (np.arange(nx + 1) / nx - 0.5) * size[0]
    y = (np.arange(ny + 1) / ny - 0.5) * size[1]
    vertices = np.zeros((ny + 1, nx + 1, 3))
    vertices[..., 0], vertices[..., 1] = x[None, :], y[:, None]
    a = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)[None, :]).ravel()
    b, c, d = a + 1, a + nx + 1, a + nx + 2
    faces = np.stack([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)], axis=1).reshape(-1, 3)
    return vertices.reshape(-1, 3), faces.astype(np.int32)


def _turned(across: np.ndarray, along: np.ndarray, around: int) -> MeshArrays:
    """Turn a profile (radius, height), from the lower pole to the upper, about z; its ends have radius 0."""
    angle = np.arange(around) * (2.0 * np.pi / around)
    rings = [
        np.stack([r * np.cos(angle), r * np.sin(angle), np.full(around, h)], axis=1)
        for r, h in zip(across[1:-1], along[1:-1], strict=True)
    ]
    poles = np.array([[0.0, 0.0, along[0]], [0.0, 0.0, along[-1]]])
    here, there = np.arange(around), (np.arange(around) + 1) % around
    top = 2 + (len(rings) - 1) * around
    faces = [np.stack([np.zeros_like(here), 2 + there, 2 + here], axis=1)]
    for ring in range(len(rings) - 1):
        low, high = 2 + ring * around, 2 + (ring + 1) * around
        faces.append(np.stack([low + here, low + there, high + there], axis=1))
        faces.append(np.stack([low + here, high + there, high + here], axis=1))
    faces.append(np.stack([np.ones_like(here), top + here, top + there], axis=1))
    return np.concatenate([poles, *rings]), np.concatenate(faces).astype(np.int32)
