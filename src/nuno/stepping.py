"""How a span of time is gone through: bodies that may touch go together, substep by substep, others by themselves.

A body that is near no other is run as if it were alone, so that what happens elsewhere changes none of its bits.
Which bodies are near is asked anew every frame, from their boxes as they may grow within it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics import SOON, Dynamics, ParticleDynamics
from nuno.path import Path

if TYPE_CHECKING:
    from nuno.body import Body
    from nuno.grip import Grip
    from nuno.simulation import Simulation

GROWTH = 1.5
"""Times its present speed that a body may have within a frame, besides what gravity adds."""
SLACK = 0.02
"""[m] What constraints may throw a particle within a frame."""
KEPT = 16
"""Sets of bodies whose tables of contacts are kept."""


class Stepping:
    """The bodies of a world in time.

    Args:
        world: Whose bodies.
    """

    def __init__(self, world: Simulation) -> None:
        self._world = world
        self._couplings: dict[Any, Any] = {}
        self._version = -1
        self.last: list[Any] = []  # the couplings of the last frame, for the forces that they tell

    def run(self, time: float, stop: float) -> None:
        """Advance all dynamic bodies from ``time`` to ``stop`` [s]."""
        world = self._world
        frame = 1.0 / world.frame_rate
        moving = [body for body in world._bodies.values() if body._dynamics is not None]
        rigid = [body for body in moving if body._dynamics.is_rigid]  # type: ignore[union-attr]
        if rigid:
            world._bring_rigid()
        if self._version != world._collider_version:
            self._couplings.clear()
            self._version = world._collider_version
        self.last = []
        if not self._may_meet(moving, rigid) and not (rigid and world._led_bodies()):
            self._run_apart(moving, time, stop - time)
            return
        now = time
        while now < stop - SOON:
            # the same instants whether a span is gone through at once or in pieces
            duration = min(frame, stop - now)
            self.last = []
            self._run_frame(moving, now, duration)
            now = stop if stop - now - duration < SOON else now + duration

    def _run_apart(self, moving: list[Body], time: float, duration: float) -> None:
        frame = 1.0 / self._world.frame_rate
        slots = []
        for body in moving:
            dynamics: Any = body._dynamics
            if dynamics.is_rigid:
                dynamics.prepare(time)
                slots.append(dynamics.slot)
            else:
                dynamics.run(time, duration, frame)
        if slots:
            scene = self._world._rigid
            assert scene is not None
            scene.solver.run(time, duration, [*slots, *scene.lead(self._world, time, duration)])

    def _may_meet(self, moving: list[Body], rigid: list[Body]) -> bool:
        """Whether two bodies could touch that different solvers move, or any are tied."""
        if any(grip.is_tie for body in moving for grip in body._dynamics.grips):  # type: ignore[union-attr]
            return True
        particles = [body for body in moving if body not in rigid]
        rules = self._world._rules
        return any(rules.touch(a, b) for k, a in enumerate(particles) for b in (*particles[k + 1 :], *rigid))

    def _run_frame(self, moving: list[Body], time: float, duration: float) -> None:
        alone: list[Body] = []
        for group in self._groups(moving, duration):
            held = any(grip.is_tie for body in group for grip in body._dynamics.grips)  # type: ignore[union-attr]
            kinds = {body._dynamics.is_rigid for body in group}  # type: ignore[union-attr]
            if not held and (len(group) == 1 or kinds == {True}):
                alone += group
            else:
                self._run_together(group, time, duration)
        self._run_apart(alone, time, duration)

    def _groups(self, moving: list[Body], duration: float) -> list[list[Body]]:
        """The bodies that may meet within ``duration`` [s], directly or by others between them, and those tied."""
        low, high = zip(*(self._box(body, duration) for body in moving), strict=True)
        lows, highs = np.stack(low), np.stack(high)  # (bodies, worlds, 3)
        near = (lows[:, None] <= highs[None]).all(axis=-1) & (lows[None] <= highs[:, None]).all(axis=-1)
        meet = near.any(axis=-1)
        rules = self._world._rules
        place = {body: k for k, body in enumerate(moving)}
        root = list(range(len(moving)))

        def find(k: int) -> int:
            while root[k] != k:
                root[k] = root[root[k]]
                k = root[k]
            return k

        for a, b in zip(*np.nonzero(np.triu(meet, 1)), strict=True):
            if find(a) != find(b) and rules.touch(moving[a], moving[b]):
                root[max(find(a), find(b))] = min(find(a), find(b))
        for body in moving:
            for grip in body._dynamics.grips:  # type: ignore[union-attr]
                if grip.is_tie and grip.target in place:
                    a, b = find(place[body]), find(place[grip.target])
                    root[max(a, b)] = min(a, b)
        groups: dict[int, list[Body]] = {}
        for k, body in enumerate(moving):
            groups.setdefault(find(k), []).append(body)
        return list(groups.values())

    def _box(self, body: Body, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """The box (worlds, 3) that a body may reach within ``duration`` [s]: lower and upper corner."""
        dynamics: Any = body._dynamics
        fall = 0.5 * float(np.linalg.norm(self._world.gravity)) * duration**2
        if dynamics.is_rigid:
            middle, _ = dynamics.solver.pose(dynamics.slot)
            velocity, spin = dynamics.solver.velocity(dynamics.slot)
            radius = dynamics.radius
            speed = np.linalg.norm(velocity, axis=-1) + np.linalg.norm(spin, axis=-1) * radius
            grow = (radius + GROWTH * speed * duration + fall + SLACK)[:, None]
            return middle - grow, middle + grow
        positions = dynamics.solver.positions()
        speed = np.linalg.norm(dynamics.solver.velocities(), axis=-1).max(axis=-1)
        grow = (GROWTH * speed * duration + fall + SLACK + body.thickness)[:, None]
        return positions.min(axis=1) - grow, positions.max(axis=1) + grow

    def _run_together(self, group: list[Body], time: float, duration: float) -> None:
        from nuno.solver.particle_solver import substeps_of

        world = self._world
        frame = 1.0 / world.frame_rate
        dynamics: list[Dynamics] = [body._dynamics for body in group]  # type: ignore[misc]
        substeps = max(each.substeps for each in dynamics)
        if duration < frame - SOON:
            substeps = substeps_of(duration, frame, substeps)
        for each in dynamics:
            if isinstance(each, ParticleDynamics):
                each.prepare(time, frame)
            else:
                each.prepare(time)  # type: ignore[attr-defined]
        key = tuple(body.key for body in group)
        ties = tuple(grip for body in group for grip in body._dynamics.grips if grip.is_tie)  # type: ignore[union-attr]
        found = self._couplings.pop((key, ties), None)
        if found is None or not found.is_current():
            from nuno.coupled_bodies import CoupledBodies

            found = CoupledBodies(world, group, ties)
        while len(self._couplings) >= KEPT:
            self._couplings.pop(next(iter(self._couplings)))
        self._couplings[key, ties] = found
        found.run_frame(time, duration, substeps)
        self.last.append(found)

    # -- what grips bear

    def wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and torque [N m], (worlds, 3) each, that a grip bore in the last frame; see ``Grip.wrench``."""
        worlds = self._world.world_count
        nothing = np.zeros((worlds, 3)), np.zeros((worlds, 3))
        if grip.is_tie:
            told = (coupled.wrench(grip) for coupled in self.last)
            return next((found for found in told if found is not None), nothing)
        dynamics: Any = grip.body._dynamics
        known = [other for other in dynamics.grips if not other.is_tie]
        if dynamics.grips_changed:
            return nothing
        forces, mass = dynamics.solver.grip_forces()[known.index(grip)]
        now, acceleration = _led(grip._spec, self._world.time, 1.0 / self._world.frame_rate)
        forces = forces + mass[..., None] * (np.asarray(self._world.gravity) - acceleration)
        corners = grip._spec.vertices if grip._spec.vertices is not None else grip._spec.corners[..., 0]
        held = (corners >= 0)[..., None]
        count = np.maximum(held.sum(axis=1, keepdims=True), 1)
        arms = np.where(held, now - np.where(held, now, 0.0).sum(axis=1, keepdims=True) / count, 0.0)
        return forces.sum(axis=1), np.cross(arms, forces).sum(axis=1)


def _led(spec: Any, time: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a path leads its points at a time [s], and how they accelerated before it: (worlds, k, 3) [m], [m/s2]."""
    worlds, k, m = spec.positions.shape[:3]
    path = object.__new__(Path)  # its numbers were checked when the grip was made: this runs every tick
    keys = spec.positions.reshape(worlds * k, m, 3)
    path.__dict__.update(times=spec.times, positions=keys, quaternions=None, interpolation=spec.interpolation)
    places = path.at(time - step * np.arange(3.0)).reshape(worlds, k, 3, 3)
    now, before, earlier = (places[:, :, n] for n in range(3))
    return now, (now - 2.0 * before + earlier) / step**2
