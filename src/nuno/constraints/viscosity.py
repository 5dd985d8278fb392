"""A tetrahedron's viscosity: it damps how fast its shape changes, never how it moves or turns."""

from typing import Any

import warp as wp

from nuno.constraints.tetrahedron import steepness
from nuno.numbers.fused_vec3 import combination, fused_add_dot, fused_dot, fused_subtract_vec, fused_vec
from nuno.numbers.lanes import add, div, full_like, fused, maximum, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.vec3 import vec3

SHARE, MAX_REPLY = wp.constant(0.2), wp.constant(0.9)
"""An element's reply T to its own viscosity counts as 1 + 0.2 T: what the rest of the pass does not undo is half of
what the three directions of T have on average. Below 0.9 T an element would turn around what it should damp."""


@wp.func
def damp_tetrahedron(
    a: Any, b: Any, c: Any, d: Any, va: Any, vb: Any, vc: Any, vd: Any, wa: Any, wb: Any, wc: Any, wd: Any, shape: Any,
    eta: Any,
):  # fmt: skip
    """Viscous stress 2 mu tau E', E' the rate of Green's strain; forces v F (2 mu tau E') B^T on b, c and d.

    It works on velocities before a substep's forces come in, so that a body at rest under load stands where elasticity
    alone puts it. The stress is symmetric: momentum and angular momentum stay. An element whose numbers are all zero
    damps nothing.

    Args:
        a: The first vertex's position [m]; likewise the others'.
        b: The second's.
        c: The third's.
        d: The fourth's.
        va: The first one's velocity [m/s]; likewise the others'.
        vb: The second's.
        vc: The third's.
        vd: The fourth's.
        wa: Inverse mass of the first [1/kg]; likewise the others'.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        shape: The rest shape, a `nuno.constraints.tetrahedron.Element` or sixteen.
        eta: 2 mu tau dt times the filled fraction, tau the damping.

    Returns:
        The vertices' velocities then [m/s].
    """
    e = b - a
    f = c - a
    g = d - a
    h = vb - va
    i = vc - va
    j = vd - va
    # half the rate of the edges' scalar products, which is what E' is in the rest shape's edges
    ef = fused_add_dot(e, i, fused_dot(f, h)) * 0.5
    eg = fused_add_dot(e, j, fused_dot(g, h)) * 0.5
    fg = fused_add_dot(f, j, fused_dot(g, i)) * 0.5
    ge = vec3(fused_dot(e, h), ef, eg)
    gf = vec3(ef, fused_dot(f, i), fg)
    gg = vec3(eg, fg, fused_dot(g, j))
    m = shape.m
    q1 = vec3(fused_dot(ge, m.x), fused_dot(gf, m.x), fused_dot(gg, m.x))
    q2 = vec3(fused_dot(ge, m.y), fused_dot(gf, m.y), fused_dot(gg, m.y))
    q3 = vec3(fused_dot(ge, m.z), fused_dot(gf, m.z), fused_dot(gg, m.z))
    one = full_like(e.x, 1.0)
    # the trace of B^T S B, S the edges' scalar products, is |F|^2: a stretched element replies more
    stretched = (
        fused_dot(e, e) * m.x.x
        + fused_dot(f, f) * m.y.y
        + fused_dot(g, g) * m.z.z
        + (fused_dot(e, f) * m.x.y + fused_dot(e, g) * m.x.z + fused_dot(f, g) * m.y.z) * 2.0
    )
    per_volume = shape.inverse * 6.0
    reply = fused(wc, m.y.y, fused(wb, m.x.x, wa * steepness(m))) + wd * m.z.z
    reply = eta * reply * maximum(one, stretched * per_volume - 2.0)
    s = eta / maximum(one + reply * SHARE, reply * MAX_REPLY) * per_volume
    n12 = s * fused_dot(q1, m.y)
    n13 = s * fused_dot(q1, m.z)
    n23 = s * fused_dot(q2, m.z)
    rb = combination(vec3(s * fused_dot(q1, m.x), n12, n13), e, f, g)
    rc = combination(vec3(n12, s * fused_dot(q2, m.y), n23), e, f, g)
    rd = combination(vec3(n13, n23, s * fused_dot(q3, m.z)), e, f, g)
    va = fused_vec(wa, rb + rc + rd, va)
    vb = fused_subtract_vec(wb, rb, vb)
    vc = fused_subtract_vec(wc, rc, vc)
    return va, vb, vc, fused_subtract_vec(wd, rd, vd)
