"""Rows of a rigid solver's reports and listings that stay as they are while some worlds of a batch are set anew."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nuno.rigid.rigid_arrays import REPORTED
from nuno.rigid.saved_contacts import load_listing, save_listing
from nuno.solvers.rigid_solver import RigidSolver


class RigidRows:
    """A rigid solver's reports of the last frame and listing of pairs, kept while some worlds are set anew.

    Args:
        solver: The solver.
        worlds: (k,) int, the worlds that are set.
    """

    def __init__(self, solver: RigidSolver, worlds: np.ndarray) -> None:
        self._solver, self._worlds = solver, worlds
        solver._load_contacts()
        self._listing = save_listing(solver)
        self._reported = {name: solver._entries(name).copy() for name in REPORTED}

    def settle(self, listing: Mapping[str, np.ndarray] | None, rows: np.ndarray) -> None:
        """Give back what was kept; the worlds that were set take rows of a saved ``listing``, None to list anew."""
        solver, worlds = self._solver, self._worlds
        solver._load_contacts()
        merged = save_listing(solver)
        for name, values in merged.items():
            kept = self._listing[name]
            values[:, : kept.shape[1]] = kept
            if listing is not None:
                known = min(values.shape[1], listing[name].shape[1])
                values[worlds, :known] = listing[name][rows, :known]
        if listing is None:
            merged["notes"][worlds] = -1.0
        load_listing(solver, merged)
        for name, values in self._reported.items():
            values[worlds] = 0
            now = solver._entries(name).copy()
            now[:, : values.shape[1], : values.shape[2]] = values
            array = getattr(solver.manifolds, name)
            array.assign(now.reshape(array.numpy().shape))
