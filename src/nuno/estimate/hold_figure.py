"""The picture of an estimate of a hold: silhouettes above, candidates on the flat garment's layers below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from nuno.estimate.contact_sheet import compared
from nuno.estimate.hold_views import hold_masks
from nuno.mesh.sewn import BACK, FRONT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nuno.estimate.hold_views import HoldView
    from nuno.estimate.imagined_holds import Holds

SHOWN = 4
"""Candidates whose silhouettes are drawn, the best ones."""


class HeldGarment(Protocol):
    """An estimate of a hold as its picture takes it; `HoldResult` says what each member is."""

    @property
    def holds(self) -> Holds:
        """The garment as it hangs from every candidate."""

    @property
    def order(self) -> np.ndarray:
        """(k,) int, candidates from best to worst."""

    @property
    def probabilities(self) -> np.ndarray:
        """(k,) float by candidate."""

    @property
    def hand(self) -> np.ndarray:
        """(3,) the held point [m]."""

    @property
    def matches(self) -> np.ndarray:
        """(k, 2) int by candidate, guess and turn."""

    @property
    def turns(self) -> np.ndarray:
        """(t,) float [rad]."""

    @property
    def views(self) -> tuple[HoldView, ...]:
        """The images, with what was seen in them."""

    @property
    def best(self) -> tuple[float, float, str]:
        """Place in the flat garment [m], and the layer."""

    @property
    def confidence(self) -> float:
        """The probability of the best candidate."""

    @property
    def confidence_up_to_symmetry(self) -> float:
        """That of the best group."""


def hold_figure(result: HeldGarment) -> Figure:
    """Draw the picture with Matplotlib, without pyplot: it opens no window and leaves no state behind."""
    from matplotlib.figure import Figure

    garment, count = result.holds.garment, min(SHOWN, len(result.order))
    figure = Figure(figsize=(2.4 * max(count, 3), 2.5 * len(result.views) + 3.6), layout="constrained")
    grid = figure.add_gridspec(len(result.views) + 1, 1, height_ratios=[2.5] * len(result.views) + [3.2])
    best = [int(k) for k in result.order[:count]]
    pairs = [(int(result.matches[k, 0]), k) for k in best]
    angles = [float(result.turns[result.matches[k, 1]]) for k in best]
    for row, seen in enumerate(result.views):
        masks = hold_masks(result.holds, pairs, angles, seen.camera, result.hand)
        columns_shown, rows_shown = _box(masks.any(axis=0) | seen.real.mask)
        columns = grid[row].subgridspec(1, count)
        for rank, k in enumerate(best):
            axes = figure.add_subplot(columns[rank])
            axes.imshow(compared(seen.real.mask, masks[rank])[rows_shown, columns_shown], interpolation="nearest")
            axes.set(xticks=[], yticks=[])
            axes.set_title(f"{rank + 1}: {100.0 * result.probabilities[k]:.0f} %", fontsize=8)
    layers = (FRONT, BACK) if garment.layers == 2 else (FRONT,)
    below = grid[len(result.views)].subgridspec(1, len(layers))
    for column, layer in enumerate(layers):
        _flat(figure.add_subplot(below[column]), result, layer)
    x, y, layer_name = result.best
    figure.suptitle(
        f"{garment.name} held at ({100.0 * x:.0f}, {100.0 * y:.0f}) cm, {layer_name}; confidence "
        f"{result.confidence:.2f}, up to symmetry {result.confidence_up_to_symmetry:.2f}\n"
        "seen orange, imagined blue, both pale", fontsize=9,
    )  # fmt: skip
    return figure


def _flat(axes: Axes, result: HeldGarment, layer: int) -> None:
    """One layer of the flat garment, seen from outside, with the candidates on it, as large as they are likely."""
    garment, held = result.holds.garment, result.holds.candidates
    side = 1.0 if layer == FRONT else -1.0  # from behind, the wearer's left is on the left
    x, y = 100.0 * side * garment.rest[:, 0], 100.0 * garment.rest[:, 1]
    axes.triplot(x, y, garment.faces[garment.face_layer == layer], color="#b8c4d0", linewidth=0.4)
    own = garment.layer[held] != (BACK if layer == FRONT else FRONT)
    size = 8.0 + 220.0 * result.probabilities
    axes.scatter(x[held[own]], y[held[own]], s=size[own], c="#1f77b4", alpha=0.8, linewidths=0, zorder=3)
    if own[result.order[0]]:
        at = held[result.order[0]]
        axes.plot(x[at], y[at], "o", color="none", markeredgecolor="#b3261e", markersize=15, markeredgewidth=2)
    axes.set_aspect("equal")
    axes.set_title("front" if layer == FRONT else "back, from behind", fontsize=8)
    axes.tick_params(labelsize=6)
    axes.set_xlabel("x [cm]" if layer == FRONT else "-x [cm]", fontsize=7)


def _box(mask: np.ndarray) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return slice(max(int(columns[0]) - 4, 0), int(columns[-1]) + 5), slice(max(int(rows[0]) - 4, 0), int(rows[-1]) + 5)
