"""Changes: what a page is told of what has changed on the stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nuno.viewer.actor import Actor


def changes(left: Sequence[int], entered: Sequence[Actor], moved: Sequence[Actor]) -> list[dict[str, Any]]:
    """Return the commands that bring a page from the look before to this one.

    Args:
        left: The numbers of actors that are there no more.
        entered: Actors that are new.
        moved: Those that are elsewhere, or of another form.
    """
    commands: list[dict[str, Any]] = []
    if left:
        commands.append({"do": "leave", "ids": left})
    commands += [actor.entrance() for actor in entered]
    placed = [actor for actor in moved if actor.pose is not None]
    if placed:
        poses = np.array([actor.pose for actor in placed], np.float32).ravel()
        commands.append({"do": "place", "ids": [actor.number for actor in placed], "poses": poses})
    commands += [
        {"do": "shift", "id": actor.number, "points": actor.points.ravel()} for actor in moved if actor.pose is None
    ]
    return commands


def clock(time: float) -> dict[str, Any]:
    """Return the command that tells the world's time [s]."""
    return {"do": "clock", "time": time}
