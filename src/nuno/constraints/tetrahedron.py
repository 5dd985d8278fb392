"""A neo-Hookean tetrahedron, elastic: both of its constraints at once, of one element, 16 worlds or 16 elements."""

from typing import Any

import warp as wp

from nuno.constraints.position_shifts import motion_of, shift_position
from nuno.numbers.element_access import factor_like
from nuno.numbers.lanes import (  # noqa: F401
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


@wp.func
def dot(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any):
    """The scalar product."""
    return fused(az, bz, fused(ay, by, ax * bx))


@wp.func
def cross(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any):
    """The vector product."""
    x = fused_subtract(az, by, ay * bz)
    y = fused_subtract(ax, bz, az * bx)
    z = fused_subtract(ay, bx, ax * by)
    return x, y, z


@wp.func
def add_dot(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any, c: Any):
    """The scalar product plus c."""
    return fused(az, bz, fused(ay, by, fused(ax, bx, c)))


@wp.func
def element_reply(
    ex: Any,
    ey: Any,
    ez: Any,
    fx: Any,
    fy: Any,
    fz: Any,
    gx: Any,
    gy: Any,
    gz: Any,
    wa: Any,
    wb: Any,
    wc: Any,
    wd: Any,
    m11: Any,
    m22: Any,
    m33: Any,
    m12: Any,
    m13: Any,
    m23: Any,
    inverse: Any,
    mu: Any,
    bulk: Any,
):
    """The work of `solve_tetrahedron` on edges e, f and g from the first corner to the others, for any element.

    Returns:
        The corners' steps -dx / (sigma w) of b, c and d, and dx / (sigma w) of a: x, y and z of a, b, c and d; sigma;
        J; and a number that is positive where the element is inside out or stretched beyond `STRETCHED`.
    """
    # the gradient of six times the volume by b, c and d
    nbx, nby, nbz = cross(fx, fy, fz, gx, gy, gz)
    ncx, ncy, ncz = cross(gx, gy, gz, ex, ey, ez)
    ndx, ndy, ndz = cross(ex, ey, ez, fx, fy, fz)
    one = full_like(ex, 1.0)
    j = dot(ex, ey, ez, nbx, nby, nbz) * inverse
    maa = m11 + m22 + m33 + (m12 + m13 + m23) * 2.0
    reply = fused(wd, factor_like(wd, m33), fused(wc, factor_like(wc, m22), fused(wb, factor_like(wb, m11), wa * maa)))
    most_stiff = CARRIED / (reply + 1.0e-30)
    mu = minimum(mu, most_stiff)
    bulk = minimum(bulk, most_stiff)
    pressure = (bulk * (j - one) - mu) * (1.0 / 6.0)
    k11 = mu * m11
    k22 = mu * m22
    k33 = mu * m33
    k12 = mu * m12
    k13 = mu * m13
    k23 = mu * m23
    kbx, kby, kbz = combine(k11, k12, k13, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    kcx, kcy, kcz = combine(k12, k22, k23, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    kdx, kdy, kdz = combine(k13, k23, k33, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    # |F|^2 mu v = e k: k is the gradient of half of it
    squares = add_dot(ex, ey, ez, kbx, kby, kbz, add_dot(fx, fy, fz, kcx, kcy, kcz, dot(gx, gy, gz, kdx, kdy, kdz)))
    # |F|^2 mu
    stretched = squares * inverse * 6.0
    kbx, kby, kbz, kcx, kcy, kcz, kdx, kdy, kdz = weakened(mu, stretched, kbx, kby, kbz, kcx, kcy, kcz, kdx, kdy, kdz)
    # W n: how the edges go where the corners follow the volume's gradient
    ux = wa * (nbx + ncx + ndx)
    uy = wa * (nby + ncy + ndy)
    uz = wa * (nbz + ncz + ndz)
    ubx = fused(wb, nbx, ux)
    uby = fused(wb, nby, uy)
    ubz = fused(wb, nbz, uz)
    ucx = fused(wc, ncx, ux)
    ucy = fused(wc, ncy, uy)
    ucz = fused(wc, ncz, uz)
    udx = fused(wd, ndx, ux)
    udy = fused(wd, ndy, uy)
    udz = fused(wd, ndz, uz)
    uk = add_dot(ubx, uby, ubz, kbx, kby, kbz, add_dot(ucx, ucy, ucz, kcx, kcy, kcz, dot(udx, udy, udz, kdx, kdy, kdz)))
    un = add_dot(ubx, uby, ubz, nbx, nby, nbz, add_dot(ucx, ucy, ucz, ncx, ncy, ncz, dot(udx, udy, udz, ndx, ndy, ndz)))
    shear = mu * reply
    sigma = one / fused(shear, fused(shear, full_like(one, SHARE_STIFF), full_like(one, SHARE)), one)
    h = bulk * inverse * (1.0 / 6.0)
    volume = sigma * h * un
    replied = fused(volume, fused(volume, full_like(one, VOLUME_STIFF), full_like(one, VOLUME_SHARE)), one)
    p = fused_subtract(h, sigma * fused(pressure, un, uk) / replied, pressure)
    rbx = fused(p, nbx, kbx)
    rby = fused(p, nby, kby)
    rbz = fused(p, nbz, kbz)
    rcx = fused(p, ncx, kcx)
    rcy = fused(p, ncy, kcy)
    rcz = fused(p, ncz, kcz)
    rdx = fused(p, ndx, kdx)
    rdy = fused(p, ndy, kdy)
    rdz = fused(p, ndz, kdz)
    rax = rbx + rcx + rdx
    ray = rby + rcy + rdy
    raz = rbz + rcz + rdz
    bad = maximum(0.0 - j, stretched - mu * STRETCHED)
    return rax, ray, raz, rbx, rby, rbz, rcx, rcy, rcz, rdx, rdy, rdz, sigma, j, bad


@wp.func
def solve_tetrahedron(
    t: Any,
    a: Any,
    b: Any,
    c: Any,
    d: Any,
    ax: Any,
    ay: Any,
    az: Any,
    bx: Any,
    by: Any,
    bz: Any,
    cx: Any,
    cy: Any,
    cz: Any,
    dx: Any,
    dy: Any,
    dz: Any,
    wa: Any,
    wb: Any,
    wc: Any,
    wd: Any,
    m11: Any,
    m22: Any,
    m33: Any,
    m12: Any,
    m13: Any,
    m23: Any,
    inverse: Any,
    mu: Any,
    bulk: Any,
    limit: float,
):
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
        a: The element's first vertex.
        b: Its second.
        c: Its third.
        d: Its fourth.
        ax: Where the first is, along x [m]; likewise the others.
        ay: y.
        az: z.
        bx: x.
        by: y.
        bz: z.
        cx: x.
        cy: y.
        cz: z.
        dx: x.
        dy: y.
        dz: z.
        wa: Inverse mass of the first [1/kg]; likewise the others.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        m11: Column 0 of the element's numbers (see `COLUMNS`), and so on.
        m22: Column 1.
        m33: Column 2.
        m12: Column 3.
        m13: Column 4.
        m23: Column 5.
        inverse: 1 / (6 v).
        mu: Shear modulus times dt^2 and the filled fraction.
        bulk: First Lame parameter plus shear modulus, times the same.
        limit: The farthest that such an element moves a corner [m].

    An element whose numbers are all zero moves nothing.

    Returns:
        Where the corners are then: x, y and z of the first, and so on [m].
    """
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    fx = cx - ax
    fy = cy - ay
    fz = cz - az
    gx = dx - ax
    gy = dy - ay
    gz = dz - az
    rax, ray, raz, rbx, rby, rbz, rcx, rcy, rcz, rdx, rdy, rdz, sigma, j, bad = element_reply(
        ex, ey, ez, fx, fy, fz, gx, gy, gz, wa, wb, wc, wd, m11, m22, m33, m12, m13, m23, inverse, mu, bulk
    )
    one = full_like(sigma, 1.0)
    ha = sigma * wa
    hb = sigma * wb
    hc = sigma * wc
    hd = sigma * wd
    if anywhere(bad):
        zero = full_like(one, 0.0)
        note_inverted(t.notes, choose(zero - j, one, zero))
        far = maximum(
            maximum(
                ha * ha * dot(rax, ray, raz, rax, ray, raz),
                hb * hb * dot(rbx, rby, rbz, rbx, rby, rbz),
            ),
            maximum(
                hc * hc * dot(rcx, rcy, rcz, rcx, rcy, rcz),
                hd * hd * dot(rdx, rdy, rdz, rdx, rdy, rdz),
            ),
        )
        farthest = full_like(one, limit)
        keep = choose(bad, farthest / maximum(sqrt(far), farthest), one)
        ha = ha * keep
        hb = hb * keep
        hc = hc * keep
        hd = hd * keep
        # where the forces work on the corners' motion so far, they give it no speed
        uax, uay, uaz = motion_of(t, a, ax, ay, az)
        ubx, uby, ubz = motion_of(t, b, bx, by, bz)
        ucx, ucy, ucz = motion_of(t, c, cx, cy, cz)
        udx, udy, udz = motion_of(t, d, dx, dy, dz)
        work = (
            dot(rax, ray, raz, uax, uay, uaz)
            - dot(rbx, rby, rbz, ubx, uby, ubz)
            - dot(rcx, rcy, rcz, ucx, ucy, ucz)
            - dot(rdx, rdy, rdz, udx, udy, udz)
        )
        shifted = choose(bad, choose(work, one, zero), zero)
        shift_position(t, a, rax, ray, raz, ha * shifted)
        shift_position(t, b, rbx, rby, rbz, zero - hb * shifted)
        shift_position(t, c, rcx, rcy, rcz, zero - hc * shifted)
        shift_position(t, d, rdx, rdy, rdz, zero - hd * shifted)
    ax = fused(ha, rax, ax)
    ay = fused(ha, ray, ay)
    az = fused(ha, raz, az)
    bx = fused_subtract(hb, rbx, bx)
    by = fused_subtract(hb, rby, by)
    bz = fused_subtract(hb, rbz, bz)
    cx = fused_subtract(hc, rcx, cx)
    cy = fused_subtract(hc, rcy, cy)
    cz = fused_subtract(hc, rcz, cz)
    dx = fused_subtract(hd, rdx, dx)
    dy = fused_subtract(hd, rdy, dy)
    dz = fused_subtract(hd, rdz, dz)
    return ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz


@wp.func
def loose_bulk(t: Any, mu: Any, bulk: Any):
    """The second modulus: a inverted body must rearrange, for which its volume may be too stiff."""
    return minimum(bulk, choose(factor_like(mu, t.notes[INVERTED]), mu * LOOSE, bulk))


@wp.func
def weakened(mu: Any, stretched: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any, cx: Any, cy: Any, cz: Any):
    """The shear's forces a, b and c times |F|^2 where that is below 1; ``stretched`` is |F|^2 mu."""
    if not anywhere(mu - stretched):
        return ax, ay, az, bx, by, bz, cx, cy, cz
    small = minimum(stretched / mu, 1.0)
    ax = ax * small
    ay = ay * small
    az = az * small
    bx = bx * small
    by = by * small
    bz = bz * small
    cx = cx * small
    cy = cy * small
    cz = cz * small
    return ax, ay, az, bx, by, bz, cx, cy, cz


@wp.func
def combine(a: Any, b: Any, c: Any, ex: Any, ey: Any, ez: Any, fx: Any, fy: Any, fz: Any, gx: Any, gy: Any, gz: Any):
    """The three edges' sum with the weights a, b and c."""
    x = fused(c, gx, fused(b, fx, a * ex))
    y = fused(c, gy, fused(b, fy, a * ey))
    z = fused(c, gz, fused(b, fz, a * ez))
    return x, y, z


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
