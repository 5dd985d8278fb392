"""Particles against static shapes: signed distances, and the push with Coulomb friction.

A particle is a ball of half the cloth's thickness. The push is a position correction at the end of the substep
(after all elastic constraints, so that what they pressed into the shape counts), and friction takes back the
tangential part of the substep's motion up to mu times the push: a cloth that sticks does not creep.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import (  # noqa: F401
    add,
    anywhere,
    choose,
    fill,
    lane,
    largest,
    least,
    most,
    mul,
    over,
    per_world,
    root,
    size_of,
    sub,
    times,
)
from nuno.solver.state import FRICTION, ORIGIN, SPEED, THICKNESS, Shapes

BOX, SPHERE, CYLINDER, CAPSULE, PLANE, SOLID_MESH, SHELL_MESH = range(7)
COLUMNS = 20
"""Numbers in a row of `Shapes.table`: position 0-2, rotation (row major, shape to world) 3-11, sizes 12-14,
friction 15, pair friction 16 (negative: geometric mean), half thickness 17, bounding radius 18."""

LEAVE_SPEED = wp.constant(0.5)
"""[m/s] A particle found inside leaves no faster than this, so that a bad start is no explosion."""


@wp.func
def distance_box(x: Any, y: Any, z: Any, a: Any, b: Any, c: Any):
    """Signed distance and normal of a box of half sides a, b, c around the origin."""
    qx = size_of(x) - a
    qy = size_of(y) - b
    qz = size_of(z) - c
    zero = fill(x, 0.0)
    one = fill(x, 1.0)
    sx = choose(x, one, -one)
    sy = choose(y, one, -one)
    sz = choose(z, one, -one)
    ox = most(qx, zero)
    oy = most(qy, zero)
    oz = most(qz, zero)
    outside = root(times(ox, ox) + times(oy, oy) + times(oz, oz) + fill(x, 1.0e-24))
    inside = most(qx, most(qy, qz))
    # inside, the nearest face gives the normal
    fz = choose(qz - most(qx, qy), one, zero)
    fx = times(one - fz, choose(qx - qy, one, zero))
    fy = one - fz - fx
    nx = times(sx, choose(inside, over(ox, outside), fx))
    ny = times(sy, choose(inside, over(oy, outside), fy))
    nz = times(sz, choose(inside, over(oz, outside), fz))
    return choose(inside, outside, inside), nx, ny, nz


@wp.func
def distance_cylinder(x: Any, y: Any, z: Any, r: Any, half: Any):
    """Signed distance and normal of a cylinder of radius r along z, between -half and half."""
    zero = fill(x, 0.0)
    one = fill(x, 1.0)
    rho = root(times(x, x) + times(y, y) + fill(x, 1.0e-24))
    qr = rho - r
    qz = size_of(z) - half
    o = most(qr, zero)
    oz = most(qz, zero)
    outside = root(times(o, o) + times(oz, oz) + fill(x, 1.0e-24))
    inside = most(qr, qz)
    side = choose(qr - qz, one, zero)
    nr = choose(inside, over(o, outside), side)
    nz = times(choose(z, one, -one), choose(inside, over(oz, outside), one - side))
    return choose(inside, outside, inside), times(nr, over(x, rho)), times(nr, over(y, rho)), nz


@wp.func
def distance_round(x: Any, y: Any, z: Any, r: Any, half: Any):
    """Signed distance and normal of a capsule along z (half > 0) or a sphere (half = 0)."""
    d = z - most(least(z, half), -half)
    length = root(times(x, x) + times(y, y) + times(d, d) + fill(x, 1.0e-24))
    return length - r, over(x, length), over(y, length), over(d, length)


@wp.func
def mesh_gap(mesh: wp.uint64, kind: int, point: wp.vec3, before: wp.vec3, reach: float):
    """Distance and normal (4 numbers) from a triangle mesh; a shell keeps to the side where the particle was.

    ``point`` and ``before`` are in the mesh's frame.
    """
    query = wp.mesh_query_point_no_sign(mesh, point, reach)
    result = wp.vec4(1.0e6, 0.0, 0.0, 1.0)
    if query.result:
        normal = wp.mesh_eval_face_normal(mesh, query.face)
        closest = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        offset = point - closest
        side = wp.dot(offset, normal)
        if kind == SHELL_MESH:
            side = wp.dot(before - closest, normal)
        length = wp.length(offset)
        toward = normal
        signed = wp.dot(offset, normal)
        if side < 0.0:
            toward = -normal
            signed = -signed
        if kind == SOLID_MESH:
            # outside near an edge the offset is the better normal; inside the face's
            if side >= 0.0 and length > 1.0e-7:
                toward = offset / length
                signed = length
            else:
                toward = normal
                signed = -length
        elif signed > 0.0 and length > 1.0e-7:
            toward = offset / length
            signed = length
        result = wp.vec4(signed, toward[0], toward[1], toward[2])
    return result


@wp.func
def gap_mesh(
    shapes: Shapes,
    s: int,
    group: int,
    worlds: int,
    x: float,
    y: float,
    z: float,
    bx: float,
    by: float,
    bz: float,
    reach: float,
):
    """`mesh_gap` of one world."""
    mesh = shapes.mesh[s + group * shapes.mesh_stride]
    r = mesh_gap(mesh, shapes.kind[s], wp.vec3(x, y, z), wp.vec3(bx, by, bz), reach)
    return r[0], r[1], r[2], r[3]


@wp.func
def gap_mesh(
    shapes: Shapes,
    s: int,
    group: int,
    worlds: int,
    x: lane,
    y: lane,
    z: lane,
    bx: lane,
    by: lane,
    bz: lane,
    reach: float,
):
    gap = lane()
    nx = lane()
    ny = lane()
    nz = lane()
    for k in range(16):
        mesh = shapes.mesh[s + wp.min(group * 16 + k, worlds - 1) * shapes.mesh_stride]
        r = mesh_gap(mesh, shapes.kind[s], wp.vec3(x[k], y[k], z[k]), wp.vec3(bx[k], by[k], bz[k]), reach)
        gap[k] = r[0]
        nx[k] = r[1]
        ny[k] = r[2]
        nz[k] = r[3]
    return gap, nx, ny, nz


@wp.func
def press(t: Any, i: int, gap: Any, nx: Any, ny: Any, nz: Any, mu: Any, leave: Any):
    """Push particle i out along the normal by at most what it came in plus ``leave``, with friction."""
    zero = fill(gap, 0.0)
    ux = t.x[i] - t.px[i]
    uy = t.y[i] - t.py[i]
    uz = t.z[i] - t.pz[i]
    un = times(ux, nx) + times(uy, ny) + times(uz, nz)
    push = least(most(-gap, zero), most(-un, zero) + leave)
    tx = ux - times(un, nx)
    ty = uy - times(un, ny)
    tz = uz - times(un, nz)
    slip = root(times(tx, tx) + times(ty, ty) + times(tz, tz) + fill(gap, 1.0e-24))
    hold = least(over(times(mu, push), slip), fill(gap, 1.0))
    free = choose(t.w[i], fill(gap, 1.0), zero)
    push = times(push, free)
    hold = times(hold, free)
    t.x[i] = t.x[i] + times(push, nx) - times(hold, tx)
    t.y[i] = t.y[i] + times(push, ny) - times(hold, ty)
    t.z[i] = t.z[i] + times(push, nz) - times(hold, tz)


@wp.func
def touch_shape(t: Any, n: int, shapes: Shapes, s: int, dt: float, thread: int, threads: int):
    """All particles against one shape."""
    row = s * COLUMNS
    like = t.x[0]
    stride = shapes.stride
    g = t.group
    w = t.worlds
    cx = per_world(like, shapes.table, g, stride, w, row) - t.scalars[ORIGIN]
    cy = per_world(like, shapes.table, g, stride, w, row + 1) - t.scalars[ORIGIN + 1]
    cz = per_world(like, shapes.table, g, stride, w, row + 2) - t.scalars[ORIGIN + 2]
    r00 = per_world(like, shapes.table, g, stride, w, row + 3)
    r01 = per_world(like, shapes.table, g, stride, w, row + 4)
    r02 = per_world(like, shapes.table, g, stride, w, row + 5)
    r10 = per_world(like, shapes.table, g, stride, w, row + 6)
    r11 = per_world(like, shapes.table, g, stride, w, row + 7)
    r12 = per_world(like, shapes.table, g, stride, w, row + 8)
    r20 = per_world(like, shapes.table, g, stride, w, row + 9)
    r21 = per_world(like, shapes.table, g, stride, w, row + 10)
    r22 = per_world(like, shapes.table, g, stride, w, row + 11)
    sa = per_world(like, shapes.table, g, stride, w, row + 12)
    sb = per_world(like, shapes.table, g, stride, w, row + 13)
    sc = per_world(like, shapes.table, g, stride, w, row + 14)
    mean = root(times(t.scalars[FRICTION], per_world(like, shapes.table, g, stride, w, row + 15)))
    pair = per_world(like, shapes.table, g, stride, w, row + 16)
    mu = choose(pair + fill(like, 0.5), pair, mean)
    radius = t.scalars[THICKNESS] * 0.5 + per_world(like, shapes.table, g, stride, w, row + 17)
    leave = fill(like, LEAVE_SPEED * dt)
    kind = shapes.kind[s]
    for i in range(thread, n, threads):
        dx = t.x[i] - cx
        dy = t.y[i] - cy
        dz = t.z[i] - cz
        # into the shape's frame
        x = times(r00, dx) + times(r10, dy) + times(r20, dz)
        y = times(r01, dx) + times(r11, dy) + times(r21, dz)
        z = times(r02, dx) + times(r12, dy) + times(r22, dz)
        gap = z
        nx = fill(z, 0.0)
        ny = fill(z, 0.0)
        nz = fill(z, 1.0)
        if kind == BOX:
            gap, nx, ny, nz = distance_box(x, y, z, sa, sb, sc)
        elif kind == CYLINDER:
            gap, nx, ny, nz = distance_cylinder(x, y, z, sa, sb)
        elif kind == SPHERE or kind == CAPSULE:
            gap, nx, ny, nz = distance_round(x, y, z, sa, sb)
        elif kind >= SOLID_MESH:
            dx = t.px[i] - cx
            dy = t.py[i] - cy
            dz = t.pz[i] - cz
            bx = times(r00, dx) + times(r10, dy) + times(r20, dz)
            by = times(r01, dx) + times(r11, dy) + times(r21, dz)
            bz = times(r02, dx) + times(r12, dy) + times(r22, dz)
            reach = 0.02 + 2.0 * largest(radius)
            gap, nx, ny, nz = gap_mesh(shapes, s, g, w, x, y, z, bx, by, bz, reach)
        gap = gap - radius
        if anywhere(-gap):
            wx = times(r00, nx) + times(r01, ny) + times(r02, nz)
            wy = times(r10, nx) + times(r11, ny) + times(r12, nz)
            wz = times(r20, nx) + times(r21, ny) + times(r22, nz)
            press(t, i, gap, wx, wy, wz, mu, leave)


@wp.func
def reset_box(t: Any, thread: int):
    """Start the worlds' bounding boxes anew; one thread does it."""
    if thread == 0:
        big = fill(t.x[0], 1.0e9)
        for k in range(3):
            t.box[k] = big
            t.box[3 + k] = -big
        t.near[0] = 0


