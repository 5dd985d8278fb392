"""Gymnasium, whose interface the environments have, or an error that says how to get it."""

from nuno.errors import MissingPackageError

try:
    import gymnasium
except ImportError as error:
    raise MissingPackageError("gymnasium", "envs", "learning environments") from error

__all__ = ["gymnasium"]
