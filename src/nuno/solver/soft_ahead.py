"""The tetrahedra by the threads of a CUDA block: each thread reads its next element while it works on one.

A colour of a body that fits a block has about as many elements as the block has threads, and all wait for each other
before the next colour. Read only then, an element's numbers would come from far away in every colour anew; the reading
takes longer than the arithmetic.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import barrier
from nuno.solver.soft_state import Tetrahedra
from nuno.solver.state import DAMPING, Settings
from nuno.solver.tetrahedron import solve_tetrahedron
from nuno.solver.viscosity import damp_tetrahedron


@wp.struct
class Element:
    """What the table has of one element: see `nuno.solver.tetrahedron.COLUMNS`."""

    tet: wp.vec4i
    m11: float
    m22: float
    m33: float
    m12: float
    m13: float
    m23: float
    inverse: float
    filled: float
    soft: int


@wp.func
def read_element(table: Tetrahedra, first: int, last: int):
    """Element ``first``, or an empty one from ``last`` on."""
    e = Element()
    if first < last:
        n = table.rows
        e.tet = table.tet[first]
        e.m11 = table.number[first]
        e.m22 = table.number[n + first]
        e.m33 = table.number[2 * n + first]
        e.m12 = table.number[3 * n + first]
        e.m13 = table.number[4 * n + first]
        e.m23 = table.number[5 * n + first]
        e.inverse = table.number[6 * n + first]
        e.filled = table.number[7 * n + first]
        e.soft = table.soft[first]
    return e


@wp.func
def solve_element(t: Any, e: Element, square: float, limit: float):
    """One element's elasticity."""
    mu = t.mu[e.soft] * square * e.filled
    bulk = t.bulk[e.soft] * square * e.filled
    solve_tetrahedron(
        t, e.tet[0], e.tet[1], e.tet[2], e.tet[3], e.m11, e.m22, e.m33, e.m12, e.m13, e.m23, e.inverse, mu, bulk, limit
    )


@wp.func
def damp_element(t: Any, e: Element, time: float):
    """One element's viscosity."""
    eta = t.mu[e.soft] * time * e.filled
    damp_tetrahedron(
        t, e.tet[0], e.tet[1], e.tet[2], e.tet[3], e.m11, e.m22, e.m33, e.m12, e.m13, e.m23, e.inverse, eta
    )


@wp.func
def elastic_ahead(t: Any, table: Tetrahedra, run: Settings, thread: int, threads: int):
    """One pass over the tetrahedra's elasticity, as `nuno.solver.soft_frame.elastic`."""
    square = run.dt * run.dt
    limit = wp.min(table.speed * run.dt, 0.5 * table.height)
    colours = table.colour.shape[0] - 1
    first = table.colour[0]
    last = table.colour[1]
    ready = read_element(table, first + thread, last)
    for c in range(colours):
        now = ready
        start = last
        stop = table.colour[wp.min(c + 2, colours)]
        ready = read_element(table, start + thread, stop)
        if first + thread < last:
            solve_element(t, now, square, limit)
        for k in range(first + thread + threads, last, threads):
            solve_element(t, read_element(table, k, last), square, limit)
        first = start
        last = stop
        barrier(threads)


@wp.func
def viscous_ahead(t: Any, table: Tetrahedra, run: Settings, thread: int, threads: int):
    """One pass over the tetrahedra's viscosity, as `nuno.solver.soft_frame.viscous`."""
    time = t.scalars[DAMPING] * (2.0 * run.dt * float(run.damped))
    colours = table.colour.shape[0] - 1
    first = table.colour[0]
    last = table.colour[1]
    ready = read_element(table, first + thread, last)
    for c in range(colours):
        now = ready
        start = last
        stop = table.colour[wp.min(c + 2, colours)]
        ready = read_element(table, start + thread, stop)
        if first + thread < last:
            damp_element(t, now, time)
        for k in range(first + thread + threads, last, threads):
            damp_element(t, read_element(table, k, last), time)
        first = start
        last = stop
        barrier(threads)
