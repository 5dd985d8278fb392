"""Panels of a pattern in triangles, sewn along their seams into one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.errors import MeshError
from nuno.mesh.garment_patterns import SEAM, Pattern, Side
from nuno.mesh.polygon import along_line
from nuno.mesh.triangulated import triangulate

FRONT, BACK, BOTH = 0, 1, 2
_DIGITS = 9  # of a coordinate in metres by which points of two panels are the same


@dataclass(frozen=True, eq=False)
class Sewn:
    """A sewn garment, flat.

    Attributes:
        points: (n, 2) float [m], each vertex's place in its panel.
        faces: (m, 3) int; those of the back look down.
        layer: (n,) int, `FRONT`, `BACK`, or `BOTH` on a seam.
        face_layer: (m,) int, `FRONT` or `BACK`.
        mirror: (n,) int, the vertex at -x in the same layer, or None where the garment is not symmetric.
        swap: (n,) int, the vertex at the same place in the other layer, or None where the panels differ or are one.
    """

    points: np.ndarray
    faces: np.ndarray
    layer: np.ndarray
    face_layer: np.ndarray
    mirror: np.ndarray | None
    swap: np.ndarray | None


def sew(pattern: Pattern, edge: float) -> Sewn:
    """Divide a pattern's panels into triangles with sides of about ``edge`` [m], and sew them to each other.

    Raises:
        MeshError: sides that cross each other, or a panel too narrow for the edge.
    """
    meshes = [_panel(sides, edge, pattern.mirrored) for sides in pattern.panels]
    points, faces, mirror = meshes[0]
    layer = np.zeros(len(points), dtype=int)
    if len(meshes) == 1:
        return Sewn(points, faces, layer, np.zeros(len(faces), int), mirror, None)
    behind, back_faces, back_mirror = meshes[1]
    sewn_at = set(_keys(_seam_points(pattern, edge)))
    front = {key: k for k, key in enumerate(_keys(points))}
    number = np.empty(len(behind), dtype=int)
    extra: list[int] = []
    for k, key in enumerate(_keys(behind)):
        if key in sewn_at:
            number[k] = front[key]
            layer[front[key]] = BOTH
        else:
            number[k] = len(points) + len(extra)
            extra.append(k)
    layer = np.concatenate([layer, np.full(len(extra), BACK)])
    every = np.concatenate([points, behind[extra]])
    both = np.concatenate([faces, number[back_faces][:, ::-1]])
    if mirror is not None and back_mirror is not None:
        mirror = np.concatenate([mirror, number[back_mirror[extra]]])
    swap = None
    if len(points) == len(behind) and np.allclose(points, behind, atol=1e-12):
        swap = np.empty(len(every), dtype=int)
        swap[np.arange(len(points))] = number
        swap[number] = np.arange(len(points))
    face_layer = np.repeat([FRONT, BACK], [len(faces), len(back_faces)])
    return Sewn(every, both, layer, face_layer, mirror, swap)


def outline(sides: tuple[Side, ...], mirrored: bool) -> np.ndarray:
    """Return the outline (n, 2) [m] of a panel's sides, of both halves where they are those of one."""
    half = np.concatenate([line[:-1] for line, _ in sides] + ([sides[-1][0][-1:]] if mirrored else []))
    if not mirrored:
        return half
    inner = half[1:-1] if half[0, 0] == 0.0 else half[1:]
    return np.concatenate([half, inner[::-1] * (-1.0, 1.0)])


def _panel(sides: tuple[Side, ...], edge: float, mirrored: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return points (n, 2) [m], faces (m, 3) and where each point's mirror image is, (n,) or None."""
    lines = [along_line(line, edge) for line, _ in sides]
    if not mirrored:
        points, faces, _ = triangulate(np.concatenate([line[:-1] for line in lines]), edge, sampled=True)
        return points, faces, None
    lines.append(along_line(np.stack([lines[-1][-1], lines[0][0]]), edge))
    half, faces, _ = triangulate(np.concatenate([line[:-1] for line in lines]), edge, sampled=True)
    if half[:, 0].min() < -1e-9:
        raise MeshError("a side of the half pattern crosses its middle")
    own = np.abs(half[:, 0]) > 1e-9
    number = np.arange(len(half))
    number[own] = len(half) + np.arange(own.sum())
    points = np.concatenate([half, half[own] * (-1.0, 1.0)])
    mirror = np.concatenate([number, np.flatnonzero(own)])
    return points, np.concatenate([faces, number[faces][:, ::-1]]), mirror


def _seam_points(pattern: Pattern, edge: float) -> np.ndarray:
    """Return the points (k, 2) [m] of all seams, their ends among them, of both halves."""
    found = np.concatenate([along_line(line, edge) for line, kind in pattern.panels[0] if kind == SEAM])
    return np.concatenate([found, found * (-1.0, 1.0)]) if pattern.mirrored else found


def _keys(points: np.ndarray) -> list[tuple[float, float]]:
    return [(x + 0.0, y + 0.0) for x, y in np.round(points, _DIGITS).tolist()]
