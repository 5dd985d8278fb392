"""Motions: static bodies that follow paths, and where they are at the frames of a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates, Pose, compose
from nuno.shapes.path import Path, path_as_it_is
from nuno.tables.path_batch import BatchMotion, KinematicGroup, PathBatch

if TYPE_CHECKING:
    from nuno.bodies.body import Body


@dataclass(frozen=True, eq=False)
class Schedule:
    """Poses of kinematic bodies in a run: at its start, and in the middle and at the end of each frame.

    Attributes:
        times: (k,) float [s].
        alone: By body key, positions (k, 3) or (worlds, k, 3) [m] and quaternions (k, 4) or (worlds, k, 4).
        path_batches: Those of all other bodies.
    """

    times: np.ndarray
    alone: dict[str, Pose]
    path_batches: tuple[BatchMotion, ...] = ()

    def frame_at(self, time: float) -> int | None:
        """Return which of ``times`` is the start of the frame at ``time`` [s]; None where the schedule is over."""
        k = 2 * int(np.argmin(np.abs(self.times[::2] - time)))
        return k if k + 2 < len(self.times) else None

    def in_frame(self, key: str, k: int) -> tuple[Pose, Pose]:
        """Return where a body is at the start and at the end of the frame that `frame_at` gave."""
        places, turns = self.poses[key]
        # what stands still has one pose for all instants
        start, end = (
            (places[..., min(at, places.shape[-2] - 1), :], turns[..., min(at, turns.shape[-2] - 1), :])
            for at in (k, k + 2)
        )
        return start, end

    @cached_property
    def poses(self) -> dict[str, Pose]:
        """Of all bodies, by key, as in ``alone``."""
        found = dict(self.alone)
        for own in self.path_batches:
            found |= own.poses
        return found


def is_kinematic(frame: Coordinates) -> bool:
    """Return True if a frame follows a path, or a frame that does."""
    return _followed_by(frame) is not None


def make_schedule(bodies: Iterable[Body], start: float, duration: float, frame: float) -> Schedule:
    """Return where bodies are from ``start`` on, for whole frames of ``frame`` and a shorter last one [s]."""
    whole = math.floor(duration / frame + 1e-6)
    times = start + 0.5 * frame * np.arange(2 * whole + 1)
    rest = duration - whole * frame
    if rest > 1e-9:
        times = np.append(times, [start + duration - 0.5 * rest, start + duration])
    # the same instants, to the bit, whether a span is gone through at once or in pieces
    times = np.round(times, 9)
    path_batches, bodies = path_batches_of(bodies)
    moved = tuple(BatchMotion(own, path, times) for own, path in path_batches)
    if not bodies:
        return Schedule(times, {}, moved)
    kinematic = {leader.key: leader for body in bodies if (leader := _followed_by(body)) is not None}
    roots = dict(zip(kinematic, paths_at([body._path for body in kinematic.values()], times), strict=True))
    return Schedule(times, {body.key: _pose_of(body, roots) for body in bodies}, moved)


def path_batches_of(bodies: Iterable[Body]) -> tuple[list[tuple[PathBatch, Path]], list[Body]]:
    """Return the whole path batches among bodies, each with one of its paths, and the other bodies."""
    bodies = list(bodies)
    whole: list[tuple[PathBatch, Path]] = []
    others: list[Body] = []
    k = 0
    while k < len(bodies):
        path = bodies[k]._path
        fields = {} if path is None else path.__dict__
        kinematic: KinematicGroup | PathBatch | None = fields.get("kinematic_group") or fields.get("path_batch")
        if kinematic is not None:
            after = k + len(kinematic.keys)
            near = bodies[k:after]
            if [body._path for body in near] == kinematic.paths and tuple(
                [body.key for body in near]
            ) == kinematic.keys:
                path_batch = kinematic.path_batch if isinstance(kinematic, KinematicGroup) else kinematic
                assert path is not None and path_batch is not None
                whole.append((path_batch, path))
                k = after
                continue
        others.append(bodies[k])
        k += 1
    return whole, others


def paths_at(paths: Sequence[Path | None], times: np.ndarray) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Return positions and quaternions (None of a path without) of many paths at ``times`` (k,) [s].

    Paths with the same keys in time, such as those of a robot's links, are worked out together.
    """
    groups: dict[tuple[Any, ...], list[int]] = {}
    for k, path in enumerate(paths):
        assert path is not None
        shape = None if path.quaternions is None else path.quaternions.shape
        groups.setdefault((path.times.tobytes(), path.interpolation, path.positions.shape, shape), []).append(k)
    found: list[Any] = [None] * len(paths)
    for group in groups.values():
        alike = [path for k in group if (path := paths[k]) is not None]
        first, last, s = alike[0].keys_around(times)
        places = np.stack([path.positions for path in alike])
        if s.ndim == 0 and s in (0.0, 1.0):  # at a key, as it is: so a path batch has it, of which one world was taken
            key = int(first if s == 0.0 else last)
            for k, path in zip(group, alike, strict=True):
                turn = None if path.quaternions is None else path.quaternions[..., key, :]
                found[k] = (path.positions[..., key, :], turn)
            continue
        a, b = places[..., first, :], places[..., last, :]
        placed = a + s[..., None] * (b - a)
        turns = [path.quaternions for path in alike if path.quaternions is not None]
        turned: Any = [None] * len(group)
        if turns:
            stack = np.stack(turns)
            turned = quat.slerp(stack[..., first, :], stack[..., last, :], s)
        for k, place, turn in zip(group, placed, turned, strict=True):
            found[k] = (place, turn)
    return found


