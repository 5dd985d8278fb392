"""Checks of what a caller passes in: finite, of a valid shape, in range.

Every check runs before any state changes, and its message says what was received and what is valid.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import wraps
from inspect import Parameter, signature
from typing import Any, ParamSpec, TypeVar

import numpy as np

from nuno.errors import InvalidInputError, UnknownNameError

Shape = tuple[int | str, ...]
Rule = tuple[str, Callable[[Any], bool]]  # what a value must be, in words, and whether it is
Kind = TypeVar("Kind")
P = ParamSpec("P")
R = TypeVar("R")
NO_NUMBERS = (str, bytes, bool, np.bool_, complex, np.complexfloating, np.datetime64, np.timedelta64)
LATEST = 1e9
"""[s] (32 years) A clock beyond this does not tell a frame's end from what is near it: a double's step is 0.1 us."""
LONGEST_WAIT = 3600.0
"""[s] The longest that a pick is lifted, or a fold or a load waited for, frame by frame in memory."""
MAX_COUNT = 2**31 - 1
"""A count beyond this fits no index of a kernel."""
GREATEST = float(np.finfo(np.float32).max)
"""The greatest number that a world holds: its state is in floats."""

_field_rules: dict[type, list[tuple[str, Rule]]] = {}  # of dataclasses, by field


def finite_array(name: str, value: Any, *shapes: Shape, error: type[Exception] = InvalidInputError) -> np.ndarray:
    """Return ``value`` as a new float64 array of one of the given shapes.

    Args:
        name: What the value is, for the message.
        value: Anything that NumPy makes an array of.
        shapes: Valid shapes; a string stands for any length of at least one, e.g. ``("k", 3)``.
        error: The error to raise.

    Raises:
        InvalidInputError: (or ``error``) not numbers, not finite, beyond what floats hold, or of another shape.
    """
    try:
        array = np.array(value)
        if array.dtype.kind not in "iufO":
            raise ValueError(f"{array.dtype} is no real number")
        array = array.astype(np.float64, copy=False)  # it is a copy already
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(f"{name} must be numbers of shape {_shape_text(shapes)}, got {_short(value)}") from problem
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise error(f"{name} must have shape {_shape_text(shapes)}, got {array.shape}")
    if not np.isfinite(array).all():
        raise error(f"{name} must be finite, got {np.count_nonzero(~np.isfinite(array))} values that are not")
    if array.size and max(array.max(), -array.min()) > GREATEST:
        raise error(f"{name} must be within +-{GREATEST:.3g}, the greatest float, got {np.abs(array).max():.3g}")
    return array


def index_array(name: str, value: Any, *shapes: Shape, low: int, high: int,
                error: type[Exception] = InvalidInputError) -> np.ndarray:  # fmt: skip
    """Return ``value`` as a new int32 array of one of the given shapes, every index in [low, high).

    Raises:
        InvalidInputError: (or ``error``) not whole numbers, out of range, or of another shape.
    """
    try:
        array = np.array(value)
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(f"{name} must be indices of shape {_shape_text(shapes)}, got {_short(value)}") from problem
    if array.dtype.kind not in "iu":
        raise error(f"{name} must be whole numbers of shape {_shape_text(shapes)}, got {array.dtype}")
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise error(f"{name} must have shape {_shape_text(shapes)}, got {array.shape}")
    if array.min() < low or array.max() >= high:
        raise error(f"{name} must lie in [{low}, {high - 1}], got {array.min()} to {array.max()}")
    return array.astype(np.int32)


def as_array(name: str, value: Any, error: type[Exception] = InvalidInputError) -> np.ndarray:
    """Return ``value`` as an array, of whatever type and shape; a copy only where it is none yet.

    Raises:
        InvalidInputError: (or ``error``) rows of different lengths.
    """
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(f"{name} must be an array, got {_short(value)}: {problem}") from problem


def number(name: str, value: Any, *, low: float = -np.inf, above: float = -np.inf, high: float = np.inf) -> float:
    """Return ``value`` as a finite float with low <= value <= high and value > above.

    Raises:
        InvalidInputError: not a number, not finite, out of range, or beyond what floats of 32 bits hold.
    """
    if (
        type(value) is float and low <= value <= high and above < value <= GREATEST and value >= -GREATEST
    ):  # what every tick asks
        return value
    valid = f"> {above:g}" if above > -np.inf else f">= {low:g}" if low > -np.inf else "finite"
    if high < np.inf:
        valid += f" and <= {high:g}"
    try:
        if isinstance(value, NO_NUMBERS) or np.ndim(value):
            raise TypeError("no number")
        result = float(value)
    except (TypeError, ValueError, OverflowError) as problem:
        wanted = "a finite number" if valid == "finite" else f"a number {valid}"
        raise InvalidInputError(f"{name} must be {wanted}, got {_short(value)}") from problem
    if not np.isfinite(result) or result < low or result <= above or result > high:
        raise InvalidInputError(f"{name} must be {valid}, got {result}")
    if abs(result) > GREATEST:
        raise InvalidInputError(f"{name} must be within +-{GREATEST:.3g}, the greatest float, got {result:.3g}")
    return result


def instant(name: str, time: float) -> float:
    """Return ``time`` [s], to which a world is to run, if its clock still tells frames apart there.

    Raises:
        InvalidInputError: it is later than `LATEST`.
    """
    if time > LATEST:
        raise InvalidInputError(
            f"{name} would set the clock to {time:g} s, and it tells frames apart up to {LATEST:g} s"
        )
    return time


def count(name: str, value: Any, *, low: int = 1, high: int = MAX_COUNT) -> int:
    """Return ``value`` as an int of at least ``low`` and at most ``high``.

    Raises:
        InvalidInputError: not a whole number, too small or too large.
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < low or value > high:
        valid = f"of at least {low}" if high == MAX_COUNT and not (whole and value > high) else f"from {low} to {high}"
        raise InvalidInputError(f"{name} must be a whole number {valid}, got {_short(value)}")
    return int(value)


