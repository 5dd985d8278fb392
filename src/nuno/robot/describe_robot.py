"""describe_robot: the table of a robot, guessed from its URDF, for somebody to look through and correct."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from nuno.files.whole_file import replacing
from nuno.robot.assumed_limits import HINGE_SPEED, SLIDE_SPEED
from nuno.robot.description import FileName
from nuno.robot.guessed_frames import (
    Guess,
    guess_camera,
    guess_foot,
    guess_hand,
    guess_sensor,
    links_of,
    shape_points,
)
from nuno.robot.humanoid import Humanoid
from nuno.robot.limb_tree import Limb, find_limbs
from nuno.robot.srdf import Srdf, read_srdf
from nuno.shapes import quaternion as quat

FIELD_OF_VIEW = 1.047
"""[rad] Of a camera that nothing is known of: 60 degrees."""
FLAT = 0.01
"""Of a quaternion: turns of less than about a degree are left out."""
HEAD = """# Guessed by nuno.describe_robot from {urdf}: look through every line, above all those that say CHECK.
# nuno.Humanoid({name!r}, robots=<this file>) reads it; src/nuno/robot/robots.toml says what each line means.
"""


def describe_robot(
    urdf: FileName, out: FileName | None = None, *, srdf: FileName | None = None,
    package_dirs: Sequence[FileName] | None = None, name: str | None = None,
) -> str:  # fmt: skip
    """Return a table (TOML) for ``nuno.Humanoid(name, robots=)``, guessed from a URDF, to be looked through and edited.

    Arms, legs and heads are told by the tree of joints, by words in names ("l_shoulder", "RLEG_KNEE", "FR_calf") and by
    which of them reach the floor; hands by fingers that branch or by links named "tcp", "palm", "gripper"; soles by the
    shapes that are lowest; an SRDF adds ends, groups and the posture. Lines that say CHECK are likely to be wrong.

    Args:
        urdf: The robot's file.
        out: A file to write the table to, which names the URDF as seen from there; None writes none.
        srdf: Pairs of links that may overlap, postures, groups, ends of arms.
        package_dirs: Folders that ``package://`` is looked up in; None are those that the URDF lies in.
        name: What the robot is to be called; None takes the file's name.

    Returns:
        The table's text.

    Raises:
        RobotModelError: a file that is not there or cannot be read.
        MeshError: the URDF names a mesh that is not there.
        OSError: ``out`` cannot be written.
    """
    robot = Humanoid(urdf, srdf=srdf, package_dirs=package_dirs)
    known = read_srdf(None if srdf is None else Path(srdf), robot.model)
    if known.posture is not None:
        robot.description = replace(robot.description, posture=known.posture)
        robot.stand()
    points = shape_points(robot)
    limbs = find_limbs(robot, points)
    own = name or robot.name
    folder = Path.cwd() if out is None else Path(out).resolve().parent
    lines = [HEAD.format(name=own, urdf=Path(urdf).name), f"[{_key(own)}]", f"urdf = {_text(_seen(urdf, out, folder))}"]
    if srdf is not None:
        lines.append(f"srdf = {_text(_seen(srdf, out, folder))}")
    if known.posture is not None:
        lines.append(f"posture = {_text(known.posture)}")
    lines += _frames(robot, own, limbs, points, known)
    lines += _groups(robot, own, limbs, known)
    lines += _speeds(robot, own)
    text = "\n".join(lines) + "\n"
    if out is not None:
        with replacing(out) as path:
            Path(path).write_text(text, encoding="utf-8")
    return text


def _frames(robot: Humanoid, own: str, limbs: list[Limb], points: dict[int, np.ndarray], known: Srdf) -> list[str]:
    frames, hands, feet = list[str](), list[str](), list[str]()
    solid = {own.joint for own in robot.geometry.shapes("collision")}
    for role, limb in _ends(limbs, "arm").items():
        hand = guess_hand(robot, limb, points, known.ends)
        frames.append(f"{role} = {_frame(hand)}  # CHECK: z out of the hand, x up when z is forward")
        wrist = guess_sensor(robot, limb, {"ft"}) or links_of(robot.model, limb.end)[0]
        frames.append(f"{role.replace('hand', 'wrist')} = {{ link = {_text(wrist)} }}")
        if limb.end in solid:  # without a shape nothing bears what it would hold
            hands += ["", f"[{_key(own)}.hands.{role}]", *_hand(hand)]
    legs = _ends(limbs, "leg")
    for role, limb in legs.items():
        foot = guess_foot(robot, limb, points)
        feet.append(f"{role} = {_frame(foot)}")
        if len(legs) == 2:
            ankle = guess_sensor(robot, limb, {"ft"}) or links_of(robot.model, limb.end)[0]
            frames.append(f"{role.replace('foot', 'ankle')} = {{ link = {_text(ankle)} }}")
    camera = guess_camera(robot, [limb for limb in limbs if limb.kind == "head"])
    if camera is not None:
        frames.append(f"head_camera = {_frame(camera)}")
    if (imu := guess_sensor(robot, None, {"imu"})) is not None:
        frames.append(f"imu = {{ link = {_text(imu)} }}")
    lines = ["", f"[{_key(own)}.frames]", *frames] if frames else []
    lines += ["", f"[{_key(own)}.feet]", *feet] if feet else []
    if camera is not None:
        pixels = f'frame = "head_camera", width = 640, height = 480, field_of_view = {FIELD_OF_VIEW}'
        lines += ["", f"[{_key(own)}.cameras]", f"head = {{ {pixels} }}  # CHECK: pixels and angle of view [rad]"]
    return lines + hands


def _ends(limbs: list[Limb], kind: str) -> dict[str, Limb]:
    """Return limbs by the role of their end: "left_hand", "front_right_foot"; those that have no role are left out."""
    found = [limb for limb in limbs if limb.kind == kind]
    noun = "hand" if kind == "arm" else "foot"
    if kind == "arm" and len(found) == 1 and not found[0].side:
        return {"right_hand": found[0]}  # which drivers of single arms call "rarm"
    if len(found) <= 2:
        return {f"{limb.side}_{noun}": limb for limb in found if limb.side}
    named: dict[str, Limb] = {}
    for side in ("left", "right"):
        of_side = [limb for limb in found if limb.side == side]
        order = ("front", "rear") if len(of_side) == 2 else tuple(f"{k + 1}" for k in range(len(of_side)))
        if kind == "arm":
            of_side = of_side[:1]
        ahead = sorted(of_side, key=lambda limb: -limb.forward)
        for place, limb in zip(order, ahead, strict=False):
            named[f"{side}_{noun}" if kind == "arm" else f"{place}_{side}_{noun}"] = limb
    return named


def _groups(robot: Humanoid, own: str, limbs: list[Limb], known: Srdf) -> list[str]:
    """Return groups where the ends of arms and legs do not tell them: of four legs, or of no limbs at all."""
    ends = [*_ends(limbs, "arm"), *_ends(limbs, "leg")]
    if ends and not any(role.startswith(("front", "rear", "1", "2", "3")) for role in ends):
        return []
    groups = known.separate_groups()
    if len(groups) < 2:
        groups = {}
        for kind in ("arm", "leg"):
            for role, limb in _ends(limbs, kind).items():
                name = role.replace("foot", "leg").replace("hand", "arm")
                groups[name] = tuple(robot.model.names[j] for j in (*limb.own, *limb.beyond))
    lines = [f"{_key(name)} = [{', '.join(map(_text, joints))}]" for name, joints in groups.items()]
    return ["", f"[{_key(own)}.groups]", *lines] if lines else []


def _speeds(robot: Humanoid, own: str) -> list[str]:
    assumed = np.where(robot.is_slide, SLIDE_SPEED, HINGE_SPEED)
    rows = np.flatnonzero(robot.velocity_limits == assumed)
    lines = [f"{_key(robot.joint_names[k])} = {assumed[k]:.4g}  # CHECK: the URDF says nothing" for k in rows]
    return ["", f"[{_key(own)}.velocity_limits]", *lines] if lines else []


def _frame(guess: Guess) -> str:
    parts = [f"link = {_text(guess.link)}"]
    if np.abs(guess.position).max() > 5e-5:
        parts.append(f"position = {_numbers(guess.position)}")
    if np.abs(guess.quaternion - quat.IDENTITY).max() > FLAT:
        parts.append(f"quaternion = {_numbers(guess.quaternion, 8)}")
    if guess.size is not None:
        parts.append(f"size = {_numbers(guess.size)}")
    return f"{{ {', '.join(parts)} }}"


def _hand(guess: Guess) -> list[str]:
    assert guess.low is not None and guess.high is not None
    lines = [f"low = {_numbers(guess.low)}  # CHECK: of what the hand closes on", f"high = {_numbers(guess.high)}"]
    if guess.closing is None:
        return lines
    joint, opened, closed, width = guess.closing
    more = [f"joint = {_text(joint)}", f"open = {opened:.6g}", f"closed = {closed:.6g}", f"width = {width:.4g}"]
    return [*lines, *(f"{line}  # CHECK" for line in more)]


def _seen(path: FileName, out: FileName | None, folder: Path) -> str:
    """Return a file's name as seen from the table's folder, in full where there is no table."""
    full = Path(path).resolve()
    return str(full) if out is None else Path(os.path.relpath(full, folder)).as_posix()


def _numbers(values: np.ndarray, digits: int = 4) -> str:
    return "[" + ", ".join(repr(round(float(value), digits) + 0.0) for value in values) + "]"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)


def _key(name: str) -> str:
    """Return a key of TOML: bare where it may be, else in quotes."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)
