"""The largest speed of a cloth and its deepest contact with itself, which its runs keep until they are forgotten."""

from typing import Any

import numpy as np

from nuno.state.cloth_state import DEEPEST, FASTEST, NOTES, SPEED
from nuno.state.pack import reset_note


def fastest(solver: Any) -> np.ndarray:
    """Return (worlds,) [m/s], the largest speed that any particle had at the end of a substep."""
    notes = _notes(solver)
    return np.asarray(np.sqrt(np.maximum(notes[:, FASTEST], notes[:, SPEED])))


def deepest(solver: Any) -> np.ndarray:
    """Return (worlds,) [m], how far a cloth was within its thickness of itself while contacts were solved, at most."""
    return _notes(solver)[:, DEEPEST]


def forget_extremes(solver: Any) -> None:
    """Let `fastest` and `deepest` tell of what comes next."""
    for entry in (FASTEST, DEEPEST):
        reset_note(solver.state, solver.group_count, solver.device, entry)


def _notes(solver: Any) -> np.ndarray:
    return np.asarray(solver.download(solver.state.notes, NOTES))
