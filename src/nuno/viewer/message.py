"""Messages to the page: a header in JSON, and the arrays that it names, as they are in memory."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

TYPES = {"float32": "f4", "uint8": "u1", "uint16": "u2", "uint32": "u4"}


def pack(content: Any) -> bytes:
    """Return a message: the header's length (uint32), the header, then each array on a multiple of four bytes.

    Args:
        content: Dictionaries, lists, numbers and strings, anywhere in them arrays of float32, uint8, uint16 or uint32.
    """
    blobs: list[bytes] = []
    place = 0

    def named(array: Any) -> dict[str, Any]:
        nonlocal place
        if not isinstance(array, np.ndarray):
            raise TypeError(f"a message cannot hold a {type(array).__name__}")
        raw = np.ascontiguousarray(array).tobytes()
        entry = {"type": TYPES[array.dtype.name], "at": place, "count": int(array.size)}
        padded = raw + b"\0" * (-len(raw) % 4)
        blobs.append(padded)
        place += len(padded)
        return {"array": entry}

    header = json.dumps(content, default=named, separators=(",", ":"), allow_nan=False).encode()
    header += b" " * (-len(header) % 4)
    return struct.pack("<I", len(header)) + header + b"".join(blobs)
