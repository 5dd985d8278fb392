"""Particles against shapes that stand still and have a formula, by the threads of a CUDA block.

What `nuno.contact.particle.shape_contact.touch_shape` does, without what it knows of meshes and of moving shapes: that
takes more numbers than a thread has registers, and to fetch them from memory again takes longer than all the rest.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import BOX, PLANE, SOLID_MESH, distance_solid, way_in
from nuno.contact.particle.shape_contact import COLUMNS, FAST, LEAVE_SPEED, origin_of, push_out, touch_shape
from nuno.numbers.lanes import mul, sub, subarray, to_float  # noqa: F401 (mul, sub: Warp takes them for the operators)
from nuno.numbers.vec3 import dot, mat3, position, start_position, transposed_mul, vec3
from nuno.state.cloth_state import FRICTION, THICKNESS, Shapes


@wp.func
def touch_still(t: Any, n: int, shapes: Shapes, s: int, dt: float, rank: int, size: int):
    """All particles against one such shape."""
    row = subarray(shapes.table, t.group * shapes.stride + s * COLUMNS, COLUMNS)
    centre = vec3(row[0], row[1], row[2]) - origin_of(t)
    r = mat3(vec3(row[3], row[4], row[5]), vec3(row[6], row[7], row[8]), vec3(row[9], row[10], row[11]))
    sa = row[12]
    sb = row[13]
    sc = row[14]
    mu = row[16]
    if mu + 0.5 <= 0.0:
        mu = wp.sqrt(t.scalars[FRICTION] * row[15])
    radius = t.scalars[THICKNESS] * 0.5 + row[17]
    kind = shapes.kind[s]
    margin = radius + FAST * dt
    for i in range(rank, n, size):
        # in the shape's frame
        p = transposed_mul(r, to_float(position(t, i) - centre))
        # a box is no nearer than the farthest of its sides' planes
        nearest = p.z
        if kind == BOX:
            nearest = wp.max(wp.max(wp.abs(p.x) - sa, wp.abs(p.y) - sb), wp.abs(p.z) - sc)
        elif kind != PLANE:
            nearest = 0.0
        gap = float(nearest)
        local = vec3(0.0, 0.0, 1.0)
        if margin - nearest > 0.0 and kind != PLANE:
            gap, local = distance_solid(kind, p, sa, sb, sc)
        if margin - gap > 0.0:
            u = position(t, i) - start_position(t, i)
            normal = r * local
            un = dot(u, normal)
            if kind != PLANE and wp.min(gap, gap - un) < 0.0:
                entered_at, entered, met = way_in(kind, p, transposed_mul(r, u), sa, sb, sc)
                if met > 0.0:
                    gap = entered_at
                    normal = r * entered
                    un = dot(u, normal)
            push_out(t, i, gap - radius, normal, u, un, mu, LEAVE_SPEED * dt)


@wp.func
def touch_shapes_together(t: Any, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    """All particles against the shapes nearby, as `nuno.contact.particle.shape_contact.touch_shapes`."""
    for k in range(t.shape_list[0]):
        s = t.shape_list[1 + k]
        if shapes.kind[s] < SOLID_MESH and shapes.slot[s] < 0:
            touch_still(t, n, shapes, s, dt, rank, size)
        else:
            touch_shape(t, n, shapes, s, dt, rank, size)
