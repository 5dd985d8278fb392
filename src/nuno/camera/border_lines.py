"""Straight edges in an image near where a table's border should be: candidates for each of its sides.

A camera or a table that is told a little wrongly puts the border some tens of pixels from where it is seen. Beside it
there may be other straight edges: the lower edge of the top's face, a shadow, a cloth that lies along it. So several
lines are found for each side, and what fits together is asked later (`nuno.camera.camera_of_table`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from nuno.camera.camera import Camera

REACH = 0.08
"""Of the image's width: so far from where a side should be its line is looked for."""
SHORTEST = 0.12
"""Of the image's width: of a shorter side in the image too little is seen."""
CONTRAST = 4.0
"""Levels between both sides of an edge from which on it is one: noise of three levels leaves 1.5 where `ALONG` points
are averaged."""
ALONG = 5
"""Points of a side that are averaged."""
SEEN_SHARE = 0.5
"""Of a side must lie on a line."""
LINES = 4
"""Of each side at most."""
APART = 5.0
"""[px] between the lines of one side."""
STEEP = 0.12
"""A line is turned against its side by no more than this [rad]."""
EVERY = 4.0
"""[px] between points of a side that are looked at."""
INNER = 0.03
"""Of a side at its ends are not looked at: corners are another side's, too."""
MARGIN = 8
"""[px] at the image's border that are not looked at."""


@dataclass(frozen=True, eq=False)
class Line:
    """A straight edge.

    Attributes:
        ends: (2, 2) float, two points of it [px], across from the ends of what is seen of the side.
        share: Of the side on it.
    """

    ends: np.ndarray
    share: float


@dataclass(frozen=True, eq=False)
class SideLines:
    """Lines found near one side.

    Attributes:
        shares: (2,) float, where the part of the side that is seen begins and ends, from 0 at its first end to 1.
        lines: The best first.
    """

    shares: np.ndarray
    lines: tuple[Line, ...]


def lines_near(image: np.ndarray, begin: np.ndarray, end: np.ndarray, camera: Camera) -> SideLines | None:
    """Return lines near the image of a side; None where too little of that is in the image.

    Args:
        image: (h, w, 3) float32.
        begin: (3,) float, one end of the side [m].
        end: The other.
        camera: The camera as it is told.
    """
    shares = _in_image(begin, end, camera)
    if shares is None:
        return None
    pixels = camera.project(begin + shares[:, None] * (end - begin))
    reach = int(REACH * camera.width)
    length = float(np.linalg.norm(pixels[1] - pixels[0]))
    share = np.linspace(0.0, 1.0, int(length / EVERY) + 1)
    points = pixels[0] + share[:, None] * (pixels[1] - pixels[0])
    along = (pixels[1] - pixels[0]) / length
    normal = np.array([-along[1], along[0]])
    edges, known = _edges(image, points, normal, reach)
    lines: list[Line] = []
    offsets = _offsets(reach)
    score, whole = _score(edges, known, share, offsets, length)
    for _ in range(LINES):
        a, b = np.unravel_index(int(score.argmax()), score.shape)
        if score[a, b] < SEEN_SHARE:
            break
        at = np.array([offsets[a], offsets[b]], dtype=float)
        ends = pixels + _refined(edges, share, at, reach)[:, None] * normal
        lines.append(Line(ends, float(score[a, b])))
        near = (np.abs(offsets[:, None] - at[0]) < APART) & (np.abs(offsets[None] - at[1]) < APART)
        score = np.where(near | ~whole, 0.0, score)
    return SideLines(shares, tuple(lines))


