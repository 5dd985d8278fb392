"""Progress bars for what takes over a couple of seconds."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
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


@contextmanager
def with_clock(doing: str, progress: bool | None) -> Iterator[None]:
    """Show on standard error how long something takes of which nothing can be counted.

    Args:
        doing: What is being done, "compiling kernels".
        progress: True shows it, False does not; None does in a terminal. In any case after two seconds.
    """
    if progress is False or (progress is None and not sys.stderr.isatty()):
        yield
        return
    done = threading.Event()

    def show() -> None:
        if done.wait(SHOWN_AFTER):
            return
        from tqdm import tqdm

        with tqdm(bar_format="{desc}: {elapsed}", desc=doing, leave=False) as clock:
            clock.start_t -= SHOWN_AFTER
            while not done.wait(0.5):
                clock.refresh()

    thread = threading.Thread(target=show, name="nuno-clock", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
