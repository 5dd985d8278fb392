"""Descriptions: what Nuno knows of a robot beside its URDF, from a table in TOML."""

from __future__ import annotations

import math
import os
import tomllib
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np

from nuno.errors import (
    FileFormatError,
    InvalidInputError,
    MeshError,
    MissingPackageError,
    RobotModelError,
    UnknownNameError,
)
from nuno.shapes import quaternion as quat
from nuno.validation import count, finite_array, number

ROBOT_TABLE = Path(__file__).with_name("robots.toml")
ENTRY = ("urdf", "srdf", "posture", "frames", "feet", "cameras", "hands", "groups", "velocity_limits")
"""Entries of a robot's table; ``robots.toml`` explains them."""
FileName = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class FrameOnLink:
    """A frame that a link carries.

    Attributes:
        link: The link's name.
        position: (3,) float [m], in the link's frame.
        quaternion: (4,) float, (w, x, y, z), likewise.
        size: (2,) float [m], of the sole along x and y, where the frame is a foot's.
    """

    link: str
    position: np.ndarray
    quaternion: np.ndarray
    size: np.ndarray | None = None


@dataclass(frozen=True)
class CameraOnFrame:
    """A camera that a frame carries.

    Attributes:
        frame: The frame's name: z looks forward, x right, y down.
        width: [px].
        height: [px].
        field_of_view: Horizontal angle of view [rad].
        ahead: How far ahead of the frame the pinhole is [m], so that the head's own shapes are behind it.
        aside: How far to the right of the frame it is [m]; half the baseline of a stereo pair.
    """

    frame: str
    width: int
    height: int
    field_of_view: float
    ahead: float = 0.0
    aside: float = 0.0


@dataclass(frozen=True, eq=False)
class HandOnFrame:
    """The object that a hand closes on, in the frame of the same name.

    Attributes:
        low: (3,) float [m], lower corner of the volume between the open fingers.
        high: (3,) float [m], upper corner.
        joint: The joint that closes it, or None.
        open: The joint's position when the hand is open [rad or m].
        closed: Likewise when the fingers meet.
        width: How far apart the open fingers are [m]; 0 of a hand without fingers.
        fingers: Links of each finger that the model fixes to the hand, and that slides as the joint closes it.
    """

    low: np.ndarray
    high: np.ndarray
    joint: str | None = None
    open: float = 0.0
    closed: float = 0.0
    width: float = 0.0
    fingers: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class RobotDescription:
    """A robot's files, and its frames by role.

    Attributes:
        name: What it is called.
        urdf: The robot's links and joints.
        srdf: Pairs of links that may overlap, and postures; None where there is no such file.
        package_dirs: Folders that ``package://`` names are looked up in.
        posture: A group state of the SRDF, or joint angles by name [rad]; others are 0.
        frames: By role ("left_hand", "imu" ...).
        feet: Of those, the soles of the feet.
        cameras: By name.
        hands: By the name of the frame of each hand that closes.
        groups: Joints by the name of the group that a controller moves; empty where the frames tell.
        velocity_limits: By joint [rad/s; m/s for slides], in place of the URDF's.
    """

    name: str
    urdf: Path
    srdf: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    posture: str | Mapping[str, float] = field(default_factory=dict)
    frames: Mapping[str, FrameOnLink] = field(default_factory=dict)
    feet: tuple[str, ...] = ()
    cameras: Mapping[str, CameraOnFrame] = field(default_factory=dict)
    hands: Mapping[str, HandOnFrame] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    velocity_limits: Mapping[str, float] = field(default_factory=dict)


def find_description(
    name: FileName, srdf: FileName | None, package_dirs: Sequence[FileName] | None, robots: FileName | None
) -> RobotDescription:
    """Return the description of a robot in a table, or that of a URDF file, which has no roles.

    Raises:
        UnknownNameError: the table has no robot of that name.
        RobotModelError: a file that is not there.
        FileFormatError: a table that cannot be read.
        MeshError: the URDF names a mesh that is not there.
        InvalidInputError: a name that is no text or path, or a number in the table that cannot be used.
    """
    if not isinstance(name, str | os.PathLike):
        raise InvalidInputError(f"a robot's name must be a text or a path, got {type(name).__name__}")
    given = tuple(Path(folder) for folder in package_dirs or ())
    if Path(name).suffix.lower() in (".urdf", ".xml"):
        urdf = Path(name).resolve()
        made = RobotDescription(urdf.stem, urdf, None, given or tuple(urdf.parents[:5]))
    else:
        made = _in_table(str(name), ROBOT_TABLE if robots is None else Path(robots), given)
    if srdf is not None:
        made = RobotDescription(**{**vars(made), "srdf": Path(srdf)})
    for what, path in (("URDF", made.urdf), ("SRDF", made.srdf)):
        if path is not None and not path.is_file():
            raise RobotModelError(f"there is no {what} file {str(path)!r}")
    _check_meshes(made)
    return made


