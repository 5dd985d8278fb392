"""Frames in which a cloth might pass through itself: more substeps, all edges, an exact look, and taking apart.

A cloth's contacts with itself are found from where a substep begins. What moves by more than about its thickness within
one, or is pressed deeper than others can push it back, may be on the other side of itself as it ends, and stays
there. A run keeps its largest speed and its deepest contact. Where one of them was too large, it is gone through
again frame by frame. A frame then has as many substeps as the cloth's speeds ask for as it begins. One that turns out
to be fast or deep is gone through with more passes over the contacts and all edges, a sheet's diagonals included, and
with twice as many substeps for as long as faces pass through each other that did not before.

Slow cloth can pass through itself along diagonals alone, for these do not touch in ordinary frames, and some is given
crossed. So all cloth is looked at every few frames of the world's clock. What passes through itself is taken apart
(`nuno.mesh.untangling`), and guarded for some time: each of its frames is then gone through as a fast one is. For how
long is part of its state.

Each world has its own numbers, for it must go as it would alone. Where nothing is fast, deep or crossed, every bit is
as it was.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import SOON, Dynamics
from nuno.materials import Cloth
from nuno.mesh.crossings import crossing_faces
from nuno.mesh.untangling import untangle
from nuno.world.islands import Islands

logger = logging.getLogger(__name__)

WAY = 0.75
"""Thicknesses that a cloth may move within a substep: 1.8 m/s at 10 substeps a frame and 4 mm. Of 60 sheets thrown
or dropped at up to 10 m/s none passed through itself at that; half as far did no better."""
DEEP = 0.7
"""Share of its thickness by which a cloth may be pressed into itself while contacts are solved. A corner that is lifted
comes to 0.1 to 0.6, what falls on itself at 4 m/s to 0.9."""
PASSES, MORE_PASSES = 2, 8  # the first is that of `nuno.solvers.cloth_solver`, which is loaded on first use only
"""Passes over a cloth's contacts with itself in a substep, and in a frame that is gone through again."""
LOOK = 10
"""Frames between two looks at whether slow cloth passes through itself, which costs a hundredth of them."""
GUARDED = 120
"""Frames in which a cloth that was taken apart is looked at each time, with all edges: what pressed it through itself
is there still."""
WAIT, TRIES = 5, 6
"""Frames until a cloth that could not be taken apart is tried again, and how often that is before it is told."""
STEP = 0.1
"""Of a cell, how far vertices move at once where a cloth is taken apart."""
MOST = 480
"""Substeps of a frame at most: twice `nuno.solvers.cloth_substeps.MAX_SUBSTEPS`."""


def are_fast(moving: dict[Body, Dynamics]) -> bool:
    """Return True if a cloth may have passed through itself for its speed since that was last forgotten, or did."""
    cloths = _touching_themselves(moving)
    return any((_fast_worlds(cloth) | (cloth.solver.guarded > 0)).any() for _, cloth in cloths)


def forget_fast(bodies: Iterable[Body]) -> None:
    """Let `fast_cloths` tell of what comes next."""
    from nuno.solvers.extremes import forget_extremes

    for _, dynamics in _touching_themselves(bodies):
        forget_extremes(dynamics.solver)


def fast_cloths(bodies: Iterable[Body]) -> dict[str, np.ndarray]:
    """Return by name in which worlds (worlds,) bool a cloth had frames for which it was too fast, or pressed too deep.

    Of worlds that go through each frame once: others forget it as they go through those frames again.
    """
    return {body.name: _fast_worlds(dynamics) for body, dynamics in _touching_themselves(bodies)}


def _touching_themselves(bodies: Iterable[Body]) -> list[tuple[Body, Any]]:
    pairs = [(body, body._dynamics) for body in bodies]
    return [(body, dynamics) for body, dynamics in pairs if dynamics is not None and collides_with_itself(dynamics)]


