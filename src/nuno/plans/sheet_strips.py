"""A sheet's bends and shears by warps on CUDA: each thread has a few vertices in its registers.

Elements of one colour share no vertex. Taken colour by colour, every vertex is read and written again for each, with
what tables say of each element, and all threads of the block wait in between. Here a warp takes lines of the grid, or
strips between two lines, through all colours that stay in them. A thread has six vertices of a line, or two of either
line of a strip, and hands on what lies between it and its neighbours. The order of the elements is that of the colours,
and where a material is the same everywhere nothing is read of tables but a number or two. The constraints are those of
`nuno.constraints`, on positions in registers.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, project_line, project_twist
from nuno.constraints.compliances import UNIFORM_BENDS, UNIFORM_SHEARS
from nuno.constraints.membrane import project_cell, shear_alpha
from nuno.numbers.crew import barrier
from nuno.numbers.element_access import at
from nuno.numbers.lanes import choose
from nuno.numbers.vec3 import position, put_position
from nuno.numbers.warp_lanes import LANES_OF_WARP, Lane, above, below, lane_of, quotient
from nuno.state.cloth_state import Settings, StateFloat, Topology

STRIP_COLUMNS, LINE_VERTICES = wp.constant(64), wp.constant(192)
"""Vertices of the longest strip and of the longest line that the 32 threads of a warp take together."""
BEND_KINDS, SHEAR_KINDS = wp.constant(UNIFORM_BENDS), wp.constant(UNIFORM_SHEARS)


@wp.func
def held(there: bool, w: float):
    """The inverse mass of an element's vertex; 0 where there is no such element, which then moves nothing.

    A branch would have to join vectors behind it, and the compiler keeps these in memory for that.
    """
    return wp.where(there, w, 0.0)


@wp.func
def twist_in_strip(xa: Any, xb: Any, xc: Any, xd: Any, wa: Any, wb: Any, wc: Any, wd: Any, scale: float, alpha: float):
    """`project_twist` under the arguments that `cell_strips` has."""
    xa, xb, xc, xd = project_twist(xa, xb, xc, xd, wa, wb, wc, wd, alpha)
    return xa, xb, xc, xd


@wp.func
def shear_in_strip(xa: Any, xb: Any, xc: Any, xd: Any, wa: Any, wb: Any, wc: Any, wd: Any, scale: float, alpha: float):
    """One pass of `project_cell`."""
    _gain, xa, xb, xc, xd = project_cell(xa, xb, xc, xd, wa, wb, wc, wd, scale, alpha, 0.0, 0.0, 0.0)
    return xa, xb, xc, xd


@wp.func
def cell_strips(
    t: Any, compliance: wp.array(dtype=float), scale: wp.array(dtype=float), which: wp.array(dtype=int),
    colour: wp.array(dtype=int), columns: int, rows: int, odd: int, same: float, varied: bool, rate: float, own: Lane,
    alpha_of: wp.Function, project: wp.Function,
):  # fmt: skip
    """The twists or shears of the cells in every other strip between two rows of a sheet: of two colours.

    Args:
        t: The world's state.
        compliance: The world's compliances.
        scale: What the compliance of each element is multiplied with.
        which: The place of each in ``compliance``.
        colour: Where the colours start.
        columns: Vertices in a row, `STRIP_COLUMNS` at most.
        rows: Rows of vertices.
        odd: Whether the first strip is that after row 1, instead of row 0.
        same: The compliance of all over dt^2, where they do not differ.
        varied: Whether they do; their scales never do.
        rate: 1 / dt^2 [1/s2].
        own: The thread among those of the block.
        alpha_of: The compliance over dt^2 by an element's compliance, its scale and ``rate``.
        project: The constraint: `twist_in_strip` or `shear_in_strip`.
    """
    across = columns - 1
    span = (columns + 1) / 2
    each = quotient(LANES_OF_WARP, span)
    strips = (rows - odd) / 2
    part = quotient(own.lane, span)
    q = own.lane - part * span
    size = scale[0]
    first = own.warp * each
    while first < strips:
        s = first + part
        on = part < each and s < strips
        a = (2 * wp.where(on, s, first) + odd) * columns + 2 * q
        two = on and 2 * q + 1 < columns
        linked = on and 2 * q + 2 < columns
        b = wp.where(two, a + 1, a)
        c = a + columns
        d = b + columns
        xa = position(t, a)
        xb = position(t, b)
        xc = position(t, c)
        xd = position(t, d)
        wa = at(t.w, a)
        wb = at(t.w, b)
        wc = at(t.w, c)
        wd = at(t.w, d)
        we = at(t.w, wp.where(linked, a + 2, a))
        wf = at(t.w, wp.where(linked, c + 2, a))
        alpha = float(same)
        beta = float(same)
        if varied:
            # where the cells of either colour start among all, and how many of them a strip has
            if two:
                k = colour[2 * odd] + s * ((across + 1) / 2) + q
                alpha = alpha_of(compliance[which[k]], size, rate)
            if linked:
                k = colour[2 * odd + 1] + s * (across / 2) + q
                beta = alpha_of(compliance[which[k]], size, rate)
        xa, xb, xc, xd = project(
            xa, xb, xc, xd, held(two, wa), held(two, wb), held(two, wc), held(two, wd), size, alpha
        )  # fmt: skip
        xe = above(own, xa, LANES_OF_WARP)
        xf = above(own, xc, LANES_OF_WARP)
        xb, xe, xd, xf = project(
            xb, xe, xd, xf, held(linked, wb), held(linked, we), held(linked, wd), held(linked, wf), size, beta
        )  # fmt: skip
        xe = below(own, xe, LANES_OF_WARP)
        xf = below(own, xf, LANES_OF_WARP)
        if on:
            # the thread before has moved the first vertices on
            put_position(t, a, choose(float(q), xe, xa))
            put_position(t, c, choose(float(q), xf, xc))
            if two:
                put_position(t, b, xb)
                put_position(t, d, xd)
        first += own.warps * each


@wp.func
def number_of_bend(table: Topology, upright: int, c: int, part: int, line: int, length: int, lines: int):
    """The place among all bends of the bend ``part`` of colour c of a line, along a row or ``upright``."""
    count = (length + 1 - wp.where(c == 0, 3, c)) / 3
    start = table.line_colour[3 * upright + c]
    return start + wp.where(upright != 0, part * lines + line, line * count + part)


@wp.func
def alpha_of_bend(t: Any, table: Topology, k: int, rate: float):
    """The compliance over dt^2 of the bend at a place among all."""
    return bend_alpha(t.bend_compliance[table.line_compliance[k]], table.line_scale[k], rate)


@wp.func
def bend_strips(t: Any, table: Topology, rows: int, upright: int, give: float, varied: bool, rate: float, own: Lane):
    """The bends along all rows, or where ``upright`` along all columns, of `LINE_VERTICES` vertices at most.

    ``give`` is the compliance of all, less their scale, where they do not differ. For the others see `cell_strips`.
    """
    columns = table.columns
    length = wp.where(upright != 0, rows, columns)
    lines = wp.where(upright != 0, columns, rows)
    along = wp.where(upright != 0, columns, 1)
    across = wp.where(upright != 0, 1, columns)
    span = (length + 5) / 6
    each = quotient(LANES_OF_WARP, span)
    side = quotient(own.lane, span)
    q = own.lane - side * span
    first = own.warp * each
    while first < lines:
        line = first + side
        on = side < each and line < lines
        mine = wp.where(on, line, first)
        here = mine * across + 6 * q * along
        left = wp.where(on, length - 6 * q, 0)
        i1 = here + wp.where(left > 1, along, 0)
        i2 = here + wp.where(left > 2, 2 * along, 0)
        i3 = here + wp.where(left > 3, 3 * along, 0)
        i4 = here + wp.where(left > 4, 4 * along, 0)
        i5 = here + wp.where(left > 5, 5 * along, 0)
        x0 = position(t, here)
        x1 = position(t, i1)
        x2 = position(t, i2)
        x3 = position(t, i3)
        x4 = position(t, i4)
        x5 = position(t, i5)
        w0 = at(t.w, here)
        w1 = at(t.w, i1)
        w2 = at(t.w, i2)
        w3 = at(t.w, i3)
        w4 = at(t.w, i4)
        w5 = at(t.w, i5)
        before = at(t.w, wp.where(q > 0, here - along, here))
        after = at(t.w, wp.where(left > 6, here + 6 * along, here))
        # lines at the rim are half as wide
        same = bend_alpha(give, table.line_scale[number_of_bend(table, upright, 1, 0, mine, length, lines)], rate)
        alpha0 = float(same)
        alpha1 = float(same)
        alpha2 = float(same)
        alpha3 = float(same)
        alpha4 = float(same)
        alpha5 = float(same)
        if varied:
            if left > 1 and q > 0:
                k = number_of_bend(table, upright, 0, 2 * q - 1, line, length, lines)
                alpha0 = alpha_of_bend(t, table, k, rate)
            if left > 2:
                k = number_of_bend(table, upright, 1, 2 * q, line, length, lines)
                alpha1 = alpha_of_bend(t, table, k, rate)
            if left > 3:
                k = number_of_bend(table, upright, 2, 2 * q, line, length, lines)
                alpha2 = alpha_of_bend(t, table, k, rate)
            if left > 4:
                k = number_of_bend(table, upright, 0, 2 * q, line, length, lines)
                alpha3 = alpha_of_bend(t, table, k, rate)
            if left > 5:
                k = number_of_bend(table, upright, 1, 2 * q + 1, line, length, lines)
                alpha4 = alpha_of_bend(t, table, k, rate)
            if left > 6:
                k = number_of_bend(table, upright, 2, 2 * q + 1, line, length, lines)
                alpha5 = alpha_of_bend(t, table, k, rate)
        # every third bend at a time: those around vertices 0 and 3, 1 and 4, 2 and 5
        xe = below(own, x5, LANES_OF_WARP)
        begun = q > 0 and left > 1
        xe, x0, x1 = project_line(xe, x0, x1, held(begun, before), held(begun, w0), held(begun, w1), alpha0)
        x2, x3, x4 = project_line(x2, x3, x4, held(left > 4, w2), held(left > 4, w3), held(left > 4, w4), alpha3)
        xe = above(own, xe, LANES_OF_WARP)
        # the next thread has moved the last vertex where it has a bend there
        x5 = choose(float(left - 7), xe, x5)
        x0, x1, x2 = project_line(x0, x1, x2, held(left > 2, w0), held(left > 2, w1), held(left > 2, w2), alpha1)
        x3, x4, x5 = project_line(x3, x4, x5, held(left > 5, w3), held(left > 5, w4), held(left > 5, w5), alpha4)
        x1, x2, x3 = project_line(x1, x2, x3, held(left > 3, w1), held(left > 3, w2), held(left > 3, w3), alpha2)
        xe = above(own, x0, LANES_OF_WARP)
        x4, x5, xe = project_line(x4, x5, xe, held(left > 6, w4), held(left > 6, w5), held(left > 6, after), alpha5)
        xe = below(own, xe, LANES_OF_WARP)
        x0 = choose(float(q), xe, x0)
        if left > 0:
            put_position(t, here, x0)
        if left > 1:
            put_position(t, i1, x1)
        if left > 2:
            put_position(t, i2, x2)
        if left > 3:
            put_position(t, i3, x3)
        if left > 4:
            put_position(t, i4, x4)
        if left > 5:
            put_position(t, i5, x5)
        first += own.warps * each


@wp.func
def fits_strips(table: Topology):
    """Return True if a cloth is a sheet whose strips a warp has threads for."""
    columns = table.columns
    return columns > 0 and columns <= STRIP_COLUMNS and table.particles <= LINE_VERTICES * columns


@wp.func
def twist_strips(t: Any, table: Topology, odd: int, same: float, rate: float, own: Lane):
    """`cell_strips` of twists."""
    cell_strips(
        t, t.bend_compliance, table.twist_scale, table.twist_compliance, table.twist_colour, table.columns,
        table.particles / table.columns, odd, same, t.bend_compliance.shape[0] > BEND_KINDS, rate, own, bend_alpha,
        twist_in_strip,
    )  # fmt: skip


@wp.func
def line_strips(t: Any, table: Topology, upright: int, rate: float, own: Lane):
    """`bend_strips` of the world's lines."""
    give = t.bend_compliance[table.line_compliance[table.line_colour[3 * upright]]]
    varied = t.bend_compliance.shape[0] > BEND_KINDS
    bend_strips(t, table, table.particles / table.columns, upright, give, varied, rate, own)


