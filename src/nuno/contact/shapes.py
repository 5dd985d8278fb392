"""Particles against static and moving shapes: the push with Coulomb friction.

A particle is a ball of half the cloth's thickness. The push is a position correction at the end of the substep
(after all elastic constraints, so that what they pressed into the shape counts), and friction takes back the
tangential part of the substep's motion up to mu times the push: a cloth that sticks does not creep. All motion is
relative to the shape's surface, which `nuno.contact.led` knows of the moving ones.

Nothing passes through: where the nearest surface is not the one that a particle met first, its way through the
substep, seen from the shape, is followed to where it went in, and it is pushed out there.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import (
    HULL,
    PLANE,
    SHELL_MESH,
    SOLID_MESH,
    distance_box,
    distance_solid,
    gap_mesh,
    way_in,
)
from nuno.contact.hull import distance_hull, way_into_hull
from nuno.contact.led import led_place, led_turn
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
    per_world,
    root,
    sub,
    times,
)
from nuno.solver.state import CLOCK, FRICTION, ORIGIN, SPEED, THICKNESS, Shapes
from nuno.solver.vector import at, put
from nuno.solver.warps import leads_warp, most_of_warp

COLUMNS = 20
"""Numbers in a row of `Shapes.table`: position 0-2, rotation (row major, shape to world) 3-11, sizes 12-14,
friction 15, pair friction 16 (negative: geometric mean), half thickness 17, bounding radius 18. Sizes are half sides
of a box, radius and half height, or half sides of a mesh's bounding box. What moves has its pose in `Shapes.pose`."""


LEAVE_SPEED = wp.constant(0.5)
"""[m/s] A particle found inside leaves no faster than this, so that a bad start is no explosion."""
SWIFT = wp.constant(10.0)
"""[m/s] A particle that is faster, seen from a shape, may pass through a shape thinner than its way in a substep."""


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
    free = choose(at(t.w, i), fill(gap, 1.0), zero)
    push = times(push, free)
    hold = times(hold, free)
    put(t.x, i, at(t.x, i) + times(push, nx) - times(hold, tx))
    put(t.y, i, at(t.y, i) + times(push, ny) - times(hold, ty))
    put(t.z, i, at(t.z, i) + times(push, nz) - times(hold, tz))


# Functions that return from their branches: a vector that is assigned in a branch goes through memory afterwards, for
# Warp joins branches by `wp.where`, of which Clang makes a choice between two addresses.


@wp.func
def distance_shape(shapes: Shapes, s: int, kind: int, x: Any, y: Any, z: Any, a: Any, b: Any, c: Any, near: Any):
    """Signed distance and normal of shape s, of a mesh those of its bounding box."""
    if kind < SOLID_MESH:
        return distance_solid(kind, x, y, z, a, b, c)
    gap, nx, ny, nz = distance_box(x, y, z, a, b, c)
    if kind == HULL and anywhere(near - gap):
        return distance_hull(shapes, s, x, y, z, near)
    return gap, nx, ny, nz


@wp.func
def way_into(
    shapes: Shapes, s: int, kind: int, x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, a: Any, b: Any, c: Any
):
    """Where a way that ends at x, y, z and is u long enters a convex shape: see `nuno.contact.distances.way_in`."""
    if kind == HULL:
        return way_into_hull(shapes, s, x, y, z, ux, uy, uz)
    return way_in(kind, x, y, z, ux, uy, uz, a, b, c)


@wp.func
def less_surface(slot: int, u: Any, e: Any, d0: Any, d1: Any, d2: Any, x: Any, y: Any, z: Any):
    """What a particle moves along one axis, less what a shape's surface moves there."""
    if slot < 0:
        return u
    return u - e - times(d0, x) - times(d1, y) - times(d2, z)


@wp.func
def turned(
    r00: Any, r01: Any, r02: Any, r10: Any, r11: Any, r12: Any, r20: Any, r21: Any, r22: Any, x: Any, y: Any, z: Any
):
    """A direction, turned by a matrix of three rows."""
    wx = times(r00, x) + times(r01, y) + times(r02, z)
    wy = times(r10, x) + times(r11, y) + times(r12, z)
    wz = times(r20, x) + times(r21, y) + times(r22, z)
    return wx, wy, wz


