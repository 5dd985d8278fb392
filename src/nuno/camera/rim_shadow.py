"""The thin shadow that a flat cloth casts on the table along its sides, which would pass for cloth."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

_OFFSETS = np.arange(-7.0, 10.01, 0.5)  # [px] along a side's normal, outward
_TABLE = _OFFSETS >= 6.0  # what is there shows the table in full light
_BLUR = 0.9  # [px] of a camera's edge
_BLURS = (0.7, 0.9, 1.15, 1.5)  # [px] that one edge may have: a softer one is no strip
_GROUP = 6  # neighbours along a side whose mean is taken, 12 px
_NARROWEST = 1.0  # [px] of a strip that tells itself from a blurred edge
_WIDEST = 0.012  # [m] of one: the shadow of 3 mm, in a light and seen by a camera from 25 degrees each
_LIGHT = (0.2, 0.9)  # a shadow leaves between these shares of the table's light
_BETTER = 0.36  # a strip must leave at most this share of the squares that one edge leaves
_INSIDE = np.arange(-40.0, -7.0, 1.5)  # [px] where a pattern that runs along the side would show its other stripes
_ALIKE = 12.0  # [levels] between colours that may be one: four times a camera's noise
_EVEN = 0.05  # median deviation of its share of the light along a side: a lamp's shadow is equally dark all along


def cloth_at_shadow(image: np.ndarray, pixels: np.ndarray, normals: np.ndarray, metres: float) -> np.ndarray | None:
    """Return where the cloth ends along a side that has its shadow beside it.

    Along the normal three colours follow each other: the cloth's, the table's in shadow, and the table's. Where that
    fits far better than the cloth's and the table's alone, the first edge is the cloth's. The shadow has the table's
    tint, so the strip adds one number to the fit, its share of the light, and a width; both are the same all along.

    Args:
        image: (h, w, 3) float32, slightly smoothed.
        pixels: (k, 2) float, points of a line within about 4 px of the edge.
        normals: (k, 2) float, outward.
        metres: What a pixel along the normals is on the table [m].

    Returns:
        (k,) float, the cloth's edge along each normal [px], or None where there is no such strip.
    """
    if len(pixels) < 2 * _GROUP:
        return None
    values = _along(image, pixels, normals, _OFFSETS)
    parts = np.array_split(np.arange(len(pixels)), len(pixels) // _GROUP)
    found = np.stack([values[part].mean(axis=0) for part in parts])
    edges, widths, cost, share = _fit(found)
    plain = np.where(widths == 0.0, cost, np.inf).min(axis=1)
    rows = np.arange(len(found))
    best = np.where(widths >= _NARROWEST, cost, np.inf).argmin(axis=1)
    edge, width, shares, left = edges[best], widths[best], share[rows, best], cost[rows, best]
    if left.sum() > _BETTER * plain.sum() or not _NARROWEST <= np.median(width) <= _WIDEST / metres:
        return None
    middle = float(np.median(shares))
    if not _LIGHT[0] < middle < _LIGHT[1] or np.median(np.abs(shares - middle)) > _EVEN:
        return None
    if np.median(np.abs(width - np.median(width))) > 0.5 or edge.min() < edges.min() + 0.5:
        return None
    dark = middle * np.median(values[:, _TABLE], axis=(0, 1))
    if np.abs(_strip_colour(found, best) - dark).max() > _ALIKE:
        return None
    # A colour that the cloth has elsewhere, and not all over, is a stripe of it.
    inside = np.abs(_along(image, pixels, normals, _INSIDE) - dark).max(axis=-1) < _ALIKE
    if 0.03 < inside.mean() < 0.9:
        return None
    middles = np.array([part.mean() for part in parts])
    keep = np.ones(len(parts), dtype=bool)
    for _ in range(2):  # the second time without what is far off the first line
        line = np.polyfit(middles[keep], edge[keep], 1 if keep.sum() > 3 else 0)
        away = np.abs(edge - np.polyval(line, middles))
        keep = away <= max(2.0 * float(np.median(away)), 0.5)
    return np.asarray(np.polyval(line, np.arange(len(pixels))))


def _strip_colour(found: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Colour (3,) of the strip in profiles (g, m, 3), whatever it is, with edges and widths as numbered (g,)."""
    _, _, cloth, strip, table = _profiles()
    colours = []
    for profile, k in zip(found, best, strict=True):
        seen = profile - table[k][:, None] * profile[_TABLE].mean(axis=0)
        colours.append(np.linalg.lstsq(np.column_stack([cloth[k], strip[k]]), seen, rcond=None)[0][1])
    return np.asarray(np.median(colours, axis=0))


def _along(image: np.ndarray, pixels: np.ndarray, normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Values (k, m, 3) of an image at offsets (m,) [px] along normals."""
    at = (pixels[:, None] + offsets[None, :, None] * normals[:, None]).astype(np.float32)
    return cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


@cache
def _profiles() -> tuple[np.ndarray, ...]:
    """Edges (n,) and strips' widths (n,) [px] that are tried, with the shares (n, m) of cloth, strip and table."""
    at, breadths = np.arange(-5.0, 3.01, 0.25), np.arange(_NARROWEST, 6.01, 0.5)
    edges, widths = (a.ravel() for a in np.meshgrid(at, breadths))
    near = edges + widths <= 4.0
    blurs = np.concatenate([np.full(near.sum(), _BLUR), np.repeat(_BLURS, len(at))])[:, None]
    edges = np.concatenate([edges[near], np.tile(at, len(_BLURS))])
    widths = np.concatenate([widths[near], np.zeros(len(at) * len(_BLURS))])
    cloth = _step((edges[:, None] - _OFFSETS) / blurs)
    table = _step((_OFFSETS - (edges + widths)[:, None]) / blurs)
    cloth, table = cloth.astype(np.float32), table.astype(np.float32)
    return edges, widths, cloth, 1.0 - cloth - table, table


def _step(x: np.ndarray) -> np.ndarray:
    """A blurred step: the normal distribution, to 1 % by the logistic one."""
    return 1.0 / (1.0 + np.exp(-1.702 * x))


def _fit(found: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Fit cloth, strip and table to profiles (g, m, 3), in closed form for every edge and width.

    Returns:
        Edges (n,) and widths (n,) [px], and (g, n) each the squares that are left and the strip's share of the light.
    """
    edges, widths, cloth, strip, table = _profiles()
    colour = found[:, _TABLE].mean(axis=1)
    length2 = (colour**2).sum(axis=-1)[:, None]
    along_colour = np.matmul(found, colour[..., None])[..., 0]  # (g, m)
    own = (cloth * cloth).sum(axis=1)
    cross_table, cross_strip = (cloth * table).sum(axis=1), (cloth * strip).sum(axis=1)
    # What the table leaves of the profile, without what the cloth's colour, whatever it is, explains.
    left2 = sum((found[..., k] @ cloth.T - colour[:, k, None] * cross_table) ** 2 for k in range(3))
    squares = (found**2).sum(axis=(1, 2))[:, None] - 2.0 * (along_colour @ table.T)
    squares = squares + length2 * (table * table).sum(axis=1) - left2 / own
    width = length2 * ((strip * strip).sum(axis=1) - cross_strip**2 / own)
    left_colour = along_colour @ cloth.T - length2 * cross_table
    along = along_colour @ strip.T - length2 * (strip * table).sum(axis=1) - left_colour * cross_strip / own
    share = np.where(widths > 0.0, np.clip(along / np.maximum(width, 1e-3), 0.0, 1.0), 0.0)
    return edges, widths, np.maximum(squares - 2.0 * share * along + share**2 * width, 0.0), share
