"""Particles against static and moving shapes: signed distances, and the push with Coulomb friction.

A particle is a ball of half the cloth's thickness. The push is a position correction at the end of the substep
(after all elastic constraints, so that what they pressed into the shape counts), and friction takes back the
tangential part of the substep's motion up to mu times the push: a cloth that sticks does not creep. All motion is
relative to the shape's surface, which `nuno.contact.led` knows of the moving ones.

Nothing passes through: where the nearest surface is not the one that a particle met first, its way through the
substep, seen from the shape, is followed to where it went in, and it is pushed out there.
"""

from typing import Any

import warp as wp

from nuno.contact.hull import distance_hull, way_into_hull
from nuno.contact.led import led_place, led_turn
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
from nuno.solver.state import CLOCK, FRICTION, ORIGIN, SPEED, THICKNESS, Shapes
from nuno.solver.warps import leads_warp, most_of_warp

BOX, SPHERE, CYLINDER, CAPSULE, PLANE, SOLID_MESH, SHELL_MESH, HULL = range(8)
COLUMNS = 20
"""Numbers in a row of `Shapes.table`: position 0-2, rotation (row major, shape to world) 3-11, sizes 12-14,
friction 15, pair friction 16 (negative: geometric mean), half thickness 17, bounding radius 18. Sizes are half sides
of a box, radius and half height, or half sides of a mesh's bounding box. What moves has its pose in `Shapes.pose`."""

LEAVE_SPEED = wp.constant(0.5)
"""[m/s] A particle found inside leaves no faster than this, so that a bad start is no explosion."""
SWIFT = wp.constant(10.0)
"""[m/s] A particle that is faster, seen from a shape, may pass through a shape thinner than its way in a substep."""
FAR = wp.constant(1.0e6)
"""[m] The distance of what is too far to matter."""
MESH_DEPTH = wp.constant(0.05)
"""[m] What starts deeper in a mesh stays there: a wider search would cost all that is near it, in every substep."""
TRACE_STEPS = wp.constant(12)
"""Steps to where a way enters a shape: one for a way straight in, 12 leave 3 % of one that comes in at 75 degrees."""


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
def distance_solid(kind: int, x: Any, y: Any, z: Any, a: Any, b: Any, c: Any):
    """Signed distance and normal of a primitive shape of sizes a, b, c."""
    gap = z
    nx = fill(z, 0.0)
    ny = fill(z, 0.0)
    nz = fill(z, 1.0)
    if kind == BOX:
        gap, nx, ny, nz = distance_box(x, y, z, a, b, c)
    elif kind == CYLINDER:
        gap, nx, ny, nz = distance_cylinder(x, y, z, a, b)
    elif kind == SPHERE or kind == CAPSULE:
        gap, nx, ny, nz = distance_round(x, y, z, a, b)
    return gap, nx, ny, nz


@wp.func
def way_in(kind: int, x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, a: Any, b: Any, c: Any):
    """Where a way of the substep that ends at x, y, z and is u long enters a convex shape.

    Returns:
        The distance of x, y, z from the plane that touches the shape there, its normal, and whether the way enters
        at all (positive). A way that starts inside enters at the side that is nearest to its start.
    """
    one = fill(x, 1.0)
    zero = fill(x, 0.0)
    length = root(times(ux, ux) + times(uy, uy) + times(uz, uz) + fill(x, 1.0e-24))
    part = fill(x, 0.0)  # of the way, from its start
    gap = zero
    nx = zero
    ny = zero
    nz = one
    steps = int(TRACE_STEPS)
    for _k in range(steps):
        # the shape is at least as far away as its distance says: go that far
        part = least(part + over(most(gap, zero), length), one)
        rest = one - part
        gap, nx, ny, nz = distance_solid(kind, x - times(rest, ux), y - times(rest, uy), z - times(rest, uz), a, b, c)
    rest = one - part
    beyond = times(rest, times(ux, nx) + times(uy, ny) + times(uz, nz))
    return gap + beyond, nx, ny, nz, rest