class Impacts:
    """A frame that cloths may be too fast for, which begins now.

    Args:
        moving: The dynamic bodies.
        worlds: Worlds in the batch.
        frame: Length of a whole frame [s].
    """

    def __init__(self, moving: list[Body], worlds: int, frame: float) -> None:
        import warp as wp

        from nuno.solvers.extremes import forget_extremes

        self._moving = moving
        own = np.array([body._dynamics.substeps for body in moving])  # type: ignore[union-attr]
        self.substeps = np.repeat(own[:, None], worlds, axis=1)
        """(bodies, worlds) int, of a whole frame, at which each body is to begin."""
        self._thorough = np.zeros_like(self.substeps, dtype=bool)  # where it has gone with more passes
        self._guarded: dict[int, np.ndarray] = {}  # (worlds,) bool, where a cloth was taken apart not long ago
        self._crossed: dict[Body, list[int]] = {}  # worlds in which a cloth passes through itself in the end
        self._start: dict[int, list[Any]] = {}  # of each cloth that touches itself, where it begins
        for k, body in enumerate(moving):
            if collides_with_itself(body._dynamics):
                solver: Any = body._dynamics.solver  # type: ignore[union-attr]
                forget_extremes(solver)
                self._guarded[k] = solver.guarded > 0
                self._start[k] = [wp.clone(array) for array in solver.doubles.arrays]
                fastest, differing = solver.speeds()
                # of two points that meet each does half of what they differ by at most, nor more than the fastest goes:
                # what is not fast alone is not here, beside a world that is
                apart = np.minimum(0.5 * np.linalg.norm(differing, axis=-1), fastest)
                asked = np.nan_to_num(apart * frame / (WAY * _thickness(solver)), posinf=0.0)
                self.substeps[k] = [_doubled(int(own[k]), float(least)) for least in asked]
        if self._guarded and all(own.all() for own in self._guarded.values()):
            # all would go again: they begin with what they would come to
            self._thorough[:] = True
            self.guard(True)

    def again(self, islands: Islands) -> tuple[Islands, np.ndarray]:
        """Look at what came of the frame.

        Args:
            islands: Those that went through it.

        Returns:
            The islands for another go, with more substeps where a cloth passed through itself, and (bodies, worlds)
            bool, which of them go again.
        """
        from nuno.contact.self.crossed_faces import crossed_worlds

        substeps, due = islands.substeps.copy(), np.zeros_like(islands.substeps, dtype=bool)
        self._crossed.clear()
        for k, start in self._start.items():
            body = self._moving[k]
            solver: Any = body._dynamics.solver  # type: ignore[union-attr]
            # what once was fast is looked at to the end
            for world in np.flatnonzero((_fast_worlds(body._dynamics) | self._guarded[k]) & ~self._thorough[k]):
                joined = islands.first[:, world] == islands.first[k, world]
                self._thorough[joined, world] = True
                due[joined, world] = True
            looked = self._thorough[k] & ~due[k]
            if not looked.any():
                continue
            now, faces = solver.positions(), np.asarray(body.faces)
            for world in np.flatnonzero(looked & crossed_worlds(solver)):
                if not np.isfinite(now[world]).all() or not len(crossing_faces(now[world], faces)):
                    continue
                joined = islands.first[:, world] == islands.first[k, world]
                was = np.stack([solver.download(array, solver.particle_count)[world] for array in start], axis=-1)
                before = len(crossing_faces(was.astype(float), faces)) > 0
                if before or islands.substeps[k, world] >= MOST:
                    self._crossed.setdefault(body, []).append(int(world))
                    continue
                substeps[joined, world] = min(2 * int(islands.substeps[k, world]), MOST)
                due[joined, world] = True
        if due.any():
            self.guard(True)
        return Islands(islands.first, substeps), due

    def settle(self) -> None:
        """End the frame: take apart what passes through itself all the same."""
        for k in self._start:
            solver: Any = self._moving[k]._dynamics.solver  # type: ignore[union-attr]
            solver.guarded = np.maximum(solver.guarded - 1, 0)
        for body, worlds in self._crossed.items():
            take_apart(body, np.array(worlds))

    def guard(self, thorough: bool) -> None:
        """Let the cloths' contacts with themselves be found and solved more thoroughly, or as ever."""
        for k in self._start:
            solver: Any = self._moving[k]._dynamics.solver  # type: ignore[union-attr]
            solver.guard(MORE_PASSES if thorough else PASSES, thorough)


