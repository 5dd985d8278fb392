"""A cloth of any outline as a body: its triangles by the mesh that is asked for, and where candidates are on it."""

from __future__ import annotations

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import cloth_mesh
from nuno.camera.cloth_outline import ClothOutline
from nuno.mesh.triangulated import triangulate
from nuno.shapes.surface import SurfacePoints

EDGE = 0.02
"""[m] About how long a triangle's side is on a mesh of `CELLS`, and in proportion on others."""
CELLS = 20
MOST = 520
"""Vertices on a mesh of `CELLS`, about: of a larger cloth the triangles are larger, as its cells are of a rectangle."""


def edge_of(cloth: ClothOutline, cells: int) -> float:
    """Return about how long a triangle's side is [m] on a mesh of so many cells along a rectangle's longer side."""
    finest = np.sqrt(cloth.area / (np.sqrt(0.75) * MOST))
    return float(max(EDGE, finest) * CELLS / cells)


def outline_body(cloth: ClothOutline, cells: int, name: str) -> Body:
    """Return the cloth as it lay, in triangles.

    Args:
        cloth: The cloth before.
        cells: Of the discretisation.
        name: The body's.
    """
    points, faces, _ = triangulate(cloth.outline[:, :2], edge_of(cloth, cells))
    vertices = np.column_stack([points, np.full(len(points), float(cloth.centre[2]))])
    return cloth_mesh(vertices, faces, name=name)


def grips_on(cloth: ClothOutline, uv: np.ndarray, body: Body) -> tuple[SurfacePoints, np.ndarray]:
    """Return the points of a cloth's body at fractions (k, 2) of the sides, and where they are, (k, 3) [m]."""
    points = body.closest(cloth.world_positions(uv))
    return points, points.positions(body.vertices, body.faces)
