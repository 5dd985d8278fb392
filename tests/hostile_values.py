"""Hostile values, and which of them an argument of a given type must refuse."""

import re

import numpy as np


class Nothing:
    """An object that is of no use to anybody."""


class Shut:
    """What a closed file is to whoever takes it for a path or numbers."""

    closed = True

    def read(self):
        """Fail as a closed file does."""
        raise ValueError("I/O operation on closed file")


VALUES = {
    "none": None,
    "nan": float("nan"),
    "inf": float("inf"),
    "minus inf": float("-inf"),
    "minus": -1,
    "minus half": -0.5,
    "zero": 0,
    "half": 0.5,
    "large": 1e30,
    "tiny": 1e-30,
    "huge": 10**400,
    "true": True,
    "complex": 1j,
    "text": "nonsense",
    "no text": "",
    "unicode": "布\u2603\x00",
    "bytes": b"\xff",
    "device": "cuda:99",
    "object": Nothing(),
    "class": int,
    "function": lambda *_: None,
    "closed file": Shut(),
    "no items": [],
    "ragged": [[1.0], [2.0, 3.0]],
    "objects": [Nothing(), Nothing()],
    "texts": ["a", "b"],
    "mapping": {"nonsense": Nothing()},
    "nan array": np.full(3, np.nan),
    "no rows": np.zeros((0, 3)),
    "wrong shape": np.zeros((2, 5, 7)),
    "text array": np.array(["a", "b", "c"]),
    "complex array": np.full(3, 1j),
}
NUMBERS = {"minus", "minus half", "zero", "half", "large", "tiny"}
WHOLE = {"minus", "zero"}
TEXTS = {"text", "no text", "unicode", "device"}
ARRAYS = {"no rows", "wrong shape"}
CONTAINERS = {"no items", "mapping", "texts", *ARRAYS}
# By a word of an annotation: what an argument of that type may accept. All else it must refuse.
MAY = {
    "RealTimeFactor": {"none", "half", "large", "tiny", "inf"},  # of a server: infinite where nothing waits
    "float": NUMBERS,
    "int": WHOLE,
    "bool": {"true"},
    "str": TEXTS,
    "Literal": set(),
    "Mode": set(),
    "ArrayLike": {*NUMBERS, *ARRAYS},
    "ndarray": {*NUMBERS, *ARRAYS},
    "Value": {*NUMBERS},
    "Directed": {*NUMBERS},
    "Callable": {"function", "class"},
    "Mapping": {"mapping"},
    "dict": {"mapping"},
    "Sequence": {"no items"},
    "Iterable": {"no items", "mapping"},
    "tuple": {"no items"},
    "list": {"no items"},
    "PathLike": TEXTS,
    "FileName": TEXTS,
    "Path": set(),
    "None": {"none"},
    "Any": set(VALUES) - {"object"},
    "Color": set(),
}


def may_accept(annotation, default):
    """Return the names of the values that an argument may accept, by its annotation and default."""
    allowed = {"none"} if default is None else set()
    for part in _parts(str(annotation)):
        word = re.match(r"[\w.]+", part)
        allowed |= MAY.get(word[0].split(".")[-1], set()) if word else set()
    return allowed


def _parts(annotation):
    """Split at the bars that are in no brackets."""
    depth, part = 0, ""
    for letter in annotation.strip("'\""):
        depth += (letter in "[(") - (letter in "])")
        if letter == "|" and not depth:
            yield part.strip()
            part = ""
        else:
            part += letter
    yield part.strip()
