"""A neo-Hookean tetrahedron, elastic: both of its constraints at once, of one element, 16 worlds or 16 elements."""

from typing import Any

import warp as wp

from nuno.constraints.position_shifts import motion_of, shift_position
from nuno.numbers.element_access import factor_like
from nuno.numbers.fused_vec3 import (
    combination,
    fused_add_dot,
    fused_cross,
    fused_dot,
    fused_subtract_vec,
    fused_vec,
)
from nuno.numbers.lanes import (  # noqa: F401 (add, div, mul, sub: the operators)
    add,
    anywhere,
    choose,
    div,
    full_like,
    fused,
    fused_subtract,
    lane,
    lane_max,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
)
from nuno.numbers.vec3 import LaneMat3, Mat3, mat3, vec3
from nuno.state.soft_state import INVERTED, SEEN

COLUMNS = 8
"""Numbers of an element: with B the inverse rest matrix and v the rest volume, v B B^T as 11, 22, 33, 12, 13, 23; then
1 / (6 v), and the filled fraction, which is negative in the inner element of a voxel that has a mean
(`nuno.constraints.mean_strain`)."""

SHARE, SHARE_STIFF = wp.constant(0.4), wp.constant(1.0)
VOLUME_SHARE, VOLUME_STIFF = wp.constant(0.5), wp.constant(0.5)
"""An element's reply T to its own shear, dt^2 mu v times the sum of w |grad N|^2 over its corners N, counts as
0.4 T + T^2, the reply Z to its change of volume as Z / 2 + Z^2 / 2. What the rest of the pass does not undo of an
element's own work is about half of it; and T is the sum over three directions, of which one is nearly all where a
corner is steep."""
CARRIED = wp.constant(0.5)
"""The largest reply to its own shear or change of volume that an element may have; its moduli are cut to that. At the
default substeps both together are 0.09 in a lattice of voxels. Elements that were let reply at 1.5 or more made
energy."""
LOOSE = wp.constant(3.0)
"""While some element of a world is inside out, the second modulus is at most 3 mu everywhere, which is that of a
Poisson ratio of 1/3: inverted bodies with stiffer volumes stay inverted. At 4 mu, 1 to 6 of 112 cubes of Poisson ratio
0.45 did, by the order of the elements."""
STRETCHED = wp.constant(12.0)
"""The sum of squares of the three stretches from which on an element is handled like one that is inside out: 3 at
rest, 12 at twice its size."""


@wp.struct
class Element:
    """An element's rest shape: with B the inverse rest matrix and v the rest volume."""

    m: Mat3  # v B B^T
    inverse: float  # 1 / (6 v)


@wp.struct
class LaneElement:
    """Sixteen elements' rest shapes."""

    m: LaneMat3
    inverse: lane


@wp.func
def element(m11: float, m22: float, m33: float, m12: float, m13: float, m23: float, inverse: float):
    """The rest shape of the first of an element's `COLUMNS`."""
    shape = Element()
    shape.m = mat3(vec3(m11, m12, m13), vec3(m12, m22, m23), vec3(m13, m23, m33))
    shape.inverse = inverse
    return shape


@wp.func
def element(m11: lane, m22: lane, m33: lane, m12: lane, m13: lane, m23: lane, inverse: lane):
    shape = LaneElement()
    shape.m = mat3(vec3(m11, m12, m13), vec3(m12, m22, m23), vec3(m13, m23, m33))
    shape.inverse = inverse
    return shape


@wp.func
def scaled_row(s: Any, row: Any):
    """A row of a matrix times a number, which may be lanes where the row is of floats."""
    return vec3(s * row.x, s * row.y, s * row.z)


@wp.func
def steepness(m: Any):
    """The first corner's own number: the sum of all those of the other three, |grad N_a|^2 v."""
    return m.x.x + m.y.y + m.z.z + (m.x.y + m.x.z + m.y.z) * 2.0


