"""Layers of a folded cloth: which parts lie under which, unseen by a camera above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.files.html_table import html_table
from nuno.validation import checked, finite_array, index_array, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEEP = 1e-3
"""Faces whose shadow on the ground is less than this share of them stand upright and count as no layer."""
SAME = 1e-6
"""Points of the cloth whose fractions differ by less are one: rounding on a border that faces share."""
PIXELS = 240
"""Of the picture of the cloth spread flat, along either side."""


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of a cloth over a grid on the ground, from the top down.

    Attributes:
        x: (c,) float, the grid's columns [m].
        y: (r,) float, the grid's rows [m].
        count: (r, c) int, how many layers lie over each point.
        height: (r, c, most) float, their heights [m], the top one first; NaN where there are no more.
        material: (r, c, most, 2) float, which point of the cloth each is, as fractions (u, v) of its sides; NaN where
            there are no more.
        upward: (r, c, most) bool, whether that side is up which was up when the cloth lay flat.
    """

    x: np.ndarray
    y: np.ndarray
    count: np.ndarray
    height: np.ndarray
    material: np.ndarray
    upward: np.ndarray

    @property
    def area(self) -> list[float]:
        """Ground area [m2] under exactly one layer, two, three ..."""
        cell = (self.x[1] - self.x[0]) * (self.y[1] - self.y[0])
        return [float((self.count == n).sum() * cell) for n in range(1, self.height.shape[-1] + 1)]

    @checked
    def over(self, u: float, v: float) -> list[tuple[float, float]]:
        """Return the points (u, v) of the cloth that lie over the point (u, v), the top one first.

        The nearest sample of the grid answers, so to about the grid's step.
        """
        away = np.linalg.norm(self.material - (u, v), axis=-1)
        row, column, layer = np.unravel_index(np.nanargmin(away), away.shape)
        return [(float(a), float(b)) for a, b in self.material[row, column, :layer]]

    def _repr_html_(self) -> str:
        rows = [(n, f"{1e4 * area:.1f}") for n, area in enumerate(self.area, 1)]
        return html_table("Layers", rows, columns=("layers", "area [cm2]"), figure=self.figure())

    def figure(self) -> Figure:
        """Two maps: how many layers lie where, from above; and, on the cloth spread flat, how deep each part lies."""
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch

        deepest = self.height.shape[-1]
        figure = Figure(figsize=(9.0, 4.2), layout="constrained", facecolor="white")
        left, right = figure.subplots(1, 2)
        extent = (self.x[0], self.x[-1], self.y[0], self.y[-1])
        shown = left.imshow(
            np.where(self.count > 0, self.count, np.nan), origin="lower", extent=extent, vmin=0.5,
            vmax=max(deepest, 2) + 0.5, cmap=_colours(max(deepest, 2)), interpolation="nearest",
        )  # fmt: skip
        figure.colorbar(shown, ax=left, ticks=range(1, max(deepest, 2) + 1), label="layers", shrink=0.7)
        left.set(title="from above: layers over the table", xlabel="x [m]", ylabel="y [m]", aspect="equal")
        names, colours, picture = self._on_the_cloth(_colours(max(deepest, 2)))
        right.imshow(picture, origin="lower", extent=(0, 1, 0, 1), aspect="auto", interpolation="nearest")
        right.set(title="on the cloth: which parts lie under which", xlabel="u", ylabel="v", xlim=(0, 1), ylim=(0, 1))
        parts = [Patch(facecolor=colour, label=name) for name, colour in zip(names, colours, strict=True)]
        right.legend(handles=parts, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2)
        return figure

    def _on_the_cloth(self, colours: Any) -> tuple[list[str], list[tuple[float, float, float]], np.ndarray]:
        """Return what parts of the cloth there are, their colours, and a picture (h, w, 3) of the cloth spread flat.

        A pixel has the colour of the grid's nearest sample. It is white where none is near, as on what stands upright.
        """
        from scipy.spatial import cKDTree

        there = np.isfinite(self.material[..., 0])
        kinds = 2 * np.nonzero(there)[2] + ~self.upward[there]
        names, shades, palette = [], [], np.ones((int(kinds.max(initial=0)) + 1, 3))
        for kind in np.unique(kinds):
            name = "seen from above" if kind < 2 else f"under {kind // 2}"
            colour = np.array(colours(int(kind) // 2)[:3])
            palette[kind] = 0.5 + 0.5 * colour if kind % 2 else colour  # paler: turned over
            names.append(f"{name}, turned over" if kind % 2 else name)
            red, green, blue = palette[kind].tolist()
            shades.append((red, green, blue))
        picture = np.ones((PIXELS, PIXELS, 3))
        if len(kinds):
            centres = (np.arange(PIXELS) + 0.5) / PIXELS
            places = np.stack(np.meshgrid(centres, centres), axis=-1)
            away, nearest = cKDTree(self.material[there]).query(places)
            near = away < 3.0 / np.sqrt(len(kinds))
            picture[near] = palette[kinds[nearest[near]]]
        return names, shades, picture


def find_layers(vertices: np.ndarray, faces: np.ndarray, fractions: np.ndarray, *, step: float = 0.004) -> Layers:
    """Count the layers of a cloth over the points of a grid.

    A vertical line through each point meets the faces over it; where faces meet, they count once.

    Args:
        vertices: (n, 3) [m].
        faces: (m, 3) int, anticlockwise seen from the side that was up when the cloth lay flat.
        fractions: (n, 2), each vertex's place (u, v) on the flat cloth.
        step: Distance of the grid's points [m].

    Raises:
        InvalidInputError: not finite, or shapes that do not fit.
    """
    points = finite_array("vertices", vertices, ("n", 3))
    triangles = index_array("faces", faces, ("m", 3), low=0, high=len(points))
    uv = finite_array("fractions", fractions, (len(points), 2))
    width = number("step", step, low=1e-6)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    x, y = (np.arange(a - 1.5 * width, b + 2.5 * width, width) for a, b in zip(low, high, strict=True))
    if len(x) * len(y) > 4_000_000:
        raise InvalidInputError(f"a step of {width} m makes a grid of {len(x)} x {len(y)} points; take a larger one")
    cells, heights, places, ups = _crossings(points, triangles, uv, x, y)
    order = np.lexsort((-heights, cells))
    cells, heights, places, ups = cells[order], heights[order], places[order], ups[order]
    # a line through an edge or vertex meets all faces there, at one point of the cloth
    again = (np.diff(cells) == 0) & (np.abs(np.diff(places, axis=0)) < SAME).all(axis=1)
    once = np.append(True, ~again)[: len(cells)]
    cells, heights, places, ups = cells[once], heights[once], places[once], ups[once]
    count = np.bincount(cells, minlength=len(x) * len(y))
    rank = np.arange(len(cells)) - np.repeat(np.cumsum(count) - count, count)
    deepest = max(int(count.max(initial=0)), 1)
    height = np.full((len(x) * len(y), deepest), np.nan)
    material = np.full((len(x) * len(y), deepest, 2), np.nan)
    upward = np.zeros((len(x) * len(y), deepest), dtype=bool)
    height[cells, rank], material[cells, rank], upward[cells, rank] = heights, places, ups
    shape = (len(y), len(x))
    return Layers(
        x, y, count.reshape(shape), height.reshape(*shape, deepest), material.reshape(*shape, deepest, 2),
        upward.reshape(*shape, deepest),
    )  # fmt: skip


def _crossings(
    points: np.ndarray, triangles: np.ndarray, uv: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cells (k,), heights (k,), places (k, 2) and sides (k,) where the grid's vertical lines meet faces."""
    cells, heights, places, ups = [], [], [], []
    width = x[1] - x[0]
    for triangle in triangles:
        a, b, c = points[triangle]
        e, f = b - a, c - a
        normal = np.cross(e, f)
        if abs(normal[2]) <= STEEP * np.linalg.norm(normal):
            continue
        left, lower = np.minimum(np.minimum(a, b), c)[:2]
        right, upper = np.maximum(np.maximum(a, b), c)[:2]
        i = np.arange(max(int((left - x[0]) / width), 0), int((right - x[0]) / width) + 1)
        j = np.arange(max(int((lower - y[0]) / width), 0), int((upper - y[0]) / width) + 1)
        dx, dy = np.meshgrid(x[i] - a[0], y[j] - a[1])
        s = (dx * f[1] - dy * f[0]) / normal[2]
        t = (dy * e[0] - dx * e[1]) / normal[2]
        inside = (s >= -SAME) & (t >= -SAME) & (s + t <= 1.0 + SAME)
        if not inside.any():
            continue
        s, t = s[inside], t[inside]
        weights = np.stack([1.0 - s - t, s, t], axis=1)
        cells.append((j[:, None] * len(x) + i)[inside])
        heights.append(weights @ points[triangle][:, 2])
        places.append(weights @ uv[triangle])
        ups.append(np.full(len(s), normal[2] > 0.0))
    if not cells:
        return np.zeros(0, int), np.zeros(0), np.zeros((0, 2)), np.zeros(0, bool)
    return tuple(np.concatenate(part) for part in (cells, heights, places, ups))  # type: ignore[return-value]


def _colours(count: int):  # type: ignore[no-untyped-def]
    from matplotlib.colors import ListedColormap

    palette = ["#4c8bd0", "#e09a3e", "#5aa469", "#b5564f", "#8a6bb1", "#7f7f7f"]
    return ListedColormap([palette[k % len(palette)] for k in range(count)])
