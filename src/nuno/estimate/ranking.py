"""From many comparisons of silhouettes to one ranking of the candidates.

A candidate is imagined under several guesses at the material on several meshes. Which of them is right is not known,
so the default ranking asks for the evidence of a candidate: the likelihood of the silhouette averaged over all guesses,
with -log likelihood = 5 ln(1 + chamfer / 1 px) + 10 (1 - IoU) up to a constant. The first term is the tail of a
heavy-tailed error in pixels: being off by twice as much costs about the same anywhere. The two weights and the
mean were chosen on generated cases (docs/performance.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RANKINGS = ("evidence", "chamfer", "iou", "eq1")
CONTOUR_WEIGHT = 5.0
OVERLAP_WEIGHT = 10.0


@dataclass(frozen=True, eq=False)
class Ranked:
    """Scores of the candidates.

    Attributes:
        name: What the scores are: "log_evidence", "negative_chamfer_px", "iou" or "eq1".
        scores: (k,) float, higher is better; -inf where no future stayed finite.
        eq1: (k,) float, the paper's similarity: the best guess of each mesh, averaged over meshes.
        guess: (k,) int, each candidate's best guess on the first mesh.
    """

    name: str
    scores: np.ndarray
    eq1: np.ndarray
    guess: np.ndarray


def rank(tables: Sequence[dict[str, np.ndarray]], score: str) -> Ranked:
    """Combine the comparisons of all meshes.

    Args:
        tables: By mesh, arrays (guesses, k): "chamfer" [px of the full image], "iou", "eq1", and "finite".
        score: One of `RANKINGS`. All but "evidence" take the best guess of each mesh and average over meshes.
    """
    errors = [np.where(table["finite"], _error(table, score), np.inf) for table in tables]
    similar = [np.where(table["finite"], table["eq1"], 0.0).max(axis=0) for table in tables]
    if score == "evidence":
        likelihood = np.concatenate(errors)
        lowest = likelihood.min(axis=0)
        offset = np.where(np.isfinite(lowest), lowest, 0.0)
        with np.errstate(divide="ignore"):
            scores = np.log(np.exp(offset - likelihood).mean(axis=0)) - offset
        name = "log_evidence"
    else:
        scores = -np.mean([error.min(axis=0) for error in errors], axis=0)
        name = "negative_chamfer_px" if score == "chamfer" else score
        scores = scores if score == "chamfer" else 1.0 + scores
    return Ranked(name, scores, np.mean(similar, axis=0), errors[0].argmin(axis=0))


def _error(table: dict[str, np.ndarray], score: str) -> np.ndarray:
    if score == "evidence":
        return CONTOUR_WEIGHT * np.log1p(table["chamfer"]) + OVERLAP_WEIGHT * (1.0 - table["iou"])
    return table["chamfer"] if score == "chamfer" else 1.0 - table[score]


def confidence(name: str, first: float, second: float) -> float:
    """How much worse the second candidate is, from 0 (as good) to 1.

    For the evidence it is 1 - the ratio of both candidates' likelihoods, else 1 - the ratio of their errors.
    """
    if name == "log_evidence":
        return float(1.0 - np.exp(min(second - first, 0.0)))
    a, b = (-first, -second) if name == "negative_chamfer_px" else (1.0 - first, 1.0 - second)
    return float(np.clip(1.0 - a / b, 0.0, 1.0)) if b > 0 else 0.0
