"""Frames on an engine other than Nuno's own: spans between frame ends, looks and the ends of pushes, one by one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from nuno.bodies.dynamics import SOON
from nuno.errors import SimulationDiverged
from nuno.tables.kinematic_motion import make_schedule

if TYPE_CHECKING:
    from nuno.world.advancing import Advancing


def step_frames(
    world: Advancing, finish: float, look: Callable[[float], None] | None, instants: np.ndarray | None
) -> None:
    """Advance a world's dynamic bodies to ``finish`` [s], and look as `nuno.world.advancing` says.

    Raises:
        SimulationDiverged: a state stopped being finite.
    """
    start = world._time
    frame = 1.0 / world.frame_rate
    ends = start + frame * np.arange(1, int((finish - start) / frame + 1e-6) + 1)
    pushes = [p.end for dynamics in world._attached() for p in dynamics.pushes if p.end is not None]
    asked = ends if instants is None else np.asarray(instants)
    stops = _apart([*ends.tolist(), *pushes, *(() if instants is None else asked.tolist()), finish], start, finish)
    now = start
    for stop in stops:
        kinematic, world._rests = world._kinematic_bodies(), False
        world._schedule = make_schedule(kinematic, now, stop - now, frame) if kinematic else None
        if world._attached():
            world._engine.step(now, stop)
            for body in world._bodies.values():
                if body._dynamics is not None and not (finite := body._dynamics.finite()).all():
                    raise SimulationDiverged(body.name, start, tuple(np.flatnonzero(~finite).tolist()))
        now = stop
        due = np.abs(asked - stop).min(initial=np.inf) < SOON or (instants is None and stop == stops[-1])
        if look is not None and due and stop > world._reported + SOON:
            world._telling = True
            try:
                look(stop)
            finally:
                world._telling = False
            world._reported = stop


def _apart(stops: list[float], start: float, finish: float) -> list[float]:
    """Return the instants after ``start`` up to ``finish`` [s], in order, of those that rounding alone parts one."""
    found: list[float] = []
    for stop in sorted(stops):
        if stop > (found[-1] if found else start) + SOON and stop < finish - SOON:
            found.append(stop)
    return [*found, finish]
