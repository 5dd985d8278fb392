"""Pinocchio and coal, which compute robots' kinematics, dynamics and collisions, or an error that says how to get them.

They are packages of the extra ``robot``: other modules import them from here, so that a program without them is told
what to install (the package is called ``pin``; ``pip install pinocchio`` brings another one).
"""

from nuno.errors import MissingPackageError

try:
    import coal
    import pinocchio as pin
except ImportError as error:
    raise MissingPackageError("pin", "robot", "a robot's model") from error

__all__ = ["coal", "pin"]
