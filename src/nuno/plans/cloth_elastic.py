"""A cloth's elastic constraints, colour by colour: bends, shears, triangles and grid lines, the stiffest last.

A table of elements is a `Topology`, or `nuno.plans.simd_elements.SimdElements` where sixteen elements are in the lanes
of a vector. CUDA goes through bends and grid lines by methods of its own: `sheet_strips`, `cloth_prefetch`,
`grid_lines_by_threads`, `grid_lines_by_warp`.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, bend_line, bend_patch, bend_twist
from nuno.constraints.membrane import shear_alpha, shear_cell, shear_triangle, stretch_grid_line, stretch_triangle
from nuno.constraints.sweeps import note_lengths, shear_cells_again, strain_triangles_again
from nuno.numbers.block_group import wait_for
from nuno.numbers.crew import Crew, shares_work
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, div, full_like, mul, product, sub  # noqa: F401
from nuno.numbers.warp_lanes import lane_of
from nuno.numbers.warps import WARP, in_warps
from nuno.plans.cloth_prefetch import bend_lines_ahead, bend_twists_ahead, shear_cells_ahead
from nuno.plans.grid_lines_by_threads import GRID_LINE_EDGES, stretch_grid_lines_by_threads
from nuno.plans.grid_lines_by_warp import PAIR_EDGES, WARP_EDGES, stretch_double_grid_lines
from nuno.plans.sheet_strips import bend_in_strips, fits_strips
from nuno.plans.simd_elements import SimdElements
from nuno.state.cloth_state import Settings, StateDouble, StateFloat, Topology

STRETCH_KINDS = wp.constant(2)
"""Numbers in ``stretch_compliance`` where they are the same for all edges of a direction."""


@wp.func
def bend_lines(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The line bends of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = bend_alpha(at(t.bend_compliance, table.line_compliance[k]), table.line_scale[k], rate)
        a = corner(table.line, k, 0, 3)
        b = corner(table.line, k, 1, 3)
        c = corner(table.line, k, 2, 3)
        bend_line(t, a, b, c, alpha)


@wp.func
def bend_twists(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The cell twists of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = bend_alpha(at(t.bend_compliance, table.twist_compliance[k]), table.twist_scale[k], rate)
        a = corner(table.twist, k, 0, 4)
        b = corner(table.twist, k, 1, 4)
        c = corner(table.twist, k, 2, 4)
        d = corner(table.twist, k, 3, 4)
        bend_twist(t, a, b, c, d, alpha)


@wp.func
def bend_patches(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The triangles' curvatures of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = product(at(t.bend_compliance, table.patch_compliance[k]), rate)
        bend_patch(t, table, k, alpha)


@wp.func
def shear_cells(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The cell shears of one colour; 4 scale is 1 / area."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        scale = table.cell_scale[k]
        alpha = shear_alpha(at(t.shear_compliance, table.cell_compliance[k]), scale, rate)
        a = corner(table.cell, k, 0, 4)
        b = corner(table.cell, k, 1, 4)
        c = corner(table.cell, k, 2, 4)
        d = corner(table.cell, k, 3, 4)
        shear_cell(t, a, b, c, d, scale, alpha, full_like(alpha, 0.0), 0.0, 0.0)


@wp.func
def strain_triangles(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The triangles of one colour: shear, then stretch along weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        area = table.triangle_area[k]
        scale = rate / area
        a = corner(table.triangle, k, 0, 3)
        b = corner(table.triangle, k, 1, 3)
        c = corner(table.triangle, k, 2, 3)
        alpha = at(t.shear_compliance, corner(table.triangle_compliance, k, 2, 3)) * scale
        zero = full_like(alpha, 0.0)
        shear_triangle(t, table, k, a, b, c, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_compliance, corner(table.triangle_compliance, k, 1, 3)) * scale
        ka = corner(table.triangle_v, k, 0, 3)
        kb = corner(table.triangle_v, k, 1, 3)
        kc = corner(table.triangle_v, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_compliance, corner(table.triangle_compliance, k, 0, 3)) * scale
        ka = corner(table.triangle_u, k, 0, 3)
        kb = corner(table.triangle_u, k, 1, 3)
        kc = corner(table.triangle_u, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)


@wp.func
def scratch_of(t: Any, table: SimdElements):
    """The arrays that grid lines and sweeps write between the passes over a table's elements."""
    return table


@wp.func
def scratch_of(t: Any, table: Topology):
    return t


