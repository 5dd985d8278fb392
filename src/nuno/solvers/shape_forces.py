"""Forces that static shapes would put on a body in the next substep, asked of its solver without changing anything."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.contact.particle.shape_contact import COLUMNS
from nuno.state.cloth_state import COMPLIANT_GRIPS, MOTION, SELF_CONTACT, SHAPES

if TYPE_CHECKING:
    from nuno.solvers.particle_solver import ParticleSolver

MU = 15
"""Columns of the table of static shapes with its friction, and that of the pair."""


def shape_forces(solver: ParticleSolver, time: float) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Return what each static shape nearby would do in the substep that comes next; nothing is changed.

    Args:
        solver: A cloth's or soft body's.
        time: The world's time [s].

    Returns:
        The shape's number in the table, the normals (worlds, n, 3) at the particles that it pushes, zero elsewhere,
        and the forces [N] on them, (worlds, n, 3).
    """
    s, saved, loads, last = solver.state, solver.save_state(), wp.clone(solver.state.grip_load), solver.last_dt
    dt = 1.0 / solver.frame_rate / solver.substeps
    solver.open(time, dt, solver.substeps)
    solver.step_parts(0, MOTION | COMPLIANT_GRIPS | SELF_CONTACT)
    starts = shape_lists(solver)
    lists = {name: getattr(s, name).numpy().reshape(solver.group_count, -1).copy() for name in starts}
    shapes = shapes_of_list(lists["shape_list"], starts["shape_list"])
    before, held = [wp.clone(a) for a in solver.doubles.arrays], wp.clone(s.w)
    table: Any = wp.clone(solver.shapes.table)
    slick = table.numpy().reshape(-1, COLUMNS).copy()
    slick[:, MU : MU + 2] = 0.0

    def moved(shape: int) -> np.ndarray:
        for array, first in zip(solver.doubles.arrays, before, strict=True):
            wp.copy(array, first)
        wp.copy(s.w, held)
        for name, start in starts.items():
            getattr(s, name).assign(one_of(shape, lists[name], start).ravel())
        s.feature_due.zero_()  # what sleeps was far from another shape
        places = solver.local_positions().astype(float)
        solver.step_parts(0, SHAPES)
        return solver.local_positions() - places

    result = []
    for shape in shapes:
        forces = moved(shape) * (solver.mass / dt**2)[..., None]
        solver.shapes.table.assign(slick.ravel())
        push = moved(shape)
        solver.shapes.table.assign(table)
        size = np.linalg.norm(push, axis=-1, keepdims=True)
        forces[solver.inverse_mass_now(held) == 0.0] = 0.0
        if size.any():
            result.append((shape, np.divide(push, size, out=np.zeros_like(push), where=size > 0.0), forces))
    solver.load_state(saved)
    wp.copy(s.grip_load, loads)
    solver.last_dt = last
    return result


def shape_lists(solver: ParticleSolver) -> dict[str, int]:
    """Return the state's lists of shapes nearby, as many as their first number says: at which number they begin."""
    return {"shape_list": 1, "feature_shapes": len(solver._surface.feature_colour)}


def shapes_of_list(rows: np.ndarray, start: int) -> list[int]:
    """Return the shapes that any row (groups, k) of such a list has."""
    return sorted({int(shape) for row in rows for shape in row[start : start + row[0]]})


def one_of(shape: int, rows: np.ndarray, start: int) -> np.ndarray:
    """Return rows (groups, k) of such a list with one shape alone, where they have it."""
    alone = rows.copy()
    alone[:, 0] = [shape in row[start : start + row[0]] for row in rows]
    alone[:, start] = shape
    return alone
