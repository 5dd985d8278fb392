"""A sheet's bends and shears by the threads of a CUDA block: each thread reads its next element while it works on one.

As `nuno.plans.soft_prefetch` does for tetrahedra. What an element has in tables comes from far away; read only when it
is due, after all threads have waited for each other, it would take longer than the arithmetic.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, bend_line, bend_twist
from nuno.constraints.membrane import shear_alpha, shear_cell
from nuno.numbers.crew import barrier
from nuno.state.cloth_state import Settings, Topology


@wp.struct
class Element:
    """An element as the tables have it: its vertices, the factor of its compliance, and whose it is."""

    a: int
    b: int
    c: int
    d: int
    scale: float
    compliance: int


@wp.func
def read_line(table: Topology, k: int, last: int):
    """Line bend k, or an empty one from ``last`` on."""
    element = Element()
    if k < last:
        q = table.line[k]
        element.a = q[0]
        element.b = q[1]
        element.c = q[2]
        element.scale = table.line_scale[k]
        element.compliance = table.line_compliance[k]
    return element


@wp.func
def read_twist(table: Topology, k: int, last: int):
    """Cell twist k, or an empty one from ``last`` on."""
    element = Element()
    if k < last:
        q = table.twist[k]
        element.a = q[0]
        element.b = q[1]
        element.c = q[2]
        element.d = q[3]
        element.scale = table.twist_scale[k]
        element.compliance = table.twist_compliance[k]
    return element


@wp.func
def read_cell(table: Topology, k: int, last: int):
    """Cell shear k, or an empty one from ``last`` on."""
    element = Element()
    if k < last:
        q = table.cell[k]
        element.a = q[0]
        element.b = q[1]
        element.c = q[2]
        element.d = q[3]
        element.scale = table.cell_scale[k]
        element.compliance = table.cell_compliance[k]
    return element


@wp.func
def solve_line(t: Any, e: Element, compliance: float, rate: float):
    """A line bend of a compliance, which counts over dt^2."""
    bend_line(t, e.a, e.b, e.c, bend_alpha(compliance, e.scale, rate))


@wp.func
def solve_twist(t: Any, e: Element, compliance: float, rate: float):
    """A cell twist."""
    bend_twist(t, e.a, e.b, e.c, e.d, bend_alpha(compliance, e.scale, rate))


@wp.func
def solve_cell(t: Any, e: Element, compliance: float, rate: float):
    """One pass of a cell shear."""
    shear_cell(t, e.a, e.b, e.c, e.d, e.scale, shear_alpha(compliance, e.scale, rate), 0.0, 0.0, 0.0)


@wp.func
def solve_ahead(
    t: Any, table: Topology, colour: wp.array(dtype=int), compliances: wp.array(dtype=float), run: Settings, rank: int,
    size: int, read: wp.Function, solve: wp.Function,
):  # fmt: skip
    """All elements of a kind, colour by colour: these start where ``colour`` says; ``read`` and ``solve`` are its."""
    rate = 1.0 / (run.dt * run.dt)
    colours = colour.shape[0] - 1
    if colours > 0:
        first = colour[0]
        last = colour[1]
        ready = read(table, first + rank, last)
        compliance = compliances[ready.compliance]
        for c in range(colours):
            now = ready
            given = compliance
            start = last
            stop = colour[wp.min(c + 2, colours)]
            ready = read(table, start + rank, stop)
            if first + rank < last:
                solve(t, now, given, rate)
            for k in range(first + rank + size, last, size):
                element = read(table, k, last)
                solve(t, element, compliances[element.compliance], rate)
            compliance = compliances[ready.compliance]
            first = start
            last = stop
            barrier(size)


@wp.func
def bend_ahead(t: Any, table: Topology, run: Settings, rank: int, size: int):
    """A sheet's twists, bends and, where they are not swept, shears, as `nuno.plans.cloth_elastic.bend_sheet`."""
    solve_ahead(t, table, table.twist_colour, t.bend_compliance, run, rank, size, read_twist, solve_twist)
    solve_ahead(t, table, table.line_colour, t.bend_compliance, run, rank, size, read_line, solve_line)
    if run.sweeps == 0:
        solve_ahead(t, table, table.cell_colour, t.shear_compliance, run, rank, size, read_cell, solve_cell)
