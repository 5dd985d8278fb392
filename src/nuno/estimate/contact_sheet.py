"""The picture of an estimate: real images above, the imagined futures of all candidates below (the paper's Fig. 9).

OpenCV draws it: loading Matplotlib and drawing the same with it takes 1.4 s of CPU time, this 0.05 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import cv2
import numpy as np

from nuno.camera.cloth_outline import ClothOutline

if TYPE_CHECKING:
    from nuno.camera.camera import Camera
    from nuno.camera.rectangle import ClothRectangle
    from nuno.estimate.similarity import Silhouette

Colour = tuple[int, int, int]

REAL, IMAGINED, BOTH = (232, 158, 64), (64, 125, 201), (194, 194, 188)
BLACK, WHITE, FRAME, BEST, SEEN, TAKEN = (
    (0, 0, 0), (255, 255, 255), (204, 204, 204), (179, 38, 30), (0, 229, 255), (255, 179, 0),
)  # fmt: skip
"""In RGB; ``SEEN`` is the cloth's outline in the image, ``TAKEN`` that of a cloth that is taken by its outline."""

COLUMN, MARGIN = 192, 12
"""[px] Width of a panel with the room beside it, and what is left free at the sheet's edges and between panels."""
TITLE, HEADING, LINE = 56, 24, 20
"""[px] Heights of the sheet's title, of an image's and of a panel's."""
LARGE, SMALL = 0.46, 0.4
"""Scales of the font: of titles, and of panels."""
SHIFT = 4
"""Bits of a pixel's fraction in what OpenCV draws."""


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


