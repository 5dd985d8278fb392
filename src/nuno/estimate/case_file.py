"""The folder of a case: an input.json with entries that must be there."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nuno.errors import FileFormatError, InvalidInputError
from nuno.validation import finite_array, number

THICKNESS = 0.04
"""[m] Of a table top that input.json tells no thickness of."""


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
        data = json.loads(path.read_text(encoding="utf-8-sig"))  # as some editors begin a file with a byte order mark
    except (ValueError, RecursionError) as error:  # no JSON, no text; numbers of thousands of digits; endless nesting
        raise FileFormatError(f"{path} is not JSON: {error}") from error
    if not isinstance(data, dict):
        raise FileFormatError(f"{path} must hold an object, got {type(data).__name__}")
    missing = [name for name in needed if name not in data]
    if missing:
        raise InvalidInputError(f"{path} lacks {', '.join(missing)}; it needs {', '.join(needed)}")
    return path, data


def read_table(
    path: Path, data: dict[str, Any]
) -> tuple[float, tuple[float, float] | None, tuple[float, float] | None, float]:
    """Return a table's height [m], half extents [m] and centre [m], None where they are not told, and thickness [m].

    Args:
        path: The case's input.json, for messages.
        data: What it holds.

    Raises:
        InvalidInputError: an entry is not usable.
    """

    def pair(name: str) -> tuple[float, float] | None:
        if data.get(name) is None:
            return None
        x, y = finite_array(f"{name} in {path}", data[name], (2,))
        return float(x), float(y)

    thickness = data.get("table_thickness_m")
    return (
        number(f"table_height_m in {path}", data["table_height_m"]),
        pair("table_half_extents_xy_m"),
        pair("table_centre_xy_m"),
        THICKNESS if thickness is None else number(f"table_thickness_m in {path}", thickness, above=0.0),
    )
