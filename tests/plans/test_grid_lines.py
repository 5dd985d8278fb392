"""A grid line's stretch as CUDA's threads, warps and blocks solve it, beside one thread from end to end."""

from typing import Any

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.constraints.membrane import stretch_grid_line
from nuno.numbers.doubles import float64
from nuno.numbers.warps import WARP
from nuno.plans.grid_lines_by_block import EDGES, stretch_edges
from nuno.plans.grid_lines_by_threads import stretch_grid_lines_by_threads
from nuno.plans.grid_lines_by_warp import stretch_double_grid_lines
from nuno.state.cloth_state import StateDouble, StateFloat, Topology
from played_lanes import SUBSTEP, keep_moved, launch, played_lane, put_back, wrinkled_sheet

PASSES = 18
"""Exchanges that follow each other: of the first rows, of up to nine steps of the reduction, of the pulls
before and after they turn."""
DIGITS = 2.0e-6
"""Of the longest move, what another order of elimination may round otherwise: rows are floats, of up to 256 a line."""


@wp.func
def solve_lines(s: Any, table: Topology, first: int, last: int, rate: float):
    """Solve grid lines one after the other, each from end to end."""
    for k in range(first, last):
        start = table.grid_line[k]
        stretch_grid_line(
            s, table, table.edge_rest, s.grid_line_gain, s.grid_line_pull, s.grid_line_inverse, start,
            table.grid_line[k + 1], rate,
        )  # fmt: skip


@wp.kernel(enable_backward=False)
def _plain(
    s: StateFloat, table: Topology, start: wp.array(dtype=float), out: wp.array(dtype=float),
    exchanged: wp.array(dtype=float), first: int, last: int, rate: float, varied: bool,
):  # fmt: skip
    put_back(s, table.particles, start)
    solve_lines(s, table, first, last, rate)
    keep_moved(s, table.particles, start, out)


@wp.kernel(enable_backward=False)
def _plain_doubles(
    s: StateDouble, table: Topology, start: wp.array(dtype=float64), out: wp.array(dtype=float64),
    exchanged: wp.array(dtype=float), first: int, last: int, rate: float, varied: bool,
):  # fmt: skip
    put_back(s, table.particles, start)
    solve_lines(s, table, first, last, rate)
    keep_moved(s, table.particles, start, out)


@wp.kernel(enable_backward=False)
def _by_threads(
    s: StateFloat, table: Topology, start: wp.array(dtype=float), out: wp.array(dtype=float),
    exchanged: wp.array(dtype=float), first: int, last: int, rate: float, varied: bool,
):  # fmt: skip
    n = table.particles
    edge = table.grid_line[first]
    count = table.grid_line[first + 1] - edge
    passes = int(PASSES)
    lanes = int(WARP)
    for k in range(passes):
        for lane in range(lanes):
            put_back(s, n, start)
            exchanged[0] = 0.0
            stretch_grid_lines_by_threads(
                s, table, table.edge_rest, edge, count, last - first, varied, rate, played_lane(lane, exchanged)
            )
            if k == passes - 1:
                keep_moved(s, n, start, out)


@wp.kernel(enable_backward=False)
def _by_warp(
    s: StateDouble, table: Topology, start: wp.array(dtype=float64), out: wp.array(dtype=float64),
    exchanged: wp.array(dtype=float), first: int, last: int, rate: float, pairs: bool,
):  # fmt: skip
    """A grid line at a time, or two."""
    n = table.particles
    passes = int(PASSES)
    lanes = int(WARP)
    line = int(first)
    while line < last:
        begin = table.grid_line[line]
        end = table.grid_line[line + 1]
        other = int(end)
        stop = int(end)
        if pairs and line + 1 < last:
            stop = table.grid_line[line + 2]
        for k in range(passes):
            for lane in range(lanes):
                put_back(s, n, start)
                exchanged[0] = 0.0
                own = played_lane(lane, exchanged)
                stretch_double_grid_lines(s, table, table.edge_rest, begin, end, other, stop, rate, own)
                if k == passes - 1:
                    keep_moved(s, n, start, out)
        line += wp.where(stop > other, 2, 1)


