"""Rigid bodies read out: where they are, and points, normals, forces and impulses of their contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from nuno.rigid.manifold import POINTS
from nuno.rigid.rigid_arrays import SAVED, RigidArrays
from nuno.rigid.saved_contacts import LASTING, LISTING
from nuno.shapes.quaternion import rotate

WHOLE = ("partner", "count")
"""Arrays of the manifolds that say which places for pairs are taken, and have points."""
TAKEN = "taken places"


class RigidContacts(RigidArrays):
    """Poses, velocities and contacts of the rigid bodies of a batch of worlds, as NumPy arrays.

    Attributes:
        origin: (worlds, 3) float64 [m], of what positions on the device are relative to.
    """

    origin: np.ndarray

    def pose(self, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Position (worlds, 3) float64 [m] and quaternion (worlds, 4), (w, x, y, z), of a slot."""
        turn = self._read("rotation", slot).astype(float)
        return self._read("position", slot) + self.origin, np.roll(turn, 1, axis=-1)

    def velocity(self, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] of the centre of mass and angular velocity [rad/s], (worlds, 3) each, world frame."""
        return self._read("velocity", slot).astype(float), self._read("spin", slot).astype(float)

    def motions(self, slots: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return `pose` and `velocity` of several slots, read at once: (worlds, slots, 3 or 4) each."""
        rows = []
        for name in ("position", "rotation", "velocity", "spin"):
            whole = getattr(self.state, name).numpy().reshape(self.world_count, self.state.capacity, -1)
            rows.append(whole[:, list(slots)].astype(float))
        return rows[0] + self.origin[:, None], np.roll(rows[1], 1, axis=-1), rows[2], rows[3]

    def contacts_of(self, slot: int, world: int = 0) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Return what touches a body: (slot of the other, points (n, 3) [m], normals (n, 3), forces (n, 3) [N]).

        Normals look at the body, forces act on it; both are those of the last substep.
        """
        c = self.manifolds
        counts, partners = self._entries("count")[world], self._entries("partner")[world]
        forces, local = self._entries("force")[world], self._entries("local_b")[world]
        shape = (self.world_count, c.parts, c.row)
        normals, tangents = (getattr(c, name).reshape(shape).numpy()[world] for name in ("normal_now", "tangent_now"))
        slots = self.table.parts.slot.numpy()
        found: dict[int, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {}
        for p, k in zip(*np.nonzero(counts > 0), strict=True):
            owner, other = int(slots[p]), int(slots[partners[p, k]])
            if slot not in (owner, other):
                continue
            place, turn = self.pose(other)
            n, t = normals[p, k].astype(float), tangents[p, k].astype(float)
            sign = 1.0 if slot == owner else -1.0
            for m in range(counts[p, k]):
                f = forces[p, k, m]
                if f[0] > 0.0:
                    force = sign * (f[0] * n + f[1] * t + f[2] * np.cross(n, t))
                    point = place[world] + rotate(turn[world], local[p, k, m].astype(float))
                    found.setdefault(other if slot == owner else owner, []).append((point, sign * n, force))
        result = []
        for other, each in found.items():
            points, directions, pushes = (np.array(part) for part in zip(*each, strict=True))
            result.append((other, points, directions, pushes))
        return result

    def impulses(self) -> dict[int, dict[int, np.ndarray]]:
        """Return what contacts gave bodies in the last frame, (worlds, 3) [N s], by slot and the slot of the other.

        One is left out if it bounced away and another took its place in the row and pressed, all within the frame.
        """
        impulse, met = self._entries("impulse"), self._entries("met")
        rows = np.unique(np.flatnonzero(impulse != 0.0) // 3)  # of bools in a twentieth of the time
        world, part, _ = np.unravel_index(rows, met.shape)
        pairs = np.stack([self.table.parts.slot.numpy()[part], met.ravel()[rows]], axis=1)
        # each gives the one and takes from the other, in the order of worlds, parts and rows
        given = impulse.reshape(-1, 3)[rows]
        given, worlds = np.stack([given, -given], axis=1).reshape(-1, 3), np.repeat(world, 2)
        sides = np.stack([pairs, pairs[:, ::-1]], axis=1).reshape(-1, 2)
        keys = sides[:, 0].astype(np.int64) * (1 << 32) + sides[:, 1]
        found: dict[int, dict[int, np.ndarray]] = {}
        _, firsts, kinds = np.unique(keys, return_index=True, return_inverse=True)
        for kind in np.argsort(firsts).tolist():
            own, (one, other) = kinds == kind, sides[firsts[kind]].tolist()
            total = np.zeros((self.world_count, 3))
            np.add.at(total, worlds[own], given[own])
            found.setdefault(one, {})[other] = total
        return found

    def copies(self, into: Mapping[tuple[str, str], Any]) -> dict[tuple[str, str], Any]:
        """Return copies of all that the next step depends on, by whose it is and its name, for `take_copies`.

        Of the places for pairs, of which few are taken, the CPU copies those.

        Args:
            into: Copies of before that are not needed any more, or none: new memory takes longer than the copy.
        """
        made: dict[tuple[str, str], Any] = {}
        lasting = LASTING
        if self.device == "cpu":
            lasting = WHOLE
            taken = np.flatnonzero(self.manifolds.partner.numpy() >= 0)
            made["manifolds", TAKEN] = taken, {name: self._places(name)[taken] for name in LASTING if name not in WHOLE}
        for owner, names in (("state", SAVED), ("manifolds", (*lasting, *LISTING))):
            for name in names:
                own, there = getattr(getattr(self, owner), name), into.get((owner, name))
                if there is None or there.size != own.size:
                    made[owner, name] = wp.clone(own)
                else:
                    wp.copy(there, own)
                    made[owner, name] = there
        return made

    def take_copies(self, copies: Mapping[tuple[str, str], Any]) -> bool:
        """Write back what `copies` returned; return whether there is other room now, for which none of it fits."""
        fits = True
        partners = copies["manifolds", "partner"].size
        for (owner, name), array in copies.items():
            if name == TAKEN:
                taken, values = array
                for each, rows in values.items() if self.manifolds.partner.size == partners else ():
                    self._places(each)[taken] = rows
                continue
            own = getattr(getattr(self, owner), name)
            if own.size == array.size:
                wp.copy(own, array)
            else:
                fits = False
        return not fits

    def _places(self, name: str) -> np.ndarray:
        """Return an array of the manifolds on the CPU, (worlds * parts * row, ...)."""
        whole: np.ndarray = getattr(self.manifolds, name).numpy()
        return whole.reshape(self.manifolds.partner.size, -1)

    def contact_count(self) -> np.ndarray:
        """(worlds,) int: points at which bodies press on each other."""
        pressing = (self._entries("force")[..., 0] > 0.0) & self._in_use()
        return pressing.sum(axis=(1, 2, 3))

    def deepest(self) -> float:
        """The deepest overlap of any contact when the last substep began [m]."""
        start = self.manifolds.start.reshape(self._entry_shape("force")).numpy()[..., 0]
        return float(np.max(-start, where=self._in_use(), initial=0.0))

    def _in_use(self) -> np.ndarray:
        return np.arange(POINTS) < self._entries("count")[..., None]