@wp.func
def mesh_gap(mesh: wp.uint64, kind: int, q: wp.vec3, u: wp.vec3, half: wp.vec3, radius: float):
    """Distance and normal (4 numbers) from a triangle mesh of a point that came to ``q`` by ``u``, in its frame.

    ``half`` are the half sides of the mesh's bounding box around the frame's origin.
    """
    result = wp.vec4(FAR, 0.0, 0.0, 1.0)
    moved = wp.length(u)
    beyond = wp.vec3(wp.abs(q[0]) - half[0], wp.abs(q[1]) - half[1], wp.abs(q[2]) - half[2])
    apart = wp.max(beyond[0], wp.max(beyond[1], beyond[2]))
    reach = radius + moved
    if apart < reach:
        if kind == SOLID_MESH and apart < 0.0:
            # nothing inside is farther from the surface than half the shortest side
            reach = reach + wp.min(MESH_DEPTH, wp.min(half[0], wp.min(half[1], half[2])))
        query = wp.mesh_query_point_sign_normal(mesh, q, reach + 1.0e-6)
        if query.result:
            face = wp.mesh_eval_face_normal(mesh, query.face)
            offset = q - wp.mesh_eval_position(mesh, query.face, query.u, query.v)
            length = wp.length(offset)
            toward = face
            signed = length
            if length > 1.0e-7:
                toward = offset / length
                if kind == SOLID_MESH and query.sign < 0.0:
                    toward = -toward
                    signed = -length
            elif kind == SHELL_MESH and wp.dot(u, face) > 0.0:
                toward = -face
            if length <= moved and moved > 1.0e-9:
                along = u / moved
                ray = wp.mesh_query_ray(mesh, q - u, along, moved)
                # out of a solid is no way into it
                if ray.result and (kind == SHELL_MESH or wp.dot(ray.normal, along) < 0.0):
                    toward = ray.normal
                    if wp.dot(toward, along) > 0.0:
                        toward = -toward
                    signed = (moved - ray.t) * wp.dot(toward, along)
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
    ux: float,
    uy: float,
    uz: float,
    a: float,
    b: float,
    c: float,
    radius: float,
):
    """`mesh_gap` of one world."""
    mesh = shapes.mesh[s + group * shapes.mesh_stride]
    r = mesh_gap(mesh, shapes.kind[s], wp.vec3(x, y, z), wp.vec3(ux, uy, uz), wp.vec3(a, b, c), radius)
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
    ux: lane,
    uy: lane,
    uz: lane,
    a: lane,
    b: lane,
    c: lane,
    radius: lane,
):
    gap = lane()
    nx = lane()
    ny = lane()
    nz = lane()
    kind = shapes.kind[s]
    for k in range(16):
        mesh = shapes.mesh[s + wp.min(group * 16 + k, worlds - 1) * shapes.mesh_stride]
        half = wp.vec3(a[k], b[k], c[k])
        r = mesh_gap(mesh, kind, wp.vec3(x[k], y[k], z[k]), wp.vec3(ux[k], uy[k], uz[k]), half, radius[k])
        gap[k] = r[0]
        nx[k] = r[1]
        ny[k] = r[2]
        nz[k] = r[3]
    return gap, nx, ny, nz


