"""Grips, ties, holds and paths of a batch that take those of another snapshot in some worlds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from nuno.errors import BodyStateError
from nuno.joints.grip import GripSpec
from nuno.joints.tie import HoldSpec, TieSpec
from nuno.shapes.path import Path, path_as_it_is

SOON = 1e-9  # [s], below which two instants are the same


class WorldRows:
    """Some worlds of a batch, and the worlds of a snapshot that they become.

    Args:
        worlds: (k,) int, worlds of the batch.
        rows: (k,) int, worlds of the snapshot, one for each.
        counts: Worlds of the batch, and of the snapshot.
        time: The time of both [s].
    """

    def __init__(self, worlds: np.ndarray, rows: np.ndarray, counts: tuple[int, int], time: float) -> None:
        self.worlds, self.rows, self.time = worlds, rows, time
        self.world_count, self.source_count = counts

    def merged(self, own: Any, other: Any, axes: int) -> Any:
        """Return values of the batch with those of the snapshot in its worlds; ``own`` itself where nothing differs.

        Args:
            own: A value (...), or one a world (worlds, ...), of ``axes`` axes besides that of the worlds.
            other: Likewise, of the snapshot.
            axes: Axes of the value of one world.
        """
        mine, theirs = np.asarray(own), self.of_rows(np.asarray(other), axes)
        there = mine[self.worlds] if mine.ndim > axes and len(mine) > 1 else mine
        if (there == theirs).all():
            return own
        whole = np.array(np.broadcast_to(mine, (self.world_count, *mine.shape[mine.ndim - axes :])))
        whole[self.worlds] = theirs
        return whole

    def of_rows(self, values: np.ndarray, axes: int) -> np.ndarray:
        """The snapshot's values, (k, ...), or (...) where all its worlds share them."""
        if values.ndim <= axes:
            return values
        return values[self.rows] if len(values) > 1 else np.repeat(values, len(self.rows), axis=0)


def merge_spec(spec: Any, other: Any, at: WorldRows, name: str, end: Callable[[GripSpec], np.ndarray] | None) -> Any:
    """Return a grip's numbers with those of another in some worlds.

    Args:
        spec: The batch's; None where it has the grip no more.
        other: The snapshot's; None where it does not have it.
        at: The worlds.
        name: The held body's, for errors.
        end: What gives the places (worlds, k, 3) [m] where an ended path of ``other`` leads its points.

    Raises:
        BodyStateError: it holds something else in the two, or paths are under way at different times.
    """
    if spec is None or other is None:
        known = spec if spec is not None else other
        if not isinstance(known, GripSpec | TieSpec):
            raise BodyStateError(f"the grip on {name!r} is not in both: hold or release it in all worlds first")
        return _without(known, at) if other is None else _only_there(known, at)
    if type(spec) is not type(other) or spec.compliance != other.compliance:
        raise BodyStateError(f"the grip on {name!r} holds it in another way than in the snapshot")
    timed = isinstance(spec, GripSpec | HoldSpec)
    if timed:
        spec, other = _on_one_clock(spec, other, at, name, end)
    changed = {}
    for item in fields(spec):
        own, theirs = getattr(spec, item.name), getattr(other, item.name)
        if item.name in ("times", "interpolation", "free", "kind", "ignored", "compliance"):
            continue
        if isinstance(own, np.ndarray) and isinstance(theirs, np.ndarray):
            changed[item.name] = at.merged(own, theirs, theirs.ndim - 1)
        elif item.name == "max_force" and own is not None and theirs is not None:
            changed[item.name] = at.merged(own, theirs, 0)
        elif (own is None) != (theirs is None):
            raise BodyStateError(f"the grip on {name!r} holds it in another way than in the snapshot")
    return replace(spec, **changed)


