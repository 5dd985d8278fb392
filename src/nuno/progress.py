"""Progress bars for what takes over a couple of seconds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

Item = TypeVar("Item")

SHOWN_AFTER = 2.0
"""[s] What is quicker shows no bar, unless one is asked for."""


def with_bar(items: Sequence[Item], doing: str, progress: bool | None, unit: str = "it") -> Iterable[Item]:
    """Return items that are counted on standard error as they are gone through.

    Args:
        items: What to go through.
        doing: What is being done, "simulating".
        progress: True shows a bar at once, False none; None shows one in a terminal after two seconds.
        unit: What an item is.
    """
    if progress is False or (progress is None and len(items) == 1):
        return items
    from tqdm import tqdm

    bar: Any = tqdm(
        items, desc=doing, unit=unit, leave=False, disable=None if progress is None else False,
        delay=0.0 if progress else SHOWN_AFTER,
    )  # fmt: skip
    return bar  # type: ignore[no-any-return]
