"""The passing of time: a world's bodies advanced, looked at, and put back where a run failed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import SOON, Dynamics, ParticleDynamics, dynamics_of
from nuno.errors import SimulationDiverged
from nuno.solvers.runaways import warn_of_runaways
from nuno.tables.kinematic_motion import arrive, make_schedule
from nuno.world.impacts import are_fast
from nuno.world.run_start import RunStart
from nuno.world.simulation import Simulation
from nuno.world.stepping import Stepping


class Advancing(Simulation):
    """A simulation that advances: it goes through a run once more where a list was too short."""

    @cached_property
    def _stepping(self) -> Stepping:
        """The bodies in time, with what the last frame told."""
        return Stepping(self)

    def _advance(
        self, duration: float, end: float | None = None, look: Callable[[float], None] | None = None,
        instants: np.ndarray | None = None, again: Callable[[], None] | None = None,
    ) -> None:  # fmt: skip
        """Advance everything, or leave the world as it was and raise.

        ``look`` is called with the time [s] at each of ``instants`` (k,), or else at the end of each frame. Where the
        run is gone through once more, as a list of contacts was too short, ``again`` is called first and ``look``
        anew for every instant; without ``again`` lists are looked at before each call, which is for good.
        """
        start = self._time
        finish = start + duration if end is None else end
        self._engine.allow_contacts()
        for driver in self.drivers:
            driver.begin_frame(start, finish)
        moving = {body: own for body in self._bodies.values() if (own := dynamics_of(body)) is not None}
        self._rests = False
        self._engine.prepare_run()
        before = RunStart(self, moving)
        self._bring_colliders()
        try:
            self._reported = start
            go = self._go_through if self._engine.is_builtin else self._step_frames
            while not go(moving, finish, look, instants, again is None):
                before.go_back()
                if again is not None:
                    self._reported = start
                    again()
        except BaseException:
            before.go_back()
            for driver in self.drivers:
                driver.cancel_frame()
            raise
        for body, dynamics in moving.items():
            dynamics.pushes = [p for p in dynamics.pushes if p.end is None or p.end > finish + SOON]
            if body._children:
                self._colliders_changed()  # what follows the body has moved along
        if not self._rests:
            arrive(self._kinematic_bodies(), finish)
        self._time = finish
        for driver in self.drivers:
            driver.end_frame()
        for watcher in tuple(self._watchers):
            watcher.seen()

    def _go_through(
        self, moving: dict[Body, Dynamics], finish: float, look: Callable[[float], None] | None,
        instants: np.ndarray | None, careful: bool,
    ) -> bool:  # fmt: skip
        """Advance all bodies to ``finish`` [s]; return whether no list was too short: else all are longer now."""
        start = now = self._time
        frame = 1.0 / self.frame_rate
        ends = [p.end for d in moving.values() for p in d.pushes if p.end is not None and start < p.end < finish]
        # frames after a push go on as if there had been none, as they do where the span is gone through in pieces
        whole = [start + frame * math.ceil((end - start - SOON) / frame) for end in ends]
        stops = _apart([*ends, *whole], start, finish)
        if look is not None and instants is None:
            instants = np.asarray(_frame_ends(start, finish, frame))
        for body, dynamics in moving.items():
            if isinstance(dynamics, ParticleDynamics):
                dynamics.set_self_contact(self._rules.touches_itself(body))
        for stop in stops:
            if moving:
                self._schedule_kinematic(now, stop - now)
            if look is None or instants is None:
                self._stepping.run(now, stop)
            elif not self._run_looking(now, stop, look, instants, moving if careful else None):
                return False
            now = stop
        rigid: dict[Body, Any] = {body: dynamics for body, dynamics in moving.items() if dynamics.is_rigid}
        sound = False
        if rigid:  # all of them at once
            motions = next(iter(rigid.values())).solver.motions([own.slot for own in rigid.values()])
            sound = all(np.isfinite(part).all() for part in motions)
            if sound and not self._quiet:
                warn_of_runaways(list(rigid), motions[2], finish)
        broken = [
            (body, np.atleast_1d(dynamics.finite()))
            for body, dynamics in moving.items()
            if not (sound and dynamics.is_rigid)
        ]
        if self._must_repeat(moving):
            return False
        self._stepping.careful = not self._quiet and are_fast(moving)
        for body, finite in broken:
            if not finite.all():
                raise SimulationDiverged(body.name, start, tuple(np.flatnonzero(~finite).tolist()))
        return True

    def _step_frames(
        self, moving: dict[Body, Dynamics], finish: float, look: Callable[[float], None] | None,
        instants: np.ndarray | None, careful: bool,
    ) -> bool:  # fmt: skip
        """Advance by another engine than Nuno's own, in spans between frame ends, looks and the ends of pushes.

        Returns:
            True: nothing must be repeated, as there are no lists.
        """
        start, frame = self._time, 1.0 / self.frame_rate
        ends = _frame_ends(start, finish, frame)
        asked = np.asarray(ends if instants is None else instants)
        pushes = [p.end for dynamics in self._attached() for p in dynamics.pushes if p.end is not None]
        now = start
        for stop in _apart([*ends, *pushes, *asked.tolist()], start, finish):
            kinematic, self._rests = self._kinematic_bodies(), False
            self._schedule = make_schedule(kinematic, now, stop - now, frame) if kinematic else None
            self._engine.schedule = self._schedule
            self._engine.step(now, stop)
            broken = [body for body in self._bodies.values() if body.is_dynamic and not self._engine.finite(body).all()]
            if broken:
                worlds = tuple(np.flatnonzero(~self._engine.finite(broken[0])).tolist())
                raise SimulationDiverged(broken[0].name, start, worlds)
            now = stop
            due = np.abs(asked - stop).min(initial=np.inf) < SOON
            if look is not None and due and stop > self._reported + SOON:
                self._telling = True
                try:
                    look(stop)
                finally:
                    self._telling = False
                self._reported = stop
        return True

    def _must_repeat(self, moving: dict[Body, Dynamics]) -> bool:
        """Return True if the run is to be gone through again: a list was too short, or a cloth fast unexpectedly."""
        longer = self._make_room(moving)
        if not self._quiet and not self._stepping.careful and are_fast(moving):
            self._stepping.careful = True
            return True
        return longer

    def _make_room(self, moving: dict[Body, Dynamics]) -> bool:
        """Make lists longer that were too short since this was asked last; return whether any is."""
        return any([own.make_room(body) for body, own in moving.items() if isinstance(own, ParticleDynamics)])

    def _run_looking(
        self, time: float, stop: float, look: Callable[[float], None], instants: np.ndarray,
        careful: dict[Body, Dynamics] | None,
    ) -> bool:  # fmt: skip
        """Advance from ``time`` to ``stop`` [s] from one of ``instants`` to the next, telling the time at each.

        Returns:
            Whether nothing must be repeated, as far as this was looked at: of ``careful``, all that moves, before each
            instant.
        """
        ends = instants[(instants > time + SOON) & (instants < stop + SOON)]
        now = time
        for end in ends.tolist():
            self._stepping.run(now, end)
            if end > self._reported + SOON:
                if careful is not None and self._must_repeat(careful):
                    return False
                self._telling = True
                try:
                    look(end)
                finally:
                    self._telling = False
                self._reported = end
            now = end
        if stop - now > SOON:
            self._stepping.run(now, stop)
        return True


def _frame_ends(start: float, finish: float, frame: float) -> list[float]:
    """Return the instants after ``start`` [s] at which frames end, ``finish`` the last of them."""
    return _apart([start + frame * k for k in range(1, int((finish - start) / frame) + 2)], start, finish)


def _apart(stops: list[float], start: float, finish: float) -> list[float]:
    """Return the instants after ``start`` up to ``finish`` [s], in order, of those that rounding alone parts one."""
    found: list[float] = []
    for stop in sorted(stops):
        if stop > (found[-1] if found else start) + SOON and stop < finish - SOON:
            found.append(stop)
    return [*found, finish]
