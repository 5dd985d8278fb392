"""Links: a robot's shapes in a world, and how they follow it."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
        joints, offsets = self._rows, self.finger_bodies.offset(self._offsets, self.robot.angle_vector())
        turns = np.concatenate([pin.SE3ToXYZQUAT(own) for own in self._placements]).reshape(-1, 7)[:, [6, 3, 4, 5]]
        places = _placed(self._joint_axes[joints], self._joint_places[joints], offsets)
        return places, np.einsum("kij,kj->ki", self._turned_by, turns[joints])

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
        positions, quaternions = self.poses()
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
