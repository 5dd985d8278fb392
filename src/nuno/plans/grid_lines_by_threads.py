"""A grid line's stretch by a few neighbouring threads on CUDA, each with four or eight edges in its registers.

What `nuno.constraints.membrane.stretch_grid_line` does from one end to the other takes a step an edge, each waiting for
the one before. Here each thread eliminates its own rows but the last, as that does, with the last row of the thread
before as one more unknown (the partition method of Wang, "A parallel method for tridiagonal equations", 1981). What is
left, a row a thread, is solved by cyclic reduction (`nuno.numbers.tridiagonal`). The rows are the constraint's.
"""

from typing import Any

import warp as wp

from nuno.constraints.membrane import between_forces, edge_coupling, edge_diagonal, edge_direction, stretch_alpha
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, choose, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.tridiagonal import free_row
from nuno.numbers.vec3 import move, position, put_position, vec3
from nuno.numbers.warp_lanes import LANES_OF_WARP, Lane, above, below, from_above, from_below, quotient
from nuno.numbers.warps import WARP, sync_warp
from nuno.state.cloth_state import Topology

FEW_ROWS, MANY_ROWS = 4, 8
"""Edges of a thread: few where a warp's threads suffice, for a thread's rows wait for each other, and its registers do
not have room for many."""
SHORT_EDGES, GRID_LINE_EDGES = wp.constant(FEW_ROWS * WARP), wp.constant(MANY_ROWS * WARP)
"""Edges of the longest grid line that threads of one warp solve by few rows each, and by many."""

four, eight = (wp.types.vector(length=rows, dtype=float) for rows in (FEW_ROWS, MANY_ROWS))


@wp.func_native("return *const_cast<const volatile float*>(x.data + i);")
def again(x: wp.array(dtype=float), i: int) -> float:
    """Element i, read anew once it is needed again: there are not registers enough to keep it."""
    ...


