"""Damping of a cloth's bends: it slows how fast they change, and moves nothing that is at rest.

Each bend c = sum k_i x_i has a viscous force beside its elastic one, tau times the rate of c over its compliance, tau
being `nuno.materials.Cloth.damping` [s]. It works on velocities before a substep's forces come in, so that a cloth at
rest under load stands where elasticity alone puts it. (XPBD's damping within the elastic update, Macklin et al. 2016,
counts what the substep has moved so far as motion, at rest too.) An update is implicit, one pass a substep:
dv_i = -w_i k_i gamma c' / (gamma sum w_i k_i^2 + alpha), c' the sum of k_i v_i, alpha the compliance over dt^2 and
gamma = tau / dt, with its denominator as in `nuno.constraints.bending.bend_stiffness`.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, bend_stiffness, total, twist_of
from nuno.numbers.block_group import wait_for
from nuno.numbers.element_access import at, corner, factor_like
from nuno.numbers.lanes import add, div, mul, product, sub  # noqa: F401
from nuno.numbers.vec3 import put_velocity, velocity
from nuno.state.cloth_state import DAMPING, Settings


@wp.func
def change_velocity(t: Any, i: Any, change: Any):
    """Change the velocity of particle i by a vector."""
    put_velocity(t, i, velocity(t, i) + change)


@wp.func
def damp_line(t: Any, a: Any, b: Any, c: Any, alpha: Any, gamma: Any):
    """Three vertices in a row: c' = v_0 - 2 v_1 + v_2."""
    rate = velocity(t, a) - velocity(t, b) * 2.0 + velocity(t, c)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    weight = gamma * (wa + wb * 4.0 + wc)
    s = gamma * -1.0 / bend_stiffness(weight, alpha)
    change_velocity(t, a, rate * (s * wa))
    change_velocity(t, b, rate * (s * wb * -2.0))
    change_velocity(t, c, rate * (s * wc))


@wp.func
def damp_twist(t: Any, a: Any, b: Any, c: Any, d: Any, alpha: Any, gamma: Any):
    """The corners of a cell: c' = v_0 - v_1 - v_2 + v_3."""
    rate = twist_of(velocity(t, a), velocity(t, b), velocity(t, c), velocity(t, d))
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    wd = at(t.w, d)
    weight = gamma * (wa + wb + wc + wd)
    s = gamma / bend_stiffness(weight, alpha)
    change_velocity(t, a, rate * (s * wa * -1.0))
    change_velocity(t, b, rate * (s * wb))
    change_velocity(t, c, rate * (s * wc))
    change_velocity(t, d, rate * (s * wd * -1.0))


@wp.func
def damp_patch(t: Any, table: Any, k: int, alpha: Any, gamma: Any):
    """A triangle and its neighbours, three times; vertices repeat as in `nuno.constraints.bending.bend_patch`."""
    i0 = table.patch[6 * k + 0]
    i1 = table.patch[6 * k + 1]
    i2 = table.patch[6 * k + 2]
    i3 = table.patch[6 * k + 3]
    i4 = table.patch[6 * k + 4]
    i5 = table.patch[6 * k + 5]
    parts = int(3)  # a variable: the loop stays a loop, and kernels compile sooner
    for j in range(parts):
        row = 18 * k + 6 * j
        v0 = velocity(t, i0)
        v1 = velocity(t, i1)
        v2 = velocity(t, i2)
        v3 = velocity(t, i3)
        v4 = velocity(t, i4)
        v5 = velocity(t, i5)
        rate = total(table.patch_weight, row, v0, v1, v2, v3, v4, v5)
        weight = gamma * 0.0
        corners = int(6)
        for q in range(corners):
            share = table.patch_weight[row + q]
            weight = weight + at(t.w, table.patch[6 * k + q]) * share * share
        s = gamma * -1.0 / bend_stiffness(gamma * weight, alpha)
        for q in range(corners):
            i = table.patch[6 * k + q]
            change_velocity(t, i, rate * (s * at(t.w, i) * table.patch_weight[row + q]))


@wp.func
def damp_bends(t: Any, table: Any, run: Settings, crew: Any):
    """The damping of all bends, colour by colour, by a crew that waits for itself."""
    rate = 1.0 / (run.dt * run.dt)
    damping = t.scalars[DAMPING] * (1.0 / run.dt)
    for colour in range(table.patch_colour.shape[0] - 1):
        for k in range(table.patch_colour[colour] + crew.rank, table.patch_colour[colour + 1], crew.size):
            alpha = product(at(t.bend_compliance, table.patch_compliance[k]), rate)
            damp_patch(t, table, k, alpha, factor_like(alpha, damping))
        wait_for(crew)
    for colour in range(table.twist_colour.shape[0] - 1):
        for k in range(table.twist_colour[colour] + crew.rank, table.twist_colour[colour + 1], crew.size):
            alpha = bend_alpha(at(t.bend_compliance, table.twist_compliance[k]), table.twist_scale[k], rate)
            a = corner(table.twist, k, 0, 4)
            b = corner(table.twist, k, 1, 4)
            c = corner(table.twist, k, 2, 4)
            d = corner(table.twist, k, 3, 4)
            damp_twist(t, a, b, c, d, alpha, factor_like(alpha, damping))
        wait_for(crew)
    for colour in range(table.line_colour.shape[0] - 1):
        for k in range(table.line_colour[colour] + crew.rank, table.line_colour[colour + 1], crew.size):
            alpha = bend_alpha(at(t.bend_compliance, table.line_compliance[k]), table.line_scale[k], rate)
            a = corner(table.line, k, 0, 3)
            b = corner(table.line, k, 1, 3)
            c = corner(table.line, k, 2, 3)
            damp_line(t, a, b, c, alpha, factor_like(alpha, damping))
        wait_for(crew)
