"""Recordings side by side: several of the same times as one, each drawn beside the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nuno.errors import InvalidInputError
from nuno.mesh.primitives import PLANE_HALF
from nuno.world.recording import RecordedBody, Recording

GAP = 0.25
"""Between two recordings, of the width of the widest."""


def side_by_side(recordings: Sequence[Recording], names: Sequence[str]) -> Recording:
    """Return one recording of several, from left to right along x.

    Args:
        recordings: The recordings of single worlds; all have the times of the first.
        names: What each is called; its bodies are "name: body".

    Raises:
        InvalidInputError: no recordings, of different lengths, or not as many names.
    """
    if not recordings or len({len(each) for each in recordings}) != 1 or len(recordings) != len(names):
        raise InvalidInputError("side_by_side needs recordings of one length, and a name for each")
    step = _step(recordings)
    bodies = []
    for column, (each, name) in enumerate(zip(recordings, names, strict=True)):
        for body in each.bodies:
            if _is_endless(body) and column:
                continue
            bodies.append(
                replace(body, name=f"{name}: {body.name}", vertices=body.vertices + np.array([column * step, 0.0, 0.0]))
            )
    return Recording.from_frames(recordings[0].times, bodies)


def heads_of_columns(recordings: Sequence[Recording]) -> np.ndarray:
    """Return (n, 3) [m], above what each recording ever shows, as `side_by_side` draws it."""
    step, heads = _step(recordings), []
    for column, each in enumerate(recordings):
        corners = [part for body in each.bodies if not _is_endless(body) for part in _corners(body)]
        low, high = (np.min(corners, axis=0), np.max(corners, axis=0)) if corners else (np.zeros(3), np.zeros(3))
        x, y, _ = 0.5 * (low + high)
        heads.append((x + column * step, y, high[2]))
    return np.array(heads)


def _corners(body: RecordedBody) -> tuple[np.ndarray, np.ndarray]:
    points = body.vertices.reshape(-1, 3)
    return points.min(axis=0), points.max(axis=0)


def _step(recordings: Sequence[Recording]) -> float:
    return (1.0 + GAP) * max(_width(each) for each in recordings)


def _is_endless(body: RecordedBody) -> bool:
    """Return True if a body is the square that stands for an endless plane: drawn once, it takes no room."""
    return body.vertices.shape[-2] == 4 and bool(np.ptp(body.vertices, axis=-2).max() >= PLANE_HALF)


def _width(recording: Recording) -> float:
    """Return how far along x everything comes that is drawn [m], but for endless planes."""
    x = [body.vertices[..., 0] for body in recording.bodies if not _is_endless(body)]
    return float(max(each.max() for each in x) - min(each.min() for each in x)) if x else 1.0
