"""Taut grid lines: a share of an edge's force turns with the edge, so that a line bears three times the tension.

A taut grid line is a string. Its edges pull along the directions that they had before the line was solved, which moves
a transverse wave y to (1 - s) y, s = (omega dt)^2 = 4 T dt^2 / (rho h^2) for the shortest: stable up to s = 4/3. Where
the share `TURNED` of each force pulls along the direction that its edge has turned to by then, it is 1 - s + TURNED
s^2, a stabilised step of two stages as Runge-Kutta-Chebyshev methods have them (van der Houwen and Sommeijer 1980):
stable up to s = 1 / TURNED, with the pitch and damping of slow waves as they were. ``benchmarks/taut_line.py`` has
the other ways that were tried.

It is done where coordinates are doubles alone (`nuno.numbers.doubles`); where no edge is at s = 1 every bit is as if it
were not there.
"""

from typing import Any

import warp as wp

from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, choose, div, full_like, maximum, minimum, mul, sqrt, sub  # noqa: F401 (the operators)
from nuno.numbers.vec3 import dot, position, put_position, vec3
from nuno.state.cloth_state import StateDouble, StateDoubleLanes

TURNED = wp.constant(2.0 / 9.0)
"""The share of a taut edge's force that turns: a wave is never turned over by more than 1/8, up to s = 4.5."""
ONSET = wp.constant(0.5)
"""Half of the s from which on a share turns; it is all of `TURNED` from s = 5/4 on."""
RISE = wp.constant(8.0 * TURNED)
"""How fast the share rises from the onset on."""


@wp.func
def redirects_forces(t: Any):
    """Return True where forces turn with the edges of taut lines: where coordinates are doubles."""
    return False


@wp.func
def redirects_forces(t: StateDouble):
    return True


@wp.func
def redirects_forces(t: StateDoubleLanes):
    return True


@wp.func
def excess(pull: Any, light: Any, rest: Any):
    """The excess of an edge over the onset, by its multiplier, its ends' inverse masses and its rest length."""
    return light * pull * -1.0 - rest * ONSET


@wp.func
def turned(force: Any, edge: Any, light: Any, rest: Any):
    """The change of an edge's ``force`` as a share of it turns to the vector ``edge``: what it loses across it."""
    along = dot(force, edge) / (dot(edge, edge) + 1.0e-20)
    size = sqrt(dot(force, force))
    pull = choose(along, size, size * -1.0)
    share = minimum(maximum(excess(pull, light, rest) / rest * RISE, 0.0), TURNED)
    return (edge * along - force) * share


@wp.func
def turned_among(edge: Any, before: Any, force: Any, after: Any, wa: Any, wb: Any, rest: Any):
    """`turned` by the vector ``edge`` that the forces of the edge and of its neighbours are yet to move."""
    return turned(force, edge + (force - before) * wa - (after - force) * wb, wa + wb, rest)


@wp.func
def turn_grid_line(t: Any, table: Any, rest: Any, force_x: Any, force_y: Any, force_z: Any, first: int, last: int):
    """Turn a share of the forces of a grid line's taut edges, first to last, once these have moved its vertices."""
    i = corner(table.edge, first, 0, 2)
    a = position(t, i)
    wa = at(t.w, i)
    zero = full_like(wa, 0.0)
    before = vec3(zero, zero, zero)
    for k in range(first, last):
        j = corner(table.edge, k, 1, 2)
        b = position(t, j)
        wb = at(t.w, j)
        change = turned(vec3(at(force_x, k), at(force_y, k), at(force_z, k)), a - b, wa + wb, rest[k])
        put_position(t, i, a + (change - before) * wa)
        i = j
        a = b
        wa = wb
        before = change
    put_position(t, i, a - before * wa)