def merge_path(
    path: Path | None, other: Path | None, pose: tuple[np.ndarray, np.ndarray],
    there: tuple[np.ndarray, np.ndarray], at: WorldRows, name: str,
) -> Path | None:  # fmt: skip
    """Return a static body's path with that of a snapshot in some worlds.

    Args:
        path: The batch's.
        other: The snapshot's.
        pose: The body's place and turn now.
        there: Those in the snapshot.
        at: The worlds.
        name: The body's, for errors.

    Raises:
        BodyStateError: both are under way, and not at the same times.
    """
    under_way, other_under_way = (p is not None and p.times[-1] > at.time + SOON for p in (path, other))
    if path is not None and path is other:
        return path
    if not under_way and not other_under_way:
        if path is None:
            return None
        place, turn = (at.merged(own, theirs, 1)[..., None, :] for own, theirs in zip(pose, there, strict=True))
        return path_as_it_is(path.times[-1:], place, None if path.quaternions is None else turn)
    if path is not None and other is not None and under_way and other_under_way:
        if not _clocks_agree(path.times, other.times) or path.interpolation != other.interpolation:
            raise BodyStateError(_under_way(f"the path of {name!r}"))
    lead: Any = path if under_way else other
    turns = any(p is not None and p.quaternions is not None for p in (path, other))
    own = _keys(path if under_way else None, pose, len(lead.times))
    theirs = _keys(other if other_under_way else None, there, len(lead.times))
    merged = []
    for mine, new in zip(own, theirs, strict=True):
        full = np.array(np.broadcast_to(mine, (at.world_count, *mine.shape[-2:])))
        full[at.worlds] = at.of_rows(new, 2)
        merged.append(full)
    return path_as_it_is(lead.times, merged[0], merged[1] if turns else None, lead.interpolation)


def _keys(path: Path | None, rest: tuple[np.ndarray, np.ndarray], count: int) -> list[np.ndarray]:
    """Return the places and turns of a path at its keys; of a body that rests, as many of where it does."""
    still = [np.repeat(part[..., None, :], count, axis=-2) for part in rest]
    if path is None:
        return still
    return [path.positions, still[1] if path.quaternions is None else path.quaternions]


def _clocks_agree(a: np.ndarray, b: np.ndarray) -> bool:
    return len(a) == len(b) and bool(np.abs(a - b).max() < SOON)


def _under_way(what: str) -> str:
    return (
        f"{what} is under way in the snapshot and in other worlds of the batch, at other times: reset between paths "
        "(a step's path that ends with the step is one), or all worlds at once with restore"
    )


def _on_one_clock(
    spec: Any, other: Any, at: WorldRows, name: str, end: Callable[[GripSpec], np.ndarray] | None
) -> tuple[Any, Any]:
    if _clocks_agree(spec.times, other.times) and spec.interpolation == other.interpolation:
        return spec, other
    ended, other_ended = (s.times[-1] <= at.time + SOON for s in (spec, other))
    if other_ended:
        return spec, _held_still(other, spec, at.time, end)
    if ended:
        return _held_still(spec, other, at.time, None), other
    raise BodyStateError(_under_way(f"the path of the grip on {name!r}"))


def _held_still(spec: Any, like: Any, time: float, end: Callable[[GripSpec], np.ndarray] | None) -> Any:
    """Return keys at the times of another, all where an ended path leads."""
    m = len(like.times)
    changed: dict[str, Any] = {"times": like.times, "interpolation": like.interpolation}
    if isinstance(spec, HoldSpec):
        place, turn = spec.at(time)
        changed |= {name: np.repeat(v[:, None], m, axis=1) for name, v in (("positions", place), ("quaternions", turn))}
    else:
        place = spec.at(np.array([time]))[:, :, 0] if end is None else end(spec)
        changed |= {"positions": np.repeat(place[:, :, None], m, axis=2)}
    return replace(spec, **changed)


def _without(spec: Any, at: WorldRows) -> Any:
    """Return a grip that holds nothing in some worlds."""
    names = [n for n in ("vertices", "corners") if getattr(spec, n, None) is not None]
    changed = {n: np.array(getattr(spec, n)) for n in names}
    for values in changed.values():
        values[at.worlds] = -1
    return replace(spec, **changed)


def _only_there(spec: Any, at: WorldRows) -> Any:
    """Return a snapshot's grip for the whole batch, which holds nothing in the other worlds."""
    changed: dict[str, Any] = {}
    for item in fields(spec):
        values = getattr(spec, item.name)
        if not isinstance(values, np.ndarray) or item.name == "times":
            continue
        whole = np.repeat(values[:1], at.world_count, axis=0)
        whole[at.worlds] = at.of_rows(values, values.ndim - 1)
        if item.name in ("vertices", "corners"):
            others = np.ones(at.world_count, dtype=bool)
            others[at.worlds] = False
            whole[others] = -1
        changed[item.name] = whole
    return replace(spec, **changed)
