"""The picture of the hands' paths in a fold: from above, over the cloth as it lay before, and in height over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.camera.rectangle import ClothRectangle
    from nuno.estimate.imagined_fold import ImaginedFold


class ShownFold(Protocol):
    """A replayed fold as the picture of the hands takes it; `FoldResult` says what each member is."""

    times: np.ndarray
    faces: np.ndarray
    hands_at: np.ndarray
    rectangle: ClothRectangle
    fold: ImaginedFold

    @property
    def final(self) -> np.ndarray:
        """(n, 3) float [m], the cloth at the last frame."""


def hands_figure(result: ShownFold) -> Figure:
    """Draw the paths with Matplotlib, without pyplot; lines are thick while a hand holds the cloth."""
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    table = np.asarray(result.rectangle.corners)[:, 2].mean()
    figure = Figure(figsize=(9.0, 3.9), layout="constrained", facecolor="white")
    above, heights = figure.subplots(1, 2)
    outline = np.vstack([result.rectangle.corners, result.rectangle.corners[:1]])
    above.plot(*outline[:, :2].T, color="0.6", linewidth=1.0, label="cloth before")
    folded = PolyCollection(result.final[:, :2][result.faces], facecolor="0.88", edgecolor="0.88", label="cloth folded")
    above.add_collection(folded)
    for hand in range(result.hands_at.shape[1]):
        path, color = result.hands_at[:, hand], f"C{hand}"
        line = "-" if hand == 0 else "--"  # hands that move alike have one height
        above.plot(*path[:, :2].T, color=color, linewidth=1.0, label=f"hand {hand}")
        heights.plot(result.times, 1000.0 * (path[:, 2] - table), line, color=color, linewidth=1.0)
        for hold in result.fold.holds:
            if hold.hand == hand and hold.held_cloth:
                held = (result.times >= hold.begin) & (result.times <= hold.end)
                above.plot(*path[held, :2].T, color=color, linewidth=2.5)
                heights.plot(result.times[held], 1000.0 * (path[held, 2] - table), line, color=color, linewidth=2.5)
        above.plot(*path[0, :2], "o", color=color, markersize=6)
        above.plot(*path[-1, :2], "x", color=color, markersize=7)
    above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="from above, from the dot to the cross")
    heights.set(xlabel="time [s]", ylabel="height above the cloth [mm]", title="thick while the hand holds the cloth")
    above.legend(fontsize=8, loc="center left")
    return figure