@wp.func
def press(t: Any, i: int, gap: Any, nx: Any, ny: Any, nz: Any, ux: Any, uy: Any, uz: Any, un: Any, mu: Any, leave: Any):
    """Push particle i out along the normal until it leaves by ``leave`` a substep at the most, with friction.

    u is what it moved in the substep, less what the shape's surface moved, and un its part along the normal.
    """
    zero = fill(gap, 0.0)
    push = least(most(-gap, zero), most(leave - un, zero))
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
    slot = shapes.slot[s]
    # what the surface moves in this substep: e of the shape's centre, d of its axes
    ex = cx
    ey = cy
    ez = cz
    d00 = r00
    d01 = r01
    d02 = r02
    d10 = r10
    d11 = r11
    d12 = r12
    d20 = r20
    d21 = r21
    d22 = r22
    if slot >= 0:
        clock = int(largest(t.notes[CLOCK]))
        ox = t.scalars[ORIGIN]
        oy = t.scalars[ORIGIN + 1]
        oz = t.scalars[ORIGIN + 2]
        ex, ey, ez = led_place(like, shapes, slot, clock - 1, g, w, ox, oy, oz)
        cx, cy, cz = led_place(like, shapes, slot, clock, g, w, ox, oy, oz)
        d00, d01, d02, d10, d11, d12, d20, d21, d22 = led_turn(like, shapes, slot, clock - 1, g, w)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = led_turn(like, shapes, slot, clock, g, w)
        ex = cx - ex
        ey = cy - ey
        ez = cz - ez
        d00 = r00 - d00
        d01 = r01 - d01
        d02 = r02 - d02
        d10 = r10 - d10
        d11 = r11 - d11
        d12 = r12 - d12
        d20 = r20 - d20
        d21 = r21 - d21
        d22 = r22 - d22
    # what comes nearer than this may have passed through within the substep
    near = radius + fill(like, SWIFT * dt)
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
            gap, nx, ny, nz = distance_box(x, y, z, sa, sb, sc)
            if kind == HULL and anywhere(near - gap):
                gap, nx, ny, nz = distance_hull(shapes, s, x, y, z, near)
        if anywhere(near - gap):
            ux = t.x[i] - t.px[i]
            uy = t.y[i] - t.py[i]
            uz = t.z[i] - t.pz[i]
            if slot >= 0:
                ux = ux - ex - times(d00, x) - times(d01, y) - times(d02, z)
                uy = uy - ey - times(d10, x) - times(d11, y) - times(d12, z)
                uz = uz - ez - times(d20, x) - times(d21, y) - times(d22, z)
            if kind == SOLID_MESH or kind == SHELL_MESH:
                lx = times(r00, ux) + times(r10, uy) + times(r20, uz)
                ly = times(r01, ux) + times(r11, uy) + times(r21, uz)
                lz = times(r02, ux) + times(r12, uy) + times(r22, uz)
                gap, nx, ny, nz = gap_mesh(shapes, s, g, w, x, y, z, lx, ly, lz, sa, sb, sc, radius)
            wx = times(r00, nx) + times(r01, ny) + times(r02, nz)
            wy = times(r10, nx) + times(r11, ny) + times(r12, nz)
            wz = times(r20, nx) + times(r21, ny) + times(r22, nz)
            un = times(ux, wx) + times(uy, wy) + times(uz, wz)
            # start and end on one side of a plane that touches a convex shape are on one side of the shape
            passed = -least(gap, gap - un)
            if (kind < PLANE or kind == HULL) and anywhere(passed):
                lx = times(r00, ux) + times(r10, uy) + times(r20, uz)
                ly = times(r01, ux) + times(r11, uy) + times(r21, uz)
                lz = times(r02, ux) + times(r12, uy) + times(r22, uz)
                at = gap
                ax = nx
                ay = ny
                az = nz
                met = gap
                if kind == HULL:
                    at, ax, ay, az, met = way_into_hull(shapes, s, x, y, z, lx, ly, lz)
                else:
                    at, ax, ay, az, met = way_in(kind, x, y, z, lx, ly, lz, sa, sb, sc)
                met = least(met, passed)
                gap = choose(met, at, gap)
                nx = choose(met, ax, nx)
                ny = choose(met, ay, ny)
                nz = choose(met, az, nz)
                wx = times(r00, nx) + times(r01, ny) + times(r02, nz)
                wy = times(r10, nx) + times(r11, ny) + times(r12, nz)
                wz = times(r20, nx) + times(r21, ny) + times(r22, nz)
                un = times(ux, wx) + times(uy, wy) + times(uz, wz)
            press(t, i, gap - radius, wx, wy, wz, ux, uy, uz, un, mu, leave)


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
def widen(box: wp.array(dtype=float), k: int, lo: float, hi: float, thread: int, threads: int):
    """Grow a bounding box along axis k."""
    if threads > 1:
        low = -most_of_warp(-lo, threads)
        high = most_of_warp(hi, threads)
        if leads_warp(thread, threads):
            wp.atomic_min(box, k, low)
            wp.atomic_max(box, 3 + k, high)
    else:
        box[k] = least(box[k], lo)
        box[3 + k] = most(box[3 + k], hi)


@wp.func
def widen(box: wp.array(dtype=Any), k: int, lo: Any, hi: Any, thread: int, threads: int):
    box[k] = least(box[k], lo)
    box[3 + k] = most(box[3 + k], hi)


@wp.func
def measure_box(t: Any, n: int, thread: int, threads: int):
    """The bounding box of all particles."""
    lx = t.x[0]
    ly = t.y[0]
    lz = t.z[0]
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
    widen(t.box, 0, lx, hx, thread, threads)
    widen(t.box, 1, ly, hy, thread, threads)
    widen(t.box, 2, lz, hz, thread, threads)


@wp.func
def select_shapes(t: Any, shapes: Shapes, ahead: float, thread: int, threads: int):
    """List the shapes that a particle could touch within ``ahead`` seconds.

    The list of a group of lanes is the union over its worlds; a shape that a world does not touch changes no bit.
    """
    like = t.x[0]
    # 1.5 times the present speed, what gravity adds in the time, and 2 cm for what constraints throw
    grow = root(t.notes[SPEED]) * (1.5 * ahead) + fill(like, 10.0 * ahead * ahead + 0.02) + t.scalars[THICKNESS]
    # and as far as the fastest shape may throw it
    grow = grow + fill(like, shapes.haste[0] * ahead)
    for s in range(thread, shapes.count, threads):
        row = s * COLUMNS
        cx = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row) - t.scalars[ORIGIN]
        cy = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 1) - t.scalars[ORIGIN + 1]
        cz = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 2) - t.scalars[ORIGIN + 2]
        reach = grow + per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 18)
        slot = shapes.slot[s]
        if slot >= 0:
            # haste covers where it goes from here
            clock = int(largest(t.notes[CLOCK]))
            ax = t.scalars[ORIGIN]
            ay = t.scalars[ORIGIN + 1]
            az = t.scalars[ORIGIN + 2]
            cx, cy, cz = led_place(like, shapes, slot, clock, t.group, t.worlds, ax, ay, az)
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
