"""SRDF files: groups of joints, ends of arms and postures that somebody has named for a robot's planner."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nuno.errors import RobotModelError
from nuno.robot.placement import frame_called

POSTURES = ("half_sitting", "standing", "stand", "home", "ready", "default", "initial")
"""Names of postures that a robot is likely to begin in, the likeliest first."""


@dataclass(frozen=True)
class Srdf:
    """The parts of an SRDF that a description is guessed from.

    Attributes:
        groups: Joints by group; groups of groups are their joints.
        ends: Links that carry end effectors.
        postures: Names of group states.
    """

    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ends: tuple[str, ...] = ()
    postures: tuple[str, ...] = ()

    @property
    def posture(self) -> str | None:
        """The posture that the robot is likely to begin in; None where no name says so."""
        return next((name for name in POSTURES if name in self.postures), None)

    def separate_groups(self) -> dict[str, tuple[str, ...]]:
        """Return the groups that contain no other; of those that share joints the first."""
        sets = {name: set(joints) for name, joints in self.groups.items() if joints}
        kept: dict[str, tuple[str, ...]] = {}
        for name, joints in sets.items():
            is_union = any(other < joints for other in sets.values())
            if not is_union and not any(joints & set(own) for own in kept.values()):
                kept[name] = self.groups[name]
        return kept


def read_srdf(path: Path | None, model: Any) -> Srdf:
    """Return what an SRDF says of a model (Pinocchio's); nothing where there is no file.

    Raises:
        RobotModelError: it is no XML.
    """
    if path is None:
        return Srdf()
    try:
        root = xml.parse(path).getroot()
    except (OSError, xml.ParseError) as error:
        raise RobotModelError(f"cannot read {str(path)!r} as an SRDF: {error}") from error
    given = {own.get("name", ""): own for own in root.findall("group")}
    groups = {name: tuple(dict.fromkeys(_joints(name, given, model, ()))) for name in given}
    ends = tuple(own.get("parent_link", "") for own in root.findall("end_effector"))
    return Srdf(groups, ends, tuple(own.get("name", "") for own in root.findall("group_state")))


def _joints(name: str, given: Mapping[str, Any], model: Any, above: Sequence[str]) -> list[str]:
    if name not in given or name in above:  # a group of itself would have no end
        return []
    moving = {joint: j for j, joint in enumerate(model.names) if j >= 2}
    found = []
    for own in given[name]:
        if own.tag == "joint":
            found += [joint for joint in (own.get("name"),) if joint in moving]
        elif own.tag == "group":
            found += _joints(own.get("name", ""), given, model, (*above, name))
        elif own.tag == "chain":
            base, tip = own.get("base_link", ""), own.get("tip_link", "")
            if model.existFrame(base) and model.existFrame(tip):
                before = set(model.supports[model.frames[frame_called(model, base)].parentJoint])
                chain = model.supports[model.frames[frame_called(model, tip)].parentJoint]
                found += [model.names[j] for j in chain if j >= 2 and j not in before]
    return found