def flag(name: str, value: Any) -> bool:
    """Return ``value`` as a bool.

    Raises:
        InvalidInputError: neither True nor False.
    """
    if not isinstance(value, bool | np.bool_):
        raise InvalidInputError(f"{name} must be True or False, got {_short(value)}")
    return bool(value)


def instance(name: str, value: Any, kind: type[Kind]) -> Kind:
    """Return ``value``, of a class.

    Raises:
        InvalidInputError: of another class.
    """
    if not isinstance(value, kind):
        raise InvalidInputError(f"{name} must be {_named(kind.__name__)}, got {_short(value)}")
    return value


def function(name: str, value: Any) -> Any:
    """Return ``value``, which can be called.

    Raises:
        InvalidInputError: it cannot.
    """
    if not callable(value):
        raise InvalidInputError(f"{name} must be a function, got {_short(value)}")
    return value


def choice(name: str, value: Any, valid: Sequence[str]) -> str:
    """Return ``value``, one of the valid names.

    Raises:
        UnknownNameError: it is none of them.
    """
    if not isinstance(value, str) or value not in valid:
        raise UnknownNameError(name, value, list(valid))
    return value


def text(name: str, value: Any) -> str:
    """Return ``value``, text that is not empty.

    Raises:
        InvalidInputError: no text, or none in it.
    """
    if not isinstance(value, str) or not value:
        raise InvalidInputError(f"{name} must be text that is not empty, got {_short(value)}")
    return value


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check a public function's arguments by their annotations, before it begins.

    It is told what a type alone can tell: a number that is finite, a Camera, a function, a path, True or False. Ranges
    and shapes are the function's own to check. An annotation that says nothing of the kind (Any, an alias) lets all
    pass.

    Raises:
        InvalidInputError: from the function that is returned, where an argument is of another type.
    """
    form = signature(function)
    rules: dict[str, Rule] = {}

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        if not rules:  # at the first call, when all names of the module are there
            known = getattr(function, "__globals__", {})
            rules.update({name: _rule(str(each.annotation), known) for name, each in form.parameters.items()})
        try:
            given = form.bind(*args, **kwargs).arguments
        except TypeError:
            given = {}  # Python says what is missing or unknown
        for name, value in given.items():
            kind = form.parameters[name].kind
            if kind not in (Parameter.VAR_KEYWORD, Parameter.VAR_POSITIONAL):
                _check(name, value, rules[name])
        return function(*args, **kwargs)

    return run


def check_fields(record: Any) -> None:
    """Check the fields of a dataclass by their annotations, as ``checked`` checks arguments.

    Raises:
        InvalidInputError: one is of another type.
    """
    kind = type(record)
    if kind not in _field_rules:  # once: some are made hundreds of times, as a fit goes on
        known = vars(sys.modules[kind.__module__])
        _field_rules[kind] = [(field.name, _rule(str(field.type), known)) for field in fields(kind) if field.init]
    for name, rule in _field_rules[kind]:
        _check(name, getattr(record, name), rule)


def _check(name: str, value: Any, rule: Rule) -> None:
    said, passes = rule
    if not passes(value):
        raise InvalidInputError(f"{name} must be {said}, got {_short(value)}")


def _rule(annotation: str, known: Mapping[str, Any]) -> Rule:
    """Return what an annotation means in words, and whether a value is of its type.

    Args:
        annotation: As text.
        known: Names of the module that it stands in; others are those of classes that only type checkers import.
    """
    parts = [_part_rule(part, known) for part in _split(annotation.strip("'\""), "|")]
    said = list(dict.fromkeys(words for words, _ in parts))
    passes = [each for _, each in parts]
    text = " or ".join([", ".join(said[:-1]), said[-1]] if len(said) > 1 else said)
    return text, lambda value: any(each(value) for each in passes)


def _part_rule(part: str, known: Mapping[str, Any]) -> Rule:
    word, _, inner = part.partition("[")
    word, items = word.split(".")[-1], _split(inner.removesuffix("]"), ",") if inner else []
    if word in SIMPLE:
        return SIMPLE[word]
    if word in ("Mapping", "dict"):
        each = [_rule(item, known) for item in items]
        values = f" of {each[1][0]}" if len(each) == 2 else ""
        return (
            f"a mapping{values}",
            lambda value: (
                isinstance(value, Mapping)
                and (len(each) < 2 or all(each[0][1](k) and each[1][1](v) for k, v in value.items()))
            ),
        )
    if word in ("Sequence", "Iterable", "tuple", "list"):
        rules = [_rule(item, known) for item in items if item != "..."]
        return _sequence_rule(rules, len(rules) if word == "tuple" and "..." not in items and rules else None, word)
    found = known.get(word)
    if word in UNCHECKED:
        return "anything", lambda value: True
    if isinstance(found, type):
        return _named(word), lambda value: isinstance(value, found)
    if word in known or not word[:1].isupper():
        return "anything", lambda value: True
    return _named(word), lambda value: any(kind.__name__ == word for kind in type(value).__mro__)


def _named(word: str) -> str:
    return f"an {word}" if word[0] in "AEIOU" else f"a {word}"


def _sequence_rule(rules: list[Rule], length: int | None, word: str) -> Rule:
    words = f" of {rules[0][0]}" if rules and len({said for said, _ in rules}) == 1 else ""
    number_of = f"{length} values" if length is not None else "a sequence"

    def passes(value: Any) -> bool:
        if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__iter__") or isinstance(value, type):
            return False
        if not isinstance(value, Sequence | np.ndarray | set | frozenset):
            return word == "Iterable"
        if (isinstance(value, np.ndarray) and not value.ndim) or (length is not None and len(value) != length):
            return False
        if isinstance(value, np.ndarray) and words and not any(of in words for of in ("number", "anything", "True")):
            return False
        each = [rule for _, rule in rules]
        return not each or all(each[k % len(each)](item) for k, item in enumerate(value))

    return f"{number_of}{words}", passes


def _split(text: str, mark: str) -> list[str]:
    """Split an annotation at marks that are in no brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[(") - (letter in ")]")
        if letter == mark and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def _is_number(value: Any) -> bool:
    try:
        number("it", value)
    except InvalidInputError:
        return False
    return True


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and abs(int(value)) < 2**63


