"""Colours by name or number."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

COMMON = frozenset(("black", "white", "gray", "red", "green", "blue", "yellow", "orange", "brown", "cyan", "magenta"))
"""Names that are known without Matplotlib, which takes half a second to load."""
_HEX = re.compile("#(?:[0-9a-fA-F]{3}){1,2}")


def checked_color(color: Any) -> str | tuple[float, float, float]:
    """Return a colour as it was given, numbers as a tuple.

    Raises:
        InvalidInputError: no such colour.
    """
    if isinstance(color, str) and (color in COMMON or _HEX.fullmatch(color)):
        return color
    values = rgb(color)
    return color if isinstance(color, str) else (float(values[0]), float(values[1]), float(values[2]))


def rgb(color: Any) -> np.ndarray:
    """Return a colour as (3,) float in [0, 1], red, green and blue as screens take them (sRGB).

    Args:
        color: A name ("gray", those of CSS), "#4080c0", or (r, g, b) in [0, 1].

    Raises:
        InvalidInputError: no such colour.
    """
    if isinstance(color, str):
        from matplotlib.colors import to_rgb

        try:
            return np.array(to_rgb(color))
        except ValueError as error:
            raise InvalidInputError(
                f'a colour is a name of CSS ("gray"), "#rrggbb" or (r, g, b) in [0, 1], got {color!r}'
            ) from error
    values = finite_array("color", color, (3,))
    if values.min() < 0.0 or values.max() > 1.0:
        raise InvalidInputError(f"a colour's (r, g, b) must lie in [0, 1], got {color!r}")
    return values


def linear(color: np.ndarray) -> np.ndarray:
    """Return sRGB values in [0, 1] as light (IEC 61966-2-1), which is what glTF's materials hold."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
