"""Particles against static and moving shapes: the push with Coulomb friction.

A particle is a ball of half the cloth's thickness. The push is a position correction at the end of the substep
(after all elastic constraints, so that what they pressed into the shape counts), and friction takes back the
tangential part of the substep's motion up to mu times the push: a cloth that sticks does not creep. All motion is
relative to the shape's surface, which `nuno.contact.particle.kinematic_pose` knows of the moving ones.

Nothing passes through: where the nearest surface is not the one that a particle met first, its way through the
substep, seen from the shape, is followed to where it went in, and it is pushed out there.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import (
    HULL,
    PLANE,
    SHELL_MESH,
    SOLID_MESH,
    distance_box,
    distance_solid,
    gap_mesh,
    way_in,
)
from nuno.contact.particle.hull import distance_hull, way_into_hull
from nuno.contact.particle.kinematic_pose import kinematic_pose, stands
from nuno.numbers.element_access import at
from nuno.numbers.lane_masks import in_lanes, lanes_without
from nuno.numbers.lanes import (  # noqa: F401
    add,
    anywhere,
    choose,
    div,
    full_like,
    lane_max,
    maximum,
    minimum,
    mul,
    per_world,
    sqrt,
    sub,
    to_float,
)
from nuno.numbers.vec3 import dot, less_product, mat3, position, put_position, start_position, transposed_mul, vec3
from nuno.numbers.warps import leads_warp, warp_max
from nuno.state.cloth_state import CLOCK, FRICTION, ORIGIN, SPEED, THICKNESS, Shapes

COLUMNS = 20
"""Numbers in a row of `Shapes.table`: position 0-2, rotation (row major, shape to world) 3-11, sizes 12-14,
friction 15, pair friction 16 (negative: geometric mean), half thickness 17, bounding radius 18. Sizes are half sides
of a box, radius and half height, or half sides of a mesh's bounding box. What moves has its pose in `Shapes.pose`."""


LEAVE_SPEED = wp.constant(0.5)
"""[m/s] A particle found inside leaves no faster than this, so that a bad start is no explosion."""
OUT_OF_REACH = wp.constant(-1.0e9)
"""[m] In place of a radius, where a shape is not to be met."""
FAST = wp.constant(10.0)
"""[m/s] A particle that is faster, seen from a shape, may pass through a shape thinner than its way in a substep."""


@wp.func
def push_out(t: Any, i: int, gap: Any, n: Any, u: Any, un: Any, mu: Any, leave: Any):
    """Push particle i out along the normal n until it leaves by ``leave`` a substep at the most, with friction.

    It moves by p n - min(mu p / |u_t|, 1) u_t, where p is the push, u what it moved in the substep, less what the
    shape's surface moved, un = u . n, and u_t = u - un n.
    """
    zero = full_like(gap, 0.0)
    push = minimum(maximum(-gap, zero), maximum(leave - un, zero))
    slip = u - un * n
    hold = minimum(mu * push / sqrt(dot(slip, slip) + 1.0e-24), 1.0)
    free = choose(at(t.w, i), 1.0, zero)
    put_position(t, i, position(t, i) + push * free * n - hold * free * slip)


# Functions that return from their branches: a vector that is assigned in a branch goes through memory afterwards, for
# Warp joins branches by `wp.where`, of which Clang makes a choice between two addresses.


@wp.func
def distance_shape(shapes: Shapes, s: int, kind: int, x: Any, y: Any, z: Any, a: Any, b: Any, c: Any, margin: Any):
    """Signed distance and normal of shape s, of a mesh those of its bounding box."""
    if kind < SOLID_MESH:
        solid, n = distance_solid(kind, vec3(x, y, z), a, b, c)
        return solid, n.x, n.y, n.z
    gap, nx, ny, nz = distance_box(x, y, z, a, b, c)
    if kind == HULL and anywhere(margin - gap):
        return distance_hull(shapes, s, x, y, z, margin)
    return gap, nx, ny, nz


@wp.func
def way_into(shapes: Shapes, s: int, kind: int, p: Any, u: Any, a: Any, b: Any, c: Any):
    """Return where a way of length u that ends at p enters a convex shape: `nuno.contact.particle.distances.way_in`."""
    if kind == HULL:
        gap, nx, ny, nz, met = way_into_hull(shapes, s, p.x, p.y, p.z, u.x, u.y, u.z)
        return gap, vec3(nx, ny, nz), met
    return way_in(kind, p, u, a, b, c)


@wp.func
def less_surface(slot: int, u: Any, e: Any, d: Any, p: Any):
    """Return what a particle moves, less what a shape's surface moves there: e and d p."""
    if slot < 0:
        return u
    return less_product(u - e, d, p)


@wp.func
def origin_of(t: Any):
    """Return what the world's positions are relative to."""
    return vec3(t.scalars[ORIGIN], t.scalars[ORIGIN + 1], t.scalars[ORIGIN + 2])


