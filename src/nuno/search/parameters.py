"""Parameters of many trials: a grid, a list or a sampler, written out as columns of values."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.validation import count


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters of all trials of a search, in the order of the trials.

    Attributes:
        columns: By name, (n,) numbers, bools or strings, or (n, ...) numbers.
        trial_count: n.
    """

    columns: dict[str, np.ndarray]
    trial_count: int

    def rows(self, indices: Sequence[int]) -> dict[str, np.ndarray]:
        """Return the columns of some trials."""
        return {name: column[list(indices)] for name, column in self.columns.items()}

    def row(self, index: int) -> dict[str, Any]:
        """Return one trial's parameters, as Python numbers, strings and lists."""
        return {name: column[index].tolist() for name, column in self.columns.items()}

    def digest(self) -> str:
        """Return a hash of all parameters, the same on every machine."""
        text = hashlib.sha256(json.dumps(sorted(self.columns)).encode())
        for k in range(self.trial_count):
            text.update(json.dumps(self.row(k), sort_keys=True).encode())
        return text.hexdigest()


def make_parameters(given: Any, samples: int | None = None, seed: int = 0) -> Parameters:
    """Write parameters out.

    Args:
        given: A grid: values by name, of which every combination is a trial, the last name's changing fastest. Or a
            list: one mapping from names to values for each trial, all with the same names. Or a sampler: a function of
            a ``numpy.random.Generator`` that returns such a mapping.
        samples: How many trials a sampler gives; None for the others.
        seed: Of the sampler; trial k draws from a generator seeded with (seed, k).

    Raises:
        InvalidInputError: none of these, no trial at all, or values that are not numbers, bools or strings.
    """
    if not callable(given) and samples is not None:
        raise InvalidInputError("samples goes with a sampler; a grid or a list says itself how many trials there are")
    if isinstance(given, Mapping):
        names = _checked_names(given)
        values = [_as_list(name, given[name]) for name in names]
        rows = [dict(zip(names, combination, strict=True)) for combination in itertools.product(*values)]
    elif callable(given):
        rows = _sampled(given, samples, seed)
    elif isinstance(given, Sequence) and not isinstance(given, str):
        rows = list(given)
    else:
        raise InvalidInputError(
            f"params must be a grid (values by name), a list of mappings or a sampler, got {type(given).__name__}"
        )
    return from_rows(rows)


def from_rows(rows: Sequence[Any]) -> Parameters:
    """Return the parameters of trials that are given one by one, as mappings with the same names.

    Raises:
        InvalidInputError: no trials, no mappings, or other names than the first has.
    """
    if not rows:
        raise InvalidInputError("there are no parameters, so there is no trial to run")
    for k, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise InvalidInputError(f"the parameters of trial {k} must be a mapping, got {type(row).__name__}")
        if set(row) != set(rows[0]):
            raise InvalidInputError(f"trial {k} has parameters {sorted(row)}, trial 0 has {sorted(rows[0])}")
    names = _checked_names(rows[0])
    return Parameters({name: _column(name, [row[name] for row in rows]) for name in names}, len(rows))


def _checked_names(row: Mapping[Any, Any]) -> list[str]:
    names = list(row)
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"parameters need names that are strings, got {names}")
    return names


def _as_list(name: str, values: Any) -> list[Any]:
    if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
        raise InvalidInputError(f"the grid's values of {name!r} must be a sequence, got {values!r}; one is [value]")
    return list(values)


def _sampled(sampler: Callable[[np.random.Generator], Any], samples: Any, seed: Any) -> list[Any]:
    if samples is None:
        raise InvalidInputError("a sampler needs samples=, how many trials it shall give")
    number, entropy = count("samples", samples), count("seed", seed, low=0)
    return [sampler(np.random.default_rng([entropy, k])) for k in range(number)]


def _column(name: str, values: list[Any]) -> np.ndarray:
    try:
        column = np.array(values)
    except ValueError as problem:
        raise InvalidInputError(f"the values of {name!r} must all have one shape") from problem
    mixed = column.dtype.kind == "U" and not all(isinstance(value, str) for value in values)
    if mixed or column.dtype.kind not in "biufU" or (column.dtype.kind == "U" and column.ndim > 1):
        raise InvalidInputError(f"the values of {name!r} must be numbers, bools or strings, got {values[0]!r} ...")
    if column.dtype.kind == "f":
        if not np.isfinite(column).all():
            raise InvalidInputError(f"the values of {name!r} must be finite")
        column = column.astype(np.float64)
    return column
