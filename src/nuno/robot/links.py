"""Links: a robot's shapes in a world, and how they follow it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot.fingers import FingerBodies
from nuno.robot.pinocchio import pin
from nuno.robot.spatial_arrays import placement_arrays, quaternions_of
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose
from nuno.tables.path_batch import KinematicGroup
from nuno.validation import checked, number

if TYPE_CHECKING:
    from nuno.robot.robot import Robot
    from nuno.world.world import World

MESHES = ("collision", "visual", "joints")
KEPT_PARTS = 64
"""Of sets of joints that move together, for which is kept which bodies they move."""


@dataclass(frozen=True, eq=False)
class _Part:
    """Some of the bodies, and what it takes to tell where they are.

    Attributes:
        which: (k,) int, the bodies.
        joints: (k,) int, Pinocchio's joints that carry them.
        placements: Pinocchio's, of those joints, each once.
        turns: (k, 4) int, where in those placements as ``pin.SE3ToXYZQUAT`` has them, one after the other, the numbers
            w, x, y, z are.
        turned_by: (k, 4, 4) float, by which they are multiplied.
    """

    which: np.ndarray
    joints: np.ndarray
    placements: list[Any]
    turns: np.ndarray
    turned_by: np.ndarray

    def place(self, axes: np.ndarray, origins: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (k, 3) [m] and quaternions (k, 4).

        Args:
            axes: (joints, 3, 3), of all of Pinocchio's joints.
            origins: (joints, 3) [m].
            offsets: (k, 3) [m], where the bodies are in the frames of their joints.
        """
        # joined as bytes, which takes a fraction of what putting many short arrays together does
        turns = np.frombuffer(b"".join(map(pin.SE3ToXYZQUAT, self.placements))).take(self.turns)
        places = _placed(axes[self.joints], origins[self.joints], offsets)
        return places, np.einsum("kij,kj->ki", self.turned_by, turns)


