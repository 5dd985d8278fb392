"""The gap that stays between fingers that close on something, from its shape and material."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.materials import Cloth, Soft

LINES = 9
"""Lines along each side of the pads, from one finger to the other, along which a body's thickness is measured."""
ASIDE = (0.0113, 0.0071)
"""Shares of the pads' sides by which lines lie aside, so that they cross faces and not the edges between two."""
CRUSHED = 0.6
"""Share of a soft body's thickness by which fingers compress it at most."""


def closing_gap(
    faces: np.ndarray, material: Any, local: np.ndarray, low: np.ndarray, high: np.ndarray, axis: int, force: float
) -> float:  # fmt: skip
    """Return how far apart fingers stay that close on a body [m]; 0 where it is not between them.

    A rigid body keeps them apart by its thickness, a soft one by what the force leaves of it, and a cloth by the
    thickness of as many layers as lie there.

    Args:
        faces: (m, 3) int, the body's.
        material: The body's.
        local: (n, 3) [m], its vertices in the frame of the hand.
        low: (3,) [m], lower corner of what the open fingers are around.
        high: (3,) [m], upper corner.
        axis: Along which the fingers close.
        force: With which they press [N].
    """
    across = [k for k in range(3) if k != axis]
    middles = (np.arange(LINES) + 0.5) / LINES
    steps = [low[k] + (high[k] - low[k]) * (middles + off) for k, off in zip(across, ASIDE, strict=True)]
    lines = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
    where, line = _crossings(local, faces, lines, across, axis)
    inside = (where > low[axis]) & (where < high[axis])
    layers = np.bincount(line[inside], minlength=len(lines))
    if isinstance(material, Cloth):
        within = ((local >= low) & (local <= high)).all(axis=1).any()
        count = max(int(layers.max()), 2 if within and not layers.any() else 0)  # one that lies across them bunches up
        return count * float(np.asarray(material.thickness).flat[0])
    first, last = np.full(len(lines), np.inf), np.full(len(lines), -np.inf)
    np.minimum.at(first, line, where)
    np.maximum.at(last, line, where)
    thick = np.minimum(last, high[axis]) - np.maximum(first, low[axis])
    if not (thick > 0.0).any():
        return 0.0
    gap = float(thick.max())
    if isinstance(material, Soft):
        area = float(np.prod([high[k] - low[k] for k in across])) * float((thick > 0.5 * gap).mean())
        strain = force / (float(np.mean(material.youngs_modulus)) * max(area, 1e-9))
        gap *= 1.0 - min(strain, CRUSHED)
    return gap


def _crossings(
    x: np.ndarray, faces: np.ndarray, lines: np.ndarray, across: list[int], axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return where lines along an axis cross triangles (k,) [m], and which lines (k,)."""
    corners = x[faces]
    flat = corners[:, :, across]
    apart = ((flat.max(axis=1) < lines.min(axis=0)) | (flat.min(axis=1) > lines.max(axis=0))).any(axis=1)
    corners, flat = corners[~apart], flat[~apart]
    a, u, v = flat[:, 0], flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    real = np.abs(area) > 1e-12
    corners, a, u, v, area = corners[real], a[real], u[real], v[real], area[real]
    d = lines[:, None] - a
    s = (d[..., 0] * v[:, 1] - d[..., 1] * v[:, 0]) / area
    t = (u[:, 0] * d[..., 1] - u[:, 1] * d[..., 0]) / area
    line, face = np.nonzero((s >= 0.0) & (t >= 0.0) & (s + t <= 1.0))
    s, t = s[line, face], t[line, face]
    y = corners[face, :, axis]
    return y[:, 0] + s * (y[:, 1] - y[:, 0]) + t * (y[:, 2] - y[:, 0]), line
