"""The answer to where a cloth was picked up, with all that a reader may want to check."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.ranking import ONLY_ONE, confidence, probabilities, tempered
from nuno.estimate.rotations import turn
from nuno.estimate.similarity import Silhouette
from nuno.files.html_table import html_table
from nuno.files.whole_file import made_folder, write_whole
from nuno.shapes.shape import Plane

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.estimate.futures import Futures
    from nuno.world.world import World

WORST = -1.0e9
SHEET_DPI = 110.0
"""Of the contact sheet as a figure [1/inch]."""

LOW_CONFIDENCE = 0.8
"""Below this an answer carries a warning. About 1 answer of 100 above it was wrong, 1 of 3 below.

The counts are in docs/reports/accuracy.md."""


@dataclass(eq=False)
class PickResult:
    """The estimate of where a cloth was picked up: a ranking of the candidates.

    Attributes:
        labels: (k, 2) the candidates: (i, j) of a grid, or the (u, v) that were given; of a cloth that is taken by its
            outline positions [m] along the longer and shorter side of its smallest rectangle, from C00.
        order: (k,) int, candidates from best to worst.
        scores: (k,) float by candidate, higher is better.
        score_name: What the scores are: "log_evidence" (of silhouettes) or "log_evidence_with_pattern", both with the
            prior of the lift unless ``sideways`` was None, "negative_chamfer_px" (minus the symmetric mean contour
            distance in pixels of the image), "iou", "eq1".
        eq1: (k,) float by candidate, the similarity of the paper's eq. (1), of futures that are not turned.
        rectangle: The cloth as it lay before, a ``ClothOutline`` where it was taken by its outline.
        camera: The camera, as the table's border or the cloth's outline told where it was told wrongly (a warning says
            it).
        grid: Candidates along both sides; (2, 2) where points were given.
        seconds: Wall time by stage [s].
        futures: The batch of imagined picks in which the best one is.
        best_index: The world of ``futures`` that is nearest to what was seen.
        turn: By how much it is turned about the hand's vertical there [rad], counterclockwise seen from above.
        hand: (3,) where the held point is [m].
        masks: (k, h, w) bool, each candidate's best imagined silhouette, turned, at the resolution of ``real``.
        real: The silhouette that was seen.
        seen_warnings: What was odd about how it was seen.
        trusted: How likely the best candidate is, as far as the evidence may be trusted (`nuno.estimate.doubt`); 1 is
            as the evidence says.
        sideways: Of the prior of the lift that is in scores of evidence (`nuno.estimate.lift_prior`); None is no prior.
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
    turn: float
    hand: np.ndarray
    masks: np.ndarray = field(repr=False)
    real: Silhouette = field(repr=False)
    image_before: np.ndarray | None = field(default=None, repr=False)
    image_after: np.ndarray | None = field(default=None, repr=False)
    mask_before: np.ndarray | None = field(default=None, repr=False)
    mask_after: np.ndarray | None = field(default=None, repr=False)
    seen_warnings: tuple[str, ...] = ()
    trusted: float = 1.0
    sideways: float | None = None

    def __repr__(self) -> str:
        odd = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"<PickResult: {self.best} of {len(self.labels)}, confidence {self.confidence:.2f}{odd}>"

    def _repr_html_(self) -> str:
        likely = self.probabilities
        rows = [
            (self._label(int(k)), f"{self.scores[k]:.4g}", "" if likely is None else f"{likely[k]:.3f}")
            for k in self.order[:5]
        ]
        title = f"PickResult: {self.best} of {len(self.labels)}, confidence {self.confidence:.2f}"
        columns = ("candidate", self.score_name.replace("_", " "), "probability")
        seen = self.image_before is not None
        return html_table(title, rows, columns=columns, notes=self.warnings, figure=self.figure() if seen else None)

    @property
    def best(self) -> tuple[Any, Any]:
        """The best candidate, (i, j) of the grid, (u, v), or the position [m] on a cloth taken by its outline."""
        return self._label(int(self.order[0]))

    @property
    def by_position(self) -> bool:
        """Return True if candidates are labelled by position [m], as of a cloth that is taken by its outline."""
        return isinstance(self.rectangle, ClothOutline)

    @property
    def fractions(self) -> np.ndarray:
        """(k, 2) float, the candidates as fractions of the (smallest rectangle's) sides, from C00."""
        if self.by_position:
            return np.asarray(self.labels / (self.rectangle.long_m, self.rectangle.short_m))
        on_grid = np.issubdtype(self.labels.dtype, np.integer)
        return np.asarray(self.labels, dtype=float) / ((np.asarray(self.grid) - 1) if on_grid else 1)

    @property
    def ranking(self) -> list[tuple[Any, Any, float]]:
        """(i, j, score) of all candidates, best first."""
        return [(*self._label(int(k)), float(self.scores[k])) for k in self.order]

    @property
    def confidence(self) -> float:
        """The probability of the best candidate where evidence ranks, from 0 to 1.

        Other scores tell no probability: there it is how much worse the second is, see
        `nuno.estimate.ranking.confidence`.
        """
        likely = self.probabilities
        return confidence(self.score_name, self.scores) if likely is None else float(likely.max())

    @property
    def probabilities(self) -> np.ndarray | None:
        """(k,) float by candidate, how likely each is; None where something else than evidence ranks."""
        likely = probabilities(self.score_name, self.scores)
        return likely if likely is None or self.trusted == 1.0 else tempered(self.scores, self.trusted)

    @cached_property
    def warnings(self) -> list[str]:
        """Return what a reader of the answer should know, in plain words."""
        found = [*self.rectangle.warnings, *self.seen_warnings]
        if len(self.labels) == 1:
            found.append(ONLY_ONE)
        if self.confidence < LOW_CONFIDENCE:
            found.append(self._doubt())
        return found

    def _doubt(self) -> str:
        """Return what else the answer might be, in words."""
        others = [int(k) for k in self.order[1:3]]
        likely = self.probabilities
        if likely is None:
            second = self._label(others[0])
            return (
                f"low confidence: {second} explains the image almost as well as {self.best} "
                f"(confidence {self.confidence:.2f})"
            )
        rivals = " and ".join(f"{self._label(k)} with {100.0 * likely[k]:.0f} %" for k in others)
        return f"low confidence: {self.best} is right with a probability of {100.0 * self.confidence:.0f} %, {rivals}"

    @property
    def world(self) -> World:
        """The world that the futures were imagined from: table, floor and the cloth as it lay before."""
        return self.futures.origin

    def adopt(self) -> World:
        """Make the best future the state of ``world``, and return it: the cloth hangs as it most likely does.

        It is turned about the hand's vertical as it was when it looked most like the image, unless it would be turned
        into the table: a part that hangs beside the table's edge stays there.
        """
        self.world.adopt(self.futures.world, self.best_index)
        cloth = self.world.find(self.futures.body.name)
        turned = turn(cloth.vertices, self.hand, self.turn)
        if self.turn != 0.0 and not self._in_table(turned):
            offset = turned.mean(axis=0) - cloth.vertices.mean(axis=0)
            cloth.rotate(self.turn, "z", wrt="world").translate(offset, wrt="world")
        return self.world

    def _in_table(self, points: np.ndarray) -> bool:
        """Return True if any of (n, 3) points is inside a table that has an edge."""
        table = self.world.find("table")
        if isinstance(table.shape, Plane):
            return False  # a turn about the vertical keeps heights
        low, high = table.vertices.min(axis=0), table.vertices.max(axis=0)
        return bool(((points > low) & (points < high)).all(axis=1).any())

    def to_dict(self) -> dict[str, Any]:
        """The answer as plain data, as it is written to result.json."""
        likely = self.probabilities
        found: dict[str, Any] = {
            "format": 1,
            "pick": list(self.best),
            # JSON has no infinity: a future that diverged counts as worse than any other
            "ranking": [[i, j, max(score, WORST)] for i, j, score in self.ranking],
            "score_name": self.score_name,
            "eq1": [float(self.eq1[k]) for k in self.order],
            "probabilities": None if likely is None else [float(likely[k]) for k in self.order],
            "confidence": self.confidence,
            "sideways": self.sideways,
            "turn_rad": self.turn,
            "warnings": self.warnings,
            "cloth": {
                "long_m": self.rectangle.long_m,
                "short_m": self.rectangle.short_m,
                "corners": self.rectangle.corners.tolist(),
            },
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
        }
        if isinstance(self.rectangle, ClothOutline):
            found["labels"] = "position_m"
            found["cloth"] |= {"outline_m": self.rectangle.polygon.tolist(), "area_m2": self.rectangle.area}
        return found

    def figure(self) -> Figure:
        """A contact sheet: the real images, and every candidate's future under the real outline; one image in it."""
        from matplotlib.figure import Figure

        from nuno.estimate.contact_sheet import contact_sheet

        sheet = contact_sheet(self)
        figure = Figure(figsize=(sheet.shape[1] / SHEET_DPI, sheet.shape[0] / SHEET_DPI), dpi=SHEET_DPI)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.imshow(sheet)
        return figure

    def save(self, folder: str | os.PathLike[str], *, picture: bool = True) -> None:
        """Write result.json, and result.png where ``picture`` is set, into a folder that is made if need be.

        Raises:
            FileWriteError: the folder or a file in it cannot be written.
        """
        folder = made_folder(folder)
        write_whole(folder / "result.json", json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")
        if picture:
            import cv2

            from nuno.estimate.contact_sheet import contact_sheet

            # packed no harder than is quick
            packed = cv2.imencode(".png", contact_sheet(self)[..., ::-1], (cv2.IMWRITE_PNG_COMPRESSION, 1))[1]
            write_whole(folder / "result.png", packed.tobytes())

    def _label(self, k: int) -> tuple[Any, Any]:
        a, b = self.labels[k]
        return (int(a), int(b)) if np.issubdtype(self.labels.dtype, np.integer) else (float(a), float(b))
