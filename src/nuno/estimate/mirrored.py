"""Futures of other candidates for nothing: a rectangle is the same after half a turn, and after two reflections.

A cloth picked at one point and its mirror image are both what could happen: the image is the same rectangle, picked at
the mirrored point by a hand that went the mirrored way. So every future of a candidate, reflected in a vertical plane
through the hand along one of the cloth's sides, along the other, or in both, which is half a turn, is one of the
candidate that lies there. It is exactly such a one where the hand ends above the cloth's middle line. Elsewhere the
hand would have gone another way, by twice its distance from that line. That matters to the part of the cloth that still
lies on the table. It matters little to a cloth that hangs free, of which only the folds, a matter of chance, and the
turn depend on the way. So these futures count where hardly any of the cloth lies, or where both ways are much alike.

Then the points that hang alike are tried with the same guess, the one that fits best included, without a simulation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.futures import Futures

REFLECTIONS = ((True, False), (False, True), (True, True))
"""Whether u, and v, are reflected."""
NEAR = 0.02
"""[m] A vertex that is no higher above the table lies on it."""
LYING = 0.05
"""Share of the cloth that may lie on the table where it hangs free."""
ALIKE = 0.1
"""[m] Ways of the hand that differ by less are alike."""
LYING_ALIKE = 0.2
"""Share of the cloth that may lie there where the ways are alike."""
WEIGHT = 0.5
"""Of such a future beside one that was imagined of the candidate itself (docs/reports/accuracy.md)."""


@dataclass
class Mirrored(Futures):
    """Futures that were reflected.

    Attributes:
        chosen: (k,) int, the numbers of the candidates that they are of; one may be there several times.
        weights: (hypotheses, k) float, how much each counts.
        kinds: (k,) int, numbers of their `REFLECTIONS`.
        moved: (hypotheses * k, n) of vec3, the cloths' vertices [m].
    """

    chosen: np.ndarray
    weights: np.ndarray
    kinds: np.ndarray
    moved: wp.array

    @property
    def finite(self) -> np.ndarray:
        """(hypotheses, k) bool: which count; others are not numbers."""
        return self.weights > 0.0

    @property
    def positions(self) -> wp.array:
        """(hypotheses * k, n) of vec3, the cloths' vertices on the device [m]."""
        return self.moved


def mirrored(
    futures: Futures, chosen: np.ndarray, uv: np.ndarray, rectangle: ClothRectangle, table: Table, hand: np.ndarray,
    hand_std: float,
) -> Mirrored | None:  # fmt: skip
    """Return the reflections of what was imagined that count for candidates which it is not of; None where none does.

    Args:
        futures: What was imagined.
        chosen: (c,) int, the numbers of the candidates that it is of.
        uv: (all, 2) float, where all candidates are, in fractions of the sides.
        rectangle: The cloth before.
        table: The table.
        hand: (3,) where the hand is told to be [m].
        hand_std: Standard deviation of this [m], by which guesses may be off.
    """
    guesses, count = len(futures.discretisation.hypotheses), len(chosen)
    points: np.ndarray = futures.positions.numpy()
    points = points.reshape(guesses, count, -1, 3)
    lying = share_lying(points, table)
    axes = np.stack([rectangle.corners[k] - rectangle.corners[0] for k in (1, 3)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    ends = hand + hand_std * np.array([h.hand for h in futures.discretisation.hypotheses])
    away = 2.0 * (ends - rectangle.centre) @ axes.T
    moved, to, weights, kinds = [], [], [], []
    for kind, along in enumerate(REFLECTIONS):
        there = counterparts(uv, along)[chosen]
        other_way = np.linalg.norm(away * along, axis=1)[:, None]
        counts = (lying <= LYING) | ((other_way <= ALIKE) & (lying <= LYING_ALIKE))
        counts &= futures.finite & (there >= 0) & ~np.isin(there, chosen)
        columns = counts.any(axis=0)
        at = points[:, columns].astype(float)
        for axis in axes[list(along)]:
            at -= 2.0 * ((at - ends[:, None, None]) @ axis)[..., None] * axis
        moved.append(at)
        to.append(there[columns])
        weights.append(WEIGHT * counts[:, columns])
        kinds.append(np.full(columns.sum(), kind))
    together = np.concatenate(to)
    if not len(together):
        return None
    flat = np.concatenate(moved, axis=1).reshape(-1, points.shape[2], 3).astype(np.float32)
    on_device: wp.array = wp.array(flat, dtype=wp.vec3, device=futures.positions.device)
    return Mirrored(
        futures.world, futures.body, futures.origin, len(together), futures.discretisation, together,
        np.concatenate(weights, axis=1), np.concatenate(kinds), on_device,
    )  # fmt: skip


def counterparts(uv: np.ndarray, along: tuple[bool, bool]) -> np.ndarray:
    """(k,) int, which candidate lies where each of the candidates (k, 2) is once it is reflected; -1 where none does.

    Args:
        uv: In fractions of the sides.
        along: Whether u, and v, are reflected.
    """
    there = np.where(along, 1.0 - uv, uv)
    apart = np.abs(there[:, None] - uv).max(axis=-1)
    nearest = apart.argmin(axis=1)
    return np.where(apart[np.arange(len(uv)), nearest] < 1e-6, nearest, -1)


def share_lying(points: np.ndarray, table: Table) -> np.ndarray:
    """(...,) float, which share of vertices (..., n, 3) [m] lies on the table."""
    low = points[..., 2] < table.height + NEAR
    if table.half_extents is not None:
        half, centre = np.asarray(table.half_extents), np.asarray(table.centre or (0.0, 0.0))
        low &= (np.abs(points[..., :2] - centre) < half + NEAR).all(axis=-1)
    return np.asarray(low.mean(axis=-1))