def collides_with_itself(dynamics: Any) -> bool:
    """Return True if dynamics are of a cloth that collides with itself."""
    return isinstance(dynamics.material, Cloth) and bool(dynamics.solver.self_contact)


def _thickness(solver: Any) -> np.ndarray:
    from nuno.state.cloth_state import THICKNESS

    return np.maximum(solver.scalars[:, THICKNESS], 1e-6)


def _fast_worlds(dynamics: Any) -> np.ndarray:
    """Return (worlds,) bool, where a cloth went farther in a substep than it should, or was pressed deeper."""
    from nuno.solvers.extremes import deepest, fastest

    solver = dynamics.solver
    fast = fastest(solver) > WAY * _thickness(solver) * solver.substeps * solver.frame_rate
    return np.asarray(fast | (deepest(solver) > DEEP * _thickness(solver)))


def _doubled(own: int, asked: float) -> int:
    """Return the body's own substeps, doubled as often as it takes, so that few different numbers come up."""
    count = own
    while count < min(asked, MOST):
        count *= 2
    return max(own, min(count, MOST))


def look_due(start: float, end: float, frame_rate: float) -> bool:
    """Return True if slow cloth is to be looked at at ``end`` [s] of a span: about every `LOOK` frames of the clock."""
    at = [math.floor(time * frame_rate / LOOK + 1e-6) for time in (start, end)]
    return at[1] > at[0]


def next_look(start: float, stop: float, frame_rate: float) -> float:
    """Return the end [s] of the first whole frame from ``start`` on after which a look is due, or ``stop``."""
    for frames in range(1, LOOK + 1):
        end = start + frames / frame_rate
        if end > stop - SOON:
            break
        if look_due(start, end, frame_rate):
            return end
    return stop


def look_at(moving: list[Body]) -> None:
    """Take apart the cloths that pass through themselves, slow as they are."""
    from nuno.contact.self.crossed_faces import crossed_worlds

    for body in moving:
        if collides_with_itself(body._dynamics):
            take_apart(body, np.flatnonzero(crossed_worlds(body._dynamics.solver)))  # type: ignore[union-attr]


def take_apart(body: Body, worlds: np.ndarray) -> None:
    """Move the vertices of a cloth that passes through itself in some worlds; tell where that is not enough.

    Where it failed, it is tried again some frames later.
    """
    from nuno.solvers.mixing import move_particles

    solver: Any = body._dynamics.solver  # type: ignore[union-attr]
    worlds = worlds[solver.guarded[worlds] <= GUARDED]
    if not len(worlds):
        return
    positions, faces, moved = solver.positions(), np.asarray(body.faces), {}
    free = solver.inverse_mass_now(solver.state.w) > 0.0
    for world in worlds.tolist():
        if np.isfinite(positions[world]).all():
            moved[world], left = untangle(positions[world], faces, free[world], STEP * solver.cell_size)
            solver.guarded[world] = GUARDED + (WAIT if left else 0)
            solver.tangled[world] = solver.tangled[world] + 1 if left else 0
            if solver.tangled[world] >= TRIES:
                _tell(body, solver, world)
    move_particles(solver, moved)


def _tell(body: Body, solver: Any, world: int) -> None:
    """Note that a world's cloth passes through itself, which could not be cured, and tell of the first."""
    if not solver.missed.any():
        logger.warning(
            "%r passes through itself, in up to %d substeps a frame too, and was not taken apart: %r.missed_contacts "
            "says in which worlds; grips that are slower or leave it more room, and thicker cloth, help",
            body.name, MOST, body.name,
        )  # fmt: skip
    solver.missed[world] = True