def _solver(rows: int) -> Any:
    """Return the function that solves grid lines with ``rows`` edges a thread; see `stretch_grid_lines_by_threads`."""
    vector = {FEW_ROWS: four, MANY_ROWS: eight}[rows]
    end = rows - 1

    @wp.func(name=f"entry_of_{rows}")
    def entry(x: vector, y: vector, z: vector, r: int):
        """Vector r of those of a thread's rows."""
        return vec3(x[r], y[r], z[r])

    @wp.func(name=f"stretch_by_{rows}_rows")
    def stretch(
        t: Any, table: Topology, rest: wp.array(dtype=float), first: int, count: int, grid_lines: int, varied: bool,
        rate: float, own: Lane,
    ):  # fmt: skip
        """Solve the edges of each grid line of one direction, a thread ``rows`` of them, and move its vertices."""
        span = int(1)
        while span * rows < count:
            span = span * 2
        each = quotient(LANES_OF_WARP, span)
        side = quotient(own.lane, span)
        q = own.lane - side * span
        begin = own.warp * each
        while begin < grid_lines:
            mine = begin + side
            here = wp.where(mine < grid_lines, count, 0)
            start = first + wp.where(mine < grid_lines, mine, begin) * count
            head = corner(table.edge, start, 0, 2)
            step = corner(table.edge, start, 1, 2) - head
            length = at(rest, start)
            alpha = stretch_alpha(at(t.stretch_compliance, table.edge_compliance[start]), table.edge_scale[start], rate)
            # the rows of the thread, and the directions of their edges; of those that are none, y = 0
            x = vector()
            y = vector()
            z = vector()
            w = vector()
            diagonal = vector()
            right = vector()
            coupling = vector()
            i = head + wp.min(q * rows, count) * step
            a = position(t, i)
            wa = at(t.w, i)
            for r in range(rows):
                k = q * rows + r
                j = head + wp.min(k + 1, count) * step
                b = position(t, j)
                wb = at(t.w, j)
                if varied and k < here:
                    e = start + k
                    alpha = stretch_alpha(at(t.stretch_compliance, table.edge_compliance[e]), table.edge_scale[e], rate)
                    length = at(rest, e)
                direction, distance, _inverse = edge_direction(a, b)
                x[r] = direction.x
                y[r] = direction.y
                z[r] = direction.z
                w[r] = wa
                right[r] = wp.where(k < here, length - distance, 0.0)
                diagonal[r] = wp.where(k < here, edge_diagonal(wa, wb, alpha), 1.0)
                if r > 0:
                    coupling[r] = wp.where(k < here, edge_coupling(wa, entry(x, y, z, r - 1), direction), 0.0)
                a = b
                wa = wb
            # what links the first row to the thread before, and the last one to the next thread's first
            before = below(own, entry(x, y, z, end), span)
            linked = q > 0 and q * rows < here
            coupling[0] = wp.where(linked, edge_coupling(w[0], before, entry(x, y, z, 0)), 0.0)
            onward = from_above(own.exchanged, own.lane, coupling[0], 1, span)
            onward = wp.where(q == span - 1, 0.0, onward)
            # row r is now right + gain (row r + 1) + far (the last row of the thread before)
            gain = vector()
            far = vector()
            s = 1.0 / diagonal[0]
            right[0] = right[0] * s
            gain[0] = coupling[1] * s
            far[0] = coupling[0] * s
            for r in range(1, end):
                s = 1.0 / (diagonal[r] - coupling[r] * gain[r - 1])
                right[r] = (right[r] + coupling[r] * right[r - 1]) * s
                gain[r] = coupling[r + 1] * s
                far[r] = coupling[r] * far[r - 1] * s
            # the first row by the thread's last and the last before, which the thread before asks for
            p = right[end - 1]
            g = gain[end - 1]
            f = far[end - 1]
            for back in range(end - 1):
                r = end - 2 - back
                p = right[r] + gain[r] * p
                f = far[r] + gain[r] * f
                g = gain[r] * g
            p = from_above(own.exchanged, own.lane, p, 1, span)
            g = from_above(own.exchanged, own.lane, g, 1, span)
            f = from_above(own.exchanged, own.lane, f, 1, span)
            s = 1.0 / (diagonal[end] - coupling[end] * gain[end - 1] - onward * f)
            low = coupling[end] * far[end - 1] * s
            high = onward * g * s
            last = (right[end] + coupling[end] * right[end - 1] + onward * p) * s
            shift = int(1)
            while shift < span:
                low_before = from_below(own.exchanged, own.lane, low, shift, span)
                high_before = from_below(own.exchanged, own.lane, high, shift, span)
                last_before = from_below(own.exchanged, own.lane, last, shift, span)
                low_after = from_above(own.exchanged, own.lane, low, shift, span)
                high_after = from_above(own.exchanged, own.lane, high, shift, span)
                last_after = from_above(own.exchanged, own.lane, last, shift, span)
                low, high, last = free_row(
                    low, high, last, low_before, high_before, last_before, low_after, high_after, last_after
                )  # fmt: skip
                shift = shift * 2
            previous = from_below(own.exchanged, own.lane, last, 1, span)
            previous = wp.where(q == 0, 0.0, previous)
            right[end] = last
            for back in range(end):
                r = end - 1 - back
                right[r] = right[r] + gain[r] * right[r + 1] + far[r] * previous
            # all have read their vertices before the first exchange, so that nothing is overwritten too soon
            sync_warp()
            pull = entry(x, y, z, 0) * right[0]
            after = above(own, pull, span)
            after = choose(float(span - 1 - q), after, after * 0.0)
            if q == 0 and here > 0:
                move(t, head, w[0] * pull)
            for r in range(rows):
                onto = after
                wb = wa
                if r < end:
                    onto = entry(x, y, z, (r + 1) % rows) * right[(r + 1) % rows]
                    wb = w[(r + 1) % rows]
                if q * rows + r < here:
                    j = head + (q * rows + r + 1) * step
                    place = vec3(again(t.x, j), again(t.y, j), again(t.z, j))
                    put_position(t, j, place + between_forces(wb, onto, pull))
                pull = onto
            begin += own.warps * each

    return stretch


_BY_FEW, _BY_MANY = _solver(FEW_ROWS), _solver(MANY_ROWS)


@wp.func
def stretch_grid_lines_by_threads(
    t: Any, table: Topology, rest: wp.array(dtype=float), first: int, count: int, grid_lines: int, varied: bool,
    rate: float, own: Lane,
):  # fmt: skip
    """Solve the edges of each grid line of one direction at once and move its vertices.

    The grid lines are equally long, and their vertices equally far apart in memory.

    Args:
        t: The world's state, coordinates as floats.
        table: The edges, those of one grid line after those of another.
        rest: Their lengths [m].
        first: The first edge of the first grid line.
        count: Edges of a grid line, `GRID_LINE_EDGES` at most.
        grid_lines: How many grid lines.
        varied: Whether the edges of a grid line differ in compliance or length.
        rate: 1 / dt^2 [1/s2].
        own: The thread among those of the block.
    """
    if count <= SHORT_EDGES:
        _BY_FEW(t, table, rest, first, count, grid_lines, varied, rate, own)
    else:
        _BY_MANY(t, table, rest, first, count, grid_lines, varied, rate, own)
