"""Trials: the function that is searched over, and what came out of one run of it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError


@dataclass(frozen=True, eq=False)
class Trial:
    """One finished trial.

    Attributes:
        index: Its place among the parameters.
        values: What the trial returned for it, by name; empty where it failed.
        error: Why it failed ("SimulationDiverged: the state of ..."), or None.
    """

    index: int
    values: dict[str, np.ndarray]
    error: str | None = None

    @property
    def failed(self) -> bool:
        """Return True if it raised, diverged, or lost its worker again and again."""
        return self.error is not None


@dataclass(frozen=True)
class Each:
    """A trial that takes one world and one row of parameters; see `each`."""

    function: Callable[[Any, dict[str, Any]], Any]


def each(trial: Callable[[Any, dict[str, Any]], Any]) -> Each:
    """Mark a trial that takes a single world and one value of each parameter, for a sweep over an executor.

    Args:
        trial: ``trial(world, params)``; ``world`` is a single world, ``params`` holds numbers, strings and lists by
            name, and the values that are returned have no axis of worlds.

    Raises:
        InvalidInputError: not a function.
    """
    if not callable(trial):
        raise InvalidInputError(f"each needs a function trial(world, params), got {type(trial).__name__}")
    return Each(trial)


def name_of(function: Any) -> str:
    """Return "module:name" of a function, or of the class of a callable object."""
    if isinstance(function, Each):
        return f"each({name_of(function.function)})"
    named = function if hasattr(function, "__qualname__") else type(function)
    module = named.__module__
    if module == "__main__":  # of a program, its file's name: another program's trial is another one
        module = FilePath(getattr(sys.modules["__main__"], "__file__", None) or module).stem
    return f"{module}:{named.__qualname__}"


def named_of(function: Any) -> Any:
    """Return what has a trial's name: its function, or the class of a callable object."""
    if isinstance(function, Each):
        function = function.function
    return function if hasattr(function, "__qualname__") else type(function)


def find(module: str, name: str) -> Any:
    """Return what a module has by a name with dots, None where there is none."""
    try:
        found: Any = import_module(module)
        for part in name.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError):
        return None
    return found


def check_importable(function: Any, what: str) -> None:
    """Raise unless another process can import a function by its name.

    Raises:
        InvalidInputError: a lambda, a function within a function, or one that is hidden by another.
    """
    named = named_of(function)
    if find(named.__module__, named.__qualname__) is not named:
        raise InvalidInputError(
            f"{what} {name_of(function)} cannot be imported by another process; define it at the top of a module"
        )