@wp.func
def element_reply(e: Any, f: Any, g: Any, wa: Any, wb: Any, wc: Any, wd: Any, shape: Any, mu: Any, bulk: Any):
    """The work of `solve_tetrahedron` on edges e, f and g from the first corner to the others, for any element.

    Returns:
        The corners' steps dx / (sigma w) of a, and -dx / (sigma w) of b, c and d; sigma; J; and a number that is
        positive where the element is inside out or stretched beyond `STRETCHED`.
    """
    # the gradient of six times the volume by b, c and d
    nb = fused_cross(f, g)
    nc = fused_cross(g, e)
    nd = fused_cross(e, f)
    one = full_like(e.x, 1.0)
    m = shape.m
    j = fused_dot(e, nb) * shape.inverse
    reply = wa * steepness(m)
    reply = fused(wb, factor_like(wb, m.x.x), reply)
    reply = fused(wd, factor_like(wd, m.z.z), fused(wc, factor_like(wc, m.y.y), reply))
    max_stiffness = CARRIED / (reply + 1.0e-30)
    mu = minimum(mu, max_stiffness)
    bulk = minimum(bulk, max_stiffness)
    pressure = (bulk * (j - one) - mu) * (1.0 / 6.0)
    kb = combination(scaled_row(mu, m.x), e, f, g)
    kc = combination(scaled_row(mu, m.y), e, f, g)
    kd = combination(scaled_row(mu, m.z), e, f, g)
    # |F|^2 mu v = e k: k is the gradient of half of it
    squares = fused_add_dot(e, kb, fused_add_dot(f, kc, fused_dot(g, kd)))
    # |F|^2 mu
    stretched = squares * shape.inverse * 6.0
    kb, kc, kd = weakened(mu, stretched, kb, kc, kd)
    # W n: how the edges go where the corners follow the volume's gradient
    u = wa * (nb + nc + nd)
    ub = fused_vec(wb, nb, u)
    uc = fused_vec(wc, nc, u)
    ud = fused_vec(wd, nd, u)
    uk = fused_add_dot(ub, kb, fused_add_dot(uc, kc, fused_dot(ud, kd)))
    un = fused_add_dot(ub, nb, fused_add_dot(uc, nc, fused_dot(ud, nd)))
    shear = mu * reply
    sigma = one / fused(shear, fused(shear, full_like(one, SHARE_STIFF), full_like(one, SHARE)), one)
    h = bulk * shape.inverse * (1.0 / 6.0)
    volume = sigma * h * un
    replied = fused(volume, fused(volume, full_like(one, VOLUME_STIFF), full_like(one, VOLUME_SHARE)), one)
    p = fused_subtract(h, sigma * fused(pressure, un, uk) / replied, pressure)
    rb = fused_vec(p, nb, kb)
    rc = fused_vec(p, nc, kc)
    rd = fused_vec(p, nd, kd)
    bad = maximum(0.0 - j, stretched - mu * STRETCHED)
    return rb + rc + rd, rb, rc, rd, sigma, j, bad


