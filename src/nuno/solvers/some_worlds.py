"""States of some worlds of a batch of particles, written over what those have; all others keep every bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from nuno.solvers.particle_solver import ParticleSolver
from nuno.state.cloth_state import FASTEST, LOADS, NOTES, ORIGIN


def load_particles(solver: ParticleSolver, worlds: np.ndarray, state: Mapping[str, np.ndarray]) -> None:
    """Set the particles of some worlds, as `ParticleSolver.load_state` sets those of all.

    Args:
        solver: The solver.
        worlds: (k,) int, the worlds.
        state: What `ParticleSolver.save_state` gave, (k, ...) each.
    """
    s, local = solver.state, np.asarray(state["local"])
    if local.dtype == np.float64 and not solver.doubles.count:
        solver.doubles.put(solver.local_positions())  # the other worlds' floats as they are
    for k, axis in enumerate("xyz"):
        for name in (axis, f"p{axis}"):
            put_rows(solver, getattr(s, name), worlds, local[..., k].astype(np.float32))
            if solver.doubles.count:
                put_rows(solver, solver.doubles.array(name), worlds, local[..., k].astype(np.float64))
        put_rows(solver, getattr(s, f"v{axis}"), worlds, np.asarray(state["velocities"])[..., k])
    notes = np.pad(np.asarray(state["notes"]), ((0, 0), (0, NOTES - FASTEST)))
    put_rows(solver, s.notes, worlds, notes)
    origin = np.asarray(state["origin"], dtype=solver.scalars.dtype)
    if not np.array_equal(solver.scalars[worlds, ORIGIN : ORIGIN + 3], origin):
        solver.scalars[worlds, ORIGIN : ORIGIN + 3] = origin
        wp.copy(s.scalars, solver._put(solver.scalars))
        if solver.grip_count:
            set_grips(solver, solver._grips, worlds)
    if hasattr(solver, "guarded"):
        solver.guarded[worlds] = state.get("guarded", np.int32(0))
    if solver.sums is not None:
        given = {key: impulse.copy() for key, impulse in solver.sums.given().items()}
        for impulse in given.values():
            impulse[worlds] = 0.0
        solver.sums.set_given(given)


def set_grips(solver: ParticleSolver, grips: Any, worlds: np.ndarray) -> None:
    """Set what is held; in all worlds but some, what the grips bore in the last frame stays known."""
    count = LOADS * max(1, solver.grip_count)
    loads, before = solver.download(solver.state.grip_load, count).copy(), solver.grip_count
    solver.set_grips(grips)
    if solver.grip_count == before:
        loads[worlds] = 0.0
        wp.copy(solver.state.grip_load, solver._put(loads))


def put_rows(solver: ParticleSolver, array: wp.array, worlds: np.ndarray, values: np.ndarray) -> None:
    """Write numbers (k, count) to some worlds of a device array, without passing the others through the host."""
    count, lanes = values.shape[1], solver.lanes
    if solver._cuda:
        rows: Any = wp.array(np.asarray(worlds, dtype=np.int32), dtype=int, device=solver.device)
        chosen: Any = [rows, None]
        there: Any = wp.indexedarray(array.reshape((solver.world_count, count)), chosen)
        wp.copy(there, wp.array(np.ascontiguousarray(values), dtype=array.dtype, device=solver.device))
        return
    if lanes == 1:
        array.numpy().reshape(solver.world_count, count)[worlds] = values
        return
    table = array.numpy().reshape(solver.group_count, count, lanes)
    table[worlds // lanes, :, worlds % lanes] = values
    last = solver.world_count - 1
    if last in worlds:  # lanes beyond the last world repeat it
        table[-1, :, last % lanes + 1 :] = table[-1, :, last % lanes, None]
