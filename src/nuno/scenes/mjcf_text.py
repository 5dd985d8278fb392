"""Numbers as MJCF has them."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbers(values: Any) -> str:
    """Return numbers as text, as exact as doubles are."""
    return " ".join(repr(float(value)) for value in np.ravel(values))
