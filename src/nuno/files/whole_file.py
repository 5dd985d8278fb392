"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[FilePath]:
    """Give a path beside ``path`` to write to, which takes its place at the end; where that fails, nothing is left."""
    goal = FilePath(path)
    partial = goal.with_name(f".{goal.name}.{os.getpid()}.partial")
    try:
        yield partial
        os.replace(partial, goal)
    finally:
        partial.unlink(missing_ok=True)
