"""Writing worlds as scene files of other programs."""

from __future__ import annotations

import os
from collections.abc import Mapping

from nuno.bodies.surface_file import check_extension
from nuno.errors import InvalidInputError
from nuno.files.whole_file import file_path, write_whole
from nuno.joints.joint import Joint
from nuno.scenes.describe_world import describe_world
from nuno.scenes.scene_report import SceneReport, report_of
from nuno.validation import checked, count
from nuno.world.world import World

WRITABLE = (".xml", ".mjcf", ".usd", ".usda", ".usdc")


@checked
def save_scene(
    world: World, path: str | os.PathLike[str], index: int | None = None, *, joints: Mapping[str, Joint] | None = None
) -> SceneReport:  # fmt: skip
    """Write a world as it is now as MJCF or USD; a file that is there is replaced.

    The file holds the world in the format's own words, for other programs, and what the format has no word for in a
    part that ``nuno.load_scene`` reads (in MJCF a text, in USD custom data). What neither holds is told once in the log
    and in the report that is returned: paths, pushes, robots' programs, grips between vertices. For everything of a
    world to the bit, ``world.save`` is there.

    Args:
        world: The world.
        path: Ends with .xml or .mjcf for MJCF, which needs no package, or .usd, .usda or .usdc (the extra ``usd``).
        index: Which world of a batch; None for a single one.
        joints: Joints by what they are to be called, such as ``LoadedScene.joints``; others are called by their kind
            and bodies.

    Raises:
        InvalidInputError: another extension, a batch without ``index``, or out of range.
        MissingPackageError: the format's package is not installed.
        FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
    """
    goal = file_path(path)
    check_extension(goal, *WRITABLE)
    if index is not None:
        count("index", index, low=0)
    if not world.bodies:
        raise InvalidInputError("the world has no bodies to save")
    names = {joint.key: name for name, joint in (joints or {}).items()}
    is_mjcf = goal.suffix.lower() in (".xml", ".mjcf")
    if is_mjcf:
        from nuno.scenes.mjcf_writer import write_mjcf

        scene = describe_world(world, index, names)
        write_whole(goal, write_mjcf(scene))
        return report_of(scene, goal, "saved")
    from nuno.scenes.usd_writer import write_usd

    scene = describe_world(world, index, names)
    write_whole(goal, write_usd(scene, goal.suffix.lower()))
    return report_of(scene, goal, "saved")
