"""The package ``mujoco``, loaded when an engine is made."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from nuno.errors import MissingPackageError

log = logging.getLogger(__name__)
_warned: set[str] = set()


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


@contextmanager
def warnings_logged() -> Iterator[None]:
    """Let MuJoCo's own warnings be logged, each kind once, in place of a file and the terminal."""
    mujoco = mujoco_package()
    before: Any = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_tell)
    try:
        with warnings.catch_warnings():
            # of flexes with a stable neo-Hookean law, whose forces the compiler does not count
            warnings.filterwarnings("ignore", message=".*is not rigid and has no equality constraints.*")
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def _tell(message: str) -> None:
    kind = message.partition(":")[0].partition(" at DOF")[0]
    if kind not in _warned:
        _warned.add(kind)
        log.warning("mujoco: %s", message)
