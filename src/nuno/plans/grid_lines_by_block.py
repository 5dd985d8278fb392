"""A grid line's stretch by all threads of a CUDA block: a thread an edge.

As in `nuno.plans.grid_lines_by_warp` all rows are freed of their neighbours at once, step by step, but the rows lie in
the block's own memory. Grid lines that follow one another are solved side by side: where one ends, its row is linked to
none.
"""

from typing import Any

import warp as wp

from nuno.constraints.membrane import (
    between_forces,
    edge_coupling,
    edge_diagonal,
    edge_direction,
    stretch_alpha,
    stretch_grid_line,
)
from nuno.constraints.taut_lines import excess, redirects_forces, turned_among
from nuno.numbers.crew import barrier, shares_work
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.tridiagonal import free_row
from nuno.numbers.vec3 import move, position, vec3
from nuno.numbers.warps import any_of_block
from nuno.plans.cloth_elastic import lengths_of, stretch_grid_lines
from nuno.state.cloth_state import Settings, Topology

EDGES = wp.constant(512)
"""Edges that a block takes at once, one for each of at most so many threads."""
six = wp.types.vector(length=6, dtype=float)


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ float rows[3072];
float* own = rows + 1536 * turn;
own[k] = a; own[512 + k] = b; own[1024 + k] = c;
__syncthreads();
#else
// as in nuno.numbers.warp_lanes, for threads that follow one another
const int next = (int)exchanged.data[0];
float* own = exchanged.data + 1 + 1536 * next;
exchanged.data[0] = next + 1;
own[k] = a; own[512 + k] = b; own[1024 + k] = c;
#endif
wp::vec_t<6, wp::float32> r;
for (int j = 0; j < 3; ++j) {
    r[j] = k >= shift ? own[512 * j + k - shift] : 0.f;
    r[3 + j] = k + shift < 512 ? own[512 * j + k + shift] : 0.f;
}
return r;
""")
def neighbours(exchanged: wp.array(dtype=float), turn: int, k: int, a: float, b: float, c: float, shift: int) -> six:
    """Hand three numbers to the other threads, and take those of threads k - shift and k + shift.

    Calls have 0 and 1 for ``turn`` alternately: what one writes is read until the next but one.
    """
    ...


@wp.func
def stretch_edges(
    t: Any, table: Topology, rest: wp.array(dtype=float), first: int, last: int, longest: int, rate: float, k: int,
    exchanged: wp.array(dtype=float),
):  # fmt: skip
    """Solve the edges first to last, those of whole grid lines of at most ``longest`` edges, and move their vertices.

    All threads k of the block come here; ``exchanged`` is as `nuno.numbers.warp_lanes.Lane` has it. For the other
    arguments see `nuno.plans.grid_lines_by_warp.stretch_double_grid_lines`.
    """
    mine = first + k < last
    e = wp.where(mine, first + k, first)
    a = corner(table.edge, e, 0, 2)
    b = corner(table.edge, e, 1, 2)
    wa = at(t.w, a)
    wb = at(t.w, b)
    direction, length, _inverse = edge_direction(position(t, a), position(t, b))
    # an edge goes on from where the one before ended
    linked = bool(False)
    if mine and k > 0:
        linked = corner(table.edge, e - 1, 1, 2) == a
    r = neighbours(exchanged, 0, k, direction.x, direction.y, direction.z, 1)
    coupling = wp.where(linked, edge_coupling(wa, vec3(r[0], r[1], r[2]), direction), 0.0)
    r = neighbours(exchanged, 1, k, coupling, 0.0, 0.0, 1)
    alpha = stretch_alpha(at(t.stretch_compliance, table.edge_compliance[e]), table.edge_scale[e], rate)
    s = 1.0 / edge_diagonal(wa, wb, alpha)
    low = coupling * s
    high = r[3] * s
    goal = at(rest, e)
    right = wp.where(mine, goal - length, 0.0) * s
    turn = int(0)
    shift = int(1)
    while shift < longest:
        r = neighbours(exchanged, turn, k, low, high, right, shift)
        low, high, right = free_row(low, high, right, r[0], r[1], r[2], r[3], r[4], r[5])
        turn = 1 - turn
        shift = shift * 2
    pull = direction * right
    r = neighbours(exchanged, turn, k, pull.x, pull.y, pull.z, 1)
    onto = vec3(r[3], r[4], r[5])
    follows = bool(False)
    if mine and k + 1 < last - first:
        follows = corner(table.edge, e + 1, 0, 2) == b
    if not follows:
        onto = onto * 0.0
    if redirects_forces(t):
        if any_of_block(excess(right, wa + wb, goal) > 0.0):
            before = vec3(r[0], r[1], r[2])
            if not linked:
                before = before * 0.0
            pull = pull + turned_among(position(t, a) - position(t, b), before, pull, onto, wa, wb, goal)
            r = neighbours(exchanged, 1 - turn, k, pull.x, pull.y, pull.z, 1)
            onto = vec3(r[3], r[4], r[5])
            if not follows:
                onto = onto * 0.0
    if mine:
        move(t, b, between_forces(wb, onto, pull))
        if not linked:
            move(t, a, wa * pull)


@wp.func
def stretch_grid_lines_of_block(
    t: Any, table: Topology, run: Settings, sweep: int, first: int, last: int, rank: int, size: int
):
    """The grid lines first to last: on CUDA by a block, as many at once as it has threads; else each by a thread."""
    if shares_work(size):
        lengths = lengths_of(t, table, sweep)
        rate = 1.0 / (run.dt * run.dt)
        k = int(first)
        while k < last:
            start = table.grid_line[k]
            longest = int(0)
            while k < last and table.grid_line[k + 1] - start <= size:
                longest = wp.max(longest, table.grid_line[k + 1] - table.grid_line[k])
                k += 1
            if longest > 0:
                stretch_edges(t, table, lengths, start, table.grid_line[k], longest, rate, rank, lengths)
            else:
                if rank == 0:
                    stretch_grid_line(
                        t, table, lengths, t.grid_line_gain, t.grid_line_pull, t.grid_line_inverse, start,
                        table.grid_line[k + 1], rate,
                    )  # fmt: skip
                k += 1
            barrier(size)
    else:
        stretch_grid_lines(t, table, run, sweep, first, last, rank, size)
