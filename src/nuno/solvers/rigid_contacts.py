"""Rigid bodies read out: where they are, and points, normals, forces and impulses of their contacts."""

from __future__ import annotations

import numpy as np

from nuno.rigid.manifold import POINTS
from nuno.rigid.rigid_arrays import RigidArrays
from nuno.shapes.quaternion import rotate


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

    def motions_of(self, slots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return ``pose`` and ``velocity`` of slots (n,) at once, (worlds, n, ...) each."""
        shape = (self.world_count, self.state.capacity)
        place, turn, velocity, spin = (
            getattr(self.state, name).reshape(shape).numpy()[:, slots].astype(float)
            for name in ("position", "rotation", "velocity", "spin")
        )
        return place + self.origin[:, None], np.roll(turn, 1, axis=-1), velocity, spin

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

    def impulses_of(self, slot: int) -> dict[int, np.ndarray]:
        """Return what contacts gave a body in the last frame, (worlds, 3) [N s], by the slot of the other body.

        One is left out if it bounced away and another took its place in the row and pressed, all within the frame.
        """
        found: dict[int, np.ndarray] = {}
        for (own, other), impulse in self.impulses_between().items():
            if own == slot:
                found[other] = impulse
        return found

    def impulses_between(self) -> dict[tuple[int, int], np.ndarray]:
        """Return what contacts gave the first of two slots in the last frame, (worlds, 3) [N s], in either order."""
        impulse, met = self._entries("impulse"), self._entries("met")
        owner = self.table.parts.slot.numpy()
        found: dict[tuple[int, int], np.ndarray] = {}
        for world, p, k in np.argwhere(impulse.any(axis=-1)):
            pair = int(owner[p]), int(met[world, p, k])
            for both, sign in ((pair, 1.0), (pair[::-1], -1.0)):
                total = found.setdefault(both, np.zeros((self.world_count, 3)))
                total[world] += sign * impulse[world, p, k]
        return found

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
