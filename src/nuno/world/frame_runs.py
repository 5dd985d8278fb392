"""A frame that some bodies go through more than once, with other substeps, of which each world keeps its own run.

Most frames are gone through once. So what comes of a run of particles is left where it is until there is another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation


class FrameRuns:
    """The runs of a frame.

    Args:
        world: Whose bodies.
        bodies: Those that may run more than once; of all others nothing is kept.
    """

    def __init__(self, world: Simulation, bodies: list[Body]) -> None:
        self._rigid: list[Body] = []
        self._start: dict[Any, Any] = {}
        self._kept: dict[Any, list[tuple[Any, np.ndarray]]] = {}
        self._latest: dict[Body, np.ndarray] = {}  # (worlds,) bool, in which the state as it is now is kept
        if not bodies:
            return
        from nuno.solvers.mixing import KeptParticles, copy_rigid

        self._scene = world._rigid
        for body in bodies:
            if body._dynamics.is_rigid:  # type: ignore[union-attr]
                self._rigid.append(body)
            else:
                self._start[body] = KeptParticles(body._dynamics.solver)  # type: ignore[union-attr]
        if self._rigid and self._scene is not None:
            self._start[None] = copy_rigid(self._scene.solver)

    def begin(self, kept: dict[Body, np.ndarray]) -> None:
        """Put bodies that ran before back to where the frame began; ``kept`` are the next run's, see `end`."""
        for body in kept:
            self._copy_latest(body)
            if body in self._kept:
                self._mix(body, [(self._start[body].values, np.ones_like(kept[body]))])
        again = [body for body in kept if body in self._rigid]
        if again and None in self._kept:
            self._mix(None, [(self._start[None], self._rows({body: np.ones_like(kept[body]) for body in again}))])

    def end(self, kept: dict[Body, np.ndarray]) -> None:
        """Keep what came of bodies in the worlds (worlds,) bool that are given for each."""
        if not self._start:
            return
        from nuno.solvers.mixing import copy_rigid

        self._latest |= {body: worlds for body, worlds in kept.items() if body in self._start}
        own = {body: kept[body] for body in self._rigid if body in kept}
        if own:
            assert self._scene is not None
            self._kept.setdefault(None, []).append((copy_rigid(self._scene.solver), self._rows(own)))

    def settle(self) -> None:
        """Give each world what it kept."""
        for body, worlds in list(self._latest.items()):
            if body in self._kept or not worlds.all():
                self._copy_latest(body)
        for key, made in self._kept.items():
            self._mix(key, made)

    def _copy_latest(self, body: Body) -> None:
        """Keep a copy of what came of the last run, in place of the state itself."""
        from nuno.solvers.mixing import KeptParticles

        if body in self._latest:
            made = KeptParticles(body._dynamics.solver).values  # type: ignore[union-attr]
            self._kept.setdefault(body, []).append((made, self._latest.pop(body)))

    def _mix(self, body: Body | None, made: list[tuple[Any, np.ndarray]]) -> None:
        from nuno.solvers.mixing import mix_particles, mix_rigid

        if body is not None:
            mix_particles(body._dynamics.solver, made)  # type: ignore[union-attr]
        elif self._scene is not None:
            mix_rigid(self._scene.solver, made)

    def _rows(self, worlds: dict[Body, np.ndarray]) -> np.ndarray:
        """(worlds, slots) bool, where the rigid solver's rows are those of some bodies in some worlds."""
        assert self._scene is not None
        rows = np.zeros((self._scene.solver.world_count, int(self._scene.solver.state.capacity)), dtype=bool)
        for body, own in worlds.items():
            rows[:, body._dynamics.slot] = own  # type: ignore[union-attr]
        return rows
