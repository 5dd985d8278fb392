"""The memory of a solver's arrays."""

from __future__ import annotations

from typing import Any

HOST_COPIES = 3
"""Copies of a state in float64 that are held at once while a batch is made: spread, as floats, and arranged."""


def array_bytes(*holders: Any) -> int:
    """Return the memory of the arrays of Warp structs, each once [bytes]."""
    import warp as wp

    values = [getattr(holder, name) for holder in holders for name in holder._cls.vars]
    # some arrays go by two names
    return sum({value.ptr: value.capacity for value in values if isinstance(value, wp.array)}.values())
