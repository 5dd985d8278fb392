"""Contacts of single particles with static and moving shapes, solved together with the rows that press on them.

A box on a cloth on a table is borne by the table: what the box pushes down, the table must push back within the same
passes, or the load sinks through the cloth. So every particle that a row presses on gets its contacts with shapes as
bounds: along a shape's normal it may go as far as the surface and no farther, with Coulomb friction on the way. A
shape has no mass of its own here, so one particle's bound is met exactly and at once, and a row can tell beforehand
how far a particle gives way: not at all where it already lies on the shape. A heavy body on a light cloth on a table
therefore needs no more passes than on the table itself.

All is taken where the substep began, as for rows; what is fast, sharp or met by more than `MOST` shapes is left to
the phase of shapes that follows (`nuno.contact.particle.shape_contact`), which then finds everything else where it
should be.
"""

import warp as wp

from nuno.contact.particle.distances import SHELL_MESH, SOLID_MESH, mesh_gap
from nuno.contact.particle.kinematic_pose import kinematic_position, kinematic_rotation
from nuno.contact.particle.shape_contact import COLUMNS, distance_shape
from nuno.coupled.bounded_particles import MOST, Particles
from nuno.coupled.contact_candidates import Elements
from nuno.coupled.contact_rows import LEAVE_SPEED
from nuno.coupled.coupled_passes import Layout
from nuno.numbers.lanes import per_world
from nuno.state.cloth_state import FRICTION, SCALARS, THICKNESS, Shapes


@wp.struct
class Surroundings:
    """The static and moving shapes around a body's particles, in its solver's arrays.

    ``near`` lists the shapes nearby, ``stride`` numbers a group of lanes: how many, which, and for each shape the lanes
    that would not list it.
    """

    shapes: Shapes
    worlds: int
    stride: int
    near: wp.array(dtype=int)
    scalars: wp.array(dtype=float)


@wp.func
def entry(shapes: Shapes, world: int, worlds: int, row: int):
    """A number of a shape's row in the table."""
    return per_world(0.0, shapes.table, world, shapes.stride, worlds, row)


@wp.func
def pose_of(around: Surroundings, s: int, clock: int, substep: int, world: int, origin: wp.vec3):
    """A shape's centre, relative to the solver's origin, and its rotation matrix, after ``clock`` substeps."""
    shapes = around.shapes
    slot = shapes.slot[s]
    row = s * COLUMNS
    n = around.worlds
    centre = wp.vec3(entry(shapes, world, n, row), entry(shapes, world, n, row + 1), entry(shapes, world, n, row + 2))
    centre = centre - origin
    turn = wp.mat33()
    if slot < 0:
        for a in range(3):
            for b in range(3):
                turn[a, b] = entry(shapes, world, n, row + 3 + 3 * a + b)
    else:
        cx, cy, cz = kinematic_position(0.0, shapes, slot, clock, substep, world, n, origin[0], origin[1], origin[2])
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = kinematic_rotation(0.0, shapes, slot, clock, substep, world, n)
        centre = wp.vec3(cx, cy, cz)
        turn = wp.mat33(r00, r01, r02, r10, r11, r12, r20, r21, r22)
    return centre, turn


@wp.func
def shape_gap(around: Surroundings, s: int, world: int, x: wp.vec3, far: float):
    """Signed distance and normal (4 numbers) of a point in a shape's frame; what is beyond ``far`` is only farther."""
    shapes = around.shapes
    kind = shapes.kind[s]
    row = s * COLUMNS + 12
    a = entry(shapes, world, around.worlds, row)
    b = entry(shapes, world, around.worlds, row + 1)
    c = entry(shapes, world, around.worlds, row + 2)
    gap, nx, ny, nz = distance_shape(shapes, s, kind, x[0], x[1], x[2], a, b, c, far)
    found = wp.vec4(gap, nx, ny, nz)
    if (kind == SOLID_MESH or kind == SHELL_MESH) and gap < far:
        mesh = shapes.mesh[s + world * shapes.mesh_stride]
        found = mesh_gap(mesh, kind, x, wp.vec3(), wp.vec3(a, b, c), far)
    return found


@wp.func
def keep_nearest(particles: Particles, j: int, s: int, n: wp.vec3, room: float, motion: wp.vec3, friction: float):
    """Note a contact with shape s, or pass over it where there are `MOST` with less room already."""
    c = int(MOST * j)
    for k in range(1, MOST):
        if particles.shape[c] >= 0 and (
            particles.shape[MOST * j + k] < 0 or particles.shape_room[MOST * j + k] > particles.shape_room[c]
        ):
            c = MOST * j + k
    if particles.shape[c] < 0 or room < particles.shape_room[c]:
        particles.shape[c] = s
        particles.shape_normal[c] = n
        particles.shape_room[c] = room
        particles.shape_motion[c] = motion
        particles.shape_friction[c] = friction


@wp.kernel(enable_backward=False, module="nuno.coupled.shape_bounds")
def bound_particles(
    layout: Layout, particles: Particles, elements: Elements, around: Surroundings, body: int, clock: int, dt: float
):
    """Find the shapes that each particle in an active row may touch in the substep that ends at ``clock``."""
    world, i = wp.tid()
    j = world * particles.count + layout.first + i
    if particles.pressed[j] == 0:
        return
    particles.pressed[j] = 0
    for k in range(MOST):
        particles.shape[MOST * j + k] = -1
        particles.shape_push[MOST * j + k] = 0.0
        particles.shape_drag[MOST * j + k] = wp.vec3(0.0, 0.0, 0.0)
    if particles.w[j] == 0.0:
        return
    group = world / layout.lanes
    lane = world % layout.lanes
    figures = group * SCALARS * layout.lanes + lane
    half = 0.5 * around.scalars[figures + THICKNESS * layout.lanes]
    own_friction = around.scalars[figures + FRICTION * layout.lanes]
    origin = layout.origin[world]
    p = particles.p[j] - layout.offset[world]
    reach = elements.reach[world * elements.bodies + body]
    for k in range(around.near[group * around.stride]):
        s = around.near[group * around.stride + 1 + k]
        if (around.near[group * around.stride + 1 + around.shapes.count + s] >> lane) & 1 != 0:
            continue  # the world would not list it alone
        row = s * COLUMNS
        radius = half + entry(around.shapes, world, around.worlds, row + 17)
        far = radius + reach
        before = clock
        if around.shapes.slot[s] >= 0:
            before = clock - 1
        centre, turn = pose_of(around, s, before, clock, world, origin)
        x = wp.transpose(turn) * (p - centre)
        found = shape_gap(around, s, world, x, far)
        gap = found[0]
        if gap < far:
            n = turn * wp.vec3(found[1], found[2], found[3])
            motion = wp.vec3(0.0, 0.0, 0.0)
            if around.shapes.slot[s] >= 0:
                after, turned_on = pose_of(around, s, clock, clock, world, origin)
                motion = (after - centre) + (turned_on - turn) * x
            mean = wp.sqrt(own_friction * entry(around.shapes, world, around.worlds, row + 15))
            pair = entry(around.shapes, world, around.worlds, row + 16)
            # parts slowly where it is too close already
            room = gap - wp.min(radius, gap + LEAVE_SPEED * dt)
            keep_nearest(particles, j, s, n, room - wp.dot(motion, n), motion, wp.where(pair < -0.5, mean, pair))
    if particles.shape[MOST * j] >= 0:
        bounded = wp.atomic_add(particles.bounded_count, world, 1)
        particles.bounded[world * particles.count + bounded] = j
