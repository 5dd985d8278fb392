"""Patterns of garments: the outlines of flat panels, and which of their sides are sewn to each other.

A pattern's panels lie in the plane, x to the wearer's left and y up. Where a garment is symmetric, sides are those of
its half x >= 0, anticlockwise from the middle below to the middle above. The shapes are of our own drawing, with
nominal measures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

SEAM, OPEN = "seam", "open"
ARC_STEP = 0.15
"""[rad] between points of a round side."""

Side = tuple[np.ndarray, str]


@dataclass(frozen=True)
class Pattern:
    """A garment's panels.

    Attributes:
        panels: Of each panel its sides, which follow each other: a line (k, 2) [m] and `SEAM` or `OPEN`. Two panels are
            sewn to each other along their seams, which are equal; of one panel every side is open.
        mirrored: Whether the sides are those of one half, x >= 0, from (0, y) to (0, y'); else they go all around.
    """

    panels: tuple[tuple[Side, ...], ...]
    mirrored: bool


def _line(*points: tuple[float, float]) -> np.ndarray:
    return np.array(points, dtype=float)


def _arc(centre: tuple[float, float], radii: tuple[float, float], start: float, end: float) -> np.ndarray:
    """Return points (k, 2) of an ellipse's arc between two angles [rad]."""
    angles = np.linspace(start, end, max(2, int(np.ceil(abs(end - start) / ARC_STEP)) + 1))
    return np.asarray(centre) + np.stack([radii[0] * np.cos(angles), radii[1] * np.sin(angles)], axis=1)


def _shirt(m: Mapping[str, float]) -> Pattern:
    """A body and two sleeves, which slope down from the neck, in one piece."""
    half, neck, top, slope = 0.5 * m["width"], 0.5 * m["neck"], m["length"], m["slope"]
    c, s = np.cos(slope), np.sin(slope)
    shoulder = (half - neck) / c + m["sleeve"]
    tip = (neck + shoulder * c, top - shoulder * s)
    cuff = (tip[0] - m["sleeve_width"] * s, tip[1] - m["sleeve_width"] * c)
    arm = (half, cuff[1] + (cuff[0] - half) * s / c)
    seams = [
        (_line((0.0, 0.0), (half, 0.0)), OPEN), (_line((half, 0.0), arm), SEAM), (_line(arm, cuff), SEAM),
        (_line(cuff, tip), OPEN), (_line(tip, (neck, top)), SEAM),
    ]  # fmt: skip
    front, back = (
        (*seams, (_arc((0.0, top), (neck, m[drop]), 0.0, -np.pi / 2), OPEN)) for drop in ("front_neck", "back_neck")
    )
    return Pattern((front, back), True)


def _trousers(m: Mapping[str, float]) -> Pattern:
    top, crotch = m["length"], m["length"] - m["rise"]
    inner = 0.5 * m["gap"]
    sides = (
        (_line((0.0, crotch), (inner, 0.0)), SEAM), (_line((inner, 0.0), (inner + m["leg"], 0.0)), OPEN),
        (_line((inner + m["leg"], 0.0), (0.5 * m["waist"], top)), SEAM),
        (_line((0.5 * m["waist"], top), (0.0, top)), OPEN),
    )  # fmt: skip
    return Pattern((sides, sides), True)


def _skirt(m: Mapping[str, float]) -> Pattern:
    hem, waist, top = 0.5 * m["hem"], 0.5 * m["waist"], m["length"]
    sides = (
        (_line((0.0, 0.0), (hem, 0.0)), OPEN), (_line((hem, 0.0), (waist, top)), SEAM),
        (_line((waist, top), (0.0, top)), OPEN),
    )  # fmt: skip
    return Pattern((sides, sides), True)


def _sock(m: Mapping[str, float]) -> Pattern:
    """A leg and a foot along x, as wide as each other, with a round heel and toe."""
    breadth, leg, foot = m["width"], m["leg"], m["foot"]
    half = 0.5 * breadth
    sides = (
        (_line((breadth, leg), (0.0, leg)), OPEN), (_line((0.0, leg), (0.0, half)), SEAM),
        (_arc((half, half), (half, half), np.pi, 1.5 * np.pi), SEAM), (_line((half, 0.0), (foot - half, 0.0)), SEAM),
        (_arc((foot - half, half), (half, half), -0.5 * np.pi, 0.5 * np.pi), SEAM),
        (_line((foot - half, breadth), (breadth, breadth)), SEAM), (_line((breadth, breadth), (breadth, leg)), SEAM),
    )  # fmt: skip
    return Pattern((sides, sides), False)


def _apron(m: Mapping[str, float]) -> Pattern:
    half, bib, waist, top = 0.5 * m["width"], 0.5 * m["bib"], m["waist"], m["length"]
    # the arm's bay is a quarter of an ellipse about the corner that is cut away
    bay = _arc((half, top), (half - bib, top - waist), 1.5 * np.pi, np.pi)
    sides = (
        (_line((0.0, 0.0), (half, 0.0)), OPEN), (_line((half, 0.0), (half, waist)), OPEN), (bay, OPEN),
        (_line((bib, top), (0.0, top)), OPEN),
    )  # fmt: skip
    return Pattern((sides,), True)


def _towel(m: Mapping[str, float]) -> Pattern:
    half, high, r = 0.5 * m["length"], m["width"], m["radius"]
    sides = (
        (_line((0.0, 0.0), (half - r, 0.0)), OPEN), (_arc((half - r, r), (r, r), -0.5 * np.pi, 0.0), OPEN),
        (_line((half, r), (half, high - r)), OPEN), (_arc((half - r, high - r), (r, r), 0.0, 0.5 * np.pi), OPEN),
        (_line((half - r, high), (0.0, high)), OPEN),
    )  # fmt: skip
    return Pattern((sides,), True)


_SHIRT = dict(width=0.5, neck=0.18, sleeve_width=0.19, slope=0.35, front_neck=0.09, back_neck=0.025)

PATTERNS: dict[str, tuple[Callable[[Mapping[str, float]], Pattern], dict[str, float]]] = {
    "t-shirt": (_shirt, _SHIRT | dict(length=0.68, sleeve=0.17)),
    "pullover": (_shirt, _SHIRT | dict(length=0.64, sleeve=0.48, sleeve_width=0.16, slope=0.6, front_neck=0.06)),
    "trousers": (_trousers, dict(length=0.95, waist=0.42, leg=0.22, rise=0.28, gap=0.04)),
    "skirt": (_skirt, dict(length=0.5, waist=0.36, hem=0.56)),
    "sock": (_sock, dict(leg=0.3, foot=0.24, width=0.1)),
    "apron": (_apron, dict(length=0.85, width=0.65, bib=0.3, waist=0.55)),
    "towel": (_towel, dict(length=0.6, width=0.4, radius=0.06)),
}
"""By name: what draws the pattern, and its measures [m], an angle ``slope`` [rad] among them."""
