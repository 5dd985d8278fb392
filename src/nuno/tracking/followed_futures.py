"""The futures of a follower: copies of its world, one for each guess, that are renewed where the world has changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.shape_topology import vertex_shares
from nuno.materials import Cloth
from nuno.world.snapshot import Snapshot
from nuno.world.snapshot_records import BodyRecord
from nuno.world.world import World


class FollowedFutures:
    """Copies of a world in which one cloth is of several materials.

    Args:
        world: The world.
        body: Its cloth.
        materials: Of the cloth, one for each copy; empty keeps its own, in ``count`` copies.
        count: How many copies.
        thorough: As of ``World.imagine``.
    """

    def __init__(self, world: World, body: Body, materials: Sequence[Cloth], count: int, thorough: bool) -> None:
        self._world, self._body, self._thorough = world, body, thorough
        self._materials, self.count = materials, count
        self._seen: Snapshot | None = None
        self.worlds: World = world
        self.body: Body = body
        self.masses = np.zeros((count, 1))
        self.held = np.zeros(1, dtype=bool)

    def bring(self) -> bool:
        """Make the futures start from what the world is now; return whether the cloth is where they left it."""
        now = self._world.save()
        if self._seen is not None and _same_but_places(now, self._seen):
            self._move_statics(now, self._seen)
            return True
        kept = None
        if self._seen is not None and _same_state(now, self._seen, self._body.key):
            state = self.worlds.state(self.body)
            kept = [state[name].numpy() for name in ("positions", "velocities")]
        self.worlds = self._world.imagine(self.count, thorough=self._thorough)
        self.body = next(body for body in self.worlds.bodies if body.key == self._body.key)
        if self._materials:
            self.worlds.set_material(self.body, stacked(self._materials))
        if kept is not None and self.count > 1:
            self.worlds.set_vertices(self.body, kept[0], kept[1])
        share = vertex_shares(self.body.shape)
        self.masses = np.reshape(self.body.mass, (self.count, 1)) * (share / share.sum())
        self.held = np.zeros(len(share), dtype=bool)
        for grip in now.grips:
            spec: Any = grip.spec
            corners = getattr(spec, "vertices", None)
            corners = getattr(spec, "corners", None) if corners is None else corners
            if grip.body == self._body.key and corners is not None:
                self.held[corners[corners >= 0]] = True
        return kept is not None

    def forget(self) -> None:
        """Make the futures anew at the next image: something went wrong amidst a run."""
        self._seen = None

    def adopt(self, k: int) -> None:
        """Let the world become future ``k``."""
        self._world.adopt(self.worlds, k)
        self._seen = self._world.save()

    def follow(self, lost: np.ndarray, best: int) -> None:
        """Put the cloths of futures (k,) int that have lost it where the best one has it."""
        if len(lost):
            state = self.worlds.state(self.body)
            places, speeds = (state[name].numpy()[best] for name in ("positions", "velocities"))
            self.worlds.set_vertices(self.body, places, speeds, worlds=lost)

    def _move_statics(self, now: Snapshot, before: Snapshot) -> None:
        """Put static bodies where they have been moved to, and let them follow the paths that they follow."""
        known = {body.key: body for body in self.worlds.bodies}
        for record, old in zip(now.bodies, before.bodies, strict=True):
            if record.dynamics is not None:
                continue
            if record.path is not old.path:
                self.worlds.move(known[record.key], record.path)
            if record.path is None and not _same_place(record, old):
                self.worlds.set_pose(known[record.key], record.position, record.quaternion)


def stacked(materials: Sequence[Cloth]) -> Cloth:
    """Return the material of a batch whose worlds have these."""

    def column(name: str) -> Any:
        values = [getattr(material, name) for material in materials]
        if any(isinstance(value, tuple) for value in values):
            pairs = [value if isinstance(value, tuple) else (value, value) for value in values]
            return tuple(np.array([pair[side] for pair in pairs], dtype=float) for side in (0, 1))
        return np.array(values, dtype=float)

    if len(materials) == 1:
        return materials[0]
    return Cloth(**{item.name: column(item.name) for item in fields(Cloth)})


def _same_place(a: BodyRecord, b: BodyRecord) -> bool:
    return np.array_equal(a.position, b.position) and np.array_equal(a.quaternion, b.quaternion)


def _same_state(a: Snapshot, b: Snapshot, key: str) -> bool:
    """Return True if a body is in the same state in two snapshots of one time."""
    found = [next((r.dynamics for r in each.bodies if r.key == key), None) for each in (a, b)]
    if a.time != b.time or found[0] is None or found[1] is None:
        return False
    one, other = found[0].state, found[1].state
    return all(np.array_equal(one[name], other[name]) for name in ("positions", "velocities") if name in one)


def _same_but_places(a: Snapshot, b: Snapshot) -> bool:
    """Return True if two snapshots differ in nothing, or only in where static bodies without frames are."""
    if (a.time, a.gravity, a.frame_rate, a.substeps) != (b.time, b.gravity, b.frame_rate, b.substeps):
        return False
    if (a.ignored, a.summed) != (b.ignored, b.summed) or len(a.bodies) != len(b.bodies):
        return False
    if len(a.pair_friction) != len(b.pair_friction) or not all(
        p[:2] == q[:2] and np.array_equal(p[2], q[2]) for p, q in zip(a.pair_friction, b.pair_friction, strict=True)
    ):
        return False
    if [(g.key, g.target) for g in a.grips] != [(g.key, g.target) for g in b.grips]:
        return False
    if any(p.spec is not q.spec for p, q in zip(a.grips, b.grips, strict=True)):
        return False
    return all(_same_body(p, q) for p, q in zip(a.bodies, b.bodies, strict=True))


def _same_body(a: BodyRecord, b: BodyRecord) -> bool:
    names = ("key", "friction", "thickness", "group", "collides_with", "parent")
    if any(not np.array_equal(getattr(a, name), getattr(b, name)) for name in names):
        return False
    if (a.dynamics is None) != (b.dynamics is None):
        return False
    if a.dynamics is None or b.dynamics is None:
        if a.deformed is None or b.deformed is None:
            return a.deformed is b.deformed
        return np.array_equal(a.deformed, b.deformed)
    own, other = a.dynamics, b.dynamics
    return (
        own.material.same_as(other.material)
        and own.pushes == other.pushes
        and own.state.keys() == other.state.keys()
        and all(np.array_equal(own.state[name], other.state[name]) for name in own.state)
    )
