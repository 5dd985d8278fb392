"""A grid line's stretch by the 32 threads of a warp on CUDA, where coordinates are doubles.

`nuno.plans.grid_lines_by_threads` reads coordinates again to save registers, in ways that are for floats. Here all rows
are freed of their neighbours at once by cyclic reduction (`nuno.numbers.tridiagonal`), a row a thread and step, with
the bits of `nuno.plans.grid_lines_by_block`.
"""

from typing import Any

import warp as wp

from nuno.constraints.membrane import between_forces, edge_coupling, edge_diagonal, edge_direction, stretch_alpha
from nuno.constraints.taut_lines import excess, turned_among
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.tridiagonal import free_row
from nuno.numbers.vec3 import move, position, vec3
from nuno.numbers.warp_lanes import SHUFFLES, Lane
from nuno.numbers.warps import any_of_warp
from nuno.state.cloth_state import Topology

PAIR_EDGES = wp.constant(32)
"""Edges of the longest grid lines of which a warp takes two side by side: each waits less for the other than for
itself."""
WARP_EDGES = wp.constant(256)
"""Edges of the longest grid line that a warp takes together: eight rows a thread."""

_NEIGHBOURS = """
constexpr int ROWS = sizeof(v) / sizeof(v[0]);
wp::vec_t<ROWS, wp::float32> s, r;
if (shift < 32) {
    for (int j = 0; j < ROWS; ++j) s[j] = shuffle(v[j], (lane DIRECTION shift) & 31);
    for (int j = 0; j < ROWS; ++j) {
        const int i = j DIRECTION 1;
        const bool within = lane DIRECTION shift >= 0 && lane DIRECTION shift < 32;
        r[j] = within ? s[j] : (i >= 0 && i < ROWS && !apart ? s[i >= 0 && i < ROWS ? i : j] : 0.f);
    }
} else {
    #pragma unroll
    for (int j = 0; j < ROWS; ++j) {
        r[j] = 0.f;
        #pragma unroll
        for (int i = 0; i < ROWS; ++i) if (32 * (i - j) == (DIRECTION shift)) r[j] = v[i];
    }
}
return r;
"""


_BEFORE, _AFTER = (SHUFFLES + _NEIGHBOURS.replace("DIRECTION", sign) for sign in "-+")
one, two, eight = (wp.types.vector(length=rows, dtype=float) for rows in (1, 2, 8))


@wp.func_native(_BEFORE)
def rows_before(exchanged: wp.array(dtype=float), lane: int, v: one, shift: int, apart: bool) -> one:
    """The values of the rows ``shift`` before; of two grid lines ``apart`` each thread has a row of either."""
    ...


@wp.func_native(_BEFORE)
def rows_before(exchanged: wp.array(dtype=float), lane: int, v: two, shift: int, apart: bool) -> two: ...


@wp.func_native(_BEFORE)
def rows_before(exchanged: wp.array(dtype=float), lane: int, v: eight, shift: int, apart: bool) -> eight: ...


@wp.func_native(_AFTER)
def rows_after(exchanged: wp.array(dtype=float), lane: int, v: one, shift: int, apart: bool) -> one:
    """The values of the rows ``shift`` after."""
    ...


@wp.func_native(_AFTER)
def rows_after(exchanged: wp.array(dtype=float), lane: int, v: two, shift: int, apart: bool) -> two: ...


@wp.func_native(_AFTER)
def rows_after(exchanged: wp.array(dtype=float), lane: int, v: eight, shift: int, apart: bool) -> eight: ...


