"""Fit how far evidence is trusted, and tell how often answers are right: ``python benchmarks/doubt_fit.py DIR``.

DIR is what ``pick_evidence.py`` dumped. The stages of every estimate are gone through again, up to where it would have
ended, with the doubt as it is (`nuno.estimate.doubt`). Its few numbers are fitted by the logarithmic score to the
scenes of one half, and judged on the other. Nothing is changed.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from evidence_file import COUNT, Evidence, read_evidence
from scipy.optimize import minimize

from nuno.camera.focal_of_rectangle import FOCAL
from nuno.camera.rectangle import SQUARE, UNEVEN
from nuno.estimate import doubt
from nuno.estimate.doubt import ELSEWHERE, POOR, doubted, misfit, oddities
from nuno.estimate.hypotheses import Hypothesis
from nuno.estimate.ranking import SURE, rank
from nuno.estimate.seeing import AWAY, COVERED

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97, 1.0001)
NAMES = ("temperature", "well", "badly", "bad share", "breadth", "hand", "focal", "warned")
BEGUN = np.array(
    [
        doubt.TEMPERATURE, doubt.WELL, doubt.BADLY, doubt.BAD_SHARE, doubt.BREADTH, doubt.SHARES[ELSEWHERE],
        doubt.SHARES[FOCAL], doubt.WARNED_SHARE,
    ]
)  # fmt: skip
LOW = np.array([0.5, 5.0, 11.0, 0.0, 1.5, 0.0, 0.0, 0.0])
HIGH = np.array([4.0, 16.0, 25.0, 0.95, 12.0, 0.9, 0.9, 0.9])


@dataclass
class Ended:
    """What the confidence is a function of, of a case at the stage where its estimate ends."""

    case: Evidence
    stages: int
    scores: np.ndarray
    without: np.ndarray
    misfit: float
    warnings: tuple[str, ...]
    confidence: float

    @property
    def best(self) -> int:
        """The answer."""
        return int(self.scores.argmax())

    @property
    def steps(self) -> int:
        """How far off it is."""
        here, there = divmod(self.best, 6), divmod(self.case.true, 6)
        return int(np.abs(np.subtract(here, there)).max())


def ended(case: Evidence) -> Ended:
    """Go through a case's stages as an estimate does."""
    comparisons = case.comparisons
    touching = case.row.get("self_contact", [True] * len(comparisons))
    for k in range(1, len(comparisons) + 1):
        seen = [*comparisons[:k], *case.reflected(k)]
        if touching[k - 1] and doubted(seen, "evidence", COUNT, case.prior).settled(SURE):
            break
    ranked = rank(seen, "evidence", COUNT, case.prior)
    best = int(ranked.order[0])
    found: list[tuple[float, int, int]] = []
    for n, comparison in enumerate(comparisons[:k]):
        at = np.flatnonzero(comparison.candidates == best)
        if len(at):
            error = comparison.error("evidence")[..., at[0]]
            found.append((float(error.min()), n, int(np.unravel_index(error.argmin(), error.shape)[1])))
    _, stage, guess = min(found)
    odd = oddities(seen, best, "evidence", Hypothesis(1e-4, mistake=case.row["mistakes"][stage][guess]))
    warnings = (*case.row["rectangle_warnings"], *case.row["seen_warnings"], *odd)
    with_doubt = doubted(seen, "evidence", COUNT, case.prior, warnings)
    assert with_doubt.likely is not None
    without = rank(seen, "evidence", COUNT, case.prior, without_best=True)
    return Ended(
        case, k, ranked.scores, without.scores, misfit(seen, best), warnings, float(with_doubt.likely[best])
    )  # fmt: skip


def kinds_of(warnings: Sequence[str]) -> np.ndarray:
    """(3,) float, how many warnings there are of each kind that counts: of the hand, of the focal length, others."""
    counted = [w for w in warnings if not w.startswith((SQUARE, UNEVEN, POOR))]
    named = [sum(w.startswith(begin) for w in counted) for begin in ((ELSEWHERE, AWAY, COVERED), FOCAL)]
    return np.array([*named, len(counted) - sum(named)], dtype=float)


