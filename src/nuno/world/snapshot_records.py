"""Records of a snapshot: bodies, their dynamics, and grips, as they were at one instant."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.dynamics.dynamics import State
from nuno.dynamics.push import Push
from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.tie import HoldSpec, TieSpec
from nuno.materials import Material
from nuno.shapes.coordinates import Pose
from nuno.shapes.path import Path
from nuno.shapes.shape import Shape


@dataclass(frozen=True, eq=False)
class DynamicsRecord:
    """The dynamics of one body; the arrays of the solver's state are (worlds, ...) each."""

    material: Material
    friction: Any
    state: State
    pushes: tuple[Push, ...]


@dataclass(frozen=True, eq=False)
class BodyRecord:
    """One body. The pose is relative to the parent where that is a body of the world, else to the world."""

    key: str
    name: str
    shape: Shape
    color: Any
    friction: Any
    thickness: Any
    group: int
    collides_with: int
    position: np.ndarray
    quaternion: np.ndarray
    parent: str | None
    deformed: np.ndarray | None  # (worlds, n, 3) [m], with the pose that they belong to
    deformed_position: np.ndarray | None
    deformed_quaternion: np.ndarray | None
    dynamics: DynamicsRecord | None
    path: Path | None = None  # that the body follows
    # relative to a frame that is no body of the world, which the body follows
    relative: Pose | None = field(default=None, metadata={"file": False})

    @property
    def deformation(self) -> tuple[np.ndarray, Pose] | None:
        """Return a deformed body's vertices, and the pose that they belong to; None where it is not deformed."""
        if self.deformed is None:
            return None
        assert self.deformed_position is not None and self.deformed_quaternion is not None
        return self.deformed, (self.deformed_position, self.deformed_quaternion)


@dataclass(frozen=True, eq=False)
class GripRecord:
    """One active grip, on the body with the key ``body``, led by the one with the key ``target``, if any."""

    key: str
    body: str
    spec: GripSpec | TieSpec | HoldSpec | JointSpec
    target: str | None
    offsets: Any  # of points an array, of a rigid body a place and a turn, or None
    followed: tuple[float, Pose, Pose] | None = None  # see ``Grip``
    borne: np.ndarray | None = None  # (worlds, 6) [N, N m], what it bore in the last frame, where that is known
