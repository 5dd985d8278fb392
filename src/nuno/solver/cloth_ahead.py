"""A sheet's bends and shears by the threads of a CUDA block: each thread reads its next element while it works on one.

As `nuno.solver.soft_ahead` does for tetrahedra. What an element has in tables comes from far away; read only when it is
due, after all threads have waited for each other, it would take longer than the arithmetic.
"""

from typing import Any

import warp as wp

from nuno.solver.bending import bend_line, bend_twist
from nuno.solver.lanes import barrier, product
from nuno.solver.membrane import shear_cell
from nuno.solver.state import Settings, Topology


@wp.struct
class Element:
    """What the tables have of one element: its vertices, what its compliance is multiplied with, and whose it is."""

    a: int
    b: int
    c: int
    d: int
    scale: float
    soft: int


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
        element.soft = table.line_soft[k]
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
        element.soft = table.twist_soft[k]
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
        element.soft = table.cell_soft[k]
    return element


@wp.func
def bend_lines_ahead(t: Any, table: Topology, run: Settings, thread: int, threads: int):
    """All line bends, as `nuno.solver.frame.bend_lines` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.line_colour.shape[0] - 1
    if colours > 0:
        first = table.line_colour[0]
        last = table.line_colour[1]
        ready = read_line(table, first + thread, last)
        soft = t.bend_soft[ready.soft]
        for c in range(colours):
            now = ready
            alpha = product(soft, now.scale * rate)
            start = last
            stop = table.line_colour[wp.min(c + 2, colours)]
            ready = read_line(table, start + thread, stop)
            if first + thread < last:
                bend_line(t, now.a, now.b, now.c, alpha)
            for k in range(first + thread + threads, last, threads):
                element = read_line(table, k, last)
                alpha = product(t.bend_soft[element.soft], element.scale * rate)
                bend_line(t, element.a, element.b, element.c, alpha)
            soft = t.bend_soft[ready.soft]
            first = start
            last = stop
            barrier(threads)


@wp.func
def bend_twists_ahead(t: Any, table: Topology, run: Settings, thread: int, threads: int):
    """All cell twists, as `nuno.solver.frame.bend_twists` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.twist_colour.shape[0] - 1
    if colours > 0:
        first = table.twist_colour[0]
        last = table.twist_colour[1]
        ready = read_twist(table, first + thread, last)
        soft = t.bend_soft[ready.soft]
        for c in range(colours):
            now = ready
            alpha = product(soft, now.scale * rate)
            start = last
            stop = table.twist_colour[wp.min(c + 2, colours)]
            ready = read_twist(table, start + thread, stop)
            if first + thread < last:
                bend_twist(t, now.a, now.b, now.c, now.d, alpha)
            for k in range(first + thread + threads, last, threads):
                element = read_twist(table, k, last)
                alpha = product(t.bend_soft[element.soft], element.scale * rate)
                bend_twist(t, element.a, element.b, element.c, element.d, alpha)
            soft = t.bend_soft[ready.soft]
            first = start
            last = stop
            barrier(threads)


@wp.func
def shear_cells_ahead(t: Any, table: Topology, run: Settings, thread: int, threads: int):
    """All cell shears, as `nuno.solver.frame.shear_cells` colour by colour."""
    rate = 1.0 / (run.dt * run.dt)
    colours = table.cell_colour.shape[0] - 1
    if colours > 0:
        first = table.cell_colour[0]
        last = table.cell_colour[1]
        ready = read_cell(table, first + thread, last)
        soft = t.shear_soft[ready.soft]
        for c in range(colours):
            now = ready
            alpha = product(soft, now.scale * 4.0 * rate)
            start = last
            stop = table.cell_colour[wp.min(c + 2, colours)]
            ready = read_cell(table, start + thread, stop)
            if first + thread < last:
                shear_cell(t, now.a, now.b, now.c, now.d, now.scale, alpha, 0.0, 0.0, 0.0)
            for k in range(first + thread + threads, last, threads):
                element = read_cell(table, k, last)
                alpha = product(t.shear_soft[element.soft], element.scale * 4.0 * rate)
                shear_cell(t, element.a, element.b, element.c, element.d, element.scale, alpha, 0.0, 0.0, 0.0)
            soft = t.shear_soft[ready.soft]
            first = start
            last = stop
            barrier(threads)
