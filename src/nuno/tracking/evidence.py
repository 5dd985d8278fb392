"""The evidence of an image on a cloth's vertices: the expectation step of Schulman, Lee, Ho and Abbeel.

"Tracking deformable objects with point clouds", ICRA 2013: every observed point belongs to the visible vertices near it
by a Gaussian, or to none (an outlier). The sum of a vertex's residuals, weighted by that, is what pulls it.

A point within a cloth tells of its vertices along the normal only, as cloth slides along itself unseen; a point at the
outline also across that. So each vertex has an information matrix beside its residual, and the displacements are the
field that fits both with the least change from vertex to vertex (`nuno.tracking.displacements`).

The cloth's own image goes through the same sums, and what comes of it is taken off. A cloth that looks as the image
does is pulled by exactly nothing, also at its rim and where something hides a part of it; without that, points on one
side only would draw every rim inwards by a quarter of a cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from nuno.tracking.cloth_image import ClothImage
from nuno.tracking.observation import Observation
from nuno.tracking.pixel_grid import PixelGrid

NEIGHBOURS = 6
"""Visible vertices that a point may belong to: the corners of its cell, and some."""
WIDTH = 0.6
"""Standard deviation of a point from the vertex it belongs to, in edge lengths: at half a cell two have even shares."""
MIN_SUPPORT = 2.0
"""Points below which a vertex is pulled by less than their mean residual says."""
IN_FRONT = 0.03
"""[m] What is seen so far before where the cloth should be hides it; less far it is noise of the depth."""
DEPTH_NOISE = 0.01
"""[m] Of the likelihood: camera, thickness of the cloth and its small wrinkles together."""
WORST = 9.0
"""Of a pixel's squared deviation, in variances: three standard deviations, or cloth where there is none."""
EDGE_ON = 0.4
"""Sine between the way inwards of a rim and a ray, below which the rim is not looked at: a cell is too narrow there."""
INDEPENDENT = 20.0
"""Pixels of an image that count as independent of each other: its errors are those of whole regions."""


@dataclass(eq=False)
class Evidence:
    """The evidence of images on a cloth's vertices, summed up over cameras.

    Attributes:
        residuals: (n, 3) [m], each vertex's information times its expected residual.
        information: (n, 3, 3), from 0 to 1 for each camera and direction.
        visible: (n,) bool.
        observed: How many pixels show the cloth.
        expected: How many should.
        common: How many do both.
        compared: How many tell anything.
        cost: Sum of their squared deviations, in variances.
    """

    residuals: np.ndarray
    information: np.ndarray
    visible: np.ndarray
    observed: int = 0
    expected: int = 0
    common: int = 0
    compared: int = 0
    cost: float = 0.0

    @classmethod
    def nothing(cls, count: int) -> Evidence:
        """Return that of no image, for so many vertices."""
        return cls(np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros(count, dtype=bool))

    @property
    def agreement(self) -> float:
        """Intersection over union of the pixels that show the cloth and those that should."""
        return self.common / max(self.observed + self.expected - self.common, 1)

    @property
    def log_likelihood(self) -> float:
        """Of the images, given this cloth."""
        return -0.5 * INDEPENDENT * self.cost / max(self.compared, 1)


def weigh(
    seen: Observation, image: ClothImage, vertices: np.ndarray, normals: np.ndarray, inwards: np.ndarray,
    faces: np.ndarray, spacing: float, reach: float, evidence: Evidence,
) -> None:  # fmt: skip
    """Add what one camera says to the evidence.

    Args:
        seen: What it shows.
        image: What it should show, by the cloth as it is.
        vertices: (n, 3) [m], of that cloth.
        normals: (n, 3), of its surface at the vertices.
        inwards: (n, 3), from `displacements.Rim`.
        faces: (m, 3) int.
        spacing: Mean length of the cloth's edges [m].
        reach: Distance [m] at which a point is as likely an outlier as one of the nearest vertex's.
        evidence: Changed in place.
    """
    grid, depth = seen.grid, image.depth
    hidden = seen.hidden
    metres = None
    if seen.depth is not None:
        known = np.isfinite(seen.depth)
        with np.errstate(invalid="ignore"):
            hidden = hidden | (~seen.cloth & (seen.depth < depth - IN_FRONT))
        if (seen.cloth & known).any():  # a cloth of which no depth is known at all is seen by its mask
            metres = seen.depth
            hidden = hidden | (seen.cloth & ~known)
    model, cloth = image.seen & ~hidden, seen.cloth & ~hidden
    visible = np.zeros(len(vertices), dtype=bool)
    visible[faces[image.faces[model]].ravel()] = True
    either, common = model | cloth, model & cloth
    evidence.visible |= visible
    evidence.observed += int(cloth.sum())
    evidence.expected += int(model.sum())
    evidence.common += int(common.sum())
    evidence.compared += int(either.sum())
    if not model.any() or not cloth.any():
        evidence.cost += WORST * int(either.sum())
        return
    lifted = _lift(depth, model, cloth) if metres is None else metres
    off = np.minimum(((lifted[common] - depth[common]) / DEPTH_NOISE) ** 2, WORST)
    evidence.cost += float(off.sum()) + WORST * int((either & ~common).sum())

    own = np.flatnonzero(visible)
    near = _Near(vertices, own, WIDTH * spacing, reach)
    observed, expected = grid.points(cloth, lifted), grid.points(model, depth)
    pull, support = near.sums(observed)
    own_pull, own_support = near.sums(expected)
    total = np.maximum(support, own_support)
    pull -= own_pull
    bare = model & ~cloth
    if bare.any():  # the cloth is not there: those who should be seen there go to the nearest that is
        points = grid.points(bare, depth)
        distance, index = cKDTree(observed).query(points)
        within = distance < reach
        pull += near.shares(points[within], observed[index[within]] - points[within])
    mean = pull / np.maximum(total, MIN_SUPPORT)[:, None]
    rim, whole = _rims(image, grid, vertices, inwards, near, spacing, metres is None)
    # pixels beyond a rim, or missing before it, are as many as it is off: it has those of half a cell within
    share = np.maximum((support - own_support) / np.maximum(whole, MIN_SUPPORT), -1.0)
    mean -= 0.5 * spacing * share[:, None] * rim
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean *= np.minimum(1.0, reach / np.maximum(length, 1e-12))

    weight = np.minimum(total / MIN_SUPPORT, 1.0)
    across = rim / np.maximum(np.linalg.norm(rim, axis=1, keepdims=True), 1e-9)
    measured = across[:, :, None] * rim[:, None, :]
    if metres is not None:
        measured += normals[:, :, None] * normals[:, None, :]
    information = weight[:, None, None] * measured
    evidence.information += information
    evidence.residuals += np.einsum("nij,nj->ni", information, mean)