def _solver(rows: int, apart: bool) -> Any:
    """Return the function that solves a grid line of at most 32 ``rows`` edges, or two of at most 32 that lie apart.

    Row k of the system is in thread k % 32; of two grid lines apart each thread has a row of either.
    """
    vector = {1: one, 2: two, 8: eight}[rows]
    steps = 5 if apart else (32 * rows).bit_length() - 1

    @wp.func(name=f"solve_{rows}_rows{'_apart' * apart}")
    def solve(
        t: Any, table: Topology, rest: wp.array(dtype=float), first: int, count: int, other: int, more: int,
        rate: float, own: Lane,
    ):  # fmt: skip
        """Solve the ``count`` edges of a grid line from ``first`` on, and where apart ``more`` from ``other`` on."""
        x = vector()
        y = vector()
        z = vector()
        right = vector()
        scale = vector()
        light = vector()
        goal = vector()
        for j in range(wp.static(rows)):
            k = own.lane + wp.static(0 if apart else 32) * j
            begin = wp.where(wp.static(apart) and j > 0, other, first)
            mine = k < wp.where(wp.static(apart) and j > 0, more, count)
            e = wp.where(mine, begin + k, first)
            a = corner(table.edge, e, 0, 2)
            b = corner(table.edge, e, 1, 2)
            direction, length, _inverse = edge_direction(position(t, a), position(t, b))
            light[j] = at(t.w, a) + at(t.w, b)
            x[j] = direction.x
            y[j] = direction.y
            z[j] = direction.z
            alpha = stretch_alpha(at(t.stretch_compliance, table.edge_compliance[e]), table.edge_scale[e], rate)
            goal[j] = at(rest, e)
            right[j] = wp.where(mine, goal[j] - length, 0.0)
            scale[j] = 1.0 / edge_diagonal(at(t.w, a), at(t.w, b), alpha)
        bx = rows_before(own.exchanged, own.lane, x, 1, wp.static(apart))
        by = rows_before(own.exchanged, own.lane, y, 1, wp.static(apart))
        bz = rows_before(own.exchanged, own.lane, z, 1, wp.static(apart))
        low = vector()
        for j in range(wp.static(rows)):
            k = own.lane + wp.static(0 if apart else 32) * j
            begin = wp.where(wp.static(apart) and j > 0, other, first)
            linked = k > 0 and k < wp.where(wp.static(apart) and j > 0, more, count)
            a = corner(table.edge, wp.where(linked, begin + k, first), 0, 2)
            coupling = edge_coupling(at(t.w, a), vec3(bx[j], by[j], bz[j]), vec3(x[j], y[j], z[j]))
            low[j] = wp.where(linked, coupling, 0.0)
        high = rows_after(own.exchanged, own.lane, low, 1, wp.static(apart))
        for j in range(wp.static(rows)):
            low[j] = low[j] * scale[j]
            high[j] = high[j] * scale[j]
            right[j] = right[j] * scale[j]
        # unrolled, so that what a shift asks for is known; steps that are too many find nothing to link
        for p in range(wp.static(steps)):
            low_before = rows_before(own.exchanged, own.lane, low, 1 << p, wp.static(apart))
            high_before = rows_before(own.exchanged, own.lane, high, 1 << p, wp.static(apart))
            right_before = rows_before(own.exchanged, own.lane, right, 1 << p, wp.static(apart))
            low_after = rows_after(own.exchanged, own.lane, low, 1 << p, wp.static(apart))
            high_after = rows_after(own.exchanged, own.lane, high, 1 << p, wp.static(apart))
            right_after = rows_after(own.exchanged, own.lane, right, 1 << p, wp.static(apart))
            for j in range(wp.static(rows)):
                freed_low, freed_high, freed_right = free_row(
                    low[j], high[j], right[j], low_before[j], high_before[j], right_before[j],
                    low_after[j], high_after[j], right_after[j],
                )  # fmt: skip
                low[j] = freed_low
                high[j] = freed_high
                right[j] = freed_right
        taut = float(0.0)
        for j in range(wp.static(rows)):
            taut = wp.max(taut, excess(right[j], light[j], goal[j]))
            x[j] = x[j] * right[j]
            y[j] = y[j] * right[j]
            z[j] = z[j] * right[j]
        nx = rows_after(own.exchanged, own.lane, x, 1, wp.static(apart))
        ny = rows_after(own.exchanged, own.lane, y, 1, wp.static(apart))
        nz = rows_after(own.exchanged, own.lane, z, 1, wp.static(apart))
        if any_of_warp(taut > 0.0):
            bx = rows_before(own.exchanged, own.lane, x, 1, wp.static(apart))
            by = rows_before(own.exchanged, own.lane, y, 1, wp.static(apart))
            bz = rows_before(own.exchanged, own.lane, z, 1, wp.static(apart))
            for j in range(wp.static(rows)):
                k = own.lane + wp.static(0 if apart else 32) * j
                begin = wp.where(wp.static(apart) and j > 0, other, first)
                if k < wp.where(wp.static(apart) and j > 0, more, count):
                    a = corner(table.edge, begin + k, 0, 2)
                    b = corner(table.edge, begin + k, 1, 2)
                    change = turned_among(
                        position(t, a) - position(t, b), vec3(bx[j], by[j], bz[j]), vec3(x[j], y[j], z[j]),
                        vec3(nx[j], ny[j], nz[j]), at(t.w, a), at(t.w, b), goal[j],
                    )  # fmt: skip
                    x[j] = x[j] + change.x
                    y[j] = y[j] + change.y
                    z[j] = z[j] + change.z
            nx = rows_after(own.exchanged, own.lane, x, 1, wp.static(apart))
            ny = rows_after(own.exchanged, own.lane, y, 1, wp.static(apart))
            nz = rows_after(own.exchanged, own.lane, z, 1, wp.static(apart))
        # all have read their ends before the first exchange, so that nothing is overwritten too soon
        for j in range(wp.static(rows)):
            k = own.lane + wp.static(0 if apart else 32) * j
            begin = wp.where(wp.static(apart) and j > 0, other, first)
            end = wp.where(wp.static(apart) and j > 0, more, count)
            if k < end:
                b = corner(table.edge, begin + k, 1, 2)
                pull = vec3(x[j], y[j], z[j])
                # rows behind the last pull nothing
                move(t, b, between_forces(at(t.w, b), vec3(nx[j], ny[j], nz[j]), pull))
                if k == 0:
                    a = corner(table.edge, begin, 0, 2)
                    move(t, a, at(t.w, a) * pull)

    return solve


_SHORT, _PAIR, _DOUBLE, _LONG = _solver(1, False), _solver(2, True), _solver(2, False), _solver(8, False)


@wp.func
def stretch_double_grid_lines(
    t: Any, table: Topology, rest: wp.array(dtype=float), first: int, last: int, start: int, stop: int, rate: float,
    own: Lane,
):  # fmt: skip
    """Solve the edges first to last of a grid line at once and move its vertices, or of two short ones side by side.

    Args:
        t: The world's state, coordinates as doubles.
        table: The edges.
        rest: Their lengths [m].
        first: The grid line's first edge.
        last: One past its last.
        start: The same of another grid line of at most 32 edges, which shares no vertex with the first, as short a one.
        stop: See ``start``, and the same where there is no other.
        rate: 1 / dt^2 [1/s2].
        own: The thread among those of the block.
    """
    count = last - first
    if stop > start:
        _PAIR(t, table, rest, first, count, start, stop - start, rate, own)
    elif count <= 32:
        _SHORT(t, table, rest, first, count, start, 0, rate, own)
    elif count <= 64:
        _DOUBLE(t, table, rest, first, count, start, 0, rate, own)
    else:
        _LONG(t, table, rest, first, count, start, 0, rate, own)