@wp.func
def widen(box: wp.array(dtype=float), k: int, lo: float, hi: float, threads: int):
    """Grow a bounding box along axis k."""
    if threads > 1:
        wp.atomic_min(box, k, lo)
        wp.atomic_max(box, 3 + k, hi)
    else:
        box[k] = least(box[k], lo)
        box[3 + k] = most(box[3 + k], hi)


@wp.func
def widen(box: wp.array(dtype=Any), k: int, lo: Any, hi: Any, threads: int):
    box[k] = least(box[k], lo)
    box[3 + k] = most(box[3 + k], hi)


@wp.func
def measure_box(t: Any, n: int, thread: int, threads: int):
    """The bounding box of all particles."""
    if thread < n:
        lx = t.x[thread]
        ly = t.y[thread]
        lz = t.z[thread]
        hx = lx
        hy = ly
        hz = lz
        for i in range(thread, n, threads):
            lx = least(lx, t.x[i])
            ly = least(ly, t.y[i])
            lz = least(lz, t.z[i])
            hx = most(hx, t.x[i])
            hy = most(hy, t.y[i])
            hz = most(hz, t.z[i])
        widen(t.box, 0, lx, hx, threads)
        widen(t.box, 1, ly, hy, threads)
        widen(t.box, 2, lz, hz, threads)