@wp.func
def three_of(like: Any, t: Any, shapes: Shapes, entry: int):
    """Three numbers of a shape's row in the table."""
    g = t.group
    x = per_world(like, shapes.table, g, shapes.stride, t.worlds, entry)
    y = per_world(like, shapes.table, g, shapes.stride, t.worlds, entry + 1)
    z = per_world(like, shapes.table, g, shapes.stride, t.worlds, entry + 2)
    return vec3(x, y, z)


@wp.func
def rotation_of(like: Any, t: Any, shapes: Shapes, row: int):
    """The rotation, shape to world, of a shape that stands still."""
    x = three_of(like, t, shapes, row + 3)
    y = three_of(like, t, shapes, row + 6)
    z = three_of(like, t, shapes, row + 9)
    return mat3(x, y, z)


@wp.func
def touch_shape(t: Any, n: int, shapes: Shapes, s: int, dt: float, rank: int, size: int):
    """All particles against one shape."""
    row = s * COLUMNS
    like = full_like(t.x[0], 0.0)
    g = t.group
    w = t.worlds
    origin = origin_of(t)
    centre = three_of(like, t, shapes, row) - origin
    r = rotation_of(like, t, shapes, row)
    extent = three_of(like, t, shapes, row + 12)
    mean = sqrt(t.scalars[FRICTION] * per_world(like, shapes.table, g, shapes.stride, w, row + 15))
    pair = per_world(like, shapes.table, g, shapes.stride, w, row + 16)
    mu = choose(pair + 0.5, pair, mean)
    radius = t.scalars[THICKNESS] * 0.5 + per_world(like, shapes.table, g, shapes.stride, w, row + 17)
    radius = in_lanes(radius, t.shape_list[1 + shapes.count + s], OUT_OF_REACH)
    leave = full_like(like, LEAVE_SPEED * dt)
    kind = shapes.kind[s]
    slot = shapes.slot[s]
    # what the surface moves in this substep: e of the shape's centre, d of its axes
    e = centre
    d = r
    if slot >= 0:
        clock = int(lane_max(t.notes[CLOCK]))
        before, turn_before = kinematic_pose(like, shapes, slot, clock - 1, clock, g, w, origin)
        centre, r = kinematic_pose(like, shapes, slot, clock, clock, g, w, origin)
        e = centre - before
        d = r - turn_before
    # what comes nearer than this may have passed through within the substep
    margin = radius + FAST * dt
    for i in range(rank, n, size):
        # in the shape's frame
        p = transposed_mul(r, to_float(position(t, i) - centre))
        gap, nx, ny, nz = distance_shape(shapes, s, kind, p.x, p.y, p.z, extent.x, extent.y, extent.z, margin)
        if anywhere(margin - gap):
            u = less_surface(slot, position(t, i) - start_position(t, i), e, d, p)
            local = vec3(nx, ny, nz)
            normal = r * local
            un = dot(u, normal)
            # start and end on one side of a plane that touches a convex shape are on one side of the shape
            passed = -minimum(gap, gap - un)
            # a lane is looked at because another is near: what is swifter must not see more than it would alone
            within = margin - gap
            passed = minimum(passed, within)
            if kind == SOLID_MESH or kind == SHELL_MESH:
                way = transposed_mul(r, u)
                deep, ax, ay, az = gap_mesh(
                    shapes, s, g, w, within, p.x, p.y, p.z, way.x, way.y, way.z, extent.x, extent.y, extent.z, radius
                )
                out = r * vec3(ax, ay, az)
                push_out(t, i, deep - radius, out, u, dot(u, out), mu, leave)
            elif kind != PLANE and anywhere(passed):
                deep, entered, met = way_into(shapes, s, kind, p, transposed_mul(r, u), extent.x, extent.y, extent.z)
                met = minimum(met, passed)
                out = r * choose(met, entered, local)
                push_out(t, i, choose(met, deep, gap) - radius, out, u, dot(u, out), mu, leave)
            elif anywhere(radius - gap):
                push_out(t, i, gap - radius, normal, u, un, mu, leave)


@wp.func
def reset_box(t: Any, rank: int):
    """Start the worlds' bounding boxes anew; one thread does it."""
    if rank == 0:
        big = full_like(t.x[0], 1.0e9)
        for k in range(3):
            t.box[k] = big
            t.box[3 + k] = -big
        t.shape_list[0] = 0


@wp.func
def grow_box(box: wp.array(dtype=float), k: int, lo: float, hi: float, rank: int, size: int):
    """Grow a bounding box along axis k."""
    if size > 1:
        low = -warp_max(-lo, size)
        high = warp_max(hi, size)
        if leads_warp(rank, size):
            wp.atomic_min(box, k, low)
            wp.atomic_max(box, 3 + k, high)
    else:
        box[k] = minimum(box[k], lo)
        box[3 + k] = maximum(box[3 + k], hi)