@wp.func
def solve_tetrahedron(
    t: Any, i: Any, j: Any, k: Any, m: Any, a: Any, b: Any, c: Any, d: Any, wa: Any, wb: Any, wc: Any, wd: Any,
    shape: Any, mu: Any, bulk: Any, limit: float,
):  # fmt: skip
    """Energy v (mu / 2 (|F|^2 - 3) + bulk / 2 (J - 1 - mu / bulk)^2), F the deformation gradient, J its determinant.

    The stable neo-Hookean energy (Smith et al. 2018) in the form of Macklin and Mueller 2021, whose two constraints
    push against each other at rest, which is what mu / bulk is for. So both are solved at once. With r the gradient of
    the whole energy by the corners, n that of the volume, and W the inverse masses, the corners
    move by

        dx = -sigma W (r + h s n),    s = -sigma n W r / (1 + sigma h n W n),    sigma = 1 / (1 + T):

    a Newton step for the volume, while the shear's stiffness stands in as a number T, the element's reply to its own
    shear. A number and not a matrix, for then forces are a sum of gradients that no motion of the whole changes: the
    momentum and the angular momentum stay. Replies are counted by the shares above, and limited by `CARRIED`.

    Where |F|^2 is below 1 (a cube at 58 % of its edges) the shear's forces are multiplied by it: else they
    would hold an element that is at a point there.

    An element that is inside out or stretched beyond `STRETCHED` moves no corner farther than ``limit``, and where its
    forces work with the corners' motion it moves them without making them faster: it is put right, but gives nobody
    energy.

    Args:
        t: The state.
        i: The element's first vertex.
        j: Its second.
        k: Its third.
        m: Its fourth.
        a: The first one's position [m]; likewise the others'.
        b: The second's.
        c: The third's.
        d: The fourth's.
        wa: Inverse mass of the first [1/kg]; likewise the others'.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        shape: The rest shape, an `Element` or sixteen.
        mu: Shear modulus times dt^2 and the filled fraction.
        bulk: First Lame parameter plus shear modulus, times the same.
        limit: The farthest that such an element moves a corner [m].

    An element whose numbers are all zero moves nothing.

    Returns:
        The corners' positions then [m].
    """
    ra, rb, rc, rd, sigma, volume, bad = element_reply(b - a, c - a, d - a, wa, wb, wc, wd, shape, mu, bulk)
    one = full_like(sigma, 1.0)
    ha = sigma * wa
    hb = sigma * wb
    hc = sigma * wc
    hd = sigma * wd
    if anywhere(bad):
        zero = full_like(one, 0.0)
        note_inverted(t.notes, choose(zero - volume, one, zero))
        far = maximum(
            maximum(ha * ha * fused_dot(ra, ra), hb * hb * fused_dot(rb, rb)),
            maximum(hc * hc * fused_dot(rc, rc), hd * hd * fused_dot(rd, rd)),
        )
        farthest = full_like(one, limit)
        keep = choose(bad, farthest / maximum(sqrt(far), farthest), one)
        ha = ha * keep
        hb = hb * keep
        hc = hc * keep
        hd = hd * keep
        # where the forces work on the corners' motion so far, they give it no speed
        work = fused_dot(ra, motion_of(t, i, a)) - fused_dot(rb, motion_of(t, j, b))
        work = work - fused_dot(rc, motion_of(t, k, c)) - fused_dot(rd, motion_of(t, m, d))
        shifted = choose(bad, choose(work, one, zero), zero)
        shift_position(t, i, ra, ha * shifted)
        shift_position(t, j, rb, zero - hb * shifted)
        shift_position(t, k, rc, zero - hc * shifted)
        shift_position(t, m, rd, zero - hd * shifted)
    a = fused_vec(ha, ra, a)
    b = fused_subtract_vec(hb, rb, b)
    c = fused_subtract_vec(hc, rc, c)
    return a, b, c, fused_subtract_vec(hd, rd, d)


@wp.func
def loose_bulk(t: Any, mu: Any, bulk: Any):
    """The second modulus: a inverted body must rearrange, for which its volume may be too stiff."""
    return minimum(bulk, choose(factor_like(mu, t.notes[INVERTED]), mu * LOOSE, bulk))


@wp.func
def weakened(mu: Any, stretched: Any, a: Any, b: Any, c: Any):
    """The shear's forces a, b and c times |F|^2 where that is below 1; ``stretched`` is |F|^2 mu."""
    if not anywhere(mu - stretched):
        return a, b, c
    small = minimum(stretched / mu, 1.0)
    return a * small, b * small, c * small


@wp.func
def note_inverted(notes: wp.array(dtype=float), inverted: float):
    """Note for the next substep that an element is inside out; all threads that write, write the same."""
    if inverted > 0.0:
        notes[SEEN] = inverted


@wp.func
def note_inverted(notes: wp.array(dtype=float), inverted: lane):
    notes[SEEN] = wp.max(notes[SEEN], lane_max(inverted))


@wp.func
def note_inverted(notes: wp.array(dtype=lane), inverted: lane):
    notes[SEEN] = maximum(notes[SEEN], inverted)
