"""The picture of an estimate: real images above, the imagined futures of all candidates below (the paper's Fig. 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import cv2
import numpy as np

from nuno.camera.cloth_outline import ClothOutline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nuno.camera.camera import Camera
    from nuno.camera.rectangle import ClothRectangle
    from nuno.estimate.similarity import Silhouette

REAL, IMAGINED, BOTH = (232, 158, 64), (64, 125, 201), (194, 194, 188)

TITLE, GAP = 0.16, 0.05
"""Room above a panel for its title and between panels, as shares of a panel."""


class RankedPicks(Protocol):
    """An estimate of a pick as its picture takes it; `PickResult` says what each member is."""

    labels: np.ndarray
    order: np.ndarray
    scores: np.ndarray
    score_name: str
    eq1: np.ndarray
    rectangle: ClothRectangle
    camera: Camera
    grid: tuple[int, int]
    turn: float
    masks: np.ndarray
    real: Silhouette
    image_before: np.ndarray | None
    image_after: np.ndarray | None
    mask_before: np.ndarray | None
    mask_after: np.ndarray | None

    @property
    def best(self) -> tuple[Any, Any]:
        """The label of the best candidate."""

    @property
    def by_position(self) -> bool:
        """True where labels are positions [m]."""

    @property
    def fractions(self) -> np.ndarray:
        """(k, 2) float, the candidates as fractions of the sides."""

    @property
    def confidence(self) -> float:
        """The probability of the best candidate."""


def contact_sheet(result: RankedPicks) -> Figure:
    """Draw the sheet with Matplotlib, without pyplot: it opens no window and leaves no state behind."""
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

    n, m = result.grid if result.grid[0] * result.grid[1] == len(result.labels) else _near_square(len(result.labels))
    width, height = 1.75 * max(n, 4), 4.3 + 1.45 * m
    figure = Figure(figsize=(width, height), facecolor="white")
    # places in inches, for Matplotlib's layout by what it draws takes a quarter of the time
    sheet = GridSpec(
        2, 1, figure=figure, height_ratios=[3.5, 1.45 * m], hspace=0.2 / (1.75 + 0.72 * m), left=0.2 / width,
        right=1.0 - 0.2 / width, bottom=0.1 / height, top=1.0 - 0.65 / height,
    )  # fmt: skip
    above = sheet[0].subgridspec(1, 2, wspace=0.04)
    _real(figure.add_subplot(above[0]), result, after=False)
    _real(figure.add_subplot(above[1]), result, after=True)
    _imagined(figure, figure.add_subplot(sheet[1]), result, n, m)
    figure.suptitle(
        f"picked at {_name(result, result.best)}, confidence {result.confidence:.2f}; cloth "
        f"{result.rectangle.long_m * 100:.1f} x {result.rectangle.short_m * 100:.1f} cm; best future turned by "
        f"{np.degrees(result.turn):.0f} degrees\nbelow: seen outline orange, imagined blue, both pale;  "
        f"rank: {'position' if result.by_position else '(i, j)'}  {result.score_name} | eq. (1)",
        fontsize=9, y=1.0 - 0.08 / height, va="top",
    )  # fmt: skip
    return figure


def _imagined(figure: Figure, axes: Axes, result: RankedPicks, n: int, m: int) -> None:
    """All candidates' futures, in one image: axes of their own for each would take most of the sheet's time."""
    from matplotlib.patches import Rectangle

    on_grid = np.issubdtype(result.labels.dtype, np.integer)
    x0, y0, x1, y1 = _crop(result)
    high, columns = y1 - y0, x1 - x0
    # a panel is wider than high where the axes are, so that all fit and none is distorted
    place = axes.get_position()
    width, height = figure.get_size_inches() * (place.width, place.height)
    down = max(high * (1.0 + TITLE), columns * n / width * height / m)
    across = max(columns * (1.0 + GAP), down * m / height * width / n)
    down, across = int(np.ceil(down)), int(np.ceil(across))
    below = int(down - high), int((across - columns) / 2)
    image = np.full((m * down, n * across, 3), 255, np.uint8)
    for k, label in enumerate(result.labels):
        row, column = (int(label[1]), int(label[0])) if on_grid else divmod(k, n)
        x, y = column * across + below[1], row * down + below[0]
        image[y : y + high, x : x + columns] = compared(result.real.mask[y0:y1, x0:x1], result.masks[k, y0:y1, x0:x1])
        rank = int(np.nonzero(result.order == k)[0][0]) + 1
        name = _name(result, label)
        axes.text(
            x + 0.5 * columns, y - 0.03 * high, f"{rank}: {name}  {result.scores[k]:.2f} | {result.eq1[k]:.3f}",
            fontsize=6.5, weight="bold" if rank == 1 else "normal", ha="center", va="bottom",
        )  # fmt: skip
        color, line = ("#b3261e", 2.5) if rank == 1 else ("#cccccc", 0.6)
        frame = Rectangle((x - 0.5, y - 0.5), columns, high, fill=False, edgecolor=color, linewidth=line, zorder=2)
        axes.add_patch(frame).set_clip_on(False)
    _bare(axes)
    axes.set_frame_on(False)
    axes.imshow(image, interpolation="nearest")


def _name(result: RankedPicks, label: Any) -> str:
    """A candidate's label as the sheet shows it: (i, j), fractions, or a position in cm."""
    a, b = label
    if result.by_position:
        return f"({100.0 * a:.0f}, {100.0 * b:.0f}) cm"
    return f"({a}, {b})" if np.issubdtype(result.labels.dtype, np.integer) else f"({a:.2f}, {b:.2f})"


