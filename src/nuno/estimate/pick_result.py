"""The answer to where a cloth was picked up, with all that a reader may want to check."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.ranking import confidence
from nuno.estimate.similarity import Silhouette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.estimate.futures import Futures
    from nuno.world import World

WORST = -1.0e9

LOW_CONFIDENCE = 0.5
"""Of 60 cases made for choosing, in two looks each, 12 of the 26 below this were right, 76 of the 94 above."""


@dataclass(eq=False)
class PickResult:
    """At which candidate the cloth was picked up.

    Attributes:
        labels: (k, 2) the candidates: (i, j) of a grid, or the (u, v) that were given.
        order: (k,) int, candidates from best to worst.
        scores: (k,) float by candidate, higher is better.
        score_name: What the scores are: "log_evidence" (of silhouettes), "log_evidence_with_pattern",
            "negative_chamfer_px" (minus the symmetric mean contour distance in pixels of the image), "iou", "eq1".
        eq1: (k,) float by candidate, the similarity of the paper's eq. (1).
        rectangle: The cloth as it lay before.
        camera: The camera.
        grid: Candidates along both sides; (2, 2) where points were given.
        seconds: Wall time by stage [s].
        futures: The batch of imagined picks in which the best one is.
        best_index: The world of ``futures`` that is nearest to what was seen.
        masks: (k, h, w) bool, each candidate's best imagined silhouette, at the resolution of ``real``.
        real: The silhouette that was seen.
    """

    labels: np.ndarray
    order: np.ndarray
    scores: np.ndarray
    score_name: str
    eq1: np.ndarray
    rectangle: ClothRectangle
    camera: Camera
    grid: tuple[int, int]
    seconds: dict[str, float]
    futures: Futures = field(repr=False)
    best_index: int
    masks: np.ndarray = field(repr=False)
    real: Silhouette = field(repr=False)
    image_before: np.ndarray | None = field(default=None, repr=False)
    image_after: np.ndarray | None = field(default=None, repr=False)
    mask_before: np.ndarray | None = field(default=None, repr=False)
    mask_after: np.ndarray | None = field(default=None, repr=False)

    @property
    def best(self) -> tuple[Any, Any]:
        """The best candidate, (i, j) of the grid or (u, v)."""
        return self._label(int(self.order[0]))

    @property
    def ranking(self) -> list[tuple[Any, Any, float]]:
        """(i, j, score) of all candidates, best first."""
        return [(*self._label(int(k)), float(self.scores[k])) for k in self.order]

    @property
    def confidence(self) -> float:
        """How much worse the second is, from 0 (as good) to 1; see `nuno.estimate.ranking.confidence`."""
        finite = [int(k) for k in self.order if np.isfinite(self.scores[k])]
        if len(finite) < 2:
            return 1.0
        return confidence(self.score_name, float(self.scores[finite[0]]), float(self.scores[finite[1]]))

    @cached_property
    def warnings(self) -> list[str]:
        """What a reader of the answer should know, in plain words."""
        found = list(self.rectangle.warnings)
        if self.confidence < LOW_CONFIDENCE:
            second = self._label(int(self.order[1]))
            found.append(
                f"low confidence: {second} explains the image almost as well as {self.best} "
                f"(confidence {self.confidence:.2f}, usual is above {LOW_CONFIDENCE})"
            )
        return found

    @property
    def world(self) -> World:
        """The world that the futures were imagined from: table, floor and the cloth as it lay before."""
        return self.futures.origin

    def adopt(self) -> World:
        """Make the best future the state of ``world``, and return it: the cloth hangs as it most likely does."""
        self.world.adopt(self.futures.world, self.best_index)
        return self.world

    def to_dict(self) -> dict[str, Any]:
        """The answer as plain data, as it is written to result.json."""
        return {
            "format": 1,
            "pick": list(self.best),
            # JSON has no infinity: a future that diverged counts as worse than any other
            "ranking": [[i, j, max(score, WORST)] for i, j, score in self.ranking],
            "score_name": self.score_name,
            "eq1": [float(self.eq1[k]) for k in self.order],
            "confidence": self.confidence,
            "warnings": self.warnings,
            "cloth": {
                "long_m": self.rectangle.long_m,
                "short_m": self.rectangle.short_m,
                "corners": self.rectangle.corners.tolist(),
            },
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
        }

    def figure(self) -> Figure:
        """A contact sheet: the real images, and every candidate's future under the real outline."""
        from nuno.estimate.contact_sheet import contact_sheet

        return contact_sheet(self)

    def save(self, folder: str | os.PathLike[str], *, picture: bool = True) -> None:
        """Write result.json, and result.png where ``picture`` is set, into a folder that is made if need be."""
        folder = FilePath(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "result.json").write_text(json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")
        if picture:
            self.figure().savefig(folder / "result.png", dpi=110)

    def _label(self, k: int) -> tuple[Any, Any]:
        a, b = self.labels[k]
        return (int(a), int(b)) if np.issubdtype(self.labels.dtype, np.integer) else (float(a), float(b))
