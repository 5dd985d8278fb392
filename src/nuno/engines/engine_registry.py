"""The engines by name, whose packages load when a world asks for one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nuno.engines.engine_table import capabilities_of, named_engine
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.bodies.contact_rules import ContactRules
    from nuno.engines.engine import Engine
    from nuno.engines.world_view import EngineWorld


def engine_class(name: Any) -> type[Engine]:
    """Return the class of an engine.

    Raises:
        UnknownNameError: there is no such engine.
    """
    found: type[Engine] = named_engine(name)
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


@checked
def engine_capabilities(engine: str) -> frozenset[str]:
    """Return the names of what an engine can do; its package need not be installed.

    Args:
        engine: "nuno", "mujoco" or "newton".

    Raises:
        UnknownNameError: there is no such engine.
    """
    return capabilities_of(engine)
