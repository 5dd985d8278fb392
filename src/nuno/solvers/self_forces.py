"""Forces of a cloth's contacts with itself in the next substep, asked of its solver without changing anything."""

from __future__ import annotations

import numpy as np
import warp as wp

from nuno.solvers.particle_solver import ParticleSolver
from nuno.state.cloth_state import COMPLIANT_GRIPS, FRICTION, MOTION, SELF_CONTACT


def self_contact_forces(solver: ParticleSolver, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what contacts of a cloth with itself would do in the substep that comes next; nothing is changed.

    Args:
        solver: A cloth's.
        time: The world's time [s].

    Returns:
        The normals (worlds, n, 3) at the particles that another part of the cloth pushes, zero elsewhere, and the
        forces [N] on them, (worlds, n, 3), friction included.
    """
    if not solver.self_contact:
        nothing = np.zeros((solver.world_count, solver.particle_count, 3))
        return nothing, nothing
    saved, loads, last = solver.save_state(), wp.clone(solver.state.grip_load), solver.last_dt
    friction = solver.scalars[:, FRICTION].copy()
    dt = 1.0 / solver.frame_rate / solver.substeps

    def moved() -> np.ndarray:
        solver.load_state(saved)
        solver.open(time, dt, solver.substeps)
        solver.step_parts(0, MOTION | COMPLIANT_GRIPS)
        start = solver.local_positions().astype(float)
        solver.step_parts(0, SELF_CONTACT)
        return solver.local_positions() - start

    forces = moved() * (solver.mass / dt**2)[..., None]
    solver.scalars[:, FRICTION] = 0.0
    push = moved()
    solver.scalars[:, FRICTION] = friction
    solver.load_state(saved)
    wp.copy(solver.state.grip_load, loads)
    solver.last_dt = last
    size = np.linalg.norm(push, axis=-1, keepdims=True)
    normals = np.divide(push, size, out=np.zeros_like(push), where=size > 0.0)
    return normals, np.where(size > 0.0, forces, 0.0)
