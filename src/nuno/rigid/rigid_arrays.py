"""The arrays of all rigid bodies on the device: a row for each slot, and for each part one of its pairs; they grow."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.rigid.broad_phase import Rules
from nuno.rigid.manifold import POINTS
from nuno.rigid.part_table import PartTable
from nuno.rigid.persistent_manifolds import COUNTS, NOTES, OVERFLOW, Contacts
from nuno.rigid.rigid_body import RigidState

log = logging.getLogger(__name__)

ROW = 24
"""Partners a part has room for at first; a box in a heap has up to 12 within reach."""

PARTS = 8
"""Parts that a scene has room for at first."""

BODY = dict(
    position=wp.vec3, rotation=wp.quat, position_before=wp.vec3, rotation_before=wp.quat, position_free=wp.vec3,
    rotation_free=wp.quat, lost=wp.vec3, left=wp.vec3, left_turn=wp.vec3, velocity=wp.vec3, spin=wp.vec3,
    force=wp.vec3, torque=wp.vec3, drag=float, inverse_mass=float, inertia=wp.mat33, inverse_inertia=wp.mat33,
    weight=float, give=wp.mat33, pressed=wp.vec3, caught=int, joined=int,
)  # fmt: skip
"""Arrays of `RigidState` with a row for each body of each world."""
SAVED = ("position", "rotation", "velocity", "spin", "force", "torque")
ENTRY = dict(
    partner=int, patch=int, count=int, frame=int, friction=float, bounce=float, normal=wp.vec3, clear=float,
    margin=float, built_place=wp.vec3, built_turn=wp.quat,
)  # fmt: skip
"""Arrays of `Contacts` with a row for each pair, which last."""
POINT = dict(local_a=wp.vec3, local_b=wp.vec3, force=wp.vec3)
REPORTED = dict(impulse=wp.vec3, met=int)
"""Arrays of `Contacts` with a row for each pair that tell of the last frame: no later step depends on them."""
PASSING = dict(
    normal_now=(wp.vec3, 1), tangent_now=(wp.vec3, 1), order=(int, 1), waiting=(int, 1), bounds=(int, 1),
    height=(float, 1), arm_a=(wp.vec3, POINTS), arm_b=(wp.vec3, POINTS), mass=(wp.vec3, POINTS),
    start=(wp.vec4, POINTS), aim=(float, POINTS),
)  # fmt: skip
"""Arrays of `Contacts` that every substep fills."""
BY_WORLD = ("order", "waiting", "bounds")
"""Those of them that are filled from the first place of a world on, the others by pair."""


class RigidArrays:
    """State, pairs and rules of the bodies of a batch of worlds.

    Args:
        world_count: Worlds in the batch.
        device: "cpu" or "cuda:0" ...
        parts: Parts that there is room for at first.
    """

    def __init__(self, world_count: int, device: str, parts: int = PARTS) -> None:
        self.world_count, self.device = world_count, device
        self.table = PartTable(device, world_count, parts)
        self.state, self.manifolds, self.rules = RigidState(), Contacts(), Rules()
        self.part_rows: dict[int, list[int]] = {}
        self._roles = np.zeros(0, dtype=np.int32)
        self.state.capacity, self.state.worlds = 0, world_count
        self.manifolds.parts, self.manifolds.row = 0, ROW
        self._grow_bodies(8)
        self._grow_rows(self.table.parts.capacity, ROW)

    def _entry_shape(self, name: str) -> tuple[int, ...]:
        shape = (self.world_count, self.manifolds.parts, self.manifolds.row)
        return (*shape, POINTS) if name in POINT else shape

    def _entries(self, name: str) -> np.ndarray:
        return getattr(self.manifolds, name).reshape(self._entry_shape(name)).numpy()

    def _read(self, name: str, slot: int) -> np.ndarray:
        array = getattr(self.state, name)
        if self.device == "cpu":  # NumPy's view of all is made in a third of the time of Warp's of a part
            values = array.numpy()
            return values.reshape((self.world_count, self.state.capacity, *values.shape[1:]))[:, slot]
        return array.reshape((self.world_count, self.state.capacity))[:, slot].numpy()

    def _write(self, name: str, slot: int, value: ArrayLike) -> None:
        self._write_to(getattr(self.state, name), slot, value)

    def _write_to(self, array: wp.array, slot: int, value: ArrayLike) -> None:
        shape = (self.world_count, *getattr(array.dtype, "_shape_", ()))
        values = np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype=np.float32), shape))
        array.reshape((self.world_count, self.state.capacity))[:, slot].assign(values)

    def _put_slot(self, name: str, slot: int, value: Any) -> None:
        getattr(self.rules, name)[slot : slot + 1].assign(np.array([value]))

    def _forget_rows(self, rows: Sequence[int]) -> None:
        """Drop the pairs in a part's own row, and those of others with it."""
        partner = self.manifolds.partner
        table = partner.numpy().reshape(self._entry_shape("partner")).copy()
        count = self.manifolds.count.numpy().reshape(table.shape).copy()
        dropped = np.isin(table, list(rows))
        dropped[:, list(rows)] = True
        table[dropped], count[dropped] = -1, 0
        partner.assign(table.ravel())
        self.manifolds.count.assign(count.ravel())
        self._list_anew()

    def _forget_impulses(self, slot: int) -> None:
        """Forget what contacts gave a body in the last frame, and others through it."""
        met, impulse = self._entries("met"), self._entries("impulse").copy()
        impulse[met == slot] = 0.0
        impulse[:, self.part_rows.get(slot, [])] = 0.0
        self.manifolds.impulse.assign(impulse.reshape(-1, 3))

    def _list_anew(self) -> None:
        self.manifolds.notes.fill_(-1.0)

    def _grow_bodies(self, capacity: int) -> None:
        old, worlds = self.state.capacity, self.world_count
        state, rules, manifolds = self.state, self.rules, self.manifolds
        kinds: list[tuple[Any, str, Any]] = [(state, name, kind) for name, kind in BODY.items()]
        kinds += [(rules, "friction", float), (rules, "bounce", float)]
        kinds += [(manifolds, "listed_position", wp.vec3), (manifolds, "listed_rotation", wp.quat)]
        kinds += [(manifolds, "winner", wp.uint64)]
        for owner, name, kind in kinds:
            wider = wp.zeros((worlds, capacity), dtype=kind, device=self.device)
            if old:
                wp.copy(wider[:, :old], getattr(owner, name).reshape((worlds, old)))
            setattr(owner, name, wider.flatten())
        for name, kind in (("radius", float), ("group", int), ("collides_with", int)):
            wider = wp.zeros(capacity, dtype=kind, device=self.device)
            if name == "radius":
                wider.fill_(-1.0)
            if old:
                wp.copy(wider, getattr(rules, name), count=old)
            setattr(rules, name, wider)
        self._roles = np.pad(self._roles, (0, capacity - old))
        state.active = wp.array(self._roles, dtype=int, device=self.device)
        state.capacity = capacity

    def _grow_rows(self, parts: int, row: int) -> None:
        c, worlds = self.manifolds, self.world_count
        old_parts, old_row = c.parts, c.row
        for name, kind in (*ENTRY.items(), *POINT.items(), *REPORTED.items()):
            shape: tuple[int, ...] = (worlds, parts, row, POINTS) if name in POINT else (worlds, parts, row)
            wider = wp.zeros(shape, dtype=kind, device=self.device)
            if name == "partner":
                wider.fill_(-1)
            if old_parts:
                old = getattr(c, name).reshape((worlds, old_parts, old_row, *shape[3:]))
                wp.copy(wider[:, :old_parts, :old_row], old)
            setattr(c, name, wider.flatten())
        for name, (kind, each) in PASSING.items():
            setattr(c, name, wp.zeros(worlds * parts * row * each, dtype=kind, device=self.device))
        c.counts = wp.zeros(worlds * COUNTS, dtype=int, device=self.device)
        c.notes = wp.full(worlds * NOTES, -1.0, dtype=float, device=self.device)
        c.parts, c.row = parts, row

    def make_room(self) -> None:
        """Make room for twice as many near each part.

        Worlds in which there was enough keep what they have found in the substep, and when they list pairs anew, as
        they would alone; those in which a row was too short have still to go on.
        """
        c, worlds = self.manifolds, self.world_count
        log.info("a part has more than %d others near by: making room for twice as many", c.row)
        parts, row, longer = c.parts, c.row, 2 * c.row
        before = {name: getattr(c, name) for name in PASSING}
        counts, notes = c.counts.numpy().copy(), c.notes.numpy().copy()
        self._grow_rows(parts, longer)
        for name, (_, each) in PASSING.items():
            shape = (1, parts * row, 1) if name in BY_WORLD else (parts, row, each)
            wider = getattr(c, name).reshape((worlds, shape[0], shape[1] * longer // row, shape[2]))
            wp.copy(wider[:, :, : shape[1]], before[name].reshape((worlds, *shape)))
        entries = c.order.numpy()
        c.order.assign(entries // row * longer + entries % row)
        c.counts.assign(counts)
        notes.reshape(worlds, NOTES)[counts.reshape(worlds, COUNTS)[:, OVERFLOW] != 0] = -1.0
        c.notes.assign(notes)
