"""Reading scene files of other programs into a world."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import FileFormatError, InvalidInputError
from nuno.files.whole_file import file_path
from nuno.joints.grip import Grip
from nuno.joints.joint import Joint
from nuno.scenes.build_world import build_world
from nuno.scenes.scene_description import SceneDescription
from nuno.scenes.scene_report import SceneReport, report_of
from nuno.validation import checked, flag, text
from nuno.world.world import World

USD = (".usd", ".usda", ".usdc", ".usdz")
READABLE = (".xml", ".mjcf", ".urdf", *USD)


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """A scene file's bodies, joints and grips in a world.

    Attributes:
        world: The world.
        bodies: By their names in the file; in the world a name that was taken has a number.
        joints: Likewise.
        grips: Of vertices that the file holds in place.
        report: What there is, and what was left out or approximated.
    """

    world: World
    bodies: Mapping[str, Body]
    joints: Mapping[str, Joint]
    grips: tuple[Grip, ...]
    report: SceneReport


@checked
def load_scene(
    path: str | os.PathLike[str], world: World | None = None, *, keyframe: str | None = None,
    fixed_base: bool = True, package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> LoadedScene:  # fmt: skip
    """Read a scene of MJCF, URDF or USD into a world.

    What does not move becomes static bodies. What is free gets ``Rigid`` dynamics, and trees of joints become bodies
    with Nuno's joints. Flexes, deformables and tetrahedral meshes become cloth and soft bodies. Lengths are converted
    to metres and the up axis to z. What a file holds besides is left out or approximated, which is told once in the log
    and in the report. If the scene cannot be read or added, the world stays as it was.

    Args:
        path: Ends with .xml or .mjcf (MJCF, the extra ``mujoco``), .urdf (the extra ``robot``), or .usd, .usda, .usdc
            or .usdz (the extra ``usd``).
        world: The world to add to, which keeps its own gravity and frame rate; None makes one with the file's.
        keyframe: Of MJCF, the key frame to begin in; None is the model's initial state, or where Nuno saved it.
        fixed_base: Of URDF, whether the root link stands still; otherwise it moves freely.
        package_dirs: Of URDF, folders that ``package://`` names are looked up in; those above the file always are.

    Raises:
        InvalidInputError: there is no such file, or its name ends otherwise.
        FileFormatError: the file is damaged, or of units that are none.
        MeshError: a mesh that the file names cannot be read.
        MissingPackageError: the format's package is not installed.
    """
    source = file_path(path)
    kind = source.suffix.lower()
    if kind not in READABLE:
        raise InvalidInputError(f"a scene's file must end with {', '.join(READABLE)}, got {source.name!r}")
    if keyframe is not None:
        text("keyframe", keyframe)
        if kind not in (".xml", ".mjcf"):
            raise InvalidInputError(f"keyframe is for MJCF, which {source.name!r} is not")
    flag("fixed_base", fixed_base)
    folders = [file_path(folder, "package_dirs") for folder in package_dirs]
    if not source.is_file():
        raise InvalidInputError(f"there is no scene file {str(source)!r}")
    scene = _read(source, kind, keyframe, fixed_base, folders)
    if not scene.bodies:
        raise FileFormatError(f"{str(source)!r} holds no body that Nuno can have" + _why(scene))
    goal = world
    if goal is None:
        settings = {} if scene.frame_rate is None else {"frame_rate": scene.frame_rate, "substeps": scene.substeps}
        goal = World(gravity=scene.gravity, **settings)  # type: ignore[arg-type]
    else:
        if not np.allclose(goal.gravity, scene.gravity, rtol=0.0, atol=1e-6):
            scene.note("the world keeps its own gravity", f"{tuple(scene.gravity)} m/s2")
        if scene.frame_rate is not None and scene.frame_rate != goal.frame_rate:
            scene.note("the world keeps its own frame rate", f"{scene.frame_rate} 1/s")
    bodies, joints, grips = build_world(scene, goal)
    return LoadedScene(goal, bodies, joints, tuple(grips), report_of(scene, source, "loaded"))


def _read(source: Path, kind: str, keyframe: str | None, fixed_base: bool, folders: list[Path]) -> SceneDescription:
    if kind in USD:
        from nuno.scenes.usd_reader import read_usd

        return read_usd(source)
    if kind == ".urdf":
        from nuno.scenes.urdf_reader import read_urdf

        return read_urdf(source, folders, fixed_base)
    from nuno.scenes.mjcf_reader import read_mjcf

    return read_mjcf(source, keyframe)


def _why(scene: SceneDescription) -> str:
    found = "; ".join(f"{what}: {', '.join(names[:3])}" for what, names in scene.notes.items())
    return f" ({found})" if found else ""
