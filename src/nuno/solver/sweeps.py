"""Shear and stretch in several sweeps of a substep, where one pass would leave them too soft.

Multipliers add up over a substep's sweeps, so that the compliance at which the sweeps arrive is the material's (XPBD,
Macklin et al. 2016); shear and a mesh's triangles are over-relaxed (successive over-relaxation). How many sweeps, and
by how much, is for `nuno.solver.relaxation` to say. A yarn is solved exactly, and then misses its rest length by alpha
lambda: in the next sweep the lengths that it was left with take the place of its multipliers.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, div, fill, mul, root, sub  # noqa: F401
from nuno.solver.membrane import shear_cell, shear_triangle, stretch_triangle
from nuno.solver.state import Settings
from nuno.solver.vector import at, corner, put


@wp.func
def past_of(sums: Any, k: int, sweep: int, like: Any):
    """What a multiplier came to in the sweeps before: nothing before the first."""
    past = fill(like, 0.0)
    if sweep > 0:
        past = at(sums, k)
    return past


@wp.func
def shear_cells_again(
    t: Any, table: Any, sums: Any, run: Settings, sweep: int, first: int, last: int, thread: int, threads: int
):
    """The cell shears of one colour in a sweep, their multipliers in ``sums``."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        scale = table.cell_scale[k]
        alpha = at(t.shear_soft, table.cell_soft[k]) * (scale * 4.0 * rate)
        a = corner(table.cell, k, 0, 4)
        b = corner(table.cell, k, 1, 4)
        c = corner(table.cell, k, 2, 4)
        d = corner(table.cell, k, 3, 4)
        past = past_of(sums, k, sweep, alpha)
        put(sums, k, past + shear_cell(t, a, b, c, d, scale, alpha, past, run.rise, run.onset))


@wp.func
def strain_triangles_again(
    t: Any, table: Any, sums: Any, run: Settings, sweep: int, first: int, last: int, thread: int, threads: int
):
    """The triangles of one colour in a sweep, three multipliers each in ``sums``: shear, weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        area = table.triangle_area[k]
        scale = rate / area
        a = corner(table.triangle, k, 0, 3)
        b = corner(table.triangle, k, 1, 3)
        c = corner(table.triangle, k, 2, 3)
        alpha = at(t.shear_soft, corner(table.triangle_soft, k, 2, 3)) * scale
        past = past_of(sums, 3 * k, sweep, alpha)
        put(sums, 3 * k, past + shear_triangle(t, table, k, a, b, c, alpha, past, run.rise, run.onset))
        alpha = at(t.stretch_soft, corner(table.triangle_soft, k, 1, 3)) * scale
        ka = corner(table.triangle_v, k, 0, 3)
        kb = corner(table.triangle_v, k, 1, 3)
        kc = corner(table.triangle_v, k, 2, 3)
        past = past_of(sums, 3 * k + 1, sweep, alpha)
        put(sums, 3 * k + 1, past + stretch_triangle(t, a, b, c, ka, kb, kc, alpha, past, run.rise, run.onset))
        alpha = at(t.stretch_soft, corner(table.triangle_soft, k, 0, 3)) * scale
        ka = corner(table.triangle_u, k, 0, 3)
        kb = corner(table.triangle_u, k, 1, 3)
        kc = corner(table.triangle_u, k, 2, 3)
        past = past_of(sums, 3 * k + 2, sweep, alpha)
        put(sums, 3 * k + 2, past + stretch_triangle(t, a, b, c, ka, kb, kc, alpha, past, run.rise, run.onset))


@wp.func
def note_lengths(t: Any, table: Any, goals: Any, first: int, last: int, thread: int, threads: int):
    """The lengths with which yarns' edges first to last are left, into ``goals``, for the next sweep."""
    for k in range(first + thread, last, threads):
        i = corner(table.edge, k, 0, 2)
        j = corner(table.edge, k, 1, 2)
        dx = at(t.x, i) - at(t.x, j)
        dy = at(t.y, i) - at(t.y, j)
        dz = at(t.z, i) - at(t.z, j)
        put(goals, k, root(dx * dx + dy * dy + dz * dz + 1.0e-20))