class Links:
    """The links of a robot as static bodies of a world, "talos/arm_left_1_link" ...

    They stay where they are until ``follow`` sets them on their way to where the robot is; what touches them feels
    their surfaces move. ``robot.enter(world)`` makes them.

    Args:
        robot: The robot.
        world: A world that is no batch.
        meshes: "collision" or "visual", a body for each shape; "joints": one for each joint, of all its collision
            shapes, whose frame is the joint's.

    Attributes:
        bodies: One for each shape; a name that the world has already gets a number.
        names: Of the links that those are the shapes of.
        joints: Pinocchio's indices of the joints that carry them.
        are_joints: Whether there is one body for each joint; those of fingers that slide follow.
        finger_bodies: Which bodies are fingers'; they go in and out with the hand's joint.

    Raises:
        InvalidInputError: other meshes, or a batch.
        MeshError: a mesh that cannot be read.
    """

    @checked
    def __init__(self, robot: Robot, world: World, meshes: str = "collision") -> None:
        if meshes not in MESHES:
            raise InvalidInputError(f"meshes must be one of {MESHES}, got {meshes!r}")
        if world.world_count != 1:
            raise InvalidInputError(f"a robot enters one world, not a batch of {world.world_count}; imagine after that")
        self.robot, self.world = robot, world
        self.are_joints = meshes == "joints"
        shapes = robot.geometry.of_joints() if self.are_joints else robot.geometry.shapes(meshes)
        passes = {"group": 0, "collides_with": 0}
        self.bodies: tuple[Body, ...] = tuple(
            Body(
                own.shape, name=f"{robot.name}/{own.link}", color=own.color,
                **(passes if meshes == "visual" or own.is_bare else {}),  # type: ignore[arg-type]
            )
            for own in shapes
        )  # fmt: skip
        self.names = tuple(own.link for own in shapes)
        self._keys = tuple(body.key for body in self.bodies)
        self.joints: tuple[int, ...] = tuple(own.joint for own in shapes)
        self.finger_bodies = FingerBodies(robot, self.names)
        self._rows = np.array(self.joints, dtype=int)
        self._offsets = np.array([own.position for own in shapes]).reshape(-1, 3)
        self._turns = np.array([own.quaternion for own in shapes]).reshape(-1, 4)
        # by which the quaternion of its joint is multiplied for that of a shape
        self._turned_by = np.stack([quat.multiply(row, self._turns) for row in np.eye(4)], axis=2)
        self._placements = robot.data.oMi.tolist()
        self._joint_axes, self._joint_places = placement_arrays(self._placements)
        self._all = self._part(np.arange(len(self.bodies)))
        self._moved_with: dict[bytes, _Part] = {}  # by which joints have moved
        self._last: tuple[np.ndarray, Pose, Pose] | None = None  # angles, the base, and where the bodies were then
        self._inside = True
        self._kinematic_group = KinematicGroup(self._keys)
        for body in self.bodies:
            body._links = self  # a viewer draws the robot's visual meshes in their place
        positions, quaternions = self.poses()
        with world.lock:
            for body, position, quaternion in zip(self.bodies, positions, quaternions, strict=True):
                body._position, body._quaternion = position, quaternion
                world.add(body)

    @checked
    def offset_of(self, k: int) -> Pose:
        """Return where the k-th body is in the frame of its joint; a finger's, with an open hand."""
        return self._offsets[k], self._turns[k]

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the robot has its shapes now: positions (n, 3) [m] and quaternions (n, 4)."""
        self.robot.update()
        offsets = self.finger_bodies.offset(self._offsets, self.robot.angle_vector())
        return self._all.place(self._joint_axes, self._joint_places, offsets)

    def _poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what `poses` does, never to be written to: only what has moved since the last time is worked out."""
        self.robot.update()
        angles, base, last = self.robot.angle_vector(), self.robot.pose(), self._last
        part = self._all
        if last is not None and base[0] is last[1][0] and base[1] is last[1][1]:
            part = self._moved(angles != last[0])
        if last is not None and not len(part.which):
            return last[2]
        offsets = self.finger_bodies.offset(self._offsets, angles)
        if part is self._all or last is None:
            found = part.place(self._joint_axes, self._joint_places, offsets)
        else:
            found = last[2][0].copy(), last[2][1].copy()
            own = part.place(self._joint_axes, self._joint_places, offsets[part.which])
            found[0][part.which], found[1][part.which] = own
        self._last = angles, base, found
        return found

    def _moved(self, rows: np.ndarray) -> _Part:
        """Return the bodies that go along with joints, of which ``rows`` (dof,) bool is True; of most of them all."""
        part = self._moved_with.get(kind := rows.tobytes())
        if part is None:
            joints = set((np.flatnonzero(rows) + 2).tolist())
            moved = [not joints.isdisjoint(self.robot.model.supports[own].tolist()) for own in self.joints]
            for finger, own in zip(self.finger_bodies.fingers, self.finger_bodies.bodies, strict=True):
                for k in own if rows[finger.row] else ():
                    moved[k] = True
            which = np.flatnonzero(moved)
            part = self._part(which) if 2 * len(which) < len(moved) else self._all
            if len(self._moved_with) >= KEPT_PARTS:
                self._moved_with.clear()
            self._moved_with[kind] = part
        return part

    def _part(self, which: np.ndarray) -> _Part:
        joints = self._rows[which]
        carriers, carrier = np.unique(joints, return_inverse=True)
        turns = 7 * carrier.reshape(-1, 1) + np.array([6, 3, 4, 5])
        placements = [self._placements[joint] for joint in carriers.tolist()] or self._placements[:1]
        return _Part(which, joints, placements, turns, self._turned_by[which])

    def poses_at(
        self, axes: np.ndarray, origins: np.ndarray, angles: np.ndarray, which: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return where the shapes of robots of this model are whose joints are elsewhere, as ``poses`` does to the bit.

        Args:
            axes: (worlds, joints, 3, 3), rotation matrices of Pinocchio's joints.
            origins: (worlds, joints, 3) [m], where they are.
            angles: (worlds, dof) of the joints.
            which: (n,) int, the shapes that are asked for; None is all.

        Returns:
            Positions (worlds, n, 3) [m] and quaternions (worlds, n, 4).
        """
        which = np.arange(len(self._rows)) if which is None else which
        shape = len(axes), len(which)
        carriers, joints = np.unique(self._rows[which], return_inverse=True)
        offsets = np.broadcast_to(self.finger_bodies.offset(self._offsets, angles)[..., which, :], (*shape, 3))
        # one long list, of matrices that lie column by column as Pinocchio's do: einsum rounds others in another way
        by_column = axes.swapaxes(-1, -2)[:, self._rows[which]].reshape(-1, 3, 3)
        turns = quaternions_of(axes[:, carriers])[..., [3, 0, 1, 2]][:, joints]
        own_origins = origins[:, self._rows[which]].reshape(-1, 3)
        places = _placed(by_column.swapaxes(-1, -2), own_origins, offsets.reshape(-1, 3))
        return places.reshape(*shape, 3), np.einsum("kij,...kj->...ki", self._turned_by[which], turns)

    def follow(self, seconds: float) -> None:
        """Let the bodies move from where they are to where the robot is now, in ``seconds`` [s] from the world's time.

        Zero puts them there at once: a jump, which drags nothing along.

        Raises:
            BodyStateError: the links have left their world.
        """
        duration = number("seconds", seconds, low=0.0)
        self._check_inside()
        positions, quaternions = self._poses()
        with self.world.lock:
            start, now = self._kinematic_group.arrived(self.bodies, self.world.time), self.world.time
            if duration == 0.0:
                times, places, turns = np.array([now]), positions[:, None], quaternions[:, None]
            else:
                times = np.array([now, now + duration])
                places, turns = np.empty((len(positions), 2, 3)), np.empty((len(positions), 2, 4))
                places[:, 0], places[:, 1] = start[0], positions
                turns[:, 0], turns[:, 1] = start[1], quaternions
            self._kinematic_group.lead(self.bodies, self.world, times, places, turns)
            if duration == 0.0:
                for body, place, turn in zip(self.bodies, positions, quaternions, strict=True):
                    body._position, body._quaternion = place, turn

    def stop(self) -> None:
        """Let the bodies stand still where they are, and follow the robot no more until ``follow``."""
        self._check_inside()
        with self.world.lock:
            for body in self.bodies:
                if body._path is not None:
                    self.world.move(body, None)

    def leave(self) -> None:
        """Take the bodies out of the world.

        Raises:
            BodyStateError: they have left it already.
        """
        if not self._inside:
            self._check_inside()
        with self.world.lock:
            for body in self.bodies:
                if body._world is self.world:
                    self.world.remove(body)
        self._inside = False

    @property
    def missing(self) -> list[str]:
        """Names of those that are not in the world any more."""
        return [body.name for body in self.bodies if body._world is not self.world]

    def _check_inside(self) -> None:
        if not self._inside:
            raise BodyStateError(f"the links of {self.robot.name!r} have left the world")
        if missing := self.missing:
            raise BodyStateError(
                f"{len(missing)} links are no longer in the world, the first is {missing[0]!r}: add them, restore a "
                "snapshot that has them, or let the robot leave"
            )


def _placed(axes: np.ndarray, origins: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return where shapes are (k, 3) [m] whose joints are there."""
    return origins + np.einsum("kij,kj->ki", axes, offsets)
