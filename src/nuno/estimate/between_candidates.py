"""Picks between candidates: how likely it is that each candidate of an outline is the nearest to where it was picked.

Candidates that are spread over an outline are up to half a spacing and more from where the cloth was picked, and none
may be that point, so evidence that takes one of them for true is too sure. Between candidates the logarithm of the
evidence is interpolated: the mean over the candidates around, with weights that fall with the distance. A candidate has
what its cell holds, which is the part of the cloth that is nearer to it than to any other; cells count alike, however
large they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nuno.estimate.ranking import Ranked
from nuno.mesh.polygon import contains, staggered

REACH = 0.5
"""Standard deviation of the weights by distance, in spacings."""
TEMPERATURE = 0.4
"""Evidence's logarithms are divided by this where they are interpolated, which flattens them again. Both numbers were
fitted to cases of the project's own generator and checked on others (docs/reports/accuracy.md)."""
SURE = 0.85
"""A candidate as likely as this, so counted, after some of the guesses needs no more."""
FINENESS = 10
"""Points a spacing at which evidence is interpolated."""
AROUND = 24
"""Candidates whose mean it is, at most; farther ones weigh less than a thousandth."""
FLOOR = -60.0
"""Least logarithm of a probability that counts: a candidate without any future is no reason to rule out its cell."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Points of a cloth, and the candidates around each.

    Attributes:
        around: (t, m) int, the candidates around each point, the nearest first.
        weights: (t, m) float, of each of these in the mean; they add up to 1.
        count: Number of candidates k.
    """

    around: np.ndarray
    weights: np.ndarray
    count: int

    def nearest(self, ranked: Ranked) -> Ranked:
        """Return how likely each candidate is the nearest to where the cloth was picked, as ``likely``.

        Scores stay, and with them the order: by these probabilities it was no better (docs/reports/accuracy.md).

        Args:
            ranked: With how likely each candidate is if one of them is where it was picked.
        """
        if ranked.likely is None:
            return ranked
        with np.errstate(divide="ignore"):
            logs = np.maximum(np.log(ranked.likely), FLOOR)
        at_points = (self.weights * logs[self.around]).sum(axis=1)
        own = self.around[:, 0]
        dense = np.exp(at_points - at_points.max())
        inside = np.bincount(own, dense, self.count) / np.maximum(np.bincount(own, minlength=self.count), 1)
        return replace(ranked, likely=inside / inside.sum())


def cells_of(polygon: np.ndarray, candidates: np.ndarray, spacing: float) -> Cells:
    """Divide a cloth among its candidates.

    Args:
        polygon: (n, 2) its outline [m].
        candidates: (k, 2) [m].
        spacing: Of the candidates [m].
    """
    from scipy.spatial import cKDTree

    points = staggered(polygon.min(axis=0), polygon.max(axis=0), spacing / FINENESS)
    points = np.concatenate([candidates, points[contains(polygon, points)]])
    around = min(AROUND, len(candidates))
    distance, which = cKDTree(candidates).query(points, k=np.arange(1, around + 1))
    weights = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2) / (REACH * spacing) ** 2)
    return Cells(which, weights / weights.sum(axis=1, keepdims=True), len(candidates))
