"""Path batches: paths of many bodies with the same keys in time, such as a robot's links, worked out together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose
from nuno.shapes.path import Path

if TYPE_CHECKING:
    from nuno.bodies.body import Body

SAME_INSTANT = 1e-8
"""[s] Times that are no farther apart are one."""


class PathWorld(Protocol):
    """A world whose bodies are sent along paths."""

    def move(self, body: Body | str, to: Path | None) -> None:
        """Let a static body follow a path from now on; see ``World.move``."""


@dataclass(frozen=True, eq=False)
class PathBatch:
    """Paths of many bodies with the same keys in time, such as a robot's links; they are worked out together.

    Attributes:
        keys: Of the bodies, n of them.
        times: (k,) float [s].
        positions: (n, k, 3) float [m], or (n, worlds, k, 3).
        quaternions: (n, k, 4) float, or (n, worlds, k, 4).
        arrived: Where the bodies were last put: the time [s], positions (n, ..., 3) and quaternions (n, ..., 4).
    """

    keys: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    arrived: tuple[float, np.ndarray, np.ndarray] | None = None

    @cached_property
    def paths(self) -> list[Path]:
        """The path of each body, of read-only numbers that need no check: they are made every frame."""
        for array in (self.times, self.positions, self.quaternions):
            array.setflags(write=False)
        made = []
        for position, quaternion in zip(self.positions, self.quaternions, strict=True):
            path = object.__new__(Path)
            path.__dict__.update(
                times=self.times, positions=position, quaternions=quaternion, interpolation="linear", path_batch=self
            )
            made.append(path)
        return made

    def on_device(self, device: Any) -> tuple[Any, Any]:
        """Return positions and quaternions as Warp's arrays (n, worlds or 1, k) of vectors."""
        import warp as wp

        positions, quaternions = (
            np.ascontiguousarray(part if part.ndim == 4 else part[:, None])
            for part in (self.positions, self.quaternions)
        )
        return (
            wp.array(positions, dtype=wp.vec3d, device=device, copy=False),
            wp.array(quaternions, dtype=wp.vec4d, device=device, copy=False),
        )

    def at(self, between: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Pose:
        """Return positions and quaternions (n, ..., 3) and (n, ..., 4), at what ``Path.keys_around`` says of times."""
        first, last, s = between
        if s.ndim == 0 and s in (0.0, 1.0):  # at a key
            key = int(first if s == 0.0 else last)
            return self.positions[..., key, :], self.quaternions[..., key, :]
        alike = self._alike
        if not alike.any():
            return _between(self.positions, self.quaternions, between)
        one = _between(self.positions[alike, :1], self.quaternions[alike, :1], between)
        if alike.all():
            shape = (*self.positions.shape[:2], *one[0].shape[2:-1])
            return np.broadcast_to(one[0], (*shape, 3)), np.broadcast_to(one[1], (*shape, 4))
        others = _between(self.positions[~alike], self.quaternions[~alike], between)
        found = []
        for shared, own in zip(one, others, strict=True):
            part = np.empty((len(alike), *own.shape[1:]))
            part[alike], part[~alike] = shared, own
            found.append(part)
        return found[0], found[1]

    @cached_property
    def _alike(self) -> np.ndarray:
        """(n,) bool, of which bodies many worlds have one path: it is worked out once."""
        if self.positions.ndim < 4:
            return np.zeros(len(self.positions), dtype=bool)
        same = [(part == part[:, :1]).all(axis=(1, 2, 3)) for part in (self.positions, self.quaternions)]
        return np.asarray(same[0] & same[1])


def _between(positions: np.ndarray, turns: np.ndarray, between: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Pose:
    """Return poses between keys, of which positions are (n, ..., k, 3) and turns (n, ..., k, 4)."""
    first, last, s = between
    a, b = positions[..., first, :], positions[..., last, :]
    placed = a + s[..., None] * (b - a)
    if turns.ndim < 4 or s.ndim == 0:
        return placed, quat.slerp(turns[..., first, :], turns[..., last, :], s)
    # of many worlds one instant after the other: most are at a key, where there is nothing to interpolate
    turned = np.empty((*placed.shape[:-1], 4))
    for k, part in enumerate(s):
        turned[..., k, :] = quat.slerp(turns[..., first[k], :], turns[..., last[k], :], part)
    return placed, turned


@dataclass(frozen=True, eq=False)
class BatchMotion:
    """A path batch in a run.

    Attributes:
        path_batch: The path batch.
        path: One of its paths.
        times: (k,) float [s], of the run.
    """

    path_batch: PathBatch
    path: Path
    times: np.ndarray

    @cached_property
    def between(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Keys around the run's times as of ``Path.keys_around``; what rounding alone keeps from a key is at the key.

        So it makes no difference how many frames a run has.
        """
        keys = self.path_batch.times
        nearest = keys[np.abs(keys[:, None] - self.times).argmin(axis=0)]
        return self.path.keys_around(np.where(np.abs(nearest - self.times) < SAME_INSTANT, nearest, self.times))

    @property
    def by_frame(self) -> np.ndarray:
        """(frames, 3, 4) float: of each instant of a frame the keys around it, the part between them, the time [s]."""
        first, last, part = self.between
        return by_frame(first, last, part, self.times)

    @cached_property
    def poses(self) -> dict[str, Pose]:
        """By body key, positions (k, 3) or (worlds, k, 3) [m] and quaternions (k, 4) or (worlds, k, 4)."""
        keys, found = self.path_batch.keys, self.path_batch.at(self.between)
        return {key: (place, turn) for key, place, turn in zip(keys, *found, strict=True)}


def by_frame(first: np.ndarray, last: np.ndarray, part: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(frames, 3, 4) float: what `nuno.tables.pose_keys.write_pose_keys` is told of a frame's start, middle and end."""
    found = np.stack([first, last, part, times], axis=1)
    return np.stack([found[k : k + 3] for k in range(0, len(found) - 1, 2)])


class KinematicGroup:
    """Bodies that are sent on one path batch after another, as a robot's links in every frame.

    Each stays on one path, which leads where the path batch does: paths need not be made for every frame.

    Args:
        keys: Of the bodies.

    Attributes:
        keys: Of the bodies.
        path_batch: The last one, None before the first.
        paths: One for each body.
    """

    def __init__(self, keys: tuple[str, ...]) -> None:
        self.keys = keys
        self.path_batch: PathBatch | None = None
        self.paths: list[Path] = [GroupPath(self, k) for k in range(len(keys))]

    def lead(
        self,
        bodies: Sequence[Body],
        world: PathWorld,
        times: np.ndarray,
        positions: np.ndarray,
        quaternions: np.ndarray,
    ) -> None:
        """Send the bodies on a path each, from now on.

        Args:
            bodies: Those of the keys, in their order.
            world: Where they are.
            times: (k,) [s].
            positions: (n, k, 3) [m], or (n, worlds, k, 3).
            quaternions: (n, k, 4), or (n, worlds, k, 4).
        """
        self.path_batch = PathBatch(self.keys, times, positions, quaternions)
        before = [body._path for body in bodies]
        if before == self.paths:
            return
        for body, path, own in zip(bodies, self.paths, before, strict=True):
            # the first time, after anything else took the body elsewhere, and where worlds part
            if own is None or own.world_count != path.world_count:
                world.move(body, path)
            else:  # what ``World.move`` does to a body that follows a path already
                body._path = path

    def arrived(self, bodies: Sequence[Body], time: float, shape: tuple[int, ...] = ()) -> Pose:
        """Return where the bodies are now: positions (n, *shape, 3) [m] and quaternions (n, *shape, 4).

        Args:
            bodies: Those of the keys, in their order.
            time: Now [s].
            shape: (), or (worlds,) of a batch.
        """
        batch, count = self.path_batch, len(bodies)
        if batch is not None and batch.arrived is not None and batch.arrived[0] == time:
            if [body._path for body in bodies] == self.paths and batch.arrived[1].shape == (count, *shape, 3):
                return batch.arrived[1:]
        places, turns = np.empty((count, *shape, 3)), np.empty((count, *shape, 4))
        for k, body in enumerate(bodies):
            places[k], turns[k] = body._position, body._quaternion
        return places, turns


class GroupPath(Path):
    """The path of the k-th body of a kinematic group, which is another one when that is sent on another path batch."""

    kinematic_group: KinematicGroup
    k: int

    def __init__(self, kinematic_group: KinematicGroup, k: int) -> None:
        self.__dict__.update(kinematic_group=kinematic_group, k=k)

    @property
    def times(self) -> np.ndarray:  # type: ignore[override]
        """(keys,) float [s]."""
        return self._path_batch.times

    @property
    def positions(self) -> np.ndarray:  # type: ignore[override]
        """(keys, 3) float [m], or (worlds, keys, 3)."""
        return self._path_batch.positions[self.k]

    @property
    def quaternions(self) -> np.ndarray:  # type: ignore[override]
        """(keys, 4) float, or (worlds, keys, 4)."""
        return self._path_batch.quaternions[self.k]

    def as_it_is(self) -> Path:
        """Return what it is now as a path that stays so."""
        return self._path_batch.paths[self.k]

    @property
    def _path_batch(self) -> PathBatch:
        path_batch = self.kinematic_group.path_batch
        assert path_batch is not None, "nothing follows the path before the first path batch"
        return path_batch