@wp.func
def select_shapes(t: Any, shapes: Shapes, ahead: float, thread: int, threads: int):
    """List the shapes that a particle could touch within ``ahead`` seconds.

    The list of a group of lanes is the union over its worlds; a shape that a world does not touch changes no bit.
    """
    like = t.x[0]
    # 1.5 times the present speed, what gravity adds in the time, and 2 cm for what constraints throw
    grow = root(t.notes[SPEED]) * (1.5 * ahead) + fill(like, 10.0 * ahead * ahead + 0.02) + t.scalars[THICKNESS]
    for s in range(thread, shapes.count, threads):
        row = s * COLUMNS
        cx = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row) - t.scalars[ORIGIN]
        cy = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 1) - t.scalars[ORIGIN + 1]
        cz = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 2) - t.scalars[ORIGIN + 2]
        reach = grow + per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 18)
        ox = most(t.box[0] - cx, cx - t.box[3])
        oy = most(t.box[1] - cy, cy - t.box[4])
        oz = most(t.box[2] - cz, cz - t.box[5])
        if anywhere(reach - most(ox, most(oy, oz))):
            k = wp.atomic_add(t.near, 0, 1)
            t.near[1 + k] = s


@wp.func
def sort_shapes(t: Any, thread: int):
    """Bring the list into the shapes' order, so that it does not depend on which thread came first."""
    if thread == 0:
        for a in range(1, t.near[0]):
            s = t.near[1 + a]
            b = int(a)
            while b > 0 and t.near[b] > s:
                t.near[1 + b] = t.near[b]
                b = b - 1
            t.near[1 + b] = s


@wp.func
def touch_shapes(t: Any, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    """All particles against the shapes nearby."""
    for k in range(t.near[0]):
        touch_shape(t, n, shapes, t.near[1 + k], dt, thread, threads)
