"""The places that vertices of a body-fitted lattice have on a mesh: its faces, its sharp edges and its corners."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from nuno.mesh.nearest import NearestOn

FREE, LOOSE, FACE, EDGE, CORNER = range(5)
"""Targets of a vertex: nothing; the mesh, but it moves half of the way only; the mesh, a sharp edge, a corner."""
CREASE = np.cos(np.radians(45.0))
"""Of the angle between the normals of two faces: where it is larger, their edge is kept."""
NEAR_EDGE, NEAR_CORNER = 0.7, 0.9
"""In cells: how far a vertex is moved onto a sharp edge or a corner."""


@dataclass(frozen=True, eq=False)
class SurfaceTargets:
    """The targets of n vertices.

    Attributes:
        surface: The mesh's triangles.
        edges: Its sharp edges; None where there are none.
        kind: (n,) int, `FREE`, `LOOSE`, `FACE`, `EDGE` or `CORNER`.
        corner: (n, 3) [m], the corner of those that have one.
    """

    surface: NearestOn
    edges: NearestOn | None
    kind: np.ndarray
    corner: np.ndarray

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return the vertices (n, 3) [m], each moved to the nearest place of what it is bound to."""
        placed = points.copy()
        loose, face, edge, corner = (self.kind == kind for kind in (LOOSE, FACE, EDGE, CORNER))
        on = loose | face
        placed[on] = self.surface.nearest(points[on])
        placed[loose] = 0.5 * (placed[loose] + points[loose])
        if self.edges is not None:
            placed[edge] = self.edges.nearest(points[edge])
        placed[corner] = self.corner[corner]
        return placed

    def of(self, used: np.ndarray) -> SurfaceTargets:
        """Return the targets of some of the vertices alone (k,) int."""
        return replace(self, kind=self.kind[used], corner=self.corner[used])

    def loosened(self, vertices: np.ndarray) -> SurfaceTargets:
        """Return the targets where some vertices (k,) int have more freedom, by one kind."""
        kind = self.kind.copy()
        kind[vertices] = np.maximum(kind[vertices] - 1, FREE)
        return replace(self, kind=kind)


def surface_targets(
    vertices: np.ndarray, faces: np.ndarray, surface: NearestOn, points: np.ndarray, bound: np.ndarray, cell: float
) -> SurfaceTargets:
    """Bind vertices to a mesh: the nearest ones to its corners and sharp edges, the others to its faces.

    Args:
        vertices: (m, 3) [m], the mesh's.
        faces: (f, 3) int, closed.
        surface: The mesh's triangles.
        points: (n, 3) [m].
        bound: (n,) bool, which of the points are bound.
        cell: Longest edge of a voxel [m].
    """
    kind, corner = np.where(bound, FACE, FREE), np.zeros_like(points)
    creases = _creases(vertices, faces)
    made = SurfaceTargets(surface, NearestOn(vertices[creases], 0.5 * cell) if len(creases) else None, kind, corner)
    names = np.flatnonzero(bound)
    if made.edges is None or not len(names):
        return made
    tree = cKDTree(surface.nearest(points[names]))
    away, which = tree.query(made.edges.centres)
    kind[names[which[away < NEAR_EDGE * cell]]] = EDGE
    tips = vertices[_corners(vertices, creases)]
    if len(tips):
        away, which = tree.query(tips)
        for tip in np.argsort(-away, kind="stable"):  # the nearest last, so that it has its vertex
            if away[tip] < NEAR_CORNER * cell:
                kind[names[which[tip]]], corner[names[which[tip]]] = CORNER, tips[tip]
    return made


def _creases(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (k, 2) int, the edges of a closed mesh at which it turns sharply."""
    normal = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    order = np.lexsort(edges.T)
    one, other = order[::2], order[1::2]
    return edges[one][(normal[one % len(faces)] * normal[other % len(faces)]).sum(axis=1) < CREASE]


def _corners(vertices: np.ndarray, creases: np.ndarray) -> np.ndarray:
    """Return (k,) int, the vertices where sharp edges end, meet or turn sharply."""
    count = np.bincount(creases.ravel(), minlength=len(vertices))
    direction = vertices[creases[:, 1]] - vertices[creases[:, 0]]
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
    away = np.zeros_like(vertices)  # of two edges of length 1 that leave a vertex: 0 where they go on straight
    np.add.at(away, creases[:, 0], direction)
    np.add.at(away, creases[:, 1], -direction)
    turned = (count == 2) & ((away**2).sum(axis=1) > 2.0 - 2.0 * CREASE)
    return np.flatnonzero(turned | ((count > 0) & (count != 2)))
