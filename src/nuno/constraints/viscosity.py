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
    ab = b - a
    ac = c - a
    ad = d - a
    vab = vb - va
    vac = vc - va
    vad = vd - va
    # half the rate of the edges' scalar products, which is what E' is in the rest shape's edges
    g12 = fused_add_dot(ab, vac, fused_dot(ac, vab)) * 0.5
    g13 = fused_add_dot(ab, vad, fused_dot(ad, vab)) * 0.5
    g23 = fused_add_dot(ac, vad, fused_dot(ad, vac)) * 0.5
    g1 = vec3(fused_dot(ab, vab), g12, g13)
    g2 = vec3(g12, fused_dot(ac, vac), g23)
    g3 = vec3(g13, g23, fused_dot(ad, vad))
    m = shape.m
    q1 = vec3(fused_dot(g1, m.x), fused_dot(g2, m.x), fused_dot(g3, m.x))
    q2 = vec3(fused_dot(g1, m.y), fused_dot(g2, m.y), fused_dot(g3, m.y))
    q3 = vec3(fused_dot(g1, m.z), fused_dot(g2, m.z), fused_dot(g3, m.z))
    one = full_like(ab.x, 1.0)
    # the trace of B^T S B, S the edges' scalar products, is |F|^2: a stretched element replies more
    stretched = (
        fused_dot(ab, ab) * m.x.x
        + fused_dot(ac, ac) * m.y.y
        + fused_dot(ad, ad) * m.z.z
        + (fused_dot(ab, ac) * m.x.y + fused_dot(ab, ad) * m.x.z + fused_dot(ac, ad) * m.y.z) * 2.0
    )
    per_volume = shape.inverse * 6.0
    reply = fused(wc, m.y.y, fused(wb, m.x.x, wa * steepness(m))) + wd * m.z.z
    reply = eta * reply * maximum(one, stretched * per_volume - 2.0)
    s = eta / maximum(one + reply * SHARE, reply * MAX_REPLY) * per_volume
    n12 = s * fused_dot(q1, m.y)
    n13 = s * fused_dot(q1, m.z)
    n23 = s * fused_dot(q2, m.z)
    rb = combination(vec3(s * fused_dot(q1, m.x), n12, n13), ab, ac, ad)
    rc = combination(vec3(n12, s * fused_dot(q2, m.y), n23), ab, ac, ad)
    rd = combination(vec3(n13, n23, s * fused_dot(q3, m.z)), ab, ac, ad)
    va = fused_vec(wa, rb + rc + rd, va)
    vb = fused_subtract_vec(wb, rb, vb)
    vc = fused_subtract_vec(wc, rc, vc)
    return va, vb, vc, fused_subtract_vec(wd, rd, vd)
