"""Signed distances of points from shapes, with their normals: primitive shapes by formula, meshes by a query.

Where the nearest surface is not the one that a point met first, its way, seen from the shape, is followed to where it
went in.
"""

from typing import Any

import warp as wp

from nuno.numbers.lanes import (  # noqa: F401
    LANES,
    absolute,
    add,
    anywhere,
    choose,
    div,
    full_like,
    lane,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
)
from nuno.numbers.vec3 import dot, vec3
from nuno.state.cloth_state import Shapes

BOX, SPHERE, CYLINDER, CAPSULE, PLANE, SOLID_MESH, SHELL_MESH, HULL = range(8)
FORMULAS = {"box": BOX, "sphere": SPHERE, "cylinder": CYLINDER, "capsule": CAPSULE, "plane": PLANE}
"""The kinds of shapes with a formula, which `distance_solid` has. Edges of cloth, too, look at those before the plane,
all of them convex; others come between the plane and the meshes, and only vertices look at them. docs/extending.md
shows what a new one needs."""

FAR = wp.constant(1.0e6)
"""[m] The distance of what is too far to matter."""
MESH_DEPTH = wp.constant(0.05)
"""[m] What starts deeper in a mesh stays there: a wider search would cost all that is near it, in every substep."""
TRACE_STEPS = wp.constant(12)
"""Steps to where a way enters a shape: one for a way straight in, 12 leave 3 % of one that comes in at 75 degrees."""


@wp.func
def distance_box(x: Any, y: Any, z: Any, a: Any, b: Any, c: Any):
    """Signed distance and normal of a box of half sides a, b, c around the origin."""
    qx = absolute(x) - a
    qy = absolute(y) - b
    qz = absolute(z) - c
    zero = full_like(x, 0.0)
    one = full_like(x, 1.0)
    sx = choose(x, one, -one)
    sy = choose(y, one, -one)
    sz = choose(z, one, -one)
    ox = maximum(qx, zero)
    oy = maximum(qy, zero)
    oz = maximum(qz, zero)
    # inside and over a face, the nearest face gives distance and normal
    gap = maximum(qx, maximum(qy, qz))
    fz = choose(qz - maximum(qx, qy), one, zero)
    fx = (one - fz) * choose(qx - qy, one, zero)
    fy = one - fz - fx
    corner = ox + oy + oz - maximum(gap, zero)
    if not anywhere(corner):
        return gap, sx * fx, sy * fy, sz * fz
    outside = sqrt(ox * ox + oy * oy + oz * oz + 1.0e-24)
    nx = sx * choose(corner, ox / outside, fx)
    ny = sy * choose(corner, oy / outside, fy)
    nz = sz * choose(corner, oz / outside, fz)
    return choose(corner, outside, gap), nx, ny, nz


@wp.func
def distance_cylinder(x: Any, y: Any, z: Any, r: Any, half: Any):
    """Signed distance and normal of a cylinder of radius r along z, between -half and half."""
    zero = full_like(x, 0.0)
    one = full_like(x, 1.0)
    rho = sqrt(x * x + y * y + 1.0e-24)
    qr = rho - r
    qz = absolute(z) - half
    o = maximum(qr, zero)
    oz = maximum(qz, zero)
    outside = sqrt(o * o + oz * oz + 1.0e-24)
    inside = maximum(qr, qz)
    side = choose(qr - qz, one, zero)
    nr = choose(inside, o / outside, side)
    nz = choose(z, one, -one) * choose(inside, oz / outside, one - side)
    return choose(inside, outside, inside), nr * (x / rho), nr * (y / rho), nz


@wp.func
def distance_round(x: Any, y: Any, z: Any, r: Any, half: Any):
    """Signed distance and normal of a capsule along z (half > 0) or a sphere (half = 0)."""
    d = z - maximum(minimum(z, half), -half)
    length = sqrt(x * x + y * y + d * d + 1.0e-24)
    return length - r, x / length, y / length, d / length


@wp.func
def distance_solid(kind: int, p: Any, a: Any, b: Any, c: Any):
    """Signed distance and normal of a primitive shape of sizes a, b, c at the point p."""
    if kind == BOX:
        gap, nx, ny, nz = distance_box(p.x, p.y, p.z, a, b, c)
        return gap, vec3(nx, ny, nz)
    if kind == CYLINDER:
        gap, nx, ny, nz = distance_cylinder(p.x, p.y, p.z, a, b)
        return gap, vec3(nx, ny, nz)
    if kind == SPHERE or kind == CAPSULE:
        gap, nx, ny, nz = distance_round(p.x, p.y, p.z, a, b)
        return gap, vec3(nx, ny, nz)
    return p.z, vec3(full_like(p.z, 0.0), full_like(p.z, 0.0), full_like(p.z, 1.0))


@wp.func
def way_in(kind: int, p: Any, u: Any, a: Any, b: Any, c: Any):
    """Return where a way of the substep that ends at p and is u long enters a shape with a formula.

    Returns:
        The distance of p from the plane that touches the shape there, its normal, and whether the way enters at all
        (positive). A way that starts inside enters at the side that is nearest to its start.
    """
    one = full_like(p.x, 1.0)
    zero = full_like(p.x, 0.0)
    length = sqrt(dot(u, u) + 1.0e-24)
    part = full_like(p.x, 0.0)  # of the way, from its start
    gap = zero
    n = vec3(zero, zero, one)
    steps = int(TRACE_STEPS)
    for _k in range(steps):
        # the shape is at least as far away as its distance says: go that far
        part = minimum(part + maximum(gap, zero) / length, one)
        gap, n = distance_solid(kind, p - (one - part) * u, a, b, c)
    rest = one - part
    return gap + rest * dot(u, n), n, rest


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
    within: float,
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
    """`mesh_gap` of one world; of many, where ``within`` is positive."""
    mesh = shapes.mesh[s + group * shapes.mesh_stride]
    r = mesh_gap(mesh, shapes.kind[s], wp.vec3(x, y, z), wp.vec3(ux, uy, uz), wp.vec3(a, b, c), radius)
    return r[0], r[1], r[2], r[3]


@wp.func
def gap_mesh(
    shapes: Shapes,
    s: int,
    group: int,
    worlds: int,
    within: lane,
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
    lanes = int(LANES)  # a variable: the loop stays a loop, and kernels compile in half the time
    for k in range(lanes):
        mesh = shapes.mesh[s + wp.min(group * LANES + k, worlds - 1) * shapes.mesh_stride]
        half = wp.vec3(a[k], b[k], c[k])
        r = wp.vec4(FAR, 0.0, 0.0, 1.0)
        if within[k] > 0.0:
            r = mesh_gap(mesh, kind, wp.vec3(x[k], y[k], z[k]), wp.vec3(ux[k], uy[k], uz[k]), half, radius[k])
        gap[k] = r[0]
        nx[k] = r[1]
        ny[k] = r[2]
        nz[k] = r[3]
    return gap, nx, ny, nz
