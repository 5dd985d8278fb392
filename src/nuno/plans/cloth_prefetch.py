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
def bend_lines_ahead(t: Any, table: Topology, run: Settings, rank: int, size: int):
    """All line bends, as `nuno.plans.cloth_elastic.bend_lines` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.line_colour.shape[0] - 1
    if colours > 0:
        first = table.line_colour[0]
        last = table.line_colour[1]
        ready = read_line(table, first + rank, last)
        compliance = t.bend_compliance[ready.compliance]
        for c in range(colours):
            now = ready
            alpha = bend_alpha(compliance, now.scale, rate)
            start = last
            stop = table.line_colour[wp.min(c + 2, colours)]
            ready = read_line(table, start + rank, stop)
            if first + rank < last:
                bend_line(t, now.a, now.b, now.c, alpha)
            for k in range(first + rank + size, last, size):
                element = read_line(table, k, last)
                alpha = bend_alpha(t.bend_compliance[element.compliance], element.scale, rate)
                bend_line(t, element.a, element.b, element.c, alpha)
            compliance = t.bend_compliance[ready.compliance]
            first = start
            last = stop
            barrier(size)


@wp.func
def bend_twists_ahead(t: Any, table: Topology, run: Settings, rank: int, size: int):
    """All cell twists, as `nuno.plans.cloth_elastic.bend_twists` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.twist_colour.shape[0] - 1
    if colours > 0:
        first = table.twist_colour[0]
        last = table.twist_colour[1]
        ready = read_twist(table, first + rank, last)
        compliance = t.bend_compliance[ready.compliance]
        for c in range(colours):
            now = ready
            alpha = bend_alpha(compliance, now.scale, rate)
            start = last
            stop = table.twist_colour[wp.min(c + 2, colours)]
            ready = read_twist(table, start + rank, stop)
            if first + rank < last:
                bend_twist(t, now.a, now.b, now.c, now.d, alpha)
            for k in range(first + rank + size, last, size):
                element = read_twist(table, k, last)
                alpha = bend_alpha(t.bend_compliance[element.compliance], element.scale, rate)
                bend_twist(t, element.a, element.b, element.c, element.d, alpha)
            compliance = t.bend_compliance[ready.compliance]
            first = start
            last = stop
            barrier(size)


@wp.func
def shear_cells_ahead(t: Any, table: Topology, run: Settings, rank: int, size: int):
    """All cell shears, as `nuno.plans.cloth_elastic.shear_cells` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.cell_colour.shape[0] - 1
    if colours > 0:
        first = table.cell_colour[0]
        last = table.cell_colour[1]
        ready = read_cell(table, first + rank, last)
        compliance = t.shear_compliance[ready.compliance]
        for c in range(colours):
            now = ready
            alpha = shear_alpha(compliance, now.scale, rate)
            start = last
            stop = table.cell_colour[wp.min(c + 2, colours)]
            ready = read_cell(table, start + rank, stop)
            if first + rank < last:
                shear_cell(t, now.a, now.b, now.c, now.d, now.scale, alpha, 0.0, 0.0, 0.0)
            for k in range(first + rank + size, last, size):
                element = read_cell(table, k, last)
                alpha = shear_alpha(t.shear_compliance[element.compliance], element.scale, rate)
                shear_cell(t, element.a, element.b, element.c, element.d, element.scale, alpha, 0.0, 0.0, 0.0)
            compliance = t.shear_compliance[ready.compliance]
            first = start
            last = stop
            barrier(size)
