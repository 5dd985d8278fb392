"""Stepping through a span of time: bodies that may touch go together, substep by substep, others by themselves.

A body that is near no other is run as if it were alone, so that what happens elsewhere changes none of its bits.
Which bodies are near is asked anew every frame, and in every world of a batch by itself (`nuno.world.islands`). Where a
body takes another number of substeps in some worlds than in others, it goes through the frame with each number, and
each world keeps what comes of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import SOON, touches_itself
from nuno.solvers.resolution_warnings import warn_of_overloads
from nuno.world.frame_runs import FrameRuns
from nuno.world.impacts import Impacts, collides_with_itself, look_at, look_due, next_look
from nuno.world.islands import Islands, find_islands

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.joints.joint import Joint
    from nuno.world.simulation import Simulation

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
        self._touch: dict[tuple[str, str], bool] = {}  # of pairs that came near each other since bodies last changed
        self.last: list[Any] = []  # the couplings of the last frame, for the forces that they tell
        self.careful = False  # whether a cloth may be so fast that it passes through itself: see `nuno.world.impacts`

    def run(self, time: float, stop: float) -> None:
        """Advance all dynamic bodies from ``time`` to ``stop`` [s]."""
        world = self._world
        frame = 1.0 / world.frame_rate
        moving = [body for body in world._bodies.values() if body.is_dynamic]
        if not moving:
            self.careful, self.last = False, []
            return
        rigid = [body for body in moving if body._dynamics.is_rigid]  # type: ignore[union-attr]
        if rigid:
            world._bring_rigid()
        if self._version != world._collider_version:
            self._couplings.clear()
            self._touch.clear()
            self._version = world._collider_version
        self.last = []
        apart = not self._may_touch(moving, rigid) and not (rigid and world._kinematic_bodies())
        if apart:
            self._prepare(moving, time)
        looking = not world._quiet and any(collides_with_itself(body._dynamics) for body in moving)
        now = time
        while now < stop - SOON:
            before = now
            if apart and not self.careful:
                now = next_look(now, stop, world.frame_rate) if looking else stop
                self._run_apart(moving, before, now - before)
                self._look(moving, before, now, looking)
                continue
            # the same instants whether a span is gone through at once or in pieces, and the same steps by itself or not
            duration = frame if stop - now > frame - SOON else stop - now
            self.last = []
            if not apart:
                self._prepare(moving, now)
            self._run_frame(moving, now, duration)
            now = stop if stop - now - duration < SOON else now + duration
            self._look(moving, before, now, looking)

    def _look(self, moving: list[Body], before: float, now: float, crossings: bool) -> None:
        """Look at cloths every few frames: whether some pass through themselves, or bear more than they can."""
        if self._world._quiet or not look_due(before, now, self._world.frame_rate):
            return
        if crossings:
            look_at(moving)
        warn_of_overloads(moving, now)

    def _run_apart(self, moving: list[Body], time: float, duration: float, substeps: int | None = None) -> None:
        slots = []
        for body in moving:
            dynamics: Any = body._dynamics
            if dynamics.is_rigid:
                slots.append(dynamics.slot)
            else:
                dynamics.solver.run(time, duration, substeps)
        if slots:
            scene = self._world._rigid
            assert scene is not None
            scene.solver.run(time, duration, [*slots, *scene.lead(self._world, time, duration)])

    def _prepare(self, moving: list[Body], time: float) -> None:
        """Bring what acts on each body; once, for that forgets where a leading body was before."""
        for body in moving:
            body._dynamics.prepare(time, 1.0 / self._world.frame_rate)  # type: ignore[union-attr]

    def _may_touch(self, moving: list[Body], rigid: list[Body]) -> bool:
        """Return True if two bodies of different solvers could touch, a soft one itself, or any are tied."""
        if any(grip.is_tie for body in moving for grip in body._dynamics.grips):  # type: ignore[union-attr]
            return True
        if any(touches_itself(self._world._rules, body) for body in moving):
            return True
        particles = [body for body in moving if body not in rigid]
        rules = self._world._rules
        return any(rules.touch(a, b) for k, a in enumerate(particles) for b in (*particles[k + 1 :], *rigid))

    def _run_frame(self, moving: list[Body], time: float, duration: float) -> None:
        world = self._world
        impacts = Impacts(moving, world.world_count, 1.0 / world.frame_rate) if self.careful else None
        islands = find_islands(world, moving, duration, None if impacts is None else impacts.substeps, self._touch)
        several = [self.careful or bool(np.ptp(own)) for own in islands.substeps]
        runs = FrameRuns(world, [body for body, more in zip(moving, several, strict=True) if more])
        due = np.ones_like(islands.substeps, dtype=bool)
        try:
            while due.any():
                for count in np.unique(islands.substeps[due]):
                    its = due & (islands.substeps == count)
                    kept = {body: own for body, own in zip(moving, its, strict=True) if own.any()}
                    runs.begin(kept)
                    self._run_with(moving, islands, int(count), kept, time, duration)
                    runs.end(kept)
                runs.settle()
                due[:] = False
                if impacts is not None:
                    islands, due = impacts.again(islands)
            if impacts is not None:
                impacts.settle()
        finally:
            if impacts is not None:
                impacts.guard(False)

    def _run_with(
        self, moving: list[Body], islands: Islands, count: int, kept: dict[Body, np.ndarray], time: float,
        duration: float,
    ) -> None:  # fmt: skip
        """Advance the bodies that take so many substeps in some world, which are kept in the worlds where they do."""
        first, alone = islands.at(count), []
        for k, body in enumerate(moving):
            # in worlds that have gone through the frame already the body may have been with others
            first[k] = np.where(kept.get(body, np.False_), first[k], k)
        for group in _joined(first, [k for k, body in enumerate(moving) if body in kept]):
            bodies = [moving[k] for k in group]
            grips = [grip for body in bodies for grip in body._dynamics.grips]  # type: ignore[union-attr]
            kinds = {body._dynamics.is_rigid for body in bodies}  # type: ignore[union-attr]
            by_itself = len(bodies) == 1 and not touches_itself(self._world._rules, bodies[0])
            if not any(grip.is_tie for grip in grips) and (by_itself or kinds == {True}):
                alone += bodies
            else:
                island = np.searchsorted(group, first[group])
                self._run_together(bodies, island, count, {body: kept[body] for body in bodies}, time, duration)
        self._run_apart(alone, time, duration, count)

    def _run_together(
        self, group: list[Body], island: np.ndarray, substeps: int, kept: dict[Body, np.ndarray], time: float,
        duration: float,
    ) -> None:  # fmt: skip
        from nuno.solvers.particle_solver import substeps_of

        world = self._world
        frame = 1.0 / world.frame_rate
        count = substeps_of(duration, frame, substeps) if duration < frame - SOON else substeps
        key = tuple(body.key for body in group)
        ties = tuple(grip for body in group for grip in body._dynamics.grips if grip.is_tie)  # type: ignore[union-attr]
        found = self._couplings.pop((key, ties), None)
        # worlds that go through the frame once more are told of by what comes now, the others by what was before
        for earlier in self.last:
            earlier.kept = {body: own & ~kept.get(body, np.False_) for body, own in earlier.kept.items()}
        self.last = [earlier for earlier in self.last if any(own.any() for own in earlier.kept.values())]
        if found is None or found in self.last or not found.is_current():
            from nuno.world.coupled_bodies import CoupledBodies

            found = CoupledBodies(world, group, ties)
        while len(self._couplings) >= KEPT:
            self._couplings.pop(next(iter(self._couplings)))
        self._couplings[key, ties] = found
        found.run_frame(time, duration, (count, substeps), dict(zip(group, island, strict=True)), kept)
        self.last.append(found)

    # -- what grips bear

    def wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and torque [N m], (worlds, 3) each, that a grip bore in the last frame; see ``Grip.wrench``."""
        worlds = self._world.world_count
        nothing = np.zeros((worlds, 3)), np.zeros((worlds, 3))
        if grip.is_tie:
            for coupled in self.last:
                borne = coupled.wrench(grip)
                for sums, own in zip(nothing, borne or (), strict=False):
                    sums[coupled.kept[grip.body]] = own[coupled.kept[grip.body]]
            return nothing
        dynamics: Any = grip.body._dynamics
        known, changed = dynamics.point_grips(), np.zeros(worlds, dtype=bool)
        if dynamics.grips_changed:
            if dynamics.grips_before is None:
                return nothing
            known, changed = dynamics.grips_before
        if grip not in known:
            return nothing
        forces, mass = dynamics.solver.grip_forces()[known.index(grip)]
        forces[changed], mass[changed] = 0.0, 0.0
        now, acceleration = _path_state(grip.spec, self._world.time, 1.0 / self._world.frame_rate)
        forces = forces + mass[..., None] * (np.asarray(self._world.gravity) - acceleration)
        corners = grip.spec.vertices if grip.spec.vertices is not None else grip.spec.corners[..., 0]
        held = (corners >= 0)[..., None]
        count = np.maximum(held.sum(axis=1, keepdims=True), 1)
        arms = np.where(held, now - np.where(held, now, 0.0).sum(axis=1, keepdims=True) / count, 0.0)
        return forces.sum(axis=1), np.cross(arms, forces).sum(axis=1)

    def effort(self, joint: Joint) -> np.ndarray:
        """(worlds,), what acted along a joint's free direction in the last frame; see ``Joint.effort``."""
        total = np.zeros(self._world.world_count)
        for coupled in self.last:
            own = coupled.effort(joint)
            if own is not None:
                total[coupled.kept[joint.body]] = own[coupled.kept[joint.body]]
        return total


def _joined(first: np.ndarray, members: list[int]) -> list[list[int]]:
    """Return the members that belong together in any world; first (bodies, worlds) is the first of each's island."""
    root = {k: k for k in members}

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    for k in members:
        for other in np.unique(first[k]):
            a, b = find(k), find(int(other))
            root[max(a, b)] = min(a, b)
    groups: dict[int, list[int]] = {}
    for k in members:
        groups.setdefault(find(k), []).append(k)
    return list(groups.values())


def _path_state(spec: Any, time: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a path's points at a time [s], and their acceleration before it: (worlds, k, 3) [m], [m/s2]."""
    places = spec.at(time - step * np.arange(3.0))
    now, before, earlier = (places[:, :, n] for n in range(3))
    return now, (now - 2.0 * before + earlier) / step**2
