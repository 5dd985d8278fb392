"""Elements that a part of a world has put into a spec of MuJoCo, and takes out again."""

from __future__ import annotations

from typing import Any


class SpecElements:
    """Elements in a spec, in the order in which they came."""

    def __init__(self) -> None:
        self._elements: list[Any] = []
        self._spec: Any = None
        self._made = 0

    def clear(self) -> None:
        """Take all elements out of the spec, the last first, as MuJoCo deletes what refers to them too."""
        for element in reversed(self._elements):
            self._spec.delete(element)
        self._elements = []
