"""The package ``mujoco``, loaded when an engine is made."""

from __future__ import annotations

from types import ModuleType

from nuno.errors import MissingPackageError


def mujoco_package() -> ModuleType:
    """Return the module ``mujoco``, with ``mujoco.batch``.

    Raises:
        MissingPackageError: it is not installed, or older than 4.0.
    """
    try:
        import mujoco
        import mujoco.batch
    except ImportError as error:
        raise MissingPackageError("mujoco 4", "mujoco", 'World(engine="mujoco")') from error
    found: ModuleType = mujoco
    return found
