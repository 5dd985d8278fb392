"""Films side by side: several films of the same length as one, each drawn beside the one before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nuno.errors import InvalidInputError
from nuno.viewer.film import Film, Track

GAP = 0.25
"""Between two films, of the width of the widest."""


def side_by_side(films: Sequence[Film], names: Sequence[str]) -> Film:
    """Return one film of several, from left to right along x; an endless plane is drawn once.

    Args:
        films: The films; all have the times of the first.
        names: What each is called in the page's tree.

    Raises:
        InvalidInputError: no films, or of different lengths.
    """
    if not films or len({len(film) for film in films}) != 1 or len(films) != len(names):
        raise InvalidInputError("side_by_side needs films of one length, and a name for each")
    step = (1.0 + GAP) * max(_width(film) for film in films)
    whole = Film(None)
    whole._times = list(films[0]._times)
    for column, (film, name) in enumerate(zip(films, names, strict=True)):
        offset = np.array([column * step, 0.0, 0.0], dtype=np.float32)
        for track in film._tracks.values():
            if track.obj.shape.get("endless") and column:
                continue
            whole._tracks[track.obj.number] = _moved(track, offset, name)
    return whole


def _moved(track: Track, offset: np.ndarray, name: str) -> Track:
    obj = track.obj
    obj.path = (name, *obj.path[1:])
    moved = Track(obj, track.first)
    moved.last, moved.frames, moved.tints = track.last, track.frames, track.tints
    shift = np.zeros(7, np.float32)
    shift[:3] = offset
    moved.poses = [pose + shift for pose in track.poses]
    moved.points = [points + offset for points in track.points]
    return moved


def _width(film: Film) -> float:
    """Return how far along x everything comes that is drawn [m], but for endless planes."""
    reach = []
    for track in film._tracks.values():
        if track.obj.shape.get("endless"):
            continue
        if track.poses:
            size = float(np.abs(track.obj.points).max())
            x = np.array(track.poses)[:, 0]
            reach.append((float(x.min()) - size, float(x.max()) + size))
        elif track.points:
            x = np.concatenate(track.points)[:, 0]
            reach.append((float(x.min()), float(x.max())))
    return max((high for _, high in reach), default=1.0) - min((low for low, _ in reach), default=0.0)
