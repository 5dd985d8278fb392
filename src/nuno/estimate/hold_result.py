"""The answer to by which point a garment is held up."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.garment import LAYER_NAMES
from nuno.errors import EstimationError
from nuno.estimate.hold_views import HoldView, hold_masks
from nuno.estimate.imagined_holds import Holds
from nuno.estimate.ranking import ONLY_ONE
from nuno.estimate.rotations import turn
from nuno.files.whole_file import made_folder, write_figure, write_whole
from nuno.validation import checked, count, flag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOW_CONFIDENCE = 0.8
LOW_OVERLAP = 0.6
"""Below this even the best imagined garment fits badly."""


@dataclass(frozen=True, eq=False)
class HoldResult:
    """The estimate of the point by which a garment is held: a ranking of candidates.

    Attributes:
        holds: The garment as it hangs from every candidate.
        order: (k,) int, candidates from best to worst.
        scores: (k,) float by candidate, log evidence; higher is better.
        probabilities: (k,) float by candidate, which add up to 1.
        hand: (3,) the held point [m].
        matches: (k, 2) int by candidate, the guess and the turn at which it looks most like the images.
        turns: (t,) float [rad].
        overlap: Intersection over union of the best candidate's best future, averaged over the images.
        views: What was seen.
    """

    holds: Holds
    order: np.ndarray
    scores: np.ndarray
    probabilities: np.ndarray
    hand: np.ndarray
    matches: np.ndarray
    turns: np.ndarray
    overlap: float
    views: tuple[HoldView, ...] = field(repr=False)

    @classmethod
    def of(
        cls, holds: Holds, views: tuple[HoldView, ...], hand: np.ndarray, turns: np.ndarray, error: np.ndarray
    ) -> HoldResult:
        """Return the result of errors (turns, guesses, candidates), -log likelihoods.

        Raises:
            EstimationError: none is finite.
        """
        if not np.isfinite(error).any():
            raise EstimationError("no imagined garment stayed finite")
        tried = error.shape[0] * error.shape[1]
        scores = np.logaddexp.reduce(-error.reshape(tried, -1), axis=0) - np.log(tried)
        likely = np.exp(scores - scores.max())
        best = error.reshape(tried, -1).argmin(axis=0)
        matches = np.stack([best % error.shape[1], best // error.shape[1]], axis=1)
        order = np.argsort(-scores, kind="stable")
        first = int(order[0])
        pair = [(int(matches[first, 0]), first)]
        overlaps = []
        for seen in views:
            drawn = hold_masks(holds, pair, [float(turns[matches[first, 1]])], seen.camera, hand)[0]
            drawn &= ~seen.real.ignore
            overlaps.append((drawn & seen.real.mask).sum() / max((drawn | seen.real.mask).sum(), 1))
        return cls(
            holds, order, scores, likely / likely.sum(), hand, matches, turns, float(np.mean(overlaps)), views
        )  # fmt: skip

    def __repr__(self) -> str:
        x, y, layer = self.best
        return (
            f"<HoldResult: {self.holds.garment.name} held at ({x:.2f}, {y:.2f}) m, {layer}, confidence "
            f"{self.confidence:.2f} or {self.confidence_up_to_symmetry:.2f} up to symmetry>"
        )

    @property
    def vertex(self) -> int:
        """The vertex by which the garment is most likely held."""
        return int(self.holds.candidates[self.order[0]])

    @property
    def best(self) -> tuple[float, float, str]:
        """Its place in the flat garment, x to the wearer's left and y up from the middle [m], and the layer's name."""
        return self._place(self.vertex)

    @property
    def ranking(self) -> list[tuple[float, float, str, float]]:
        """(x [m], y [m], layer, probability) of all candidates, best first."""
        return [(*self._place(int(self.holds.candidates[k])), float(self.probabilities[k])) for k in self.order]

    @property
    def confidence(self) -> float:
        """The probability of the best candidate."""
        return float(self.probabilities.max())

    @cached_property
    def groups(self) -> list[np.ndarray]:
        """Candidates that the garment's symmetries take to each other, as indices, the likeliest group first.

        Their garments hang alike or as mirror images of each other. Those that are turned alike no image tells apart;
        mirror images one image does not, but for perspective, and two do.
        """
        candidates = self.holds.candidates
        place = {int(v): k for k, v in enumerate(candidates)}
        seen: set[int] = set()
        found = []
        for k in self.order:
            if int(k) not in seen:
                orbit = {place.get(int(one[candidates[k]]), -1) for one in self.holds.garment.symmetries} - {-1}
                found.append(np.array(sorted(orbit)))
                seen |= orbit
        return sorted(found, key=lambda group: -float(self.probabilities[group].sum()))

    @property
    def confidence_up_to_symmetry(self) -> float:
        """The probability that the garment is held by the best group of points that its symmetries make alike."""
        return float(self.probabilities[self.groups[0]].sum())

    def distance(self, vertex: int, *, up_to_symmetry: bool = False) -> float:
        """Return how far the answer is from a vertex on the cloth [m].

        Args:
            vertex: By which the garment really is held.
            up_to_symmetry: Whether the nearest of the points counts that its symmetries make of that vertex.

        Raises:
            InvalidInputError: the garment has no such vertex.
        """
        count("vertex", vertex, low=0, high=len(self.holds.garment.vertices) - 1)
        flag("up_to_symmetry", up_to_symmetry)
        away = self.holds.garment.distances(self.vertex)
        maps = self.holds.garment.symmetries if up_to_symmetry else self.holds.garment.symmetries[:1]
        return float(min(away[one[vertex]] for one in maps))

    @cached_property
    def warnings(self) -> list[str]:
        """Return what a reader of the answer should know, in plain words."""
        found = []
        if self.overlap < LOW_OVERLAP:
            found.append(
                f"even the best imagined garment overlaps with what is seen by {self.overlap:.0%} only: is it this "
                "garment, in this size, and does it hang free?"
            )
        if len(self.holds.candidates) == 1:
            found.append(ONLY_ONE)
        if self.confidence_up_to_symmetry < LOW_CONFIDENCE:
            others = ", ".join(
                "({:.2f}, {:.2f}) m {} with {:.0f} %".format(
                    *self._place(int(self.holds.candidates[group[0]])), 100.0 * float(self.probabilities[group].sum())
                )
                for group in self.groups[1:3]
            )
            found.append(
                f"low confidence: the best point and those like it by symmetry are right with a probability of "
                f"{100.0 * self.confidence_up_to_symmetry:.0f} %" + (f", {others}" if others else "")
            )
        return found

    @checked
    def positions(self, rank: int = 0) -> np.ndarray:
        """Return (n, 3) where the garment's vertices are in the world [m], as the candidate of a rank hangs at best.

        Args:
            rank: 0 is the best candidate.

        Raises:
            InvalidInputError: there is no candidate of that rank.
        """
        k = int(self.order[count("rank", rank, low=0, high=len(self.order) - 1)])
        guess, at = (int(v) for v in self.matches[k])
        return turn(self.holds.positions[guess, k].astype(float) + self.hand, self.hand, float(self.turns[at]))

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain data, as it is written to result.json."""
        return {
            "format": 1,
            "garment": self.holds.garment.name,
            "held": list(self.best),
            "ranking": [list(one) for one in self.ranking],
            "confidence": self.confidence,
            "confidence_up_to_symmetry": self.confidence_up_to_symmetry,
            "overlap": self.overlap,
            "turn_rad": float(self.turns[self.matches[self.order[0], 1]]),
            "warnings": self.warnings,
        }

    def figure(self) -> Figure:
        """Draw the seen and the likeliest silhouettes, and the candidates on the flat garment's layers."""
        from nuno.estimate.hold_figure import hold_figure

        return hold_figure(self)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write result.json and result.png into a folder that is made if need be.

        Raises:
            FileWriteError: the folder or a file in it cannot be written.
        """
        folder = made_folder(folder)
        write_whole(folder / "result.json", json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")
        write_figure(folder / "result.png", self.figure())

    def _place(self, vertex: int) -> tuple[float, float, str]:
        garment = self.holds.garment
        x, y = garment.rest[vertex, :2]
        return float(x), float(y), LAYER_NAMES[int(garment.layer[vertex])]
