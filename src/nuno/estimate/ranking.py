"""From many comparisons of silhouettes to one ranking of the candidates.

A candidate is imagined under several guesses at the material on several meshes, and each future compared at several
turns about the hand's vertical. Which of them is right is not known, so the default ranking asks for the evidence of a
candidate: the likelihood of the images averaged over all guesses, and over the turns by their prior, with -log
likelihood = 5 ln(1 + chamfer / 1 px) + 10 (1 - IoU) + 25 pattern up to a constant. The first term is the tail of a
heavy-tailed error in pixels: being off by twice as much costs about the same anywhere. The last is that of some 25
independent patches of cloth with normal errors of unknown size (`nuno.estimate.pattern`); it is 0 where there are
only masks, and for a cloth without a pattern. The weights and the mean were chosen on cases made for choosing
(docs/reports/accuracy.md). What a network has learned of silhouettes corrects the likelihood of every guess
(`nuno.estimate.learned`). How far sideways the hand would have gone from a candidate is its prior
(`nuno.estimate.lift_prior`), by which its evidence is multiplied. Where the hand may have gone straight or up first,
the mean over the guesses of each way counts by the way's own prior: so it does not matter of which there are more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nuno.estimate.lift_prior import UP_FIRST
from nuno.estimate.rotations import log_prior

RANKINGS = ("evidence", "silhouette", "chamfer", "iou", "eq1")
CONTOUR_WEIGHT = 5.0
OVERLAP_WEIGHT = 10.0
PATTERN_WEIGHT = 25.0
EVIDENCE = ("evidence", "silhouette")
"""The rankings that average over guesses and turns."""
SURE = 0.96
"""A candidate as likely as this after some of the guesses, with and without the best of them, needs no more."""
HOTTEST = 12.0
"""Logarithm of the highest temperature, at which all are alike."""
COLDEST = -2.0
"""The same of the lowest."""
SHARE = 0.95
"""Further guesses look at the candidates that together hold so much of the probability."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Scores of one mesh's futures beside the real silhouette, (turns, guesses, c) each.

    Attributes:
        candidates: (c,) int, which candidates were looked at.
        turns: (turns,) float, how far the futures were turned about the hand's vertical [rad]; 0 is among them.
        chamfer: Symmetric mean contour distance [px of the full image].
        iou: Intersection over union.
        eq1: The paper's eq. (1).
        finite: Whether the future's state is a number, (guesses, c).
        pattern: How badly the cloth's pattern fits, see `nuno.estimate.pattern`; None where only masks are known.
        correction: What is added to every guess's log likelihood, (guesses, c), see `nuno.estimate.learned`; None is
            nothing.
        shifts: (turns, 3) float, how far the futures were moved after each turn [m]; None is not at all.
        log_priors: (turns,) float, logarithms of the priors of turns and shifts, which add up to 1; None is
            `nuno.estimate.rotations.log_prior` of the turns.
        up_first: (guesses,) bool, of which the hand went up first; None is of none.
        weights: (guesses, c) float, how much each counts in the mean over the guesses; None is 1 of all. They are given
            of futures that were not imagined of these candidates (`nuno.estimate.mirrored`), which count as evidence
            alone.
    """

    candidates: np.ndarray
    turns: np.ndarray
    chamfer: np.ndarray
    iou: np.ndarray
    eq1: np.ndarray
    finite: np.ndarray
    pattern: np.ndarray | None = None
    correction: np.ndarray | None = None
    shifts: np.ndarray | None = None
    log_priors: np.ndarray | None = None
    up_first: np.ndarray | None = None
    weights: np.ndarray | None = None

    def part(self, columns: np.ndarray) -> Comparison:
        """The same of some candidates, by ``columns`` (c,) bool."""
        names = ("chamfer", "iou", "eq1", "finite", "pattern", "correction", "weights")
        arrays = {name: getattr(self, name) for name in names}
        changed = {name: array[..., columns] for name, array in arrays.items() if array is not None}
        return replace(self, candidates=self.candidates[columns], **changed)

    def error(self, score: str) -> np.ndarray:
        """(turns, guesses, c) float, lower is better; infinite where the future is not finite.

        Of the evidence it is -log(likelihood x prior of the turn); the other scores know no turns but 0.
        """
        if score in EVIDENCE:
            error = CONTOUR_WEIGHT * np.log1p(self.chamfer) + OVERLAP_WEIGHT * (1.0 - self.iou)
            if score == "evidence" and self.pattern is not None:
                error = error + PATTERN_WEIGHT * self.pattern
            priors = log_prior(self.turns) if self.log_priors is None else self.log_priors
            error = error - priors[:, None, None]
            if self.correction is not None:
                error = error - self.correction
        else:
            error = self.chamfer if score == "chamfer" else 1.0 - getattr(self, score)
            error = np.where(self.turns[:, None, None] == 0.0, error, np.inf)
        return np.where(self.finite, error, np.inf)


@dataclass(frozen=True, eq=False)
class Ranked:
    """Scores of the candidates.

    Attributes:
        name: What the scores are: "log_evidence" (of silhouettes), "log_evidence_with_pattern", both with the
            candidate's prior where there is one, "negative_chamfer_px", "iou" or "eq1".
        scores: (k,) float, higher is better; -inf where no future stayed finite.
        eq1: (k,) float, the paper's similarity, without a turn: the best guess of each mesh, averaged over meshes.
        likely: (k,) float, how likely each candidate is as far as the evidence may be trusted (`nuno.estimate.doubt`);
            None: as the scores say.
        up_first: How likely it is that the hand went up first, of the candidates of which both ways were looked at; 0
            where none was.
    """

    name: str
    scores: np.ndarray
    eq1: np.ndarray
    likely: np.ndarray | None = None
    up_first: float = 0.0

    @property
    def order(self) -> np.ndarray:
        """(k,) int, candidates from best to worst."""
        return np.argsort(-self.scores, kind="stable")

    @property
    def probabilities(self) -> np.ndarray | None:
        """(k,) float, how likely each candidate is; None where something else than evidence ranks."""
        return probabilities(self.name, self.scores) if self.likely is None else self.likely

    def plausible(self, limit: int, share: float = SHARE) -> np.ndarray:
        """The best candidates, in the order of their numbers: (m,) int.

        Where evidence ranks, they are the fewest that hold a share of the probability, but two at least.

        Args:
            limit: No more than so many.
            share: Of the probability; 1 is all of it.
        """
        order, likely = self.order, self.probabilities
        if likely is not None and self.likely is not None:
            order = np.argsort(-likely, kind="stable")
        if likely is not None and share < 1.0:
            limit = min(limit, max(2, 1 + int(np.searchsorted(np.cumsum(likely[order]), share))))
        return np.sort(order[:limit])

    def settled(self, sure: float) -> bool:
        """Return True if one candidate is as likely as ``sure``, below 1, so that no more guesses are needed."""
        likely = self.probabilities
        return sure < 1.0 and likely is not None and bool(likely.max() >= sure)


def rank(
    comparisons: Sequence[Comparison], score: str, count: int, log_prior_of_candidates: np.ndarray | None = None,
    *, without_best: bool = False,
) -> Ranked:  # fmt: skip
    """Combine the comparisons of all meshes.

    The evidence of a candidate is the weighted mean likelihood over all guesses that looked at it, times its prior
    where there is one; of two ways of the hand, the sum of this by both. The other scores take the best guess of each
    mesh and average over the meshes that looked at the candidate.

    Args:
        comparisons: One for each mesh.
        score: One of `RANKINGS`.
        count: Number of candidates.
        log_prior_of_candidates: (count,) float, how likely each is before any image is seen
            (`nuno.estimate.lift_prior`), up to a constant; None is alike. Or (2, count), of hands that went straight
            and of those that went up first, whose guesses are then told from each other. Evidence alone asks for it.
        without_best: Leave every candidate's best guess out of its evidence, if it has others: what a single guess
            says may be chance.
    """
    looked, similar, errors = np.zeros(count), np.zeros(count), np.zeros(count)
    for comparison in comparisons:
        if comparison.weights is not None:
            continue
        at = comparison.candidates
        looked[at] += 1
        similar[at] += 1.0 - np.minimum(comparison.error("eq1").min(axis=(0, 1)), 1.0)
        errors[at] += comparison.error(score).min(axis=(0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        eq1, mean = similar / looked, errors / looked
        if score in EVIDENCE:
            looks = score == "evidence" and any(c.pattern is not None for c in comparisons)
            name = "log_evidence_with_pattern" if looks else "log_evidence"
            scores, up_first = _evidence(comparisons, score, log_prior_of_candidates, count, without_best)
            return Ranked(name, scores, eq1, up_first=up_first)
        if score == "chamfer":
            return Ranked("negative_chamfer_px", -mean, eq1)
        return Ranked(score, 1.0 - mean, eq1)


def _evidence(
    comparisons: Sequence[Comparison], score: str, log_priors: np.ndarray | None, count: int, without_best: bool
) -> tuple[np.ndarray, float]:
    """Logarithms of the candidates' evidence (count,), and how likely it is that the hand went up first."""
    priors = np.zeros((1, count)) if log_priors is None else np.atleast_2d(log_priors)
    shares = np.ones(1) if len(priors) == 1 else np.array((1.0 - UP_FIRST, UP_FIRST))
    total, guesses, best = (np.zeros(priors.shape) for _ in range(3))
    weight_of_best = np.ones(priors.shape)
    # scaled by the best of all, for exp would underflow far from it
    offset = min((e[np.isfinite(e)].min(initial=np.inf) for e in (c.error(score) for c in comparisons)), default=0.0)
    offset = offset if np.isfinite(offset) else 0.0
    for comparison in comparisons:
        likelihood = np.exp(offset - comparison.error(score)).sum(axis=0)
        up_first = np.zeros(len(likelihood), dtype=bool) if comparison.up_first is None else comparison.up_first
        counts = np.ones(likelihood.shape) if comparison.weights is None else comparison.weights
        for way in range(len(priors)):
            its = np.ones(len(likelihood), dtype=bool) if len(priors) == 1 else up_first == bool(way)
            of, weight, at = (counts * likelihood)[its], counts[its], comparison.candidates
            total[way, at] += of.sum(axis=0)
            guesses[way, at] += weight.sum(axis=0)
            if len(of):
                top = of.argmax(axis=0), np.arange(len(at))
                better = of[top] > best[way, at]
                best[way, at] = np.where(better, of[top], best[way, at])
                weight_of_best[way, at] = np.where(better, weight[top], weight_of_best[way, at])
    weights = priors + np.log(shares)[:, None]
    if without_best:
        highest = np.where(guesses > 0, np.log(best / guesses) + weights, -np.inf)
        way, every = np.argmax(highest, axis=0), np.arange(count)
        of, one = best[way, every], weight_of_best[way, every]
        several = guesses[way, every] > one
        # no less than rounding leaves of a sum without its largest part
        left = np.maximum(total[way, every] - of, 1e-12 * of)
        total[way, every] = np.where(several, left, total[way, every])
        guesses[way, every] -= several * one
    known = guesses > 0
    logs = np.where(known, np.log(total / guesses) - offset + weights, -np.inf)
    scores = np.logaddexp.reduce(logs, axis=0) - np.log((known * shares[:, None]).sum(axis=0))
    both = known.all(axis=0) & np.isfinite(scores)
    if len(priors) == 1 or not both.any():
        return scores, 0.0
    of_ways = np.logaddexp.reduce(logs[:, both], axis=1)
    return scores, float(np.exp(of_ways[1] - np.logaddexp(*of_ways)))


