"""Doubt of evidence: a chance fit, a best future that fits badly, and warnings make an answer less sure.

Evidence (`nuno.estimate.ranking`) takes it that one of the guesses is right up to chance. Where it is not, three things
tell so. The answer may depend on a single future: so it is asked for again without each candidate's best guess, and
the mean of both probabilities counts. Even the best future may fit badly: the hand, the camera, the table or the cloth
are not what they are taken for. And a warning may say that what was seen is odd. The last two mix the probabilities
with broad ones, whose logarithms are a fraction of the evidence's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nuno.camera.focal_of_rectangle import FOCAL
from nuno.camera.rectangle import SQUARE, UNEVEN
from nuno.estimate.hypotheses import Hypothesis
from nuno.estimate.ranking import CONTOUR_WEIGHT, EVIDENCE, OVERLAP_WEIGHT, Comparison, Ranked, rank
from nuno.estimate.seeing import AWAY, COVERED, OUTSIDE

FAIRLY = 10.0
"""-log likelihood of a silhouette, without its pattern, up to which no other way of the hand is looked for."""
WELL = 13.0
"""-log likelihood of a silhouette, without its pattern, up to which a future fits well; beyond, a warning says so."""
BADLY = 19.0
"""The same, from which on it fits badly."""
BAD_SHARE = 0.6
"""Of the broad probabilities in the answer, where the best future fits badly; up to there in proportion."""
POOR = "even the best imagined pick looks little like the image after"
"""How the warning of a bad fit begins."""
ELSEWHERE = "the image after looks as if the hand were "
"""How a warning begins that the hand is told to be where it is not."""
SEEN_ELSEWHERE = "by where the cloth begins in the image after, the hand is taken to be "
"""The same where all guesses took it to be there (`nuno.estimate.hypotheses.elsewhere`)."""
SHARES = {SQUARE: 0.0, UNEVEN: 0.0, POOR: 0.0, ELSEWHERE: 0.4, AWAY: 0.4, COVERED: 0.4, OUTSIDE: 0.4, FOCAL: 0.1}
"""Of the broad probabilities, by how a warning begins, of what those before it left. A square or rough outline told
nothing of answers (docs/reports/accuracy.md), and how badly the best future fits counts by itself."""
WARNED_SHARE = 0.1
"""The same of any other warning."""
TEMPERATURE = 0.8
"""Evidence's logarithms are divided by this. Its weights were chosen to rank; by them right answers are doubted too
much (docs/reports/accuracy.md)."""
BREADTH = 6.0
"""Evidence's logarithms are divided by this for the broad probabilities."""


def misfit(comparisons: Sequence[Comparison], candidate: int) -> float:
    """Return -log likelihood of the silhouette of a candidate's best future, its pose's prior left out.

    It is of those that were imagined of the candidate itself.
    """
    found = [np.inf]
    for comparison in (c for c in comparisons if c.weights is None):
        at = comparison.candidates == candidate
        chamfer, missed = comparison.chamfer[..., at], 1.0 - comparison.iou[..., at]
        error = CONTOUR_WEIGHT * np.log1p(chamfer) + OVERLAP_WEIGHT * missed
        error = np.where(comparison.finite[:, at], error, np.inf)
        found.append(float(error.min(initial=np.inf)))
    return min(found)


def oddities(
    comparisons: Sequence[Comparison], candidate: int, score: str, guess: Hypothesis, *, seen: bool = False
) -> tuple[str, ...]:
    """Return warnings of how the best future fits; none where something else than evidence ranks.

    Args:
        comparisons: Of all meshes.
        candidate: The best one.
        score: What ranks.
        guess: Of the future that fits best.
        seen: Whether the image after shows that the hand is elsewhere.
    """
    if score not in EVIDENCE:
        return ()
    if guess.mistake != 0.0:
        return (
            f"{SEEN_ELSEWHERE if seen else ELSEWHERE}{100.0 * abs(guess.mistake):.0f} cm "
            f"{'higher' if guess.mistake > 0.0 else 'lower'} than it is told to be: are hand, camera and table_height "
            "right?",
        )
    if misfit(comparisons, candidate) < WELL:
        return ()
    return (
        f"{POOR}: is the cloth larger, folded or of another kind than any guess, or are hand, camera or table_height "
        "wrong?",
    )


def share_of_doubt(misfit: float, warnings: Sequence[str] = ()) -> float:
    """Return which share of the broad probabilities there is in an answer, 0 to 1.

    Args:
        misfit: Of the best future, see `misfit`.
        warnings: What was odd.
    """
    left = 1.0 - BAD_SHARE * float(np.clip((misfit - WELL) / (BADLY - WELL), 0.0, 1.0))
    for warning in warnings:
        left *= 1.0 - next((share for begin, share in SHARES.items() if warning.startswith(begin)), WARNED_SHARE)
    return 1.0 - left


def doubted(
    comparisons: Sequence[Comparison], score: str, count: int, log_prior_of_candidates: np.ndarray | None,
    warnings: Sequence[str] = (), temperature: float = TEMPERATURE,
) -> Ranked:  # fmt: skip
    """Rank the candidates, and tell how likely each is as far as the evidence may be trusted.

    Args:
        comparisons: As `nuno.estimate.ranking.rank` takes them, like the next three.
        score: What ranks.
        count: Number of candidates.
        log_prior_of_candidates: (count,) or (2, count) float, or None.
        warnings: Of how the images and the cloth are odd; none while more guesses may follow, for none of them would
            mend that.
        temperature: By which the evidence's logarithms are divided.
    """
    ranked = rank(comparisons, score, count, log_prior_of_candidates)
    if score not in EVIDENCE or not np.isfinite(ranked.scores).any():
        return ranked
    without = rank(comparisons, score, count, log_prior_of_candidates, without_best=True)
    with_and_without = (_log_shares(scores / temperature) for scores in (ranked.scores, without.scores))
    logs = np.logaddexp(*with_and_without) - np.log(2.0)
    found = misfit(comparisons, int(ranked.order[0]))
    share = share_of_doubt(found, warnings)
    if share > 0.0:
        logs = np.logaddexp(np.log1p(-share) + logs, np.log(share) + _log_shares(ranked.scores / BREADTH))
    return replace(ranked, likely=np.exp(logs), up_first=0.5 * (ranked.up_first + without.up_first))


def _log_shares(scores: np.ndarray) -> np.ndarray:
    """Logarithms of probabilities (k,) that are as exp of the scores (k,)."""
    return np.asarray(scores - np.logaddexp.reduce(scores))
