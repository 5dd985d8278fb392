"""The rest shape of a cloth or soft body, placed where the body is now."""

from __future__ import annotations

import numpy as np

from nuno.scenes.scene_description import SceneBody
from nuno.shapes.shape import ClothMesh
from nuno.shapes.soft_shape import SoftShape

HELD = 1e6
"""Weight of a vertex that is held, by which it stays where it is."""


def placed_rest(body: SceneBody, held: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return a body's vertices at rest (n, 3) [m], moved and turned as a whole to be nearest to where they are now.

    Args:
        body: The body.
        held: (k,) int, vertices that are to be there above all.

    Returns:
        Those, and triangles (m, 3) or tetrahedra (m, 4) int.
    """
    rest, elements = rest_shape(body)
    assert body.vertices is not None
    if np.allclose(rest, body.vertices, rtol=0.0, atol=1e-12):
        return rest, elements
    weights = np.ones(len(rest))
    if held is not None:
        weights[held] = HELD
    return nearest_motion(rest, body.vertices, weights), elements


def rest_shape(body: SceneBody) -> tuple[np.ndarray, np.ndarray]:
    """Return a body's vertices at rest (n, 3) [m] and its triangles (m, 3) or tetrahedra (m, 4) int."""
    shape = body.shape
    if isinstance(shape, SoftShape):
        made = shape.tetrahedra()
        return made.vertices, made.tets
    vertices, faces = shape.mesh()
    if isinstance(shape, ClothMesh):
        rest = np.asarray(shape.rest)
        vertices = np.pad(rest, ((0, 0), (0, 3 - rest.shape[1])))
    return vertices, faces


def nearest_motion(points: np.ndarray, goal: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return points (n, 3) moved and turned as a whole to be nearest to others (Kabsch, Acta Cryst. A32, 1976)."""
    share = weights / weights.sum()
    middle, there = share @ points, share @ goal
    u, _, vt = np.linalg.svd(((points - middle) * share[:, None]).T @ (goal - there))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt)) or 1.0])
    return (points - middle) @ (u @ mirror @ vt) + there