def shares(scores: np.ndarray) -> np.ndarray:
    """(n, k) float, probabilities by the logarithms of evidence (n, k)."""
    weights = np.exp(scores - scores.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


@dataclass
class Table:
    """Cases as arrays."""

    scores: np.ndarray
    without: np.ndarray
    misfit: np.ndarray
    kinds: np.ndarray
    best: np.ndarray
    true: np.ndarray

    @classmethod
    def of(cls, cases: Sequence[Ended]) -> Table:
        """Put cases together."""
        return cls(
            np.stack([c.scores for c in cases]), np.stack([c.without for c in cases]),
            np.array([c.misfit for c in cases]), np.stack([kinds_of(c.warnings) for c in cases]),
            np.array([c.best for c in cases]), np.array([c.case.true for c in cases]),
        )  # fmt: skip

    def likely(self, numbers: np.ndarray) -> np.ndarray:
        """(n, k) float, probabilities by the doubt with other numbers, in the order of `NAMES`."""
        temperature, well, badly, bad, breadth, *warned = numbers
        good = 0.5 * (shares(self.scores / temperature) + shares(self.without / temperature))
        left = 1.0 - bad * np.clip((self.misfit - well) / max(badly - well, 0.1), 0.0, 1.0)
        left = left * np.prod((1.0 - np.asarray(warned)) ** self.kinds, axis=1)
        return np.asarray(left[:, None] * good + (1.0 - left)[:, None] * shares(self.scores / breadth))

    def loss(self, numbers: np.ndarray) -> float:
        """Mean of the logarithmic scores of the answer being right and of the true candidate."""
        likely = np.clip(self.likely(numbers), 1e-6, 1.0 - 1e-6)
        row = np.arange(len(likely))
        trusted, right = likely[row, self.best], self.best == self.true
        answer = np.where(right, np.log(trusted), np.log1p(-trusted))
        return float(-0.5 * (answer + np.log(likely[row, self.true])).mean())

    def confidence(self, numbers: np.ndarray) -> np.ndarray:
        """(n,) float, how likely the answers are."""
        return self.likely(numbers)[np.arange(len(self.best)), self.best]


def fitted(table: Table) -> np.ndarray:
    """The numbers with the best score, drawn a little to where they begin."""
    spread = HIGH - LOW

    def cost(x: np.ndarray) -> float:
        inside = np.clip(x, LOW, HIGH)
        away = ((inside - BEGUN) / spread) ** 2
        return (
            table.loss(inside) + 0.2 * away.sum() / len(table.best) * 10.0 + float((((x - inside) / spread) ** 2).sum())
        )

    best = min(
        (
            minimize(cost, start, method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-3, "fatol": 1e-6})
            for start in (BEGUN, 0.5 * (LOW + HIGH), np.clip(BEGUN + 0.2 * spread, LOW, HIGH))
        ),
        key=lambda found: found.fun,
    )
    return np.clip(best.x, LOW, HIGH)


def reliability(name: str, confidence: np.ndarray, steps: np.ndarray) -> None:
    """Print how often answers are right by their confidence."""
    if not len(steps):
        return
    right = steps == 0
    where = np.minimum((confidence * 5).astype(int), 4)
    error = sum(abs(float((right[where == k] - confidence[where == k]).sum())) for k in range(5)) / len(right)
    sure = confidence >= 0.8
    print(
        f"\n{name}: {len(right)} cases, {right.sum()} exact ({right.mean():.1%}), {(steps <= 1).sum()} within a step; "
        f"calibration error {error:.3f}; at 0.8 or more {sure.sum()}, of them {right[sure].sum()} exact, "
        f"{(steps[sure] > 1).sum()} more than one step off; log score "
        f"{np.log(np.clip(np.where(right, confidence, 1 - confidence), 1e-6, 1)).mean():.3f}"
    )
    print("| confidence | answers | mean confidence | exact |\n|---|---|---|---|")
    for low, high in itertools.pairwise(BINS):
        at = (confidence >= low) & (confidence < high)
        if at.any():
            means = f"{confidence[at].mean():.2f} | {right[at].mean():.2f}"
            print(f"| {low:.2f} to {min(high, 1.0):.2f} | {at.sum()} | {means} |")


def by_kind(cases: Sequence[Ended]) -> None:
    """Print the answers by what departs."""
    print(
        "\n| departs | cases | exact | within one step | mean confidence | 0.8 or more: right of | stages | warnings |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for kind in sorted({c.case.row["kind"] for c in cases}):
        of = [c for c in cases if c.case.row["kind"] == kind]
        sure = [c for c in of if c.confidence >= 0.8]
        told = {w.split(":")[0][:44] for c in of for w in c.warnings}
        print(
            f"| {kind} | {len(of)} | {sum(c.steps == 0 for c in of)} | {sum(c.steps <= 1 for c in of)} | "
            f"{np.mean([c.confidence for c in of]):.2f} | {sum(c.steps == 0 for c in sure)} of {len(sure)} | "
            f"{np.mean([c.stages for c in of]):.1f} | {len(told)} |"
        )


def main() -> None:
    """Fit and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--no-fit", action="store_true", help="judge the doubt as it is alone")
    options = parser.parse_args()
    cases, others = read_evidence(options.folder)
    answers = [ended(case) for case in cases]
    print(f"{len(cases)} cases; {len(others)} more without an answer or taken by their outline")
    halves = [[a for a in answers if a.case.seed // 4 % 2 == half] for half in (0, 1)]
    by_kind(answers)
    for name, of in (("all", answers), ("first half", halves[0]), ("second half", halves[1])):
        reliability(f"{name}, as it is", np.array([a.confidence for a in of]), np.array([a.steps for a in of]))
    if options.no_fit:
        return
    for k in (0, 1):
        mine, other = Table.of(halves[k]), Table.of(halves[1 - k])
        numbers = fitted(mine)
        print(f"\nfitted to half {k + 1}:", dict(zip(NAMES, numbers.round(2).tolist(), strict=True)))
        for name, table, of in (("fitted", mine, halves[k]), ("the other half", other, halves[1 - k])):
            print(f"loss {table.loss(numbers):.4f}, with the numbers as they were {table.loss(BEGUN):.4f}")
            reliability(name, table.confidence(numbers), np.array([a.steps for a in of]))
    print("\nfitted to all:", dict(zip(NAMES, fitted(Table.of(answers)).round(2).tolist(), strict=True)))


if __name__ == "__main__":
    main()
