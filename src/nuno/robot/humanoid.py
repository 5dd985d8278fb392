"""Humanoid: a robot that stands in the world, with cameras and links that can enter it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nuno.robot.description import FileName
from nuno.robot.robot import Robot
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.reach import Reach
    from nuno.world.world import World


class Humanoid(Robot):
    """A robot whose base stands free in the world; its own pose is that of the base link.

    It starts in its posture, with its soles on the floor z = 0 and the point between them at the origin.

    Args:
        name: "talos", "g1", another name in ``robots``, or the path of a URDF file.
        srdf: Of a URDF file: which pairs of links may overlap, and postures.
        package_dirs: Folders that ``package://`` is looked up in; None are those that the URDF lies in.
        robots: A table of robots (TOML) in place of Nuno's own ``robots.toml``, which explains its form.

    Raises:
        UnknownNameError: no robot, link or joint of a name that was given.
        RobotModelError: a file that is not there, or a joint that is no hinge or slide.
        MeshError: the URDF names a mesh that is not there.
    """

    @checked
    def __init__(
        self, name: FileName = "talos", *, srdf: FileName | None = None,
        package_dirs: Sequence[FileName] | None = None, robots: FileName | None = None,
    ) -> None:  # fmt: skip
        super().__init__(name, srdf=srdf, package_dirs=package_dirs, robots=robots)
        self.stand()

    def __repr__(self) -> str:
        return f"<Humanoid {self.name!r}, {len(self.joint_names)} joints>"

    @checked
    def enter(self, world: World, meshes: str = "collision") -> Links:
        """Put the links into a world, as static bodies that can follow the robot; see ``Links``.

        Args:
            world: A world that is no batch.
            meshes: "collision": convex hulls that all else touches; "visual": as it looks, touched by nothing.
        """
        from nuno.robot.links import Links

        return Links(self, world, meshes)

    def reach(self, targets: Mapping[str, Any], **options: Any) -> Reach:
        """Take a configuration in which frames are where they are asked to be; see ``nuno.robot.reach.reach``."""
        from nuno.robot.reach import reach

        return reach(self, targets, **options)
