"""Leaders: bodies in MuJoCo so heavy that nothing moves them, which are sent along paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.shapes import quaternion as quat

LEADER = 1e6
"""[kg] and [kg m2] Of a body on a path, and of what leads a rigid one: what touches it does not move it in a step."""


def push(batch: Any, address: tuple[int, int], place: np.ndarray, turn: np.ndarray, step: float) -> None:
    """Send a heavy body on as `send` does, by a force, so that what hangs on it by joints feels how it speeds up."""
    qvel, applied = batch.bind("qvel"), batch.bind("qfrc_applied")
    to = address[1]
    before = qvel[:, to : to + 6].copy()
    send(batch, address, place, turn, step)
    applied[:, to : to + 6] = LEADER * (qvel[:, to : to + 6] - before) / step
    qvel[:, to : to + 6] = before


def send(batch: Any, address: tuple[int, int], place: np.ndarray, turn: np.ndarray, step: float) -> None:
    """Put a heavy body where it is at the start of a substep, with the velocity that brings it to its end.

    Args:
        batch: The batch.
        address: Its first coordinate and its first velocity.
        place: (worlds, 2, 3) [m].
        turn: (worlds, 2, 4).
        step: [s].
    """
    qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
    at, to = address
    qpos[:, at : at + 3], qpos[:, at + 3 : at + 7] = place[:, 0], turn[:, 0]
    own = quat.multiply(quat.inverse(turn[:, 0]), turn[:, 1])
    own = np.where(own[:, :1] < 0.0, -own, own)
    sine = np.linalg.norm(own[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, own[:, :1])
    axis = np.divide(own[:, 1:], sine, out=np.zeros_like(own[:, 1:]), where=sine > 0.0)
    qvel[:, to : to + 3] = (place[:, 1] - place[:, 0]) / step
    qvel[:, to + 3 : to + 6] = axis * angle / step  # along the body's axes
