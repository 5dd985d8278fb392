"""Changes: what a page is told of what has changed on the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nuno.viewer.scene_object import SceneObject


def changes(
    left: Sequence[int], entered: Sequence[SceneObject], moved: Sequence[SceneObject], recolored: Sequence[SceneObject]
) -> list[dict[str, Any]]:
    """Return the commands that bring a page from the look before to this one.

    Args:
        left: The numbers of scene objects that are there no more.
        entered: Scene objects that are new.
        moved: Those that are elsewhere, or of another form.
        recolored: Those whose points have other colours.
    """
    commands: list[dict[str, Any]] = []
    if left:
        commands.append({"do": "leave", "ids": left})
    commands += [obj.entrance() for obj in entered]
    placed = [obj for obj in moved if obj.pose is not None]
    if placed:
        poses = np.array([obj.pose for obj in placed], np.float32).ravel()
        commands.append({"do": "place", "ids": [obj.number for obj in placed], "poses": poses})
    commands += [{"do": "shift", "id": obj.number, "points": obj.points.ravel()} for obj in moved if obj.pose is None]
    none = np.empty(0, np.uint8)
    commands += [
        {"do": "tint", "id": obj.number, "colors": none if obj.colors is None else obj.colors.ravel()}
        for obj in recolored
    ]
    return commands


def clock(time: float) -> dict[str, Any]:
    """Return the command that tells the world's time [s]."""
    return {"do": "clock", "time": time}