def _followed_by(frame: Coordinates) -> Any:
    """Return the body at or above a frame that follows a path."""
    above: Coordinates | None = frame
    while above is not None and getattr(above, "_path", None) is None:
        above = above.parent
    return above


def _pose_of(frame: Any, roots: dict[str, Any]) -> Pose:
    """Return a kinematic frame's pose from those of the bodies with paths: parts with an axis of times, or of 1."""
    own_place, own_turn = frame.relative_pose
    if getattr(frame, "_path", None) is not None:
        place, turn = roots[frame.key]
        return place, own_turn[..., None, :] if turn is None else turn
    return compose(_pose_of(frame.parent, roots), (own_place[..., None, :], own_turn[..., None, :]))


def path_for(body: Body, to: Path, world_count: int) -> Path:
    """Return ``to`` as ``body`` can follow it in a batch of so many worlds.

    Raises:
        BodyStateError: the body is dynamic, or follows another frame.
        InvalidInputError: it is no path, or one for another number of worlds.
    """
    if not isinstance(to, Path):
        raise InvalidInputError(f"a body moves along a Path, or None ends it; got {type(to).__name__}")
    if body.is_dynamic:
        raise BodyStateError(f"{body.name!r} is dynamic and cannot follow a path; grip it instead")
    if body.parent is not None:
        raise BodyStateError(f"{body.name!r} follows another frame; dissoc it first")
    if to.world_count not in (None, world_count):
        raise InvalidInputError(f"the path is for {to.world_count} worlds, but there are {world_count}")
    if world_count == 1 and to.world_count == 1:
        to = of_world(to, 0)
    return to


def of_world(path: Path, world: int) -> Path:
    """Return the path of one world."""
    turns = path.quaternions
    return path_as_it_is(
        path.times,
        path.positions[world] if path.positions.ndim == 3 else path.positions,
        turns[world] if turns is not None and turns.ndim == 3 else turns,
        path.interpolation,
    )


def arrive(bodies: Iterable[Body], time: float) -> None:
    """Set the poses of bodies that follow paths to where those are at ``time`` [s]."""
    by_key = {body.key: body for body in bodies if body._path is not None}
    path_batches, kinematic = path_batches_of(by_key.values())
    for path_batch, path in path_batches:
        places, turns = path_batch.at(path.keys_around(np.array(time)))
        path_batch.__dict__["arrived"] = (time, places, turns)
        for key, own_place, own_turn in zip(path_batch.keys, places, turns, strict=True):
            body = by_key[key]
            body._position, body._quaternion = own_place, own_turn
    for body, (place, turn) in zip(
        kinematic, paths_at([body._path for body in kinematic], np.array(time)), strict=True
    ):
        body._position = place
        if turn is not None:
            body._quaternion = turn