def _in_image(begin: np.ndarray, end: np.ndarray, camera: Camera) -> np.ndarray | None:
    """(2,) float, shares of a side between which it is well inside of the image; None where that is too little."""
    share = np.linspace(0.0, 1.0, 401)
    pixels = camera.project(begin + share[:, None] * (end - begin))
    size = np.array([camera.width, camera.height])
    with np.errstate(invalid="ignore"):
        inside = ((pixels > MARGIN) & (pixels < size - 1 - MARGIN)).all(axis=1)
    seen = np.flatnonzero(inside)  # one piece: a rectangle is convex
    if len(seen) < 2 or np.linalg.norm(pixels[seen[-1]] - pixels[seen[0]]) < SHORTEST * camera.width:
        return None
    begins, ends = share[seen[0]], share[seen[-1]]
    inner = INNER * (ends - begins)
    return np.array([begins + inner, ends - inner])


def _edges(image: np.ndarray, points: np.ndarray, normal: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour contrast (k, 2 reach + 1) across a side at offsets along its normal, and where the image goes on."""
    offsets = np.arange(-reach - 3, reach + 4)
    at = (points[:, None] + offsets[None, :, None] * normal).astype(np.float32)
    values: np.ndarray = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    values = cv2.blur(values.reshape(len(points), len(offsets), 3), (1, ALONG))
    width = values.shape[1]
    before, after = ((values[:, k : width - 6 + k] + values[:, k + 1 : width - 5 + k]) / 2 for k in (1, 4))
    contrast = np.linalg.norm(after - before, axis=2)
    inner = at[:, 3:-3]
    known = ((inner > 1) & (inner < np.array([image.shape[1] - 2, image.shape[0] - 2]))).all(axis=2)
    return np.where(known, contrast, 0.0), known


def _offsets(reach: int) -> np.ndarray:
    return np.arange(-reach, reach + 1, 2)


def _score(
    edges: np.ndarray, known: np.ndarray, share: np.ndarray, offsets: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """The share of a side on the line between an offset at one end and one at the other, (n, n) each; and which count.

    A point is on it where the strongest edge around is: so a broad or a strong edge counts no more than a fine one.
    """
    strongest = cv2.dilate(edges.astype(np.float32), np.ones((1, 7)))
    found = ((edges >= strongest) & (edges > CONTRAST)).astype(np.float32)
    crests = np.asarray(cv2.dilate(found, np.ones((1, 3))))
    reach = (edges.shape[1] - 1) // 2
    a, b = np.meshgrid(offsets, offsets, indexing="ij")
    whole = np.abs(a - b) < STEEP * length
    score = np.zeros(a.shape)
    row = np.arange(len(share))
    columns = np.round(a[whole][:, None] * (1.0 - share) + b[whole][:, None] * share).astype(int) + reach
    inside = known[row, columns]
    hit = crests[row, columns] * inside
    score[whole] = np.where(inside.mean(axis=1) > 0.6, hit.sum(axis=1) / np.maximum(inside.sum(axis=1), 1), 0.0)
    return score, whole


def _refined(edges: np.ndarray, share: np.ndarray, at: np.ndarray, reach: int) -> np.ndarray:
    """(2,) float, offsets at both ends of the line through the crests beside it, to a fraction of a pixel."""
    row = np.arange(len(share))
    for width in (3, 2, 2):
        middle = at[0] * (1.0 - share) + at[1] * share
        nearby = np.round(middle)[:, None].astype(int) + np.arange(-width, width + 1)
        column = np.clip(nearby + reach, 0, edges.shape[1] - 1)
        weights = np.maximum(edges[row[:, None], column] - 0.5 * CONTRAST, 0.0)
        mass = weights.sum(axis=1)
        good = mass > 0.0
        if good.sum() < 3:
            return at
        found = (weights * nearby).sum(axis=1)[good] / mass[good]
        design = np.stack([1.0 - share[good], share[good]], axis=1)
        off = np.abs(found - design @ at)
        trust = 1.0 / (1.0 + (off / max(1.5 * float(np.median(off)), 0.3)) ** 2)
        at = np.linalg.lstsq(design * trust[:, None] ** 0.5, found * trust**0.5, rcond=None)[0]
    return np.asarray(at)
