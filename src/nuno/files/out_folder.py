"""The folder that a command's files go to, checked before the work is done."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from nuno.errors import InvalidInputError


def check_out_folder(name: str) -> None:
    """Raise an error unless a folder can be written to, or made.

    Args:
        name: As given with ``--out``.

    Raises:
        InvalidInputError: it is no folder, or cannot be written to.
    """
    if not name or "\0" in name:
        raise InvalidInputError(f"--out must be the name of a folder, got {name!r}")
    there = Path(name).absolute()
    while not os.path.lexists(there):
        there = there.parent
    if not there.is_dir():
        raise InvalidInputError(f"--out must be a folder, or the name of one to make; {there} is a file")
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InvalidInputError(f"--out must be a folder to write to; {there} is none: {error.strerror}") from error
