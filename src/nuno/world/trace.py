"""Traces: where a body's vertices are at many instants of a run, kept on the device until they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import SOON, ParticleDynamics
from nuno.world.simulation import CHUNK

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.advancing import Advancing


class Trace:
    """A dynamic body's vertices at some instants.

    Cloth and soft bodies are copied from array to array on the device, so that nobody waits for it there.

    Args:
        body: The body.
        most: How many instants at most.
    """

    def __init__(self, body: Body, most: int) -> None:
        self._body = body
        self._fetched: list[np.ndarray] = []
        self._rows: Any = None
        self._count = 0
        if isinstance(body._dynamics, ParticleDynamics):
            import warp as wp

            solver = body._dynamics.solver
            shape = (most, solver.world_count, solver.particle_count)
            self._rows = wp.empty(shape, dtype=wp.vec3, device=solver.device)

    def look(self, _: float) -> None:
        """Take the vertices as they are now."""
        dynamics: Any = self._body._dynamics
        if self._rows is None:
            self._fetched.append(dynamics.vertices(self._body).astype(np.float32))
        else:
            dynamics.solver.positions_on_device(self._rows[self._count])
            self._count += 1

    def drop(self) -> None:
        """Forget what was taken since the last time `take` was asked."""
        self._fetched, self._count = [], 0

    def take(self) -> np.ndarray:
        """Return the vertices at the instants since the last time this was asked, (k, worlds, n, 3) float32 [m]."""
        if self._rows is None:
            taken, self._fetched = np.stack(self._fetched), []
            return taken
        taken, self._count = self._rows[: self._count].numpy().copy(), 0
        return np.asarray(taken)


def run_traced(world: Advancing, body: Body, instants: np.ndarray, run: Callable[[float], None]) -> np.ndarray:
    """Advance a world through instants (k,) [s]; returns the body's vertices there, (k, worlds, n, 3) float32 [m].

    ``run`` lets the world run for some seconds, as its program would.
    """
    trace, found, ahead = Trace(body, CHUNK), [], instants
    # drivers are asked and viewers told of each run, and paths of bodies are scheduled for it
    apart = bool(world.drivers or world._watchers or world._kinematic_bodies())
    while len(ahead):
        near = ahead[:CHUNK]
        near = near[near - world.time < CHUNK / world.frame_rate + SOON]
        if apart or not len(near) or near[0] - world.time < SOON:
            near = ahead[:1]
            run(max(0.0, float(near[0]) - world.time))
            trace.look(world.time)
        else:
            end = float(near[-1])
            world._advance(end - world.time, end, trace.look, near, trace.drop)
        found.append(trace.take())
        ahead = ahead[len(near) :]
    return np.concatenate(found)