@wp.func
def stretch_each_grid_line(t: Any, table: Any, rest: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The grid lines first to last, each by one member of a crew; sixteen of them where the table has them so."""
    rate = 1.0 / (run.dt * run.dt)
    room = scratch_of(t, table)
    for k in range(first + rank, last, size):
        start = table.grid_line[k]
        stretch_grid_line(
            t,
            table,
            rest,
            room.grid_line_gain,
            room.grid_line_pull,
            room.grid_line_inverse,
            start,
            table.grid_line[k + 1],
            rate,
        )


@wp.func
def stretch_grid_lines(
    t: StateFloat, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    """The grid lines of one direction, which are equally long: on CUDA each by a few threads, else by one.

    ``rest`` is as `nuno.constraints.membrane.stretch_grid_line` has it.
    """
    rate = 1.0 / (run.dt * run.dt)
    count = int(0)
    if in_warps(size) and first < last:
        count = table.grid_line[first + 1] - table.grid_line[first]
    if count > 0 and count <= GRID_LINE_EDGES:
        varied = sweep > 0 or t.stretch_compliance.shape[0] > STRETCH_KINDS
        stretch_grid_lines_by_threads(
            t, table, rest, table.grid_line[first], count, last - first, varied, rate, lane_of(rank, size)
        )  # fmt: skip
    else:
        stretch_each_grid_line(t, table, rest, run, first, last, rank, size)


@wp.func
def stretch_grid_lines(
    t: StateDouble, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    rate = 1.0 / (run.dt * run.dt)
    if in_warps(size):
        warps = size / WARP
        k = int(first + rank / WARP)
        while k < last:
            start = table.grid_line[k]
            stop = table.grid_line[k + 1]
            other = int(0)
            end = int(0)
            if k + warps < last:
                other = table.grid_line[k + warps]
                end = table.grid_line[k + warps + 1]
            if wp.max(stop - start, end - other) > PAIR_EDGES:
                end = other
            if stop - start <= WARP_EDGES:
                stretch_double_grid_lines(t, table, rest, start, stop, other, end, rate, lane_of(rank, size))
            elif rank % WARP == 0:
                stretch_grid_line(
                    t, table, rest, t.grid_line_gain, t.grid_line_pull, t.grid_line_inverse, start, stop, rate
                )
            k += wp.where(end > other, 2 * warps, warps)
    else:
        stretch_each_grid_line(t, table, rest, run, first, last, rank, size)


@wp.func
def stretch_grid_lines(
    t: Any, table: Any, rest: Any, run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    stretch_each_grid_line(t, table, rest, run, first, last, rank, size)


@wp.func
def bend_sheet(t: Any, table: Any, run: Settings, crew: Crew):
    """A sheet's twists, bends and, where they are not swept, shears."""
    for c in range(table.twist_colour.shape[0] - 1):
        bend_twists(t, table, run, table.twist_colour[c], table.twist_colour[c + 1], crew.rank, crew.size)
        wait_for(crew)
    for c in range(table.line_colour.shape[0] - 1):
        bend_lines(t, table, run, table.line_colour[c], table.line_colour[c + 1], crew.rank, crew.size)
        wait_for(crew)
    if run.sweeps == 0:
        for c in range(table.cell_colour.shape[0] - 1):
            shear_cells(t, table, run, table.cell_colour[c], table.cell_colour[c + 1], crew.rank, crew.size)
            wait_for(crew)


@wp.func
def bend_sheet_ahead(t: Any, table: Topology, run: Settings, crew: Crew):
    """`bend_sheet` by the threads of a block, which read elements before their turn."""
    bend_twists_ahead(t, table, run, crew.rank, crew.size)
    bend_lines_ahead(t, table, run, crew.rank, crew.size)
    if run.sweeps == 0:
        shear_cells_ahead(t, table, run, crew.rank, crew.size)


@wp.func
def bend(t: Any, table: Any, run: Settings, crew: Crew):
    """A sheet's bends and shears, in the crew's quickest way."""
    bend_sheet(t, table, run, crew)


@wp.func
def bend(t: StateFloat, table: Topology, run: Settings, crew: Crew):
    if in_warps(crew.size) and fits_strips(table):
        bend_in_strips(t, table, run, crew.rank, crew.size)
    elif shares_work(crew.size):
        bend_sheet_ahead(t, table, run, crew)
    else:
        bend_sheet(t, table, run, crew)


@wp.func
def bend(t: StateDouble, table: Topology, run: Settings, crew: Crew):
    if shares_work(crew.size):
        bend_sheet_ahead(t, table, run, crew)
    else:
        bend_sheet(t, table, run, crew)


@wp.func
def sweep_membrane(t: Any, table: Any, run: Settings, crew: Crew):
    """Shear and stretch in ``run.sweeps`` sweeps, grid lines last in each."""
    room = scratch_of(t, table)
    for sweep in range(run.sweeps):
        for c in range(table.cell_colour.shape[0] - 1):
            first = table.cell_colour[c]
            last = table.cell_colour[c + 1]
            shear_cells_again(t, table, room.cell_sum, run, sweep, first, last, crew.rank, crew.size)
            wait_for(crew)
        for c in range(table.triangle_colour.shape[0] - 1):
            first = table.triangle_colour[c]
            last = table.triangle_colour[c + 1]
            strain_triangles_again(t, table, room.triangle_sum, run, sweep, first, last, crew.rank, crew.size)
            wait_for(crew)
        for c in range(table.grid_line_kind.shape[0] - 1):
            first = table.grid_line_kind[c]
            last = table.grid_line_kind[c + 1]
            if sweep == 0:
                stretch_grid_lines(t, table, table.edge_rest, run, sweep, first, last, crew.rank, crew.size)
            else:
                stretch_grid_lines(t, table, room.grid_line_goal, run, sweep, first, last, crew.rank, crew.size)
            wait_for(crew)
            if sweep + 1 < run.sweeps:
                start = table.grid_line[first]
                note_lengths(t, table, room.grid_line_goal, start, table.grid_line[last], crew.rank, crew.size)
                wait_for(crew)


@wp.func
def solve_cloth(t: Any, table: Any, run: Settings, crew: Crew):
    """One pass over all elastic constraints, or more over those in the cloth's plane."""
    for c in range(table.patch_colour.shape[0] - 1):
        bend_patches(t, table, run, table.patch_colour[c], table.patch_colour[c + 1], crew.rank, crew.size)
        wait_for(crew)
    bend(t, table, run, crew)
    if run.sweeps > 0:
        sweep_membrane(t, table, run, crew)
    else:
        for c in range(table.triangle_colour.shape[0] - 1):
            first = table.triangle_colour[c]
            strain_triangles(t, table, run, first, table.triangle_colour[c + 1], crew.rank, crew.size)
            wait_for(crew)
        for c in range(table.grid_line_kind.shape[0] - 1):
            first = table.grid_line_kind[c]
            last = table.grid_line_kind[c + 1]
            stretch_grid_lines(t, table, table.edge_rest, run, 0, first, last, crew.rank, crew.size)
            wait_for(crew)
