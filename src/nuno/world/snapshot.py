"""Snapshots: everything that a world is at one instant, copied out of it.

Save, restore, imagine and adopt are the same three steps: ``capture`` a world, spread or pick its worlds, and
``apply`` the result to the same world or another.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.dynamics.push import Push
from nuno.errors import InvalidInputError
from nuno.joints.tie import batched_spec
from nuno.materials import Material, Rigid
from nuno.shapes.coordinates import Pose
from nuno.shapes.path import Path, path_as_it_is
from nuno.tables.kinematic_motion import of_world
from nuno.validation import checked, index_array, number
from nuno.world.rigid_layout import RigidLayout
from nuno.world.snapshot_records import BodyRecord, DynamicsRecord, GripRecord

NEUTRAL = "any"
"""The engine of a snapshot whose states all engines take."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything that a world is at one instant; made by ``World.save``, taken by ``World.restore``."""

    time: float
    gravity: tuple[float, float, float]
    frame_rate: float
    substeps: int | None
    world_count: int
    family: str  # worlds that were imagined from each other share it
    bodies: tuple[BodyRecord, ...]
    grips: tuple[GripRecord, ...]
    pair_friction: tuple[tuple[str, str, Any], ...]
    ignored: tuple[tuple[str, str], ...]
    rigid: RigidLayout | None = None
    summed: tuple[str, ...] = ()
    clock_shift: np.ndarray | None = None  # (worlds,) [s], what each world's own clock is behind ``time``
    from_file: bool = field(default=False)
    engine: str = "nuno"  # whose states they are
    drivers: tuple[tuple[Any, Any], ...] = field(default=(), metadata={"file": False})  # and what each saved

    def __repr__(self) -> str:
        batch = f", {self.world_count} worlds" if self.world_count > 1 else ""
        dynamic = sum(body.dynamics is not None for body in self.bodies)
        return f"<Snapshot at t = {self.time:.3f} s, {len(self.bodies)} bodies, {dynamic} of them dynamic{batch}>"

    @checked
    def spread(self, world_count: int) -> Snapshot:
        """Return a batch of equal copies of this one world."""

        def repeated(array: Any) -> Any:
            return None if array is None else np.repeat(array, world_count, axis=0)

        def alike(array: np.ndarray) -> np.ndarray:  # a solver sends one world of these to its device
            return np.broadcast_to(array, (world_count, *array.shape[1:]))

        return self._mapped(
            repeated, lambda value, _: value, lambda material: material, lambda path: path, world_count, alike
        )

    @checked
    def pick(self, world: ArrayLike) -> Snapshot:
        """Return one world of a batch, or a batch of several, (k,).

        Raises:
            InvalidInputError: no whole numbers, fewer than two of several, or worlds that there are not.
        """
        if np.ndim(world) == 0:  # what one world has, has no axis of worlds
            own: Any = check_world_index(world, self.world_count, "world")
            rows: Any = slice(own, own + 1)
            if self.world_count == 1:
                return self
        else:
            own = rows = index_array("world", world, ("k",), low=0, high=self.world_count)
            if len(own) < 2:
                raise InvalidInputError("a batch has two worlds or more; pick(k) is a single one")

        def batched(array: Any) -> Any:
            return None if array is None else array[rows]

        def chosen(value: Any, axes: int) -> Any:
            return value[own] if value is not None and np.ndim(value) > axes else value

        def path(of_all: Path | None) -> Path | None:
            return None if of_all is None else of_world(of_all, own)

        def of_worlds(material: Material) -> Material:
            return material.of_world(own, self.world_count)

        return self._mapped(batched, chosen, of_worlds, path, np.size(own))

    def _mapped(
        self, batched: Any, single: Any, material: Any, path: Any, world_count: int, particles: Any = None
    ) -> Snapshot:  # fmt: skip
        """Map arrays that have a world axis, values that may (beside ``axes`` others), materials and paths.

        Arrays of the state of cloth and soft bodies are mapped by ``particles``, or as all others.
        """
        bodies = []
        for body in self.bodies:
            dynamics = body.dynamics
            if dynamics is not None:
                rows = batched if particles is None or isinstance(dynamics.material, Rigid) else particles
                dynamics = DynamicsRecord(
                    material(dynamics.material), _plain(single(dynamics.friction, 0)),
                    {name: rows(array) for name, array in dynamics.state.items()},
                    tuple(Push(batched(p.force), p.end) for p in dynamics.pushes),
                )  # fmt: skip
            bodies.append(replace(
                body, friction=_plain(single(body.friction, 0)), thickness=_plain(single(body.thickness, 0)),
                position=single(body.position, 1), quaternion=single(body.quaternion, 1),
                deformed=batched(body.deformed), deformed_position=single(body.deformed_position, 1),
                deformed_quaternion=single(body.deformed_quaternion, 1), dynamics=dynamics, path=path(body.path),
                relative=None if body.relative is None else tuple(single(part, 1) for part in body.relative),
            ))  # fmt: skip
        grips = [
            replace(
                grip,
                offsets=tuple(map(batched, grip.offsets)) if isinstance(grip.offsets, tuple) else batched(grip.offsets),
                spec=batched_spec(grip.spec, batched),
                followed=_mapped_lead(grip.followed, batched),
                borne=batched(grip.borne),
            )
            for grip in self.grips
        ]
        friction = tuple((a, b, _plain(single(mu, 0))) for a, b, mu in self.pair_friction)
        rigid = self.rigid
        if rigid is not None:
            listing = {name: batched(array) for name, array in rigid.listing.items()}
            rigid = replace(rigid, origin=batched(rigid.origin), listing=listing)
        return replace(
            self, bodies=tuple(bodies), grips=tuple(grips), pair_friction=friction, world_count=world_count,
            rigid=rigid, drivers=(), clock_shift=batched(self.clock_shift),
        )  # fmt: skip  # a driver moves the one world that it is in

    def at(self, time: float) -> Snapshot:
        """Return the same at another reading of the world's clock: paths and the ends of pushes go along with it.

        Args:
            time: What ``World.time`` is then [s].

        Raises:
            InvalidInputError: a time that is not finite.
        """
        later = number("time", time) - self.time
        if later == 0.0:
            return self
        bodies = [
            replace(
                body,
                path=None if body.path is None else path_as_it_is(
                    body.path.times + later, body.path.positions, body.path.quaternions, body.path.interpolation
                ),
                dynamics=body.dynamics and replace(
                    body.dynamics,
                    pushes=tuple(Push(p.force, None if p.end is None else p.end + later) for p in body.dynamics.pushes),
                ),
            )
            for body in self.bodies
        ]  # fmt: skip
        grips = [
            replace(
                grip,
                spec=_later(grip.spec, later),
                followed=grip.followed and (grip.followed[0] + later, *grip.followed[1:]),
            )
            for grip in self.grips
        ]
        shift = np.zeros(self.world_count) if self.clock_shift is None else self.clock_shift
        return replace(
            self, time=self.time + later, bodies=tuple(bodies), grips=tuple(grips), clock_shift=shift + later
        )


def _mapped_lead(followed: tuple[float, Pose, Pose] | None, batched: Any) -> tuple[float, Pose, Pose] | None:
    if followed is None:
        return None
    time, start, end = followed
    return time, (batched(start[0]), batched(start[1])), (batched(end[0]), batched(end[1]))


def _later(spec: Any, seconds: float) -> Any:
    """Return a grip's numbers with its keys so much later."""
    return replace(spec, times=spec.times + seconds) if hasattr(spec, "times") else spec


def _plain(value: Any) -> Any:
    return float(value) if isinstance(value, np.generic) else value


def check_world_index(k: Any, world_count: int, name: str = "k") -> int:
    """Return ``k`` as an index of one world of a batch.

    Raises:
        InvalidInputError: not a whole number, or out of range.
    """
    if isinstance(k, bool) or not isinstance(k, int | np.integer) or not 0 <= k < world_count:
        raise InvalidInputError(f"{name} must be a whole number in [0, {world_count - 1}], got {k!r}")
    return int(k)
