"""Files that appear whole or not at all, and named errors where they cannot be written."""

from __future__ import annotations

import errno
import os
import re
import socket
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path as FilePath
from typing import Any

from nuno.errors import FileWriteError, InvalidInputError

REASONS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk's quota is used up",
    errno.EFBIG: "the file would be larger than files may be here",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "the folder or the file may not be written to",
    errno.EPERM: "the folder or the file may not be written to",
    errno.ENOENT: "there is no such folder",
    errno.ENOTDIR: "a file is in the place of its folder",
    errno.EEXIST: "a file is in the place of its folder",
    errno.EISDIR: "a folder is in its place",
    errno.ENAMETOOLONG: "its name is too long",
}
"""Why files cannot be written, by the system's number of the error."""

_cleared: set[str] = set()  # folders from which this process has removed what killed ones left


def file_path(path: Any, what: str = "path") -> FilePath:
    """Return a path that a caller gave.

    Raises:
        InvalidInputError: neither text nor a path.
    """
    try:
        name = os.fspath(path)
    except TypeError as problem:
        raise InvalidInputError(f"{what} must be a path, got {type(path).__name__}") from problem
    if not isinstance(name, str) or not name or "\0" in name:
        raise InvalidInputError(f"{what} must be a path as text that is not empty, got {name!r}")
    return FilePath(name)


@contextmanager
def naming(path: FilePath) -> Iterator[None]:
    """Turn the system's errors of what writes to ``path`` into FileWriteError."""
    try:
        yield
    except FileWriteError:
        raise
    except OSError as problem:
        # NumPy raises an OSError without a number where fewer bytes are written than there are
        reason = REASONS.get(problem.errno or 0, str(problem) if problem.errno else f"{problem}; is the disk full?")
        raise FileWriteError(f"cannot write {str(path)!r}: {reason}", problem.errno) from problem


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[FilePath]:
    """Give a path beside ``path`` to write to, which takes its place at the end; where that fails, nothing is left.

    What processes of this machine left in the folder that were killed as they wrote is thrown away.

    Raises:
        InvalidInputError: no path.
        FileWriteError: no folder, a read-only one, a full disk; a file that was there stays as it was.
    """
    goal = file_path(path)
    partial = goal.with_name(f".{goal.name}.{_host()}-{os.getpid()}-{uuid.uuid4().hex[:8]}.partial")
    try:
        with naming(goal):
            yield partial
            if goal.is_dir():
                raise IsADirectoryError(errno.EISDIR, "a folder", str(goal))
            os.replace(partial, goal)
    finally:
        with suppress(OSError):  # a folder that is not there, or that became read-only
            partial.unlink()
    _clear_partials(goal.parent)


def write_whole(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write a file as ``replacing`` does; text as UTF-8."""
    with replacing(path) as partial:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)


def write_figure(path: str | os.PathLike[str], figure: Any, **options: Any) -> None:
    """Write a figure of Matplotlib as a PNG as ``replacing`` does; ``options`` are those of ``savefig``."""
    with replacing(path) as partial:
        figure.savefig(partial, format="png", dpi=110, **options)


def made_folder(path: str | os.PathLike[str]) -> FilePath:
    """Return a folder, made with those above it where it is not there.

    Raises:
        InvalidInputError: no path.
        FileWriteError: it cannot be made.
    """
    folder = file_path(path, "folder")
    with naming(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def _clear_partials(folder: FilePath) -> None:
    """Remove what processes left that were killed; those of other machines on a shared disk may still be at work."""
    if str(folder.absolute()) in _cleared:  # once: a folder of a sweep's arrays may hold many files
        return
    _cleared.add(str(folder.absolute()))
    ours = re.compile(rf"\..+\.{re.escape(_host())}-(\d+)-[0-9a-f]{{8}}\.partial")
    with suppress(OSError):
        for entry in os.scandir(folder):
            found = ours.fullmatch(entry.name)
            if found and not _is_alive(int(found[1])):
                os.unlink(entry.path)


def _host() -> str:
    return re.sub(r"[^\w]", "_", socket.gethostname())[:32]


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        pass
    return True
