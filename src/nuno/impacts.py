"""Frames in which a cloth might pass through itself: more substeps, and an exact look at the result.

A cloth's contacts with itself are found from where a substep begins. What moves by more than about its thickness within
one, or is pressed deeper than others can push it back, may be on the other side of itself as it ends, and stays
there. A run keeps its largest speed and its deepest contact. Where one of them was too large, it is gone through
again frame by frame. A frame then has as many substeps as the cloth's speeds ask for as it begins. One that turns out
to be fast or deep is gone through with more passes over the contacts, and with twice as many substeps for as long as
faces pass through each other that did not before. Each world has its own numbers, for it must go as it would alone.
Where nothing is fast or deep, every bit is as it was.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from nuno.body import Body
from nuno.dynamics import Dynamics
from nuno.materials import Cloth
from nuno.mesh.crossings import crossing_faces
from nuno.parties import Parties

logger = logging.getLogger(__name__)

WAY = 0.75
"""Thicknesses that a cloth may move within a substep: 1.8 m/s at 10 substeps a frame and 4 mm. Of 60 sheets thrown
or dropped at up to 10 m/s none passed through itself at that; half as far did no better."""
DEEP = 0.7
"""Share of its thickness by which a cloth may be pressed into itself while contacts are solved. A corner that is lifted
comes to 0.1 to 0.6, what falls on itself at 4 m/s to 0.9."""
PASSES, MORE_PASSES = 2, 8  # the first is that of `nuno.solver.cloth_solver`, which is loaded on first use only
"""Passes over a cloth's contacts with itself in a substep, and in a frame that is gone through again."""
MOST = 480
"""Substeps of a frame at most: twice `nuno.solver.substeps.MOST_SUBSTEPS`."""


def are_fast(moving: dict[Body, Dynamics]) -> bool:
    """Return whether a cloth may have passed through itself for its speed since that was last forgotten."""
    return any(_fast_worlds(dynamics).any() for dynamics in moving.values() if _touches_itself(dynamics))


class Impacts:
    """A frame that cloths may be too fast for, which begins now.

    Args:
        moving: The dynamic bodies.
        worlds: Worlds in the batch.
        frame: Length of a whole frame [s].
    """

    def __init__(self, moving: list[Body], worlds: int, frame: float) -> None:
        from nuno.solver.extremes import forget_extremes

        self._moving = moving
        own = np.array([body._dynamics.substeps for body in moving])  # type: ignore[union-attr]
        self.substeps = np.repeat(own[:, None], worlds, axis=1)
        """(bodies, worlds) int, of a whole frame, at which each body is to begin."""
        self._thorough = np.zeros_like(self.substeps, dtype=bool)  # where it has gone with more passes
        self._start: dict[int, np.ndarray] = {}  # of each cloth that touches itself, where it begins
        for k, body in enumerate(moving):
            if _touches_itself(body._dynamics):
                solver: Any = body._dynamics.solver  # type: ignore[union-attr]
                forget_extremes(solver)
                self._start[k] = solver.positions()
                velocities = solver.velocities()
                # of two points that meet each does half of what they differ by at most
                apart = 0.5 * np.linalg.norm(np.ptp(velocities, axis=1), axis=-1)
                # nor more than the fastest goes: what is not fast alone is not here, beside a world that is
                apart = np.minimum(apart, np.linalg.norm(velocities, axis=-1).max(axis=1))
                asked = np.nan_to_num(apart * frame / (WAY * _thickness(solver)), posinf=0.0)
                self.substeps[k] = [_at_least(int(own[k]), float(least)) for least in asked]

    def again(self, parties: Parties) -> tuple[Parties, np.ndarray]:
        """Look at what came of the frame.

        Args:
            parties: Those that went through it.

        Returns:
            The parties for another go, with more substeps where a cloth passed through itself, and (bodies, worlds)
            bool, which of them go again.
        """
        substeps, due = parties.substeps.copy(), np.zeros_like(parties.substeps, dtype=bool)
        for k, start in self._start.items():
            body = self._moving[k]
            solver: Any = body._dynamics.solver  # type: ignore[union-attr]
            fast = np.flatnonzero(_fast_worlds(body._dynamics))
            if not len(fast):
                continue
            now, faces = solver.positions(), np.asarray(body.faces)
            for world in fast:
                joined = parties.first[:, world] == parties.first[k, world]
                if not self._thorough[k, world]:
                    self._thorough[joined, world] = True
                    due[joined, world] = True
                    continue
                if not np.isfinite(now[world]).all() or not len(crossing_faces(now[world], faces)):
                    continue
                before = len(crossing_faces(start[world], faces)) > 0
                if before or parties.substeps[k, world] >= MOST:
                    _tell(body, solver, int(world))
                    continue
                substeps[joined, world] = min(2 * int(parties.substeps[k, world]), MOST)
                due[joined, world] = True
        if due.any():
            self.set_passes(MORE_PASSES)
        return Parties(parties.first, substeps), due

    def set_passes(self, passes: int) -> None:
        """Let the cloths' contacts with themselves be solved so often in a substep."""
        for k in self._start:
            self._moving[k]._dynamics.solver.passes = passes  # type: ignore[union-attr]


def _touches_itself(dynamics: Any) -> bool:
    return isinstance(dynamics.material, Cloth) and bool(dynamics.solver.self_contact)


def _thickness(solver: Any) -> np.ndarray:
    from nuno.solver.state import THICKNESS

    return np.maximum(solver._scalars[:, THICKNESS], 1e-6)


def _fast_worlds(dynamics: Any) -> np.ndarray:
    """Return (worlds,) bool, where a cloth went farther in a substep than it should, or was pressed deeper."""
    from nuno.solver.extremes import deepest, fastest

    solver = dynamics.solver
    fast = fastest(solver) > WAY * _thickness(solver) * solver.substeps * solver.frame_rate
    return np.asarray(fast | (deepest(solver) > DEEP * _thickness(solver)))


def _at_least(own: int, asked: float) -> int:
    """Return the body's own substeps, doubled as often as it takes, so that few different numbers come up."""
    count = own
    while count < min(asked, MOST):
        count *= 2
    return max(own, min(count, MOST))


def _tell(body: Body, solver: Any, world: int) -> None:
    """Note that a world's cloth passes through itself, which more substeps do not cure, and tell of the first."""
    if not solver.missed.any():
        logger.warning(
            "%r passes through itself, in up to %d substeps a frame too, or did so before: %r.missed_contacts says in "
            "which worlds; grips that are slower or leave it more room, and thicker cloth, help",
            body.name, MOST, body.name,
        )  # fmt: skip
    solver.missed[world] = True