def contact_sheet(result: RankedPicks) -> np.ndarray:
    """Draw the sheet.

    Returns:
        (h, w, 3) uint8, RGB.
    """
    width = _width(result)
    images = [_real(result, (width - 3 * MARGIN) // 2, after=after) for after in (False, True)]
    boxes = panel_boxes(result)
    sheet = np.full((int((boxes[:, 1] + boxes[:, 3]).max()) + MARGIN, width, 3), 255, np.uint8)
    for k, line in enumerate(_title(result)):
        _write(sheet, line, (0.5 * width, 22 + 20 * k), LARGE, centred=True)
    for k, (name, image) in enumerate(zip(("before", "after"), images, strict=True)):
        left, top = MARGIN + k * (image.shape[1] + MARGIN), TITLE + HEADING
        sheet[top : top + image.shape[0], left : left + image.shape[1]] = image
        _write(sheet, name, (left + 0.5 * image.shape[1], top - 7), LARGE, centred=True)
    x0, y0, x1, y1 = _crop(result)
    for k, (x, y, w, h) in enumerate(boxes.tolist()):
        panel = compared(result.real.mask[y0:y1, x0:x1], result.masks[k, y0:y1, x0:x1])
        sheet[y : y + h, x : x + w] = _resized(panel, (w, h))
        rank = int(np.nonzero(result.order == k)[0][0]) + 1
        is_best = rank == 1
        text = f"{rank}: {_name(result, result.labels[k])}  {result.scores[k]:.2f} | {result.eq1[k]:.3f}"
        _write(sheet, text, (x + 0.5 * w, y - 7), SMALL, bold=is_best, centred=True)
        out = 2 if is_best else 1
        corners = (x - out, y - out), (x + w + out - 1, y + h + out - 1)
        cv2.rectangle(sheet, *corners, BEST if is_best else FRAME, 3 if is_best else 1)
    return sheet


def panel_boxes(result: RankedPicks) -> np.ndarray:
    """Return where the candidates' panels are: as their points in a grid, other points in rows.

    Returns:
        (k, 4) int, left, top, width and height [px].
    """
    n = _columns(result)
    x0, y0, x1, y1 = _crop(result)
    step = (_width(result) - 2 * MARGIN) / n
    share = min((step - 2 * MARGIN) / (x1 - x0), 0.75 * COLUMN / (y1 - y0))
    w, h = max(round(share * (x1 - x0)), 1), max(round(share * (y1 - y0)), 1)
    image = round((_width(result) - 3 * MARGIN) // 2 / result.camera.width * result.camera.height)
    if np.issubdtype(result.labels.dtype, np.integer):
        column, row = np.asarray(result.labels, dtype=int).T
    else:
        row, column = np.divmod(np.arange(len(result.labels)), n)
    left = np.round(MARGIN + (column + 0.5) * step - 0.5 * w).astype(int)
    top = TITLE + HEADING + image + MARGIN + row * (h + LINE + MARGIN) + LINE
    return np.stack(np.broadcast_arrays(left, top, w, h), axis=1)


def _width(result: RankedPicks) -> int:
    """[px] of the sheet."""
    return COLUMN * max(_columns(result), 4) + 2 * MARGIN


def _columns(result: RankedPicks) -> int:
    """Panels beside each other: as many as the grid has candidates, else as many as make the sheet near square."""
    n, m = result.grid
    return n if n * m == len(result.labels) else int(np.ceil(np.sqrt(len(result.labels))))


def _title(result: RankedPicks) -> tuple[str, str]:
    return (
        f"picked at {_name(result, result.best)}, confidence {result.confidence:.2f}; cloth "
        f"{result.rectangle.long_m * 100:.1f} x {result.rectangle.short_m * 100:.1f} cm; best future turned by "
        f"{np.degrees(result.turn):.0f} degrees",
        "below: seen outline orange, imagined blue, both pale;  "
        f"rank: {'position' if result.by_position else '(i, j)'}  {result.score_name} | eq. (1)",
    )


def _name(result: RankedPicks, label: Any) -> str:
    """A candidate's label as the sheet shows it: (i, j), fractions, or a position in cm."""
    a, b = label
    if result.by_position:
        return f"({100.0 * a:.0f}, {100.0 * b:.0f}) cm"
    return f"({a}, {b})" if np.issubdtype(result.labels.dtype, np.integer) else f"({a:.2f}, {b:.2f})"


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


def _real(result: RankedPicks, width: int, *, after: bool) -> np.ndarray:
    """An image of some width with the cloth's outline in it; before, also the candidates."""
    image = result.image_after if after else result.image_before
    mask = result.mask_after if after else result.mask_before
    if image is None:
        image = np.full((result.camera.height, result.camera.width, 3), 255, np.uint8)
        if mask is not None:
            image[mask] = 200
    share = width / image.shape[1]
    size = (width, max(round(share * image.shape[0]), 1))
    drawn = _resized(image, size)
    if mask is not None and mask.any() and not mask.all():
        outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for outline in outlines:
            _polyline(drawn, share * (outline[:, 0] + 0.5) - 0.5, SEEN)
    if not after:
        _draw_candidates(drawn, result, share)
    cv2.rectangle(drawn, (0, 0), (size[0] - 1, size[1] - 1), BLACK, 1)
    return drawn


def _resized(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """An image of another width and height."""
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA if size[0] < image.shape[1] else cv2.INTER_LINEAR)


def _draw_candidates(image: np.ndarray, result: RankedPicks, share: float) -> None:
    """Draw the candidates, the cloth's frame and the answer into the image before, which was scaled by a share."""
    corners = result.rectangle.corners
    uv = result.fractions
    points = corners[0] + uv[:, :1] * (corners[1] - corners[0]) + uv[:, 1:] * (corners[3] - corners[0])
    pixels = share * (result.camera.project(points) + 0.5) - 0.5
    if isinstance(result.rectangle, ClothOutline):
        _polyline(image, share * result.camera.project(result.rectangle.outline), TAKEN)
        _polyline(image, share * result.camera.project(corners), WHITE)
    for point in pixels:
        _circle(image, point, 2.4, BLACK)
        _circle(image, point, 1.4, WHITE)
    _circle(image, pixels[result.order[0]], 8.0, BEST, 2)
    for k, name in ((0, "C00"), (1, "CI"), (3, "CJ")):
        x, y = share * result.camera.project(corners[k])
        _write(image, name, (x + 4, y - 4), LARGE, colour=WHITE, bold=True)


def _write(
    image: np.ndarray, text: str, at: tuple[float, float], scale: float, *, colour: Colour = BLACK, bold: bool = False,
    centred: bool = False,
) -> None:  # fmt: skip
    """Write a line from a baseline's left end on, or about its middle."""
    font, thickness = cv2.FONT_HERSHEY_SIMPLEX, 2 if bold else 1
    left = at[0] - (0.5 * cv2.getTextSize(text, font, scale, thickness)[0][0] if centred else 0.0)
    cv2.putText(image, text, (round(left), round(at[1])), font, scale, colour, thickness, cv2.LINE_AA)


def _fixed(points: np.ndarray) -> np.ndarray:
    """Points [px] as the whole numbers that OpenCV takes; those far outside are brought nearer."""
    return np.round(np.clip(np.nan_to_num(points), -1e5, 1e5) * (1 << SHIFT)).astype(np.int32)


def _polyline(image: np.ndarray, points: np.ndarray, colour: Colour) -> None:
    cv2.polylines(image, [_fixed(points)[:, None]], True, colour, 1, cv2.LINE_AA, SHIFT)


def _circle(image: np.ndarray, at: np.ndarray, radius: float, colour: Colour, thickness: int = cv2.FILLED) -> None:
    x, y = _fixed(at).tolist()
    cv2.circle(image, (x, y), round(radius * (1 << SHIFT)), colour, thickness, cv2.LINE_AA, SHIFT)