def probabilities(name: str, scores: np.ndarray) -> np.ndarray | None:
    """Return how likely each candidate is by its log evidence, which its prior is in: (k,) float that add up to 1.

    Args:
        name: What the scores are, see `Ranked`: None is returned where they are no evidence.
        scores: (k,) float, higher is better; -inf where there is none. None is returned where there is none at all.
    """
    if not name.startswith("log_evidence") or not np.isfinite(scores).any():
        return None
    likely = np.exp(scores - scores.max())
    return np.asarray(likely / likely.sum())


def tempered(scores: np.ndarray, trusted: float) -> np.ndarray:
    """Return probabilities (k,) in the order of the scores (k,), of which the best one's is what is trusted.

    They are as exp of the scores divided by a temperature, which lies between `COLDEST` and `HOTTEST`.
    """
    finite = np.isfinite(scores)
    best = np.where(finite, scores, -np.inf).max()

    def at(log_temperature: float) -> np.ndarray:
        weights = np.where(finite, np.exp(np.where(finite, scores - best, 0.0) / np.exp(log_temperature)), 0.0)
        return np.asarray(weights / weights.sum())

    low, high = COLDEST, HOTTEST
    if at(low).max() <= trusted:
        return at(low)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if at(middle).max() <= trusted else (middle, high)
    return at(high)


ONLY_ONE = "only one candidate was given: its probability of 1 says nothing of how sure it is; give two or more"
"""Warning of answers that had no rival."""


def confidence(name: str, scores: np.ndarray) -> float:
    """Return how far the best candidate may be trusted, from 0 to 1.

    For the evidence it is the probability of the best candidate, else 1 - the ratio of the errors of the best and the
    second: 0 where they are equal. 1 where there is no second.

    Args:
        name: What the scores are, see `Ranked`.
        scores: (k,) float, higher is better; -inf where there is none.
    """
    likely = probabilities(name, scores)
    if likely is not None:
        return float(likely.max())
    finite = np.sort(scores[np.isfinite(scores)])[::-1]
    if len(finite) < 2:
        return 1.0
    a, b = -finite[:2] if name == "negative_chamfer_px" else 1.0 - finite[:2]
    return float(np.clip(1.0 - a / b, 0.0, 1.0)) if b > 0 else 0.0