def _is_array(value: Any) -> bool:
    if type(value).__module__.partition(".")[0] == "warp":
        return True
    if isinstance(value, bool):
        return False
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O":
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return array.dtype.kind in "biu" or (array.dtype.kind == "f" and bool(np.isfinite(array).all()))


def _is_path(value: Any) -> bool:
    return isinstance(value, str | os.PathLike) and "\0" not in str(value) and str(value) not in ("", ".")


SIMPLE: dict[str, Rule] = {
    "None": ("None", lambda value: value is None),
    "float": ("a finite number", _is_number),
    "int": ("a whole number", _is_whole),
    "bool": ("True or False", lambda value: isinstance(value, bool | np.bool_)),
    "str": ("text", lambda value: isinstance(value, str)),
    "Literal": ("text", lambda value: isinstance(value, str)),
    "Callable": ("a function", callable),
    "ArrayLike": ("finite numbers", _is_array),
    "ndarray": ("finite numbers", lambda value: _is_array(value) and np.size(value) > 0),
    "PathLike": ("a path", _is_path),
    "FileName": ("a path", _is_path),
    "Any": ("anything", lambda value: True),
}
UNCHECKED = ("Self", "Unpack", "TypeVar", "Executor")  # what takes an executor says itself where to get one


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except Exception as problem:  # of somebody else's class; or an int of more digits than Python writes
        return f"a {type(value).__name__} ({problem})"
    return text if len(text) <= 200 else f"{text[:200]}..."


def _fits(actual: tuple[int, ...], wanted: Shape) -> bool:
    if len(actual) != len(wanted):
        return False
    return all(a >= 1 if isinstance(w, str) else a == w for a, w in zip(actual, wanted, strict=True))


def _shape_text(shapes: tuple[Shape, ...]) -> str:
    return " or ".join("(" + ", ".join(map(str, s)) + ("," if len(s) == 1 else "") + ")" for s in shapes)
