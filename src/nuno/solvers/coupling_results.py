"""The contacts, ties and joints of coupled bodies read out: points, forces and impulses of the last frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from nuno.coupled.bounded_particles import MOST
from nuno.coupled.coupled_passes import IMPULSE_UNIT
from nuno.coupled.joint_response import Joints
from nuno.coupled.tie_constraints import Holds, Ties
from nuno.solvers.particle_solver import ParticleSolver
from nuno.state.cloth_state import NOTES, SPEED


class CouplingResults:
    """Speeds of coupled bodies, and the forces and impulses of their contacts, ties and joints.

    Attributes:
        world_count: Worlds in the batch.
        holds: Rigid bodies that are held in a frame.
        joints: Rigid bodies that are joined.
    """

    world_count: int
    holds: Holds
    joints: Joints
    _solvers: list[ParticleSolver]
    _rigid: Any
    _slots: list[int]
    _state: Any
    _rows: Any
    _particles: Any
    _ties: Ties
    _impulses: wp.array
    _bodies: int
    _firsts: list[int]  # of each solver, its first particle among all
    _origins: np.ndarray
    _island: np.ndarray
    _row_count: int  # rows at most, of any world
    _rate: float  # from an impulse in the substep's units to a force
    _scale: float  # the same of a mean over the frame

    def contacts(self) -> list[tuple[int, tuple[int, int], np.ndarray, np.ndarray, np.ndarray]]:
        """Return what pushed in the last substep: world, the two bodies, point [m], normal and force [N] on the first.

        By world, bodies and elements: on CUDA rows are listed as threads come to them.
        """
        rows, particles, worlds = self._rows, self._particles, self.world_count
        counts = rows.active_count.numpy() if self._row_count else np.zeros(worlds, int)
        names = ("push", "drag", "normal", "weights", "corners", "bodies", "active")
        push, drag, normal, weights, corners, bodies, active = (getattr(rows, name).numpy() for name in names)
        keys = (bodies, corners, *(getattr(rows, name).numpy() for name in ("kind", "part", "point")))
        place = particles.p.numpy() + particles.u.numpy()
        found = []
        for world in range(worlds):
            base = world * rows.room
            pushing = active[base : base + counts[world]]
            pushing = pushing[push[pushing] > 0.0]
            order = np.lexsort(np.column_stack([key[pushing] for key in keys]).T[::-1])
            for r in pushing[order]:
                ours = (corners[r] >= 0) & (weights[r] > 0.0)
                share = weights[r][ours] / weights[r][ours].sum()
                point = share @ place[world * particles.count + corners[r][ours]]
                force = (push[r] * normal[r] + drag[r]).astype(float) * self._rate
                pair = (int(bodies[r][0]), int(bodies[r][1]))
                point = point + self._origins[world, pair[0]]
                found.append((world, pair, point, normal[r].astype(float), force))
        return found

    def shape_contacts(self, k: int) -> tuple[np.ndarray, list[tuple[int, int, int, np.ndarray, np.ndarray]]]:
        """Return what shapes did in the last substep to those particles of a solver that rows pressed on.

        Returns:
            Which particles these are, (worlds, n) bool, and of each contact the world, the particle, the shape's number
            in the solver's table, the normal and the force [N].
        """
        particles, first, n = self._particles, self._firsts[k], self._solvers[k].particle_count
        bounded, counts = particles.bounded.numpy(), particles.bounded_count.numpy()
        of_shapes = ("shape", "shape_normal", "shape_push", "shape_drag")
        shape, normal, push, drag = (getattr(particles, name).numpy() for name in of_shapes)
        weight, pressed, found = particles.w.numpy(), np.zeros((self.world_count, n), dtype=bool), []
        for world in range(self.world_count):
            base = world * particles.count
            for j in np.sort(bounded[base : base + counts[world]]):
                i = int(j) - base - first
                if not 0 <= i < n:
                    continue
                pressed[world, i] = True
                for c in range(MOST * j, MOST * (j + 1)):
                    if shape[c] >= 0 and push[c] > 0.0:
                        force = (push[c] * normal[c] + drag[c]).astype(float) * (self._rate / weight[j])
                        found.append((world, i, int(shape[c]), normal[c].astype(float), force))
        return pressed, found

    def impulses(self, rows: Sequence[int]) -> dict[int, dict[int, np.ndarray]]:
        """Return what contacts with each of the others gave some bodies in the last frame, (worlds, 3) [N s].

        By the body, and by the other: those between which there was any in some world.
        """
        given = self._impulses.numpy().reshape(self.world_count, self._bodies, self._bodies, 3)
        pairs = np.unique(np.flatnonzero(given) // 3 % self._bodies**2)
        pushing = np.zeros((self._bodies, self._bodies), dtype=bool)
        pushing.ravel()[pairs] = True
        pushing |= pushing.T
        unit = IMPULSE_UNIT * np.sqrt(self._rate)
        return {
            row: {other: given[:, row, other] * unit - given[:, other, row] * unit
                  for other in np.flatnonzero(pushing[row]).tolist()}
            for row in rows
        }  # fmt: skip

    def tie_forces(self) -> np.ndarray:
        """(worlds, ties, 3) [N], the mean force over the last frame on the points of the ties' own bodies."""
        return self._per_world(self._ties.total, self._ties.count)

    def unmet(self) -> list[np.ndarray]:
        """(worlds, ties), (worlds, holds) and (worlds, joints) int, substeps of the frame that each was not met in."""
        worlds = self.world_count
        return [
            part.unmet.numpy()[: worlds * part.count].reshape(worlds, part.count)
            if part.count
            else np.zeros((worlds, 0), dtype=int)
            for part in (self._ties, self.holds, self.joints)
        ]

    def joint_wrenches(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean force [N] and torque [N m] on the joined bodies at their joints, and what acts along them, over a frame.

        (worlds, joints, 3) twice, and (worlds, joints).
        """
        joints, worlds = self.joints, self.world_count
        if not joints.count:
            return np.zeros((worlds, 0, 3)), np.zeros((worlds, 0, 3)), np.zeros((worlds, 0))
        axial = joints.total_axial.numpy().reshape(worlds, joints.count).astype(float) * self._scale
        return self._per_world(joints.total, joints.count), self._per_world(joints.total_twist, joints.count), axial

    def hold_wrenches(self) -> tuple[np.ndarray, np.ndarray]:
        """(worlds, holds, 3) each, the mean force [N] and torque [N m] on the held bodies' centres of mass."""
        count = self.holds.count
        return self._per_world(self.holds.total, count), self._per_world(self.holds.total_twist, count)

    def _per_world(self, array: wp.array, count: int) -> np.ndarray:
        return array.numpy().reshape(self.world_count, -1, 3)[:, :count].astype(float) * self._scale

    def _of_island(self, function: Any, values: np.ndarray) -> np.ndarray:
        """Return (bodies, worlds), the largest or smallest value in each one's island."""
        column = np.arange(self.world_count)
        found = np.full(self._island.shape, np.inf if function is np.minimum else 0.0)
        function.at(found, (self._island, column), values)
        return found[self._island, column]

    def _speeds(self) -> np.ndarray:
        """The largest speed in each one's island, (bodies, worlds) [m/s]."""
        own = [np.sqrt(s.download(s.state.notes, NOTES)[:, SPEED].astype(float)) for s in self._solvers]
        if self._rigid is not None:

            def sizes(array: wp.array) -> np.ndarray:
                return np.linalg.norm(array.numpy().reshape(self.world_count, -1, 3)[:, self._slots], axis=-1)

            radius = self._rigid.rules.radius.numpy()[self._slots]
            own += list((sizes(self._state.velocity) + sizes(self._state.spin) * radius).T.astype(float))
        return self._of_island(np.maximum, np.array(own))
