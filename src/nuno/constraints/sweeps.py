"""Shear and stretch in one plain pass of a substep, or in several sweeps where that would leave them too soft.

Multipliers add up over a substep's sweeps, so that the compliance at which the sweeps arrive is the material's (XPBD,
Macklin et al. 2016); shear and a mesh's triangles are over-relaxed (successive over-relaxation). How many sweeps, and
by how much, is for `nuno.constraints.relaxation` to say. A grid line is solved exactly, and then misses its rest length
by alpha
lambda: in the next sweep the lengths that it was left with take the place of its multipliers.
"""

from typing import Any

import warp as wp

from nuno.constraints.membrane import shear_alpha, shear_cell, shear_triangle, stretch_triangle
from nuno.numbers.element_access import at, corner, put
from nuno.numbers.lanes import add, div, full_like, mul, sqrt, sub  # noqa: F401
from nuno.state.cloth_state import Settings


@wp.func
def past_of(sums: Any, k: int, sweep: int, like: Any):
    """Return what a multiplier came to in the sweeps before: nothing before the first."""
    past = full_like(like, 0.0)
    if sweep > 0:
        past = at(sums, k)
    return past


@wp.func
def keep(sums: Any, k: int, past: Any, change: Any, more: bool):
    """Keep what a multiplier has come to, where another sweep follows."""
    if more:
        put(sums, k, past + change)


@wp.func
def shear_cells(t: Any, table: Any, sums: Any, run: Settings, sweep: int, first: int, last: int, rank: int, size: int):
    """The cell shears of one colour in a sweep, their multipliers in ``sums``; 4 scale is 1 / area."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        scale = table.cell_scale[k]
        alpha = shear_alpha(at(t.shear_compliance, table.cell_compliance[k]), scale, rate)
        a = corner(table.cell, k, 0, 4)
        b = corner(table.cell, k, 1, 4)
        c = corner(table.cell, k, 2, 4)
        d = corner(table.cell, k, 3, 4)
        past = past_of(sums, k, sweep, alpha)
        change = shear_cell(t, a, b, c, d, scale, alpha, past, run.rise, run.onset)
        keep(sums, k, past, change, sweep + 1 < run.sweeps)


@wp.func
def stretch_along(
    t: Any, table: Any, factors: Any, which: int, k: int, a: Any, b: Any, c: Any, scale: Any, sums: Any, run: Settings,
    sweep: int,
):  # fmt: skip
    """Triangle k's stretch by the ``factors`` of a direction, of which a triangle has the compliance ``which``."""
    alpha = at(t.stretch_compliance, corner(table.triangle_compliance, k, which, 3)) * scale
    ka = corner(factors, k, 0, 3)
    kb = corner(factors, k, 1, 3)
    kc = corner(factors, k, 2, 3)
    place = 3 * k + 2 - which
    past = past_of(sums, place, sweep, alpha)
    change = stretch_triangle(t, a, b, c, ka, kb, kc, alpha, past, run.rise, run.onset)
    keep(sums, place, past, change, sweep + 1 < run.sweeps)


@wp.func
def strain_triangles(
    t: Any, table: Any, sums: Any, run: Settings, sweep: int, first: int, last: int, rank: int, size: int
):
    """The triangles of one colour in a sweep, three multipliers each in ``sums``: shear, weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        area = table.triangle_area[k]
        scale = rate / area
        a = corner(table.triangle, k, 0, 3)
        b = corner(table.triangle, k, 1, 3)
        c = corner(table.triangle, k, 2, 3)
        alpha = at(t.shear_compliance, corner(table.triangle_compliance, k, 2, 3)) * scale
        past = past_of(sums, 3 * k, sweep, alpha)
        change = shear_triangle(t, table, k, a, b, c, alpha, past, run.rise, run.onset)
        keep(sums, 3 * k, past, change, sweep + 1 < run.sweeps)
        stretch_along(t, table, table.triangle_v, 1, k, a, b, c, scale, sums, run, sweep)
        stretch_along(t, table, table.triangle_u, 0, k, a, b, c, scale, sums, run, sweep)


@wp.func
def note_lengths(t: Any, table: Any, goals: Any, first: int, last: int, rank: int, size: int):
    """The lengths with which grid lines' edges first to last are left, into ``goals``, for the next sweep."""
    for k in range(first + rank, last, size):
        i = corner(table.edge, k, 0, 2)
        j = corner(table.edge, k, 1, 2)
        dx = at(t.x, i) - at(t.x, j)
        dy = at(t.y, i) - at(t.y, j)
        dz = at(t.z, i) - at(t.z, j)
        put(goals, k, sqrt(dx * dx + dy * dy + dz * dz + 1.0e-20))
