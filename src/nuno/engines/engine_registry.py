"""The engines by name, whose packages load when a world asks for one."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from nuno.errors import UnknownNameError
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.bodies.contact_rules import ContactRules
    from nuno.engines.engine import Engine
    from nuno.engines.world_view import EngineWorld

ENGINES = {
    "nuno": "nuno.engines.builtin_engine:BuiltinEngine",
    "mujoco": "nuno.engines.mujoco.mujoco_engine:MujocoEngine",
    "newton": "nuno.engines.newton.newton_engine:NewtonEngine",
}
"""Where the class of each engine is; its module imports the engine's package only when an instance is made."""


def engine_class(name: Any) -> type[Engine]:
    """Return the class of an engine.

    Raises:
        UnknownNameError: there is no such engine.
    """
    if not isinstance(name, str) or name not in ENGINES:
        raise UnknownNameError("engine", name, list(ENGINES))
    module, _, attribute = ENGINES[name].partition(":")
    found: type[Engine] = getattr(import_module(module), attribute)
    return found


def make_engine(name: Any, world: EngineWorld, device: str, rules: ContactRules) -> Engine:
    """Return an engine for a world.

    Args:
        name: Of the engine.
        world: The world.
        device: The device that was asked for: "auto", "cpu", "cuda" ...
        rules: The world's rules of which pairs touch.

    Raises:
        UnknownNameError: there is no such engine.
        MissingPackageError: its package is not installed.
        EngineCapabilityError: it does not run on the world's device.
    """
    made = engine_class(name)(world)
    made.rules = rules
    if device.startswith("cuda"):
        made.require("cuda")
    return made


def engines_with(capability: str) -> tuple[str, ...]:
    """Return the names of the engines that have a capability."""
    return tuple(name for name in ENGINES if capability in engine_class(name).capabilities)


@checked
def engine_capabilities(engine: str) -> frozenset[str]:
    """Return the names of what an engine can do; its package need not be installed.

    Args:
        engine: "nuno", "mujoco" or "newton".

    Raises:
        UnknownNameError: there is no such engine.
    """
    return engine_class(engine).capabilities