@wp.func
def touch_shape(t: Any, n: int, shapes: Shapes, s: int, dt: float, thread: int, threads: int):
    """All particles against one shape."""
    row = s * COLUMNS
    like = fill(t.x[0], 0.0)
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
        dx = minus(at(t.x, i), cx)
        dy = minus(at(t.y, i), cy)
        dz = minus(at(t.z, i), cz)
        # into the shape's frame
        x, y, z = turned(r00, r10, r20, r01, r11, r21, r02, r12, r22, dx, dy, dz)
        gap, nx, ny, nz = distance_shape(shapes, s, kind, x, y, z, sa, sb, sc, near)
        if anywhere(near - gap):
            ux = less_surface(slot, at(t.x, i) - at(t.px, i), ex, d00, d01, d02, x, y, z)
            uy = less_surface(slot, at(t.y, i) - at(t.py, i), ey, d10, d11, d12, x, y, z)
            uz = less_surface(slot, at(t.z, i) - at(t.pz, i), ez, d20, d21, d22, x, y, z)
            wx, wy, wz = turned(r00, r01, r02, r10, r11, r12, r20, r21, r22, nx, ny, nz)
            un = times(ux, wx) + times(uy, wy) + times(uz, wz)
            # start and end on one side of a plane that touches a convex shape are on one side of the shape
            passed = -least(gap, gap - un)
            # a lane is looked at because another is near: what is swifter must not see more than it would alone
            within = near - gap
            passed = least(passed, within)
            if kind == SOLID_MESH or kind == SHELL_MESH:
                lx, ly, lz = turned(r00, r10, r20, r01, r11, r21, r02, r12, r22, ux, uy, uz)
                deep, ax, ay, az = gap_mesh(shapes, s, g, w, within, x, y, z, lx, ly, lz, sa, sb, sc, radius)
                bx, by, bz = turned(r00, r01, r02, r10, r11, r12, r20, r21, r22, ax, ay, az)
                bn = times(ux, bx) + times(uy, by) + times(uz, bz)
                press(t, i, deep - radius, bx, by, bz, ux, uy, uz, bn, mu, leave)
            elif kind != PLANE and anywhere(passed):
                lx, ly, lz = turned(r00, r10, r20, r01, r11, r21, r02, r12, r22, ux, uy, uz)
                deep, ax, ay, az, met = way_into(shapes, s, kind, x, y, z, lx, ly, lz, sa, sb, sc)
                met = least(met, passed)
                ax = choose(met, ax, nx)
                ay = choose(met, ay, ny)
                az = choose(met, az, nz)
                bx, by, bz = turned(r00, r01, r02, r10, r11, r12, r20, r21, r22, ax, ay, az)
                bn = times(ux, bx) + times(uy, by) + times(uz, bz)
                press(t, i, choose(met, deep, gap) - radius, bx, by, bz, ux, uy, uz, bn, mu, leave)
            elif anywhere(radius - gap):
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
        lx = least(lx, at(t.x, i))
        ly = least(ly, at(t.y, i))
        lz = least(lz, at(t.z, i))
        hx = most(hx, at(t.x, i))
        hy = most(hy, at(t.y, i))
        hz = most(hz, at(t.z, i))
    widen(t.box, 0, lx, hx, thread, threads)
    widen(t.box, 1, ly, hy, thread, threads)
    widen(t.box, 2, lz, hz, thread, threads)


@wp.func
def along_box(t: Any, shapes: Shapes, row: int, axis: int, centre: Any):
    """The least of the box's corners along a plane's normal, by one coordinate."""
    n = per_world(centre, shapes.table, t.group, shapes.stride, t.worlds, row + 5 + 3 * axis)
    return least(times(n, t.box[axis] - centre), times(n, t.box[3 + axis] - centre))


@wp.func
def reach_of_frame(t: Any, shapes: Shapes, ahead: float):
    """How much farther than a cloth's particles and a shape's surface are now they may come to meet [m].

    That is within ``ahead`` seconds.
    """
    # 1.5 times the present speed, what gravity adds in the time, and 2 cm for what constraints throw
    grow = root(t.notes[SPEED]) * (1.5 * ahead) + fill(t.x[0], 10.0 * ahead * ahead + 0.02) + t.scalars[THICKNESS]
    # and as far as the fastest shape may throw it
    return grow + fill(t.x[0], shapes.haste[0] * ahead)


@wp.func
def select_shapes(t: Any, shapes: Shapes, ahead: float, thread: int, threads: int):
    """List the shapes that a particle could touch within ``ahead`` seconds.

    The list of a group of lanes is the union over its worlds; a shape that a world does not touch changes no bit.
    """
    like = t.x[0]
    grow = reach_of_frame(t, shapes, ahead)
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
        far = most(ox, most(oy, oz))
        if shapes.kind[s] == PLANE and slot < 0:
            # as far as the corner of the box that is the nearest
            far = along_box(t, shapes, row, 0, cx) + along_box(t, shapes, row, 1, cy) + along_box(t, shapes, row, 2, cz)
            reach = grow + per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 17)
        if anywhere(reach - far):
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
