"""Coordinates: a position and an orientation, in EusLisp's words (locate, translate, rotate, assoc)."""

from __future__ import annotations

from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError
from nuno.shapes import quaternion as quat
from nuno.validation import checked, finite_array

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
Self = TypeVar("Self", bound="Coordinates")
Frame = Literal["local", "world"]


Pose = tuple[np.ndarray, np.ndarray]
"""Position [m] and quaternion (w, x, y, z), (3,) and (4,), or (worlds, 3) and (worlds, 4)."""


class Coordinates:
    """A frame in the world, which may follow a parent frame.

    In a batch, the pose may differ by world: position (worlds, 3), quaternion (worlds, 4).

    Args:
        position: (3,) or (worlds, 3) [m], in the world frame.
        quaternion: (4,) or (worlds, 4), (w, x, y, z), in the world frame; scaled to unit length.

    Raises:
        InvalidInputError: not finite, another shape, or a quaternion of length zero.
    """

    def __init__(self, position: ArrayLike = (0.0, 0.0, 0.0), quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)):
        # Both are relative to the parent, which is the world where there is none.
        self._position = finite_array("position", position, (3,), ("worlds", 3))
        self._quaternion = quat.unit("quaternion", quaternion, (4,), ("worlds", 4))
        self._parent: Coordinates | None = None
        self._children: list[Coordinates] = []

    def __repr__(self) -> str:
        return f"{type(self).__name__}(position={self.position.tolist()}, quaternion={self.quaternion.tolist()})"

    @property
    def position(self) -> np.ndarray:
        """(3,) or (worlds, 3) float [m], a copy, in the world frame."""
        return np.array(self.pose()[0])

    @property
    def quaternion(self) -> np.ndarray:
        """(4,) or (worlds, 4) float, (w, x, y, z), a copy, in the world frame."""
        return np.array(self.pose()[1])

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) or (worlds, 3, 3) float, the rotation matrix from this frame to the world."""
        return quat.to_matrix(self.pose()[1])

    @property
    def parent(self) -> Coordinates | None:
        """The frame that this one follows, or None."""
        return self._parent

    @property
    def children(self) -> tuple[Coordinates, ...]:
        """The frames that follow this one."""
        return tuple(self._children)

    def locate(self: Self, position: ArrayLike) -> Self:
        """Put the origin at ``position``, (3,) or (worlds, 3) [m], in the world frame.

        Returns:
            This frame, as ``translate``, ``rotate`` and ``transform`` do.
        """
        goal = finite_array("position", position, (3,), ("worlds", 3))
        self._place(goal, self.pose()[1])
        return self

    @checked
    def translate(self: Self, offset: ArrayLike, wrt: Frame = "local") -> Self:
        """Move by ``offset``, (3,) or (worlds, 3) [m], along this frame's axes or the world's."""
        step = finite_array("offset", offset, (3,), ("worlds", 3))
        position, quaternion = self.pose()
        if _checked_frame(wrt) == "local":
            step = quat.rotate(quaternion, step)
        self._place(position + step, quaternion)
        return self

    @checked
    def rotate(self: Self, angle: ArrayLike, axis: ArrayLike | str, wrt: Frame = "local") -> Self:
        """Turn about the origin of this frame, which stays where it is.

        Args:
            angle: Scalar or (worlds,) [rad].
            axis: (3,), any length but zero, or "x", "y", "z".
            wrt: Whether ``axis`` is given in this frame ("local") or in the world's.

        Raises:
            InvalidInputError: an axis of length zero, a frame that is neither, or a value that is not finite.
        """
        turn = finite_array("angle", angle, (), ("worlds",))
        if isinstance(axis, str):
            if axis not in AXES:
                raise InvalidInputError(f"axis must be 'x', 'y', 'z' or a vector (3,), got {axis!r}")
            axis = AXES[axis]
        direction = finite_array("axis", axis, (3,))
        length = np.linalg.norm(direction)
        if length < 1e-12:
            raise InvalidInputError("axis must not be of length zero")
        q = quat.from_axis_angle(direction / length, turn)
        position, quaternion = self.pose()
        turned = quat.multiply(quaternion, q) if _checked_frame(wrt) == "local" else quat.multiply(q, quaternion)
        self._place(position, turned / np.linalg.norm(turned, axis=-1, keepdims=True))
        return self

    @checked
    def transform(self: Self, other: Coordinates, wrt: Frame = "local") -> Self:
        """Move by another frame's pose, given in this frame ("local") or in the world.

        Raises:
            InvalidInputError: what is given is no ``Coordinates``, or the frame neither "local" nor "world".
        """
        if not isinstance(other, Coordinates):
            raise InvalidInputError(f"transform needs Coordinates, got {type(other).__name__}")
        own, motion = self.pose(), other.pose()
        self._place(*(compose(own, motion) if _checked_frame(wrt) == "local" else compose(motion, own)))
        return self

    def copy_coords(self) -> Coordinates:
        """Return new Coordinates at this pose, with no parent and no children."""
        return Coordinates(*self.pose())

    def to_world(self, points: ArrayLike) -> np.ndarray:
        """Map points (n, 3) [m] of this frame to the world, (n, 3) or (worlds, n, 3)."""
        return apply(self.pose(), finite_array("points", points, ("n", 3), ("worlds", "n", 3)))

    def to_local(self, points: ArrayLike) -> np.ndarray:
        """Map points (n, 3) [m] of the world to this frame, (n, 3) or (worlds, n, 3)."""
        return apply(invert(self.pose()), finite_array("points", points, ("n", 3), ("worlds", "n", 3)))

    def assoc(self, child: Coordinates) -> Coordinates:
        """Let ``child`` follow this frame from now on; its present pose does not change.

        Returns:
            The child.

        Raises:
            BodyStateError: the child has a parent already, or is this frame or one of its ancestors.
            InvalidInputError: the child is no ``Coordinates``.
        """
        if not isinstance(child, Coordinates):
            raise InvalidInputError(f"assoc needs Coordinates, got {type(child).__name__}")
        if child._parent is not None:
            raise BodyStateError("the child follows another frame already; dissoc it there first")
        ancestor: Coordinates | None = self
        while ancestor is not None:
            if ancestor is child:
                raise BodyStateError("a frame cannot follow itself, nor a frame that follows it")
            ancestor = ancestor._parent
        child._follow(self)
        self._children.append(child)
        child._moved()  # not yet, but it may from now on
        return child

    def dissoc(self, child: Coordinates) -> Coordinates:
        """Let ``child`` stand still from now on, at its present pose, and return it.

        Raises:
            BodyStateError: the child does not follow this frame.
        """
        if not any(c is child for c in self._children):
            raise BodyStateError("this frame has no such child")
        pose = child.pose()
        self._children = [c for c in self._children if c is not child]
        child._parent = None
        child._position, child._quaternion = pose
        child._moved()
        return child

    def _follow(self, parent: Coordinates) -> None:
        relative = compose(invert(parent.pose()), self.pose())
        self._parent, (self._position, self._quaternion) = parent, relative

    @property
    def relative_pose(self) -> Pose:
        """Position [m] and quaternion in the parent's frame, or the world's where there is none; not to be changed."""
        return self._position, self._quaternion

    def pose(self) -> Pose:
        """Return position [m] and quaternion in the world frame; neither is a copy, nor to be changed."""
        own = self.relative_pose
        return own if self._parent is None else compose(self._parent.pose(), own)

    def _place(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        pose = (position, quaternion)
        if self._parent is not None:
            pose = compose(invert(self._parent.pose()), pose)
        self._position, self._quaternion = pose
        self._moved()

    def _moved(self) -> None:
        """Be told that the pose has changed, by ``_place`` here or in an ancestor."""
        for child in self._children:
            child._moved()


def compose(a: Pose, b: Pose) -> Pose:
    """Return the pose of ``b``, given in the frame ``a``, in the frame that ``a`` is given in."""
    return a[0] + quat.rotate(a[1], b[0]), quat.multiply(a[1], b[1])


def invert(pose: Pose) -> Pose:
    """Return the inverse of a pose."""
    q = quat.inverse(pose[1])
    return -quat.rotate(q, pose[0]), q


def apply(pose: Pose, points: np.ndarray) -> np.ndarray:
    """Map points (n, 3) or (worlds, n, 3) by a pose, of which either part may have a world axis."""
    position, quaternion = (part[..., None, :] for part in pose)
    return position + quat.rotate(quaternion, points)


def _checked_frame(wrt: Any) -> str:
    if not isinstance(wrt, str) or wrt not in ("local", "world"):
        raise InvalidInputError(f"wrt must be 'local' or 'world', got {wrt!r}")
    return str(wrt)
