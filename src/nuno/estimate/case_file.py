"""What the folders of all cases have in common: an input.json with entries that must be there."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nuno.errors import FileFormatError, InvalidInputError


def read_case_file(folder: str | os.PathLike[str], needed: Sequence[str]) -> tuple[Path, dict[str, Any]]:
    """Return the path of a folder's input.json, and what it holds.

    Args:
        folder: The case's folder.
        needed: Names of entries that must be there.

    Raises:
        InvalidInputError: the folder or an entry is missing.
        FileFormatError: input.json is not JSON, or no object.
    """
    path = Path(folder) / "input.json"
    if not path.is_file():
        raise InvalidInputError(f"{Path(folder)} is not a case: there is no input.json in it")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path} is not JSON: {error}") from error
    if not isinstance(data, dict):
        raise FileFormatError(f"{path} must hold an object, got {type(data).__name__}")
    missing = [name for name in needed if name not in data]
    if missing:
        raise InvalidInputError(f"{path} lacks {', '.join(missing)}; it needs {', '.join(needed)}")
    return path, data
