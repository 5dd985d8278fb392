"""The mean deformation of a voxel's five tetrahedra: elastic without the locking of each one by itself.

With a, b, c, d the corners of a voxel's inner tetrahedron and e, f, g, h those across from them, the mean of the five
deformation gradients, weighted by volume, is the deformation gradient of a tetrahedron of the inner one's rest shape
with the corners 2/3 a - 1/3 e, 2/3 b - 1/3 f, and so on. No two of them share a vertex, so that it is solved like any
other element, with the inverse masses 4/9 w_a + 1/9 w_e and so on.
"""

from typing import Any

import warp as wp

from nuno.constraints.tetrahedron import element_reply
from nuno.numbers.element_access import at
from nuno.numbers.fused_vec3 import fused_subtract_vec, fused_vec
from nuno.numbers.lanes import add, choose, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.vec3 import position, put_position
from nuno.topology.soft_topology import OWN_SHARE

OWN = wp.constant(OWN_SHARE)
MEAN = wp.constant(3.0 * (1.0 - OWN_SHARE))
"""Of the inner tetrahedron's stiffness, that of the mean: the voxel has three times its volume."""
INNER, OUTER = wp.constant(2.0 / 3.0), wp.constant(1.0 / 3.0)
"""The weights of a corner of the inner tetrahedron, and of that across from it."""


@wp.func
def mean_edge(a: Any, b: Any, e: Any, f: Any):
    """The edge from the first corner of the mean tetrahedron to the second."""
    return (b - a) * INNER - (f - e) * OUTER


@wp.func
def mean_weight(w: Any, across: Any):
    """The inverse mass of a corner of the mean tetrahedron."""
    return (w * INNER) * INNER + (across * OUTER) * OUTER


@wp.func
def solve_mean(
    t: Any, i: Any, j: Any, k: Any, m: Any, a: Any, b: Any, c: Any, d: Any, wa: Any, wb: Any, wc: Any, wd: Any,
    shape: Any, mu: Any, bulk: Any,
):  # fmt: skip
    """Solve the mean of a voxel's tetrahedra as `nuno.constraints.tetrahedron.solve_tetrahedron` does one of them.

    A mean that is inside out, or stretched beyond what an element keeps to, moves nothing: its tetrahedra right
    themselves.

    Args:
        t: The state; the vertices i to m are moved there.
        i: The vertex across from the inner element's first corner.
        j: From its second.
        k: From its third.
        m: From its fourth.
        a: The inner element's first corner [m], and so on.
        b: The second.
        c: The third.
        d: The fourth.
        wa: Its inverse mass [1/kg], and so on.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        shape: The inner element's rest shape.
        mu: The mean's shear modulus times dt^2 and the filled fraction; 0 where there is no mean.
        bulk: Its second modulus times the same.

    Returns:
        The inner element's corners then [m].
    """
    e = position(t, i)
    f = position(t, j)
    g = position(t, k)
    h = position(t, m)
    we = at(t.w, i)
    wf = at(t.w, j)
    wg = at(t.w, k)
    wh = at(t.w, m)
    ra, rb, rc, rd, sigma, _volume, bad = element_reply(
        mean_edge(a, b, e, f), mean_edge(a, c, e, g), mean_edge(a, d, e, h),
        mean_weight(wa, we), mean_weight(wb, wf), mean_weight(wc, wg), mean_weight(wd, wh), shape, mu, bulk,
    )  # fmt: skip
    sigma = choose(bad, 0.0, sigma)
    inner = sigma * INNER
    outer = sigma * OUTER
    put_position(t, i, fused_subtract_vec(outer * we, ra, e))
    put_position(t, j, fused_vec(outer * wf, rb, f))
    put_position(t, k, fused_vec(outer * wg, rc, g))
    put_position(t, m, fused_vec(outer * wh, rd, h))
    a = fused_vec(inner * wa, ra, a)
    b = fused_subtract_vec(inner * wb, rb, b)
    c = fused_subtract_vec(inner * wc, rc, c)
    return a, b, c, fused_subtract_vec(inner * wd, rd, d)