def robot_data() -> Path:
    """Return the folder that the package example-robot-data keeps its robots in.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        found = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except PackageNotFoundError as error:
        raise MissingPackageError("example-robot-data", "robot", "a known robot such as Talos") from error
    return Path(str(found))


def _in_table(name: str, table: Path, package_dirs: tuple[Path, ...]) -> RobotDescription:
    try:
        robots = tomllib.loads(table.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FileFormatError(f"cannot read {str(table)!r} as a table of robots: {error}") from error
    if name not in robots:
        raise UnknownNameError("robot", name, list(robots))
    try:
        return _description(name, robots[name], table.parent, package_dirs)
    except (KeyError, TypeError, AttributeError) as error:
        raise FileFormatError(f"the entry {name!r} of {str(table)!r} lacks or misuses {error}") from error


def _description(name: str, entry: dict[str, Any], folder: Path, package_dirs: tuple[Path, ...]) -> RobotDescription:
    strangers = set(entry) - set(ENTRY)
    if strangers:
        raise FileFormatError(f"the entry {name!r} has {min(strangers)!r}; it may have {', '.join(ENTRY)}")
    feet = {role: _frame(role, given) for role, given in entry.get("feet", {}).items()}
    frames = {role: _frame(role, given) for role, given in entry.get("frames", {}).items()}
    cameras = {
        role: CameraOnFrame(
            str(given["frame"]), count("width", given["width"]), count("height", given["height"]),
            number("field_of_view", given["field_of_view"], above=0.0, high=math.pi - 0.01),
            number("ahead", given.get("ahead", 0.0)), number("aside", given.get("aside", 0.0)),
        )
        for role, given in entry.get("cameras", {}).items()
    }  # fmt: skip
    hands = {role: _hand(role, given) for role, given in entry.get("hands", {}).items()}
    for role in feet:
        if feet[role].size is None:
            raise FileFormatError(f"the foot {role!r} of {name!r} needs the size of its sole")
    groups = {group: _joints(group, given) for group, given in entry.get("groups", {}).items()}
    speeds = {
        joint: number(f"the velocity limit of {joint!r}", given, above=0.0)
        for joint, given in entry.get("velocity_limits", {}).items()
    }
    urdf, srdf = _placed(entry["urdf"], folder), entry.get("srdf")
    return RobotDescription(
        name, urdf, None if srdf is None else _placed(srdf, folder), package_dirs or tuple(urdf.parents[:5]),
        entry.get("posture", {}), frames | feet, tuple(feet), cameras, hands, groups, speeds,
    )  # fmt: skip


def _frame(role: str, given: dict[str, Any]) -> FrameOnLink:
    size = None if "size" not in given else finite_array(f"{role} size", given["size"], (2,))
    return FrameOnLink(
        str(given["link"]), finite_array(f"{role} position", given.get("position", (0.0, 0.0, 0.0)), (3,)),
        quat.unit(f"{role} quaternion", given.get("quaternion", quat.IDENTITY), (4,)), size,
    )  # fmt: skip


def _hand(role: str, given: dict[str, Any]) -> HandOnFrame:
    low, high = (finite_array(f"{role} {end}", given[end], (3,)) for end in ("low", "high"))
    if (low >= high).any():
        raise InvalidInputError(f"the volume of {role!r} needs low below high, got {low} and {high}")
    joint = given.get("joint")
    opened, closed = (number(f"{role} {end}", given[end] if joint else 0.0) for end in ("open", "closed"))
    width = number(f"{role} width", given.get("width", 0.0), low=0.0)
    fingers = tuple(_joints(f"fingers of {role}", links) for links in given.get("fingers", []))
    return HandOnFrame(low, high, joint, opened, closed, width, fingers)


def _joints(group: str, given: Any) -> tuple[str, ...]:
    if not isinstance(given, list) or not all(isinstance(joint, str) for joint in given):
        raise InvalidInputError(f"the group {group!r} must be a list of names, got {given!r}")
    return tuple(given)


def _placed(name: str, folder: Path) -> Path:
    sibling = folder / name
    return sibling if sibling.is_file() else robot_data() / name


def _check_meshes(robot: RobotDescription) -> None:
    """Raise where a mesh is missing: Pinocchio would say so only when meshes are first asked for."""
    try:
        root = xml.parse(robot.urdf).getroot()
    except xml.ParseError as error:
        raise RobotModelError(f"cannot read {str(robot.urdf)!r} as a URDF: {error}") from error
    names = dict.fromkeys(mesh.get("filename", "") for mesh in root.iter("mesh"))
    missing = [name for name in names if not _mesh_is_there(name, robot)]
    if missing:
        folders = ", ".join(str(folder) for folder in robot.package_dirs) or "none"
        raise MeshError(
            f"{len(missing)} meshes of {robot.name!r} are not there, the first is {missing[0]!r}; "
            f"package_dirs are {folders}"
        )


def _mesh_is_there(name: str, robot: RobotDescription) -> bool:
    for scheme in ("package://", "model://"):
        if name.startswith(scheme):
            within = name.removeprefix(scheme).lstrip("/")  # some have a slash too many, which Pinocchio passes over
            return any((folder / within).is_file() for folder in robot.package_dirs)
    return (robot.urdf.parent / name.removeprefix("file://")).is_file()
