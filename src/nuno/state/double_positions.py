"""A body's coordinates as doubles beside those as floats, and which of the two count."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.state.cloth_state import PLACES, Settings

DOUBLE_RATE = 1500.0
"""[1/s] From so many substeps a second on, 25 a frame of 1/60 s, coordinates are doubles (see `nuno.numbers.doubles`);
of a cloth whose substeps the rule chooses in any case. Gravity then moves a vertex by 4 um in one, and a float at half
a metre has steps of 0.03 to 0.06 um."""


@wp.kernel(enable_backward=False, module="nuno.state.to_doubles")
def to_doubles(x: wp.array(dtype=float), out: wp.array(dtype=float64)):  # type: ignore[valid-type]
    """Floats as doubles."""
    i = wp.tid()
    out[i] = float64(x[i])


class DoublePositions:
    """The doubles of a solver, made when they are first needed.

    Floats are always there: at the end of a substep they are what the doubles round to. What sets them sets the doubles
    aside, and so does a run with few substeps a second.

    Args:
        solver: A `nuno.solvers.particle_solver.ParticleSolver`.
        kind: The class of its state with coordinates as doubles.
        rate: Substeps a second [1/s] from which on doubles count.
    """

    def __init__(self, solver: Any, kind: Any, rate: float = DOUBLE_RATE) -> None:
        self._solver, self._kind, self._rate = solver, kind, rate
        self._state: Any = None
        self.count = False  # whether the doubles are what counts

    @property
    def arrays(self) -> list[wp.array]:
        """x, y and z, those that count."""
        state = self._state if self.count else self._solver.state
        return [state.x, state.y, state.z]

    def array(self, name: str) -> wp.array:
        """One of the doubles' arrays."""
        return getattr(self._made(), name)

    def begin_at(self, rate: float) -> None:
        """Let doubles count from so many substeps a second [1/s] on, or from where they did if that is more."""
        self._rate = max(self._rate, rate)

    def count_in(self, step: np.ndarray) -> np.ndarray:
        """Return True, elementwise, where doubles count in substeps of so many seconds."""
        return 1.0 >= (1.0 - 1e-9) * self._rate * step

    def bring(self, run: Settings) -> Any:
        """The state with doubles that count from now on, or None where a run has so few substeps that floats do."""
        if self._solver.frame_rate * run.frame < self._rate:
            self.count = False
            return None
        state, floats = self._made(), self._solver.state
        for name in state._cls.vars:
            if name not in PLACES and getattr(state, name) is not getattr(floats, name):
                setattr(state, name, getattr(floats, name))
        if not self.count:
            for name in PLACES:
                self._to_doubles(getattr(floats, name), getattr(state, name))
            self.count = True
        return state

    def put(self, local: np.ndarray) -> None:
        """Set positions (worlds, n, 3) float64 [m], relative to the origins; the floats are set already."""
        for k, name in enumerate(("x", "y", "z")):
            self._solver.fill(self.array(name), local[..., k])
            wp.copy(self.array("p" + name), self.array(name))
        self.count = True

    def _made(self) -> Any:
        if self._state is None:
            solver, state = self._solver, self._kind()
            number = double_lane if solver.lanes > 1 else float64
            for name in PLACES:
                room = solver._empty(solver._whole, number)
                setattr(state, name, room[: solver.group_count * solver.particle_count])
            self._state = state
        return self._state

    def _to_doubles(self, floats: wp.array, out: wp.array) -> None:
        if str(out.device).startswith("cuda"):
            wp.launch(to_doubles, dim=len(out), inputs=[floats, out], device=out.device)
        else:
            out.numpy()[...] = floats.numpy()