@wp.func
def grow_box(box: wp.array(dtype=Any), k: int, lo: Any, hi: Any, rank: int, size: int):
    box[k] = minimum(box[k], lo)
    box[3 + k] = maximum(box[3 + k], hi)


@wp.func
def measure_box(t: Any, n: int, rank: int, size: int):
    """The bounding box of all particles."""
    lx = t.x[0]
    ly = t.y[0]
    lz = t.z[0]
    hx = lx
    hy = ly
    hz = lz
    for i in range(rank, n, size):
        lx = minimum(lx, at(t.x, i))
        ly = minimum(ly, at(t.y, i))
        lz = minimum(lz, at(t.z, i))
        hx = maximum(hx, at(t.x, i))
        hy = maximum(hy, at(t.y, i))
        hz = maximum(hz, at(t.z, i))
    grow_box(t.box, 0, lx, hx, rank, size)
    grow_box(t.box, 1, ly, hy, rank, size)
    grow_box(t.box, 2, lz, hz, rank, size)


@wp.func
def along_box(t: Any, n: Any, axis: int, centre: Any):
    """The least of the box's corners along a plane's normal, by one coordinate."""
    return minimum(n * (t.box[axis] - centre), n * (t.box[3 + axis] - centre))


@wp.func
def reach_of_frame(t: Any, shapes: Shapes, ahead: float):
    """Return how much farther apart than now a particle and a shape may be and still meet [m].

    That is within ``ahead`` seconds.
    """
    # 1.5 times the present speed, what gravity adds in the time, and 2 cm for what constraints throw
    grow = sqrt(t.notes[SPEED]) * (1.5 * ahead) + (10.0 * ahead * ahead + 0.02) + t.scalars[THICKNESS]
    # and as far as the fastest shape may throw it
    return grow + shape_speed_of(t, shapes) * ahead


@wp.func
def shape_speed_of(t: Any, shapes: Shapes):
    """The speed of the world's fastest shape [m/s]."""
    return per_world(t.notes[SPEED], shapes.shape_speed, t.group, wp.min(shapes.pose_stride, 1), t.worlds, 0)


@wp.func
def select_shapes(t: Any, shapes: Shapes, ahead: float, rank: int, size: int):
    """List the shapes that a particle could touch within ``ahead`` seconds.

    The list of a group of lanes is the union over its worlds. Behind it are, for each shape, the worlds that would not
    list it alone, bit by bit: what moves farther than was expected must not meet it for another world's sake.
    """
    like = t.x[0]
    grow = reach_of_frame(t, shapes, ahead)
    for s in range(rank, shapes.count, size):
        row = s * COLUMNS
        cx = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row) - t.scalars[ORIGIN]
        cy = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 1) - t.scalars[ORIGIN + 1]
        cz = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 2) - t.scalars[ORIGIN + 2]
        reach = grow + per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 18)
        slot = shapes.slot[s]
        still = full_like(like, 1.0)
        nx = like
        ny = like
        nz = like
        if shapes.kind[s] == PLANE:
            nx = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 5)
            ny = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 8)
            nz = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 11)
        if slot >= 0:
            # haste covers where it goes from here
            clock = int(lane_max(t.notes[CLOCK]))
            centre, r = kinematic_pose(like, shapes, slot, clock, clock + 1, t.group, t.worlds, origin_of(t))
            cx = centre.x
            cy = centre.y
            cz = centre.z
            nx = r.x.z
            ny = r.y.z
            nz = r.z.z
            still = stands(like, shapes, slot, clock + 1, t.group, t.worlds)
        ox = maximum(t.box[0] - cx, cx - t.box[3])
        oy = maximum(t.box[1] - cy, cy - t.box[4])
        oz = maximum(t.box[2] - cz, cz - t.box[5])
        far = maximum(ox, maximum(oy, oz))
        if shapes.kind[s] == PLANE:
            # where it stands as far as the corner of the box that is the nearest
            corner = along_box(t, nx, 0, cx) + along_box(t, ny, 1, cy) + along_box(t, nz, 2, cz)
            near = grow + per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 17)
            far = choose(still, corner, far)
            reach = choose(still, near, reach)
        if anywhere(reach - far):
            k = wp.atomic_add(t.shape_list, 0, 1)
            t.shape_list[1 + k] = s
            t.shape_list[1 + shapes.count + s] = lanes_without(reach - far)


@wp.func
def sort_shapes(t: Any, rank: int):
    """Bring the list into the shapes' order, so that it does not depend on which thread came first."""
    if rank == 0:
        for a in range(1, t.shape_list[0]):
            s = t.shape_list[1 + a]
            b = int(a)
            while b > 0 and t.shape_list[b] > s:
                t.shape_list[1 + b] = t.shape_list[b]
                b = b - 1
            t.shape_list[1 + b] = s


@wp.func
def touch_shapes(t: Any, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    """All particles against the shapes nearby."""
    for k in range(t.shape_list[0]):
        touch_shape(t, n, shapes, t.shape_list[1 + k], dt, rank, size)
