"""A cloth's elastic constraints, colour by colour: bends, shears, triangles and grid lines, the stiffest last.

A table of elements is a `Topology`, or `nuno.plans.simd_elements.SimdElements` where sixteen elements are in the lanes
of a vector. CUDA goes through bends and grid lines by methods of its own: `sheet_strips`, `cloth_prefetch`,
`grid_lines_by_threads`, `grid_lines_by_warp`.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, bend_line, bend_patch, bend_twist
from nuno.constraints.membrane import stretch_grid_line
from nuno.constraints.sweeps import note_lengths, shear_cells, strain_triangles
from nuno.numbers.block_group import wait_for
from nuno.numbers.crew import Crew, shares_work
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, div, full_like, mul, product, sub  # noqa: F401
from nuno.numbers.warp_lanes import lane_of
from nuno.numbers.warps import WARP, in_warps
from nuno.plans.cloth_prefetch import bend_ahead
from nuno.plans.grid_lines_by_threads import GRID_LINE_EDGES, stretch_grid_lines_by_threads
from nuno.plans.grid_lines_by_warp import PAIR_EDGES, WARP_EDGES, stretch_double_grid_lines
from nuno.plans.sheet_strips import bend_in_strips, fits_strips
from nuno.plans.simd_elements import SimdElements
from nuno.state.cloth_state import Settings, StateDouble, StateFloat, Topology
from nuno.topology.cloth_topology import PLAIN_KINDS

PLAIN = wp.constant(len(PLAIN_KINDS))
"""Kinds of elements that every plan solves colour by colour."""
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
def plain_colours(table: Any, kind: int):
    """The starts of the colours of a plain kind, a number of `PLAIN_KINDS`."""
    return table.patch_colour


@wp.func
def solve_plain(t: Any, table: Any, run: Settings, kind: int, first: int, last: int, rank: int, size: int):
    """The elements first to last of a plain kind, a number of `PLAIN_KINDS`; they share no vertex."""
    if kind == 0:
        bend_patches(t, table, run, first, last, rank, size)


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
def lengths_of(t: Any, table: Topology, sweep: int):
    """The edges' lengths at rest in a sweep, ``rest`` of `nuno.constraints.membrane.stretch_grid_line`."""
    lengths = table.edge_rest
    if sweep > 0:
        lengths = t.grid_line_goal
    return lengths


@wp.func
def stretch_grid_lines(
    t: StateFloat, table: Topology, run: Settings, sweep: int, first: int, last: int, rank: int, size: int
):
    """The grid lines of one direction, which are equally long: on CUDA each by a few threads, else by one."""
    rate = 1.0 / (run.dt * run.dt)
    rest = lengths_of(t, table, sweep)
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
    t: StateDouble, table: Topology, run: Settings, sweep: int, first: int, last: int, rank: int, size: int
):
    rate = 1.0 / (run.dt * run.dt)
    rest = lengths_of(t, table, sweep)
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
def stretch_grid_lines(t: Any, table: Any, run: Settings, sweep: int, first: int, last: int, rank: int, size: int):
    if sweep == 0:
        stretch_each_grid_line(t, table, table.edge_rest, run, first, last, rank, size)
    else:
        stretch_each_grid_line(t, table, scratch_of(t, table).grid_line_goal, run, first, last, rank, size)


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
            first = table.cell_colour[c]
            last = table.cell_colour[c + 1]
            shear_cells(t, table, scratch_of(t, table).cell_sum, run, 0, first, last, crew.rank, crew.size)
            wait_for(crew)


@wp.func
def bend(t: Any, table: Any, run: Settings, crew: Crew):
    """A sheet's bends and shears, in the crew's quickest way."""
    bend_sheet(t, table, run, crew)


@wp.func
def bend(t: StateFloat, table: Topology, run: Settings, crew: Crew):
    if in_warps(crew.size) and fits_strips(table):
        bend_in_strips(t, table, run, crew.rank, crew.size)
    elif shares_work(crew.size):
        bend_ahead(t, table, run, crew.rank, crew.size)
    else:
        bend_sheet(t, table, run, crew)


@wp.func
def bend(t: StateDouble, table: Topology, run: Settings, crew: Crew):
    if shares_work(crew.size):
        bend_ahead(t, table, run, crew.rank, crew.size)
    else:
        bend_sheet(t, table, run, crew)


@wp.func
def sweep_membrane(t: Any, table: Any, run: Settings, crew: Crew):
    """Shear and stretch in ``run.sweeps`` sweeps, grid lines last; in one plain pass `bend` has done the shears."""
    room = scratch_of(t, table)
    for sweep in range(wp.max(run.sweeps, 1)):
        if run.sweeps > 0:
            for c in range(table.cell_colour.shape[0] - 1):
                first = table.cell_colour[c]
                last = table.cell_colour[c + 1]
                shear_cells(t, table, room.cell_sum, run, sweep, first, last, crew.rank, crew.size)
                wait_for(crew)
        for c in range(table.triangle_colour.shape[0] - 1):
            first = table.triangle_colour[c]
            last = table.triangle_colour[c + 1]
            strain_triangles(t, table, room.triangle_sum, run, sweep, first, last, crew.rank, crew.size)
            wait_for(crew)
        for c in range(table.grid_line_kind.shape[0] - 1):
            first = table.grid_line_kind[c]
            last = table.grid_line_kind[c + 1]
            stretch_grid_lines(t, table, run, sweep, first, last, crew.rank, crew.size)
            wait_for(crew)
            if sweep + 1 < run.sweeps:
                start = table.grid_line[first]
                note_lengths(t, table, room.grid_line_goal, start, table.grid_line[last], crew.rank, crew.size)
                wait_for(crew)


@wp.func
def solve_cloth(t: Any, table: Any, run: Settings, crew: Crew):
    """One pass over all elastic constraints, or more over those in the cloth's plane."""
    for kind in range(PLAIN):
        colour = plain_colours(table, kind)
        for c in range(colour.shape[0] - 1):
            solve_plain(t, table, run, kind, colour[c], colour[c + 1], crew.rank, crew.size)
            wait_for(crew)
    bend(t, table, run, crew)
    sweep_membrane(t, table, run, crew)