@wp.func
def shear_strips(t: Any, table: Topology, odd: int, same: float, rate: float, own: Lane):
    """`cell_strips` of shears."""
    cell_strips(
        t, t.shear_compliance, table.cell_scale, table.cell_compliance, table.cell_colour, table.columns,
        table.particles / table.columns, odd, same, t.shear_compliance.shape[0] > SHEAR_KINDS, rate, own, shear_alpha,
        shear_in_strip,
    )  # fmt: skip


@wp.func
def bend_in_strips(t: StateFloat, table: Topology, run: Settings, rank: int, size: int):
    """All twists, bends and shears of a sheet that `fits_strips`, as `nuno.plans.cloth_elastic.bend_sheet` has them."""
    own = lane_of(rank, size)
    rate = 1.0 / (run.dt * run.dt)
    # early, for it comes from far away
    twist = bend_alpha(t.bend_compliance[table.twist_compliance[0]], table.twist_scale[0], rate)
    shear = shear_alpha(t.shear_compliance[table.cell_compliance[0]], table.cell_scale[0], rate)
    halves = int(2)  # a variable, or Warp would unroll the loops
    for odd in range(halves):
        twist_strips(t, table, odd, twist, rate, own)
        barrier(size)
    for upright in range(halves):
        line_strips(t, table, upright, rate, own)
        barrier(size)
    if run.sweeps > 0:
        halves = 0
    for odd in range(halves):
        shear_strips(t, table, odd, shear, rate, own)
        barrier(size)
