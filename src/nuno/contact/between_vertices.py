"""A cloth's edges and triangles against what is sharp or small: edges and corners of boxes, rims, small balls.

A convex shape's distance along a straight edge is convex. Where it falls from both ends inwards, its lowest point is
between them, and found by the tangents at two points on either side: they cross under it. Inside of a triangle it is
the shape's outermost point against the triangle's plane that touches. Point and normal are those where the substep
began, when nothing crossed, and the whole motion of the substep, relative to the shape, counts against them, so that
what was pressed through within the substep is put back (`nuno.contact.sharp_pushes`).

Elements come colour by colour, those of one colour, which share no vertex, all at once on CUDA. Vertices come after
them, by themselves.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import BOX, CYLINDER, FAR, SPHERE, distance_solid
from nuno.contact.shapes import COLUMNS, LEAVE_SPEED
from nuno.contact.sharp_pushes import PATIENCE, SLANT, push_apart, square_of
from nuno.contact.sharp_shapes import QUICK, ROUND, pose_of, sharp_features
from nuno.solver.lanes import (  # noqa: F401
    add,
    anywhere,
    barrier,
    choose,
    fill,
    largest,
    least,
    minus,
    most,
    mul,
    over,
    per_world,
    root,
    size_of,
    sub,
    times,
)
from nuno.solver.state import CLOCK, FRICTION, SPEED, THICKNESS, Settings, Shapes

STEPS = wp.constant(6)
"""Tangents looked at between two ends: the distance of a 40 mm edge from a ball of 4 mm, or from the edge of a box, is
then found within 0.006 mm, of twenty thousand that were tried."""

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
def travel(t: Any, run: Settings, shapes: Shapes):
    """How far any vertex, and any shape, may have gone from where it was at the frame's start to the substep's [m]."""
    return t.sharp_wake[0] + (largest(root(t.notes[SPEED])) + shapes.haste[0]) * run.dt


@wp.func
def sleep(t: Any, entry: int, gone: float, near: Any):
    """Let an element sleep until all have gone as far as ``near`` is below zero in every world."""
    t.sharp_wake[1 + entry] = wp.min(t.sharp_wake[1 + entry], gone - largest(near))


@wp.func
def wake_up(t: Any, topo: Any, gone: float, thread: int, threads: int):
    """Wake what may be near again of the listed elements, the others get a number below zero.

    Whoever wakes an element also looks at it.
    """
    for c in range(topo.sharp_colour.shape[0] - 1):
        first = topo.sharp_colour[c]
        for k in range(first + thread, first + t.sharp[1 + c], threads):
            element = t.sharp_list[k]
            element = wp.max(element, -1 - element)
            if gone >= t.sharp_wake[1 + k]:
                t.sharp_wake[1 + k] = FAR
            else:
                element = -1 - element
            t.sharp_list[k] = element


@wp.func
def touch_between(t: Any, topo: Any, run: Settings, shapes: Shapes, s: int, thread: int, threads: int):
    """The listed edges and triangles against one shape."""
    like = fill(t.x[0], 0.0)
    zero = fill(like, 0.0)
    one = fill(like, 1.0)
    kind = shapes.kind[s]
    slot = shapes.slot[s]
    clock = int(largest(t.notes[CLOCK]))
    # where the shape was when the substep began, and what its surface moves: e of its centre, d of its axes
    cx, cy, cz, r00, r01, r02, r10, r11, r12, r20, r21, r22 = pose_of(like, t, shapes, s, clock - 1)
    ex = zero
    ey = zero
    ez = zero
    d00 = zero
    d01 = zero
    d02 = zero
    d10 = zero
    d11 = zero
    d12 = zero
    d20 = zero
    d21 = zero
    d22 = zero
    if slot >= 0:
        ex, ey, ez, d00, d01, d02, d10, d11, d12, d20, d21, d22 = pose_of(like, t, shapes, s, clock)
        ex = ex - cx
        ey = ey - cy
        ez = ez - cz
        d00 = d00 - r00
        d01 = d01 - r01
        d02 = d02 - r02
        d10 = d10 - r10
        d11 = d11 - r11
        d12 = d12 - r12
        d20 = d20 - r20
        d21 = d21 - r21
        d22 = d22 - r22
    row = s * COLUMNS
    sa = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 12)
    sb = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 13)
    sc = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 14)
    mean = root(times(t.scalars[FRICTION], per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 15)))
    pair = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 16)
    mu = choose(pair + fill(like, 0.5), pair, mean)
    radius = t.scalars[THICKNESS] * 0.5
    leave = fill(like, LEAVE_SPEED * run.dt)
    # what is farther than this when a substep begins is not reached in it, and what is farther by its slack not before
    # all have gone as far
    reach = radius + fill(like, QUICK * run.dt)
    broad = ROUND * run.cell
    rough = fill(like, ROUGH)
    quick = fill(like, QUICK * run.dt)
    third = float(1.0 / 3.0)
    gone = travel(t, run, shapes)
    edges = topo.side.shape[0]
    for c in range(topo.side_colours):
        first = topo.sharp_colour[c]
        for entry in range(first + thread, first + t.sharp[1 + c], threads):
            element = t.sharp_list[entry]
            if element < 0:
                continue
            ends = topo.side[element]
            i = ends[0]
            j = ends[1]
            dx = minus(t.px[i], cx)
            dy = minus(t.py[i], cy)
            dz = minus(t.pz[i], cz)
            ax = times(r00, dx) + times(r10, dy) + times(r20, dz)
            ay = times(r01, dx) + times(r11, dy) + times(r21, dz)
            az = times(r02, dx) + times(r12, dy) + times(r22, dz)
            dx = t.px[j] - t.px[i]
            dy = t.py[j] - t.py[i]
            dz = t.pz[j] - t.pz[i]
            lx = times(r00, dx) + times(r10, dy) + times(r20, dz)
            ly = times(r01, dx) + times(r11, dy) + times(r21, dz)
            lz = times(r02, dx) + times(r12, dy) + times(r22, dz)
            hx = size_of(lx) * 0.5 + reach
            hy = size_of(ly) * 0.5 + reach
            hz = size_of(lz) * 0.5 + reach
            on, _point = sharp_features(
                kind, ax + lx * 0.5, ay + ly * 0.5, az + lz * 0.5, hx, hy, hz, sa, sb, sc, broad
            )  # fmt: skip
            sleep(t, entry, gone, on)
            fa = zero
            da = zero
            fb = zero
            db = zero
            if anywhere(on):
                fa, nx, ny, nz = distance_solid(kind, ax, ay, az, sa, sb, sc)
                da = times(nx, lx) + times(ny, ly) + times(nz, lz)
                fb, nx, ny, nz = distance_solid(kind, ax + lx, ay + ly, az + lz, sa, sb, sc)
                db = times(nx, lx) + times(ny, ly) + times(nz, lz)
                # over a face both ends see the same slope, which one may lose within the substep
                on = least(-da, db) + quick
            if anywhere(on):
                tiny = -fill(like, 1.0e-12)
                part = over(fb - db - fa, least(da - db, tiny))
                # it is nowhere nearer than where the two ends' tangents cross
                on = least(on, reach - (fa + times(da, part)))
                if anywhere(on):
                    other = part
                    apart = one
                    turns = int(1)  # variables, or Warp would unroll the loops
                    steps = int(STEPS)
                    if kind == BOX:
                        steps = 1
                        turns = 2
                        part = past_box_edge(ax, ay, az, lx, ly, lz, part, sa, sb, sc)
                        part = most(zero, least(one, part))
                        # over two edges with a face between, it lies on both: on one at a time it would rock
                        left = most(zero, least(one, past_box_edge(ax, ay, az, lx, ly, lz, zero, sa, sb, sc)))
                        right = most(zero, least(one, past_box_edge(ax, ay, az, lx, ly, lz, one, sa, sb, sc)))
                        other = choose(left + right - part - part, right, left)
                        apart = size_of(other - part) - over(radius * 2.0, root(square_of(lx, ly, lz)) - tiny)
                        if not anywhere(least(on, apart)):
                            turns = 1
                    elif kind == SPHERE:
                        steps = 1
                        part = over(times(ax, lx) + times(ay, ly) + times(az, lz), tiny - square_of(lx, ly, lz))
                    for turn in range(turns):
                        low = zero
                        high = one
                        at = part
                        gap = fa
                        for _k in range(steps):
                            at = most(low, least(high, part))
                            gap, nx, ny, nz = distance_solid(
                                kind, ax + times(at, lx), ay + times(at, ly), az + times(at, lz), sa, sb, sc
                            )
                            slope = times(nx, lx) + times(ny, ly) + times(nz, lz)
                            low = choose(slope, low, at)
                            fa = choose(slope, fa, gap)
                            da = choose(slope, da, slope)
                            high = choose(slope, at, high)
                            fb = choose(slope, gap, fb)
                            db = choose(slope, slope, db)
                            part = over(fb - times(db, high) - fa + times(da, low), least(da - db, tiny))
                        part = other
                        if (kind == BOX or kind == CYLINDER) and anywhere(rough - gap):
                            gap, nx, ny, nz = across_edge(
                                kind, ax + times(at, lx), ay + times(at, ly), az + times(at, lz), lx, ly, lz, gap, nx,
                                ny, nz, sa, sb, sc, 0.5 * run.cell,
                            )  # fmt: skip
                        # what the point moves, less what the surface moves there
                        rest = one - at
                        ux = times(rest, t.x[i] - t.px[i]) + times(at, t.x[j] - t.px[j])
                        uy = times(rest, t.y[i] - t.py[i]) + times(at, t.y[j] - t.py[j])
                        uz = times(rest, t.z[i] - t.pz[i]) + times(at, t.z[j] - t.pz[j])
                        if slot >= 0:
                            x = ax + times(at, lx)
                            y = ay + times(at, ly)
                            z = az + times(at, lz)
                            ux = ux - ex - times(d00, x) - times(d01, y) - times(d02, z)
                            uy = uy - ey - times(d10, x) - times(d11, y) - times(d12, z)
                            uz = uz - ez - times(d20, x) - times(d21, y) - times(d22, z)
                        # across the edge: what of the normal is along it, all of it where the edge stands across the
                        # shape, parts nothing
                        slope = over(times(nx, lx) + times(ny, ly) + times(nz, lz), square_of(lx, ly, lz) - tiny)
                        nx = nx - times(slope, lx)
                        ny = ny - times(slope, ly)
                        nz = nz - times(slope, lz)
                        size = root(square_of(nx, ny, nz) + fill(like, 1.0e-20))
                        nx = over(nx, size)
                        ny = over(ny, size)
                        nz = over(nz, size)
                        wx = times(r00, nx) + times(r01, ny) + times(r02, nz)
                        wy = times(r10, nx) + times(r11, ny) + times(r12, nz)
                        wz = times(r20, nx) + times(r21, ny) + times(r22, nz)
                        gap = over(gap - radius, most(size, fill(like, SLANT)))
                        gap = gap - least(gap, zero) * PATIENCE + times(ux, wx) + times(uy, wy) + times(uz, wz)
                        touching = least(least(on, least(at, rest)), least(-gap, size - fill(like, SLANT)))
                        if turn > 0:
                            touching = least(touching, apart)
                        if anywhere(touching):
                            push_apart(t, i, j, i, rest, at, zero, gap, wx, wy, wz, ux, uy, uz, mu, leave, touching)
        if t.sharp[1 + c] > 0:
            barrier(threads)
    for c in range(topo.side_colours, topo.sharp_colour.shape[0] - 1):
        first = topo.sharp_colour[c]
        for entry in range(first + thread, first + t.sharp[1 + c], threads):
            element = t.sharp_list[entry]
            if element < 0:
                continue
            corners = topo.face[element - edges]
            i = corners[0]
            j = corners[1]
            k = corners[2]
            dx = minus(t.px[i], cx)
            dy = minus(t.py[i], cy)
            dz = minus(t.pz[i], cz)
            ax = times(r00, dx) + times(r10, dy) + times(r20, dz)
            ay = times(r01, dx) + times(r11, dy) + times(r21, dz)
            az = times(r02, dx) + times(r12, dy) + times(r22, dz)
            dx = t.px[j] - t.px[i]
            dy = t.py[j] - t.py[i]
            dz = t.pz[j] - t.pz[i]
            lx = times(r00, dx) + times(r10, dy) + times(r20, dz)
            ly = times(r01, dx) + times(r11, dy) + times(r21, dz)
            lz = times(r02, dx) + times(r12, dy) + times(r22, dz)
            dx = t.px[k] - t.px[i]
            dy = t.py[k] - t.py[i]
            dz = t.pz[k] - t.pz[i]
            mx = times(r00, dx) + times(r10, dy) + times(r20, dz)
            my = times(r01, dx) + times(r11, dy) + times(r21, dz)
            mz = times(r02, dx) + times(r12, dy) + times(r22, dz)
            ox = (lx + mx) * third
            oy = (ly + my) * third
            oz = (lz + mz) * third
            far = most(square_of(lx - ox, ly - oy, lz - oz), square_of(mx - ox, my - oy, mz - oz))
            h = root(most(square_of(ox, oy, oz), far)) + reach
            _along, on = sharp_features(kind, ax + ox, ay + oy, az + oz, h, h, h, sa, sb, sc, broad)
            sleep(t, entry, gone, on)
            if not anywhere(on):
                continue
            nx = times(ly, mz) - times(lz, my)
            ny = times(lz, mx) - times(lx, mz)
            nz = times(lx, my) - times(ly, mx)
            nn = times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(like, 1.0e-20)
            # away from the shape's middle
            size = over(choose(times(nx, ax) + times(ny, ay) + times(nz, az), one, -one), root(nn))
            qx = times(nx, size)
            qy = times(ny, size)
            qz = times(nz, size)
            sx, sy, sz = outermost(kind, qx, qy, qz, sa, sb, sc)
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
            bi = one - bj - bk
            # deeper than half a cell it has gone through
            on = least(least(bi, least(bj, bk)), least(reach - gap, gap + fill(like, 0.5 * run.cell)))
            if anywhere(on):
                ux = times(bi, t.x[i] - t.px[i]) + times(bj, t.x[j] - t.px[j]) + times(bk, t.x[k] - t.px[k])
                uy = times(bi, t.y[i] - t.py[i]) + times(bj, t.y[j] - t.py[j]) + times(bk, t.y[k] - t.py[k])
                uz = times(bi, t.z[i] - t.pz[i]) + times(bj, t.z[j] - t.pz[j]) + times(bk, t.z[k] - t.pz[k])
                if slot >= 0:
                    # the triangle's point
                    sx = sx + times(gap, qx)
                    sy = sy + times(gap, qy)
                    sz = sz + times(gap, qz)
                    ux = ux - ex - times(d00, sx) - times(d01, sy) - times(d02, sz)
                    uy = uy - ey - times(d10, sx) - times(d11, sy) - times(d12, sz)
                    uz = uz - ez - times(d20, sx) - times(d21, sy) - times(d22, sz)
                wx = times(r00, qx) + times(r01, qy) + times(r02, qz)
                wy = times(r10, qx) + times(r11, qy) + times(r12, qz)
                wz = times(r20, qx) + times(r21, qy) + times(r22, qz)
                gap = gap - radius
                gap = gap - least(gap, zero) * PATIENCE + times(ux, wx) + times(uy, wy) + times(uz, wz)
                on = least(on, -gap)
                if anywhere(on):
                    push_apart(
                        t, i, j, k, bi, bj, bk, gap, wx, wy, wz, ux, uy, uz, mu, leave, on
                    )  # fmt: skip
        if t.sharp[1 + c] > 0:
            barrier(threads)


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


@wp.func
def touch_sharp(t: Any, topo: Any, run: Settings, shapes: Shapes, thread: int, threads: int):
    """All listed edges and triangles against the sharp shapes nearby."""
    gone = travel(t, run, shapes)
    wake_up(t, topo, gone, thread, threads)
    for k in range(t.sharp[0]):
        touch_between(t, topo, run, shapes, t.sharp[topo.sharp_colour.shape[0] + k], thread, threads)
    # a barrier passed: all know what `travel` gave
    if thread == 0:
        t.sharp_wake[0] = gone
