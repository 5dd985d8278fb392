"""The learned correction of scores: how silhouettes of one pick differ, from many imagined picks.

Folding is a matter of chance, and a contour distance does not know which differences of two outlines are mere chance
and which tell of another pick. A network (`nuno.estimate.outline_net`) does to some degree: it was trained on
silhouettes of Nuno's own engine alone, one picked cloth seen and others imagined on other meshes, with other steps
and materials, to give the true candidate the most probability. What it says of a pair, r, is added to the hand-made
log likelihood h of a guess (`nuno.estimate.ranking`): 0.7 h + r. Both shares were chosen on scenes that it was not
trained on (docs/reports/accuracy.md).

It sees the two silhouettes and is told which guess the imagined one is of, not where the cloth lay nor where the hand
went: picks of all candidates were equally likely when it was trained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.table import Table
from nuno.estimate.futures import Futures
from nuno.estimate.hypotheses import Hypothesis
from nuno.estimate.outline_net import SIZE, log_ratios
from nuno.estimate.pick_sight import masks_of_turned
from nuno.estimate.ranking import Comparison
from nuno.numbers.blas_threads import one_blas_thread

HAND_MADE_SHARE = 0.7
LEARNED_SHARE = 1.0
FIRST_BEST = 12
"""Candidates of a stage that the network looks at, the best ones; it was trained on the best eight."""
WIDTH = 224
"""[px] Width of the whole image in which silhouettes are cut out: 0.35 of that of the images it was trained on."""
FULL_WIDTH = 640
"""[px] Width of those."""
BORDER = 1.25
"""The picture's side, beside the longer side of the seen silhouette."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The seen silhouette as the network looks at it.

    Attributes:
        camera: The camera at a width of `WIDTH`.
        hidden: (h, w) bool, pixels that do not count there.
        across: (SIZE, w) float, which columns make up a column of the picture.
        down: (SIZE, h) float, the same of rows.
        picture: (SIZE, SIZE) float, the seen cloth, 0 to 1.
        place: (4,) float, where the hand is in the picture, in sides from its middle, right and down; how long a pixel
            of the picture is where the hand is [2 cm], and in the image [5 px of 640].
    """

    camera: Camera
    hidden: np.ndarray
    across: np.ndarray
    down: np.ndarray
    picture: np.ndarray
    place: np.ndarray

    def cut(self, masks: np.ndarray) -> np.ndarray:
        """(n, SIZE, SIZE) float, the pictures of masks (n, h, w)."""
        # the part of the image that the picture shows
        shown = (np.flatnonzero(weights.any(axis=0)) for weights in (self.down, self.across))
        rows, columns = (slice(k[0], k[-1] + 1) for k in shown)
        visible = (masks[:, rows, columns] & ~self.hidden[rows, columns]).astype(np.float32)
        with one_blas_thread():
            return np.asarray(self.down[:, rows] @ visible @ self.across[:, columns].T)


def outline_of(mask: np.ndarray, hidden: np.ndarray, camera: Camera, hand: ArrayLike) -> Outline | None:
    """Prepare what the image shows; None where nothing of the cloth is left at a lower resolution.

    Args:
        mask: (h, w) bool, the cloth as it is seen.
        hidden: (h, w) bool, pixels of the hand and of what hides the cloth.
        camera: The camera of both.
        hand: (3,) the held point [m].
    """
    import cv2

    small = camera.scaled(WIDTH / camera.width)

    def shrink(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), (small.width, small.height), interpolation=cv2.INTER_AREA)

    covered = shrink(hidden) > 0.5
    share = np.where(covered, 0.0, shrink(mask & ~hidden)).astype(np.float32)
    rows, columns = np.nonzero(share > 0.5)
    if len(rows) == 0:
        return None
    middle = np.array([columns.min() + columns.max(), rows.min() + rows.max()]) / 2.0
    side = BORDER * float(max(np.ptp(columns), np.ptp(rows)) + 1)
    across, down = (_samples(m, side, n) for m, n in zip(middle, (small.width, small.height), strict=True))
    away = (np.asarray(small.project(hand)) - middle) / side
    pixel = side / SIZE
    place = (*away, 50.0 * pixel * float(small.depth_of(hand)) / small.fx, pixel * FULL_WIDTH / WIDTH / 5.0)
    with one_blas_thread():
        picture = down @ share @ across.T
    return Outline(small, covered, across, down, picture, np.array(place))


def _samples(middle: float, side: float, count: int) -> np.ndarray:
    """(SIZE, count) float32: every row is the mean of two samples, linear between pixels, nothing beyond them."""
    at = middle + ((np.arange(2 * SIZE) + 0.5) / (2 * SIZE) - 0.5) * side
    weights = np.maximum(1.0 - np.abs(at[:, None] - np.arange(count)), 0.0)
    return weights.reshape(SIZE, 2, count).mean(axis=1).astype(np.float32)


def correction(outline: Outline, futures: Futures, comparison: Comparison, table: Table, hand: ArrayLike) -> np.ndarray:
    """Return what is to be added to the log likelihood of every guess, (guesses, c) float.

    Every future is looked at as it is turned where it fits best.

    Args:
        outline: The seen silhouette.
        futures: What was compared with it.
        comparison: The comparison, still without a correction.
        table: The table.
        hand: (3,) the held point [m].
    """
    error = comparison.error("silhouette")
    by_hand = np.logaddexp.reduce(-error, axis=0)
    finite = np.isfinite(by_hand)
    added = np.where(finite, (HAND_MADE_SHARE - 1.0) * np.where(finite, by_hand, 0.0), 0.0)
    looked = finite.copy()
    if looked.shape[1] > FIRST_BEST:
        worse = np.argsort(-np.logaddexp.reduce(by_hand, axis=0), kind="stable")[FIRST_BEST:]
        looked[:, worse] = False
    guess, candidate = np.nonzero(looked)
    if len(guess):
        turn = error[:, guess, candidate].argmin(axis=0)
        angles = comparison.turns[turn]
        shifts = () if comparison.shifts is None else (comparison.shifts[turn],)
        masks = masks_of_turned(
            futures, guess * looked.shape[1] + candidate, angles, outline.camera, table, hand, *shifts
        )  # fmt: skip
        pair = [values[turn, guess, candidate] for values in (comparison.chamfer, comparison.iou)]
        of_guess = described(futures.discretisation.hypotheses, futures.discretisation.cells)[guess]
        place = np.tile(outline.place, (len(guess), 1))
        scalars = np.column_stack([np.log1p(pair[0]), pair[1], np.abs(angles), place, of_guess])
        added[guess, candidate] += LEARNED_SHARE * log_ratios(outline.picture, outline.cut(masks), scalars)
    return np.asarray(added)


def described(hypotheses: Sequence[Hypothesis], cells: int) -> np.ndarray:
    """(n, 5) float, guesses as the network is told of them: rigidity, friction, stretch, shear, mesh; about -1 to 1.

    Args:
        hypotheses: The guesses.
        cells: Cells along the longer side of their mesh.
    """
    return np.array([
        (
            np.log(h.bending_rigidity) / 2 + 4.5, h.friction, np.log(h.stretch_stiffness) - 6.0,
            np.log(h.shear_stiffness) / 2 - 2.0, cells / 20 - 1.0,
        )
        for h in hypotheses
    ])  # fmt: skip