def _rims(
    image: ClothImage, grid: PixelGrid, vertices: np.ndarray, inwards: np.ndarray, near: _Near, spacing: float,
    outer: bool,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return which way is inwards of each vertex at a rim that is seen, (n, 3), 0 elsewhere, and its points (n,).

    Args:
        image: The cloth as it would be seen.
        grid: The pixels.
        vertices: (n, 3) [m].
        inwards: (n, 3), from `displacements.Rim`.
        near: Those that are seen.
        spacing: [m].
        outer: Whether only a rim against what is no cloth counts, not that of a layer before another.
    """
    drawn = image.faces >= 0
    pull, support = near.sums(grid.points(drawn, image.depth))
    # points on one side only, of half a cell, are a quarter of a cell away in the mean; half of that is taken for noise
    offset = np.einsum("ni,ni->n", pull, inwards) / np.maximum(support, MIN_SUPPORT)
    strength = np.clip(8.0 * offset / spacing - 1.0, 0.0, 1.0)
    if outer:
        inside = distance_transform_edt(np.pad(drawn, 1))[1:-1, 1:-1]
        pixels = grid.camera.project(vertices)
        pixels = np.where(np.isfinite(pixels), np.round(pixels), -1.0).astype(int)
        inner = (pixels >= 0).all(axis=1) & (pixels < (grid.camera.width, grid.camera.height)).all(axis=1)
        metres = np.zeros(len(vertices))
        at = pixels[inner]
        metres[inner] = inside[at[:, 1], at[:, 0]] * grid.camera.depth_of(vertices[inner]) / grid.camera.fx
        strength = strength * (metres < 0.5 * spacing + grid.camera.depth_of(vertices) / grid.camera.fx)
    rays = vertices - grid.origin
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
    seen = inwards - np.einsum("ni,ni->n", inwards, rays)[:, None] * rays  # along a ray nothing is seen to move
    return seen * (strength * (np.linalg.norm(seen, axis=1) > EDGE_ON))[:, None], support


def _lift(depth: np.ndarray, model: np.ndarray, cloth: np.ndarray) -> np.ndarray:
    """Return depths (h, w) [m] for a mask: the cloth's own, and beside it those of its nearest pixel."""
    if not (cloth & ~model).any():
        return depth
    rows, columns = distance_transform_edt(~model, return_distances=False, return_indices=True)
    return depth[rows, columns]


class _Near:
    """Shares of points in the visible vertices near them."""

    def __init__(self, vertices: np.ndarray, own: np.ndarray, spread: float, reach: float) -> None:
        self._vertices, self._own, self._width = vertices, own, spread
        self._outlier = -0.5 * (reach / spread) ** 2
        self._tree = cKDTree(vertices[own])
        self._count = list(range(1, min(NEIGHBOURS, len(own)) + 1))

    def _weights(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance, index = self._tree.query(points, k=self._count)
        log_weight = -0.5 * (distance / self._width) ** 2
        top = np.maximum(log_weight.max(axis=1, keepdims=True), self._outlier)
        weight = np.exp(log_weight - top)
        return self._own[index], weight / (weight.sum(axis=1, keepdims=True) + np.exp(self._outlier - top))

    def sums(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of residuals (n, 3) [m] of all vertices, and by how many points (n,)."""
        index, weight = self._weights(points)
        total = self._add(index, weight[..., None] * (points[:, None] - self._vertices[index]))
        return total, np.bincount(index.ravel(), weight.ravel(), minlength=len(self._vertices))

    def shares(self, points: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return moves (k, 3) [m] of points, shared by the vertices near these: sums (n, 3) [m]."""
        index, weight = self._weights(points)
        return self._add(index, weight[..., None] * moves[:, None])

    def _add(self, index: np.ndarray, parts: np.ndarray) -> np.ndarray:
        flat, rows = index.ravel(), parts.reshape(-1, 3)
        return np.stack([np.bincount(flat, rows[:, k], minlength=len(self._vertices)) for k in range(3)], axis=1)
