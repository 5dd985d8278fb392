"""Reports of what a scene file brought or took, and of what was left out or approximated."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nuno.materials import Cloth, Rigid, Soft

if TYPE_CHECKING:
    from nuno.scenes.scene_description import SceneDescription

logger = logging.getLogger(__name__)

SHOWN = 4
"""Names of a note that a text shows."""


@dataclass(frozen=True, eq=False)
class SceneReport:
    """A report of what a scene file brought or took.

    Attributes:
        path: The file.
        bodies: How many bodies there are of each kind: "static", "rigid", "cloth", "soft".
        joints: How many joints there are of each kind.
        notes: By what was left out or approximated, the names of what it was; empty where nothing was.
    """

    path: Path
    bodies: Mapping[str, int]
    joints: Mapping[str, int]
    notes: Mapping[str, tuple[str, ...]]

    @property
    def complete(self) -> bool:
        """Return True if nothing was left out or approximated."""
        return not self.notes

    def __str__(self) -> str:
        lines = [f"{self.path.name}: {_counted(self.bodies, 'bodies')}; {_counted(self.joints, 'joints')}"]
        return "\n".join(lines + [f"  {what}: {_in_short(names)}" for what, names in self.notes.items()])


def report_of(scene: SceneDescription, path: Path, verb: str) -> SceneReport:
    """Return the report of a scene, and tell once in the log what was left out or approximated."""
    kinds = {Rigid: "rigid", Cloth: "cloth", Soft: "soft"}
    bodies = Counter("static" if body.material is None else kinds[type(body.material)] for body in scene.bodies)
    joints = Counter(joint.kind for joint in scene.joints)
    report = SceneReport(path, dict(bodies), dict(joints), {what: tuple(names) for what, names in scene.notes.items()})
    if report.notes:
        notes = "; ".join(f"{what}: {_in_short(names)}" for what, names in report.notes.items())
        logger.warning("%s is not %s as it is: %s", path.name, verb, notes)
    return report


def _counted(numbers: Mapping[str, int], none: str) -> str:
    return ", ".join(f"{number} {kind}" for kind, number in numbers.items()) or f"no {none}"


def _in_short(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
