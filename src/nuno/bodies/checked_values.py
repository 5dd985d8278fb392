"""Values of a body as a caller gives them, checked: friction and the bit masks of collision groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

ALL_GROUPS = 0xFFFFFFFF


def checked_friction(value: Any) -> Any:
    """Return Coulomb's coefficient as a float, or an array (worlds,).

    Raises:
        InvalidInputError: not finite, below 0, or of another shape.
    """
    friction = finite_array("friction", value, (), ("worlds",))
    if (friction < 0.0).any():
        raise InvalidInputError(f"friction must be at least 0, got {value!r}")
    return float(friction) if friction.ndim == 0 else friction


def checked_mask(name: str, value: Any) -> int:
    """Return a bit mask of collision groups.

    Raises:
        InvalidInputError: no whole number, or out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value <= ALL_GROUPS:
        raise InvalidInputError(f"{name} must be a bit mask from 0 to {ALL_GROUPS:#x}, got {value!r}")
    return int(value)