@wp.kernel(enable_backward=False)
def _by_block(
    s: StateDouble, table: Topology, start: wp.array(dtype=float64), out: wp.array(dtype=float64),
    exchanged: wp.array(dtype=float), first: int, last: int, rate: float, varied: bool,
):  # fmt: skip
    """As many grid lines at once as a block has threads for."""
    n = table.particles
    passes = int(PASSES)
    threads = int(EDGES)
    longest = table.grid_line[first + 1] - table.grid_line[first]
    line = int(first)
    while line < last:
        stop = wp.min(last, line + threads / longest)
        begin = table.grid_line[line]
        end = table.grid_line[stop]
        for k in range(passes):
            for thread in range(threads):
                put_back(s, n, start)
                exchanged[0] = 0.0
                stretch_edges(s, table, table.edge_rest, begin, end, longest, rate, thread, exchanged)
                if k == passes - 1:
                    keep_moved(s, n, start, out)
        line = int(stop)


def solved(method, plain, cells, differ, doubles, flag=None, strain=0.0):
    """Return the moves by a method and by one thread, of grid lines along the rows and then along the columns.

    A ``strain`` has most edges so taut that their forces turn (`nuno.constraints.taut_lines`).
    """
    number = np.random.default_rng(5)
    count = cells[0] * cells[1]
    stiffness = number.uniform(100.0, 5000.0, count) if differ else 800.0
    stiffness = 0.1 * stiffness if strain else stiffness
    state, table, start = wrinkled_sheet(cells, nuno.Cloth(stretch_stiffness=stiffness), doubles=doubles)
    start *= 1.0 + strain
    kinds, rate = table.grid_line_kind.numpy(), 1.0 / SUBSTEP**2
    for first, last in ((kinds[0], kinds[1]), (kinds[1], kinds[2])):
        numbers = int(first), int(last), rate, differ if flag is None else flag
        found, expected = (launch(kernel, state, table, start, *numbers) - start for kernel in (method, plain))
        assert np.abs(expected).max() > 1e-4
        yield found, expected


@pytest.mark.long
@pytest.mark.parametrize("differ", [False, True], ids=["uniform", "each its own"])
@pytest.mark.parametrize("cells", [(5, 8), (9, 33), (64, 6), (200, 4)])
def test_four_and_eight_edges_a_thread_are_solved_exactly(cells, differ):
    """Direct solution: elimination from end to end, to the digits of a float; coordinates, 0.5 m, round to 6e-8 m."""
    for found, expected in solved(_by_threads, _plain, cells, differ, False):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1.2e-7 + DIGITS * np.abs(expected).max())


@pytest.mark.parametrize("pairs", [False, True])
@pytest.mark.parametrize("cells", [(5, 8), (31, 12)])
def test_a_warp_solves_short_grid_lines_alone_and_two_at_a_time(cells, pairs):
    """Direct solution, coordinates as doubles."""
    for found, expected in solved(_by_warp, _plain_doubles, cells, True, True, pairs):
        np.testing.assert_allclose(found, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


@pytest.mark.parametrize("cells", [(40, 5), (64, 4), (200, 4)])
def test_a_warp_solves_long_grid_lines(cells):
    """Direct solution, with two and with eight rows a thread."""
    for found, expected in solved(_by_warp, _plain_doubles, cells, True, True, False):
        np.testing.assert_allclose(found, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


@pytest.mark.parametrize("cells", [(5, 8), (40, 7), (300, 1)])
def test_a_block_solves_grid_lines_side_by_side(cells):
    """Direct solution, of as many as have 512 edges together."""
    for found, expected in solved(_by_block, _plain_doubles, cells, True, True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


@pytest.mark.parametrize(
    ("cells", "pairs"), [((5, 8), False), ((5, 8), True), pytest.param((40, 5), False, marks=pytest.mark.long)]
)
def test_taut_lines_turn_alike(cells, pairs):
    """The same as one thread, where forces turn: it takes places that have moved, the others what moves them."""
    for method in (_by_warp, _by_block):
        for found, expected in solved(method, _plain_doubles, cells, True, True, pairs, 0.8):
            np.testing.assert_allclose(found, expected, rtol=0, atol=DIGITS * np.abs(expected).max())


@pytest.mark.parametrize("strain", [0.0, 0.8])
@pytest.mark.parametrize("cells", [(5, 8), (31, 12), (40, 5)])
def test_a_warp_and_a_block_give_the_same_bits(cells, strain):
    """Promise: a world by a block and one by a group of blocks do the same arithmetic, row by row."""
    warp = [found for found, _ in solved(_by_warp, _plain_doubles, cells, True, True, False, strain)]
    block = [found for found, _ in solved(_by_block, _plain_doubles, cells, True, True, None, strain)]
    for one, other in zip(warp, block, strict=True):
        np.testing.assert_array_equal(one, other)
