"""The table of engines: where the class of each is, and which of them has a capability."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nuno.errors import UnknownNameError

ENGINES = {
    "nuno": "nuno.engines.builtin_engine:BuiltinEngine",
    "mujoco": "nuno.engines.mujoco.mujoco_engine:MujocoEngine",
    "newton": "nuno.engines.newton.newton_engine:NewtonEngine",
}
"""Where the class of each engine is; its module imports the engine's package only when an instance is made."""


def named_engine(name: Any) -> Any:
    """Return the class of an engine.

    Raises:
        UnknownNameError: there is no such engine.
    """
    if not isinstance(name, str) or name not in ENGINES:
        raise UnknownNameError("engine", name, list(ENGINES))
    module, _, attribute = ENGINES[name].partition(":")
    return getattr(import_module(module), attribute)


def capabilities_of(name: Any) -> frozenset[str]:
    """Return the names of what an engine can do; raises as `named_engine` does."""
    found: frozenset[str] = named_engine(name).capabilities
    return found


def engines_with(capability: str) -> tuple[str, ...]:
    """Return the names of the engines that have a capability."""
    return tuple(name for name in ENGINES if capability in capabilities_of(name))
