"""A cloth's edges and triangles against what is sharp or small: edges and corners of boxes, rims, small balls.

A convex shape's distance along a straight edge is convex. Where it falls from both ends inwards, its lowest point is
between them, and found by the tangents at two points on either side: they cross under it; at balls and capsules there
is a formula. Inside of a triangle it is the shape's outermost point against the triangle's plane that touches. Point
and normal are those where the substep began, when nothing crossed, and the whole motion of the substep, relative to
the shape, counts against them, so that what was pressed through within the substep is put back
(`nuno.contact.sharp_pushes`).

All that is found here is of the substep's start, and so does not depend on which element is pushed first.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import BOX, CAPSULE, CYLINDER, SPHERE, distance_solid
from nuno.contact.sharp_pushes import PATIENCE, SLANT, square_of
from nuno.contact.sharp_shapes import WAKE, sharp_features
from nuno.solver.lanes import (  # noqa: F401
    add,
    anywhere,
    choose,
    fill,
    largest,
    least,
    minus,
    most,
    mul,
    over,
    root,
    size_of,
    sub,
    times,
)

STEPS = wp.constant(6)
"""Tangents looked at between two ends: the distance of a 40 mm edge from what is round by 4 mm, or from the edge of a
box, is then found within 0.006 mm, of twenty thousand that were tried."""

ROUGH = wp.constant(1.0e-5)
"""[m] What is nearer to an edge than this does not say by where it is which way is out: rounding moves it."""


@wp.func
def past_box_edge(ax: Any, ay: Any, az: Any, lx: Any, ly: Any, lz: Any, part: Any, a: Any, b: Any, c: Any):
    """The part of a way l from a point on that is nearest to an edge of a box, the one next to its ``part``."""
    zero = fill(ax, 0.0)
    one = fill(ax, 1.0)
    x = ax + times(part, lx)
    y = ay + times(part, ly)
    z = az + times(part, lz)
    qx = size_of(x) - a
    qy = size_of(y) - b
    qz = size_of(z) - c
    # along the edge nothing counts
    kx = choose(least(qy, qz) - qx, zero, one)
    kz = choose(times(kx, qy - qz), zero, one)
    ky = fill(ax, 2.0) - kx - kz
    vx = times(kx, lx)
    vy = times(ky, ly)
    vz = times(kz, lz)
    ux = ax - choose(x, a, -a)
    uy = ay - choose(y, b, -b)
    uz = az - choose(z, c, -c)
    return -over(times(ux, vx) + times(uy, vy) + times(uz, vz), square_of(vx, vy, vz) + fill(ax, 1.0e-20))


@wp.func
def past_axis(ax: Any, ay: Any, az: Any, lx: Any, ly: Any, lz: Any, half: Any):
    """The part of a way l from a point on that is nearest to a ball's middle, or to a capsule's axis along z."""
    tiny = -fill(ax, 1.0e-12)
    across = times(ax, lx) + times(ay, ly)
    flat = times(lx, lx) + times(ly, ly)
    part = over(across, tiny - flat)
    z = az + times(part, lz)
    # beyond the axis it is nearest to its end
    end = az - choose(z, half, -half)
    return choose(size_of(z) - half, over(across + times(end, lz), tiny - (flat + times(lz, lz))), part)


@wp.func
def across_edge(
    kind: int, x: Any, y: Any, z: Any, lx: Any, ly: Any, lz: Any, gap: Any, nx: Any, ny: Any, nz: Any, a: Any, b: Any,
    c: Any, deepest: float,
):  # fmt: skip
    """How deep an edge along l is at a point in a box or a cylinder, by the way out across the shape's nearest edge.

    The nearest face's normal would be another one on either side of the shape's edge.

    Returns:
        The distance and its normal; those given where the point is outside or deeper than ``deepest`` [m], or the two
        do not cross.
    """
    zero = fill(x, 0.0)
    one = fill(x, 1.0)
    # outward normals f and g of the two faces that meet in the shape's edge, and the distances p and q from them
    rho = root(times(x, x) + times(y, y) + fill(x, 1.0e-20))
    fx = over(x, rho)
    fy = over(y, rho)
    p = rho - a
    gy = zero
    gz = choose(z, one, -one)
    q = size_of(z) - b
    if kind == BOX:
        qx = size_of(x) - a
        qy = size_of(y) - b
        qz = size_of(z) - c
        # along the edge the point is the deepest
        kx = choose(least(qy, qz) - qx, zero, one)
        kz = choose(times(kx, qy - qz), zero, one)
        gy = choose(y, one, -one)
        fx = times(choose(x, one, -one), kx)
        fy = times(gy, one - kx)
        gy = times(gy, one - kz)
        gz = times(gz, kz)
        p = choose(kx, qx, qy)
        q = choose(kz, qz, qy)
    # across the edge along l, where the shape's edge is a point
    lf = times(fx, lx) + times(fy, ly)
    lg = times(gy, ly) + times(gz, lz)
    mf = size_of(lg)
    mg = size_of(lf)
    lean = choose(mf - mg, one, -one)
    alike = times(lf, lg)
    mf = times(mf, choose(alike, lean, one))
    mg = times(mg, choose(alike, -lean, one))
    size = root(times(lf, lf) + times(lg, lg) + fill(x, 1.0e-20))
    mf = over(mf, size)
    mg = over(mg, size)
    deep = times(mf, p) + times(mg, q)
    slant = fill(x, SLANT)
    on = least(least(fill(x, ROUGH) - gap, deep + fill(x, deepest)), least(mf, mg) + slant)
    on = least(on, size - times(slant, root(square_of(lx, ly, lz))))
    nx = choose(on, times(mf, fx), nx)
    ny = choose(on, times(mf, fy) + times(mg, gy), ny)
    nz = choose(on, times(mg, gz), nz)
    return choose(on, deep, gap), nx, ny, nz


@wp.func
def sleep(t: Any, entry: int, gone: float, near: Any):
    """Let an element sleep until all have gone as far as ``near`` is below zero in every world."""
    t.sharp_wake[WAKE + entry] = wp.min(t.sharp_wake[WAKE + entry], gone - largest(near))


@wp.func
def into_frame(h: Any, dx: Any, dy: Any, dz: Any):
    """A direction as the shape sees it."""
    x = times(h.r00, dx) + times(h.r10, dy) + times(h.r20, dz)
    y = times(h.r01, dx) + times(h.r11, dy) + times(h.r21, dz)
    z = times(h.r02, dx) + times(h.r12, dy) + times(h.r22, dz)
    return x, y, z


@wp.func
def meet_edge(t: Any, h: Any, entry: int, gone: float, i: int, j: int, turn: int, cell: float):
    """Where an edge comes nearest to a shape: at its point 0 or 1 (``turn``), for over two edges of a box it has two.

    Returns:
        Whether the shape may touch it there (positive) and whether there is a second point; the point's part of the
        way from i to j, its place in the shape's frame and the normal there (3 numbers each), and the gap [m], less
        what of it may stay. What is deeper in than half a ``cell`` [m] has gone past the shape's edge.
    """
    like = h.radius
    zero = fill(like, 0.0)
    one = fill(like, 1.0)
    ax, ay, az = into_frame(h, minus(t.px[i], h.cx), minus(t.py[i], h.cy), minus(t.pz[i], h.cz))
    lx, ly, lz = into_frame(h, t.px[j] - t.px[i], t.py[j] - t.py[i], t.pz[j] - t.pz[i])
    hx = size_of(lx) * 0.5 + h.reach
    hy = size_of(ly) * 0.5 + h.reach
    hz = size_of(lz) * 0.5 + h.reach
    on, _point = sharp_features(
        h.kind, ax + lx * 0.5, ay + ly * 0.5, az + lz * 0.5, hx, hy, hz, h.sa, h.sb, h.sc, h.broad
    )  # fmt: skip
    tiny = -fill(like, 1.0e-12)
    part = zero
    near = on
    fa = zero
    da = zero
    fb = zero
    db = zero
    if anywhere(on):
        fa, nx, ny, nz = distance_solid(h.kind, ax, ay, az, h.sa, h.sb, h.sc)
        da = times(nx, lx) + times(ny, ly) + times(nz, lz)
        fb, nx, ny, nz = distance_solid(h.kind, ax + lx, ay + ly, az + lz, h.sa, h.sb, h.sc)
        db = times(nx, lx) + times(ny, ly) + times(nz, lz)
        part = over(fb - db - fa, least(da - db, tiny))
        # nowhere is it nearer than at the lower end or, if both slopes fall inwards, where the ends' tangents cross
        near = least(near, h.reach - least(least(fa, fb), choose(least(-da, db), fa + times(da, part), fa)))
        # over a face both ends see the same slope, which one may lose within the substep
        on = least(least(-da, db) + h.reach - h.radius, near)
    sleep(t, entry, gone, near)
    at = zero
    x = zero
    y = zero
    z = zero
    gap = zero
    nx = zero
    ny = zero
    nz = zero
    more = int(0)
    if anywhere(on):
        steps = int(STEPS)  # a variable, or Warp would unroll the loop
        if h.kind == BOX:
            steps = 1
            part = past_box_edge(ax, ay, az, lx, ly, lz, part, h.sa, h.sb, h.sc)
            part = most(zero, least(one, part))
            # over two edges with a face between, it lies on both: on one at a time it would rock
            left = most(zero, least(one, past_box_edge(ax, ay, az, lx, ly, lz, zero, h.sa, h.sb, h.sc)))
            right = most(zero, least(one, past_box_edge(ax, ay, az, lx, ly, lz, one, h.sa, h.sb, h.sc)))
            other = choose(left + right - part - part, right, left)
            apart = size_of(other - part) - over(h.radius * 2.0, root(square_of(lx, ly, lz)) - tiny)
            if anywhere(least(on, apart)):
                more = 1
            if turn > 0:
                part = other
                on = least(on, apart)
        elif h.kind == SPHERE or h.kind == CAPSULE:
            steps = 1
            part = past_axis(ax, ay, az, lx, ly, lz, h.sb)
        low = zero
        high = one
        for _k in range(steps):
            at = most(low, least(high, part))
            gap, nx, ny, nz = distance_solid(
                h.kind, ax + times(at, lx), ay + times(at, ly), az + times(at, lz), h.sa, h.sb, h.sc
            )
            slope = times(nx, lx) + times(ny, ly) + times(nz, lz)
            low = choose(slope, low, at)
            fa = choose(slope, fa, gap)
            da = choose(slope, da, slope)
            high = choose(slope, at, high)
            fb = choose(slope, gap, fb)
            db = choose(slope, slope, db)
            part = over(fb - times(db, high) - fa + times(da, low), least(da - db, tiny))
        x = ax + times(at, lx)
        y = ay + times(at, ly)
        z = az + times(at, lz)
        if (h.kind == BOX or h.kind == CYLINDER) and anywhere(fill(like, ROUGH) - gap):
            gap, nx, ny, nz = across_edge(
                h.kind, x, y, z, lx, ly, lz, gap, nx, ny, nz, h.sa, h.sb, h.sc, 0.5 * cell
            )  # fmt: skip
        # across the edge: what of the normal is along it, all of it where the edge stands across the shape,
        # parts nothing
        slope = over(times(nx, lx) + times(ny, ly) + times(nz, lz), square_of(lx, ly, lz) - tiny)
        nx = nx - times(slope, lx)
        ny = ny - times(slope, ly)
        nz = nz - times(slope, lz)
        size = root(square_of(nx, ny, nz) + fill(like, 1.0e-20))
        nx = over(nx, size)
        ny = over(ny, size)
        nz = over(nz, size)
        gap = over(gap - h.radius, most(size, fill(like, SLANT)))
        gap = gap - least(gap, zero) * PATIENCE
        on = least(least(on, size - fill(like, SLANT)), least(at, one - at))
        if turn > 0 and more == 0:
            on = -one
    return on, more, at, x, y, z, nx, ny, nz, gap


@wp.func
def meet_triangle(t: Any, h: Any, entry: int, gone: float, i: int, j: int, k: int, cell: float):
    """Where a shape's outermost point meets a triangle, whose parts of the way are those from i to j and to k.

    Returns:
        As `meet_edge`, without the second of its numbers, and with two parts. What is deeper in than half a ``cell``
        [m] has gone through.
    """
    like = h.radius
    zero = fill(like, 0.0)
    one = fill(like, 1.0)
    third = float(1.0 / 3.0)
    ax, ay, az = into_frame(h, minus(t.px[i], h.cx), minus(t.py[i], h.cy), minus(t.pz[i], h.cz))
    lx, ly, lz = into_frame(h, t.px[j] - t.px[i], t.py[j] - t.py[i], t.pz[j] - t.pz[i])
    mx, my, mz = into_frame(h, t.px[k] - t.px[i], t.py[k] - t.py[i], t.pz[k] - t.pz[i])
    ox = (lx + mx) * third
    oy = (ly + my) * third
    oz = (lz + mz) * third
    far = most(square_of(lx - ox, ly - oy, lz - oz), square_of(mx - ox, my - oy, mz - oz))
    size = root(most(square_of(ox, oy, oz), far)) + h.reach
    _along, on = sharp_features(
        h.kind, ax + ox, ay + oy, az + oz, size, size, size, h.sa, h.sb, h.sc, h.broad
    )  # fmt: skip
    sleep(t, entry, gone, on)
    bj = zero
    bk = zero
    sx = zero
    sy = zero
    sz = zero
    qx = zero
    qy = zero
    qz = zero
    gap = zero
    if anywhere(on):
        nx = times(ly, mz) - times(lz, my)
        ny = times(lz, mx) - times(lx, mz)
        nz = times(lx, my) - times(ly, mx)
        nn = times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(like, 1.0e-20)
        # away from the shape's middle
        size = over(choose(times(nx, ax) + times(ny, ay) + times(nz, az), one, -one), root(nn))
        qx = times(nx, size)
        qy = times(ny, size)
        qz = times(nz, size)
        sx, sy, sz = outermost(h.kind, qx, qy, qz, h.sa, h.sb, h.sc)
        dx = sx - ax
        dy = sy - ay
        dz = sz - az
        gap = -(times(dx, qx) + times(dy, qy) + times(dz, qz))
        # weights of the vertices where the shape's point is over the triangle
        bj = over(
            times(times(dy, mz) - times(dz, my), nx)
            + times(times(dz, mx) - times(dx, mz), ny)
            + times(times(dx, my) - times(dy, mx), nz),
            nn,
        )
        bk = over(
            times(times(ly, dz) - times(lz, dy), nx)
            + times(times(lz, dx) - times(lx, dz), ny)
            + times(times(lx, dy) - times(ly, dx), nz),
            nn,
        )
        on = least(least(one - bj - bk, least(bj, bk)), least(h.reach - gap, gap + fill(like, 0.5 * cell)))
        # the triangle's point
        sx = sx + times(gap, qx)
        sy = sy + times(gap, qy)
        sz = sz + times(gap, qz)
        gap = gap - h.radius
        gap = gap - least(gap, zero) * PATIENCE
    return on, bj, bk, sx, sy, sz, qx, qy, qz, gap


@wp.func
def outermost(kind: int, nx: Any, ny: Any, nz: Any, a: Any, b: Any, c: Any):
    """The point of a shape that is farthest along a direction."""
    one = fill(nx, 1.0)
    x = times(a, nx)
    y = times(a, ny)
    z = times(choose(nz, one, -one), b)
    if kind == BOX:
        x = times(choose(nx, one, -one), a)
        y = times(choose(ny, one, -one), b)
        z = times(choose(nz, one, -one), c)
    elif kind == CYLINDER:
        rho = root(times(nx, nx) + times(ny, ny) + fill(nx, 1.0e-20))
        x = over(x, rho)
        y = over(y, rho)
    else:
        z = z + times(a, nz)
    return x, y, z