def _near_square(count: int) -> tuple[int, int]:
    columns = int(np.ceil(np.sqrt(count)))
    return columns, -(-count // columns)


def _bare(axes: Axes) -> None:
    axes.set(xticks=[], yticks=[])


def _crop(result: RankedPicks) -> tuple[int, int, int, int]:
    """The part of the small image in which any silhouette is, with a margin."""
    seen = result.masks.any(axis=0) | result.real.mask
    ys, xs = np.nonzero(seen)
    h, w = seen.shape
    return max(xs.min() - 5, 0), max(ys.min() - 5, 0), min(xs.max() + 6, w), min(ys.max() + 6, h)


def compared(real: np.ndarray, imagined: np.ndarray) -> np.ndarray:
    """Two silhouettes in one image: orange where only the seen one is, blue where only the imagined one, else both."""
    colors = np.array([(255, 255, 255), REAL, IMAGINED, BOTH], np.uint8)
    return colors[real + 2 * imagined]


def _shrunk(image: np.ndarray, axes: Axes) -> np.ndarray:
    """An image no larger than axes are in pixels, by areas in OpenCV: Matplotlib's filter takes ten times as long."""
    height, width = image.shape[:2]
    there = axes.bbox  # [pixels]
    share = min(there.width / width, there.height / height, 1.0)
    return cv2.resize(image, (round(share * width), round(share * height)), interpolation=cv2.INTER_AREA)


def _real(axes: Axes, result: RankedPicks, *, after: bool) -> None:
    """An image with the cloth's outline in it; before, also the grid of candidates."""
    image = result.image_after if after else result.image_before
    mask = result.mask_after if after else result.mask_before
    _bare(axes)
    if image is None:
        image = np.full((result.camera.height, result.camera.width, 3), 255, np.uint8)
        if mask is not None:
            image[mask] = 200
    axes.imshow(
        _shrunk(image, axes), extent=(-0.5, image.shape[1] - 0.5, image.shape[0] - 0.5, -0.5), interpolation="nearest"
    )
    axes.set_title("after" if after else "before", fontsize=9)
    if mask is not None and mask.any() and not mask.all():
        axes.contour(mask.astype(float), levels=[0.5], colors=["#00e5ff"], linewidths=1.0)
    if not after:
        corners = result.rectangle.corners
        uv = result.fractions
        points = corners[0] + uv[:, :1] * (corners[1] - corners[0]) + uv[:, 1:] * (corners[3] - corners[0])
        pixels = result.camera.project(points)
        axes.plot(
            pixels[:, 0], pixels[:, 1], ".", color="white", markersize=4, markeredgecolor="black", markeredgewidth=0.4
        )
        if isinstance(result.rectangle, ClothOutline):
            around = result.camera.project(np.concatenate([result.rectangle.outline, result.rectangle.outline[:1]]))
            axes.plot(around[:, 0], around[:, 1], "-", color="#ffb300", linewidth=0.8)
            ring = result.camera.project(np.concatenate([corners, corners[:1]]))
            axes.plot(ring[:, 0], ring[:, 1], ":", color="white", linewidth=0.8)
        u, v = pixels[result.order[0]]
        axes.plot(u, v, "o", color="none", markeredgecolor="#b3261e", markersize=10, markeredgewidth=2)
        for k, name in ((0, "C00"), (1, "CI"), (3, "CJ")):
            axes.annotate(name, tuple(result.camera.project(corners[k])), color="white", fontsize=8, weight="bold")
    axes.set(xlim=(-0.5, result.camera.width - 0.5), ylim=(result.camera.height - 0.5, -0.5))
