"""Particles against shapes that stand still and have a formula, by the threads of a CUDA block.

What `nuno.contact.shapes.touch_shape` does, without what it knows of meshes and of moving shapes: that takes more
numbers than a thread has registers, and to fetch them from memory again takes longer than all the rest.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import BOX, PLANE, SOLID_MESH, distance_solid, way_in
from nuno.contact.shapes import COLUMNS, LEAVE_SPEED, SWIFT, press, touch_shape
from nuno.solver.lanes import minus, sub, window  # noqa: F401 (sub: Warp takes it for the operator)
from nuno.solver.state import FRICTION, ORIGIN, THICKNESS, Shapes


@wp.func
def touch_still(t: Any, n: int, shapes: Shapes, s: int, dt: float, thread: int, threads: int):
    """All particles against one such shape."""
    row = window(shapes.table, t.group * shapes.stride + s * COLUMNS, COLUMNS)
    cx = row[0] - t.scalars[ORIGIN]
    cy = row[1] - t.scalars[ORIGIN + 1]
    cz = row[2] - t.scalars[ORIGIN + 2]
    r00 = row[3]
    r01 = row[4]
    r02 = row[5]
    r10 = row[6]
    r11 = row[7]
    r12 = row[8]
    r20 = row[9]
    r21 = row[10]
    r22 = row[11]
    sa = row[12]
    sb = row[13]
    sc = row[14]
    mu = row[16]
    if mu + 0.5 <= 0.0:
        mu = wp.sqrt(t.scalars[FRICTION] * row[15])
    radius = t.scalars[THICKNESS] * 0.5 + row[17]
    kind = shapes.kind[s]
    near = radius + SWIFT * dt
    for i in range(thread, n, threads):
        dx = minus(t.x[i], cx)
        dy = minus(t.y[i], cy)
        dz = minus(t.z[i], cz)
        x = r00 * dx + r10 * dy + r20 * dz
        y = r01 * dx + r11 * dy + r21 * dz
        z = r02 * dx + r12 * dy + r22 * dz
        # a box is no nearer than the farthest of its sides' planes
        nearest = z
        if kind == BOX:
            nearest = wp.max(wp.max(wp.abs(x) - sa, wp.abs(y) - sb), wp.abs(z) - sc)
        elif kind != PLANE:
            nearest = 0.0
        gap = float(nearest)
        nx = float(0.0)
        ny = float(0.0)
        nz = float(1.0)
        if near - nearest > 0.0 and kind != PLANE:
            gap, nx, ny, nz = distance_solid(kind, x, y, z, sa, sb, sc)
        if near - gap > 0.0:
            ux = t.x[i] - t.px[i]
            uy = t.y[i] - t.py[i]
            uz = t.z[i] - t.pz[i]
            wx = r00 * nx + r01 * ny + r02 * nz
            wy = r10 * nx + r11 * ny + r12 * nz
            wz = r20 * nx + r21 * ny + r22 * nz
            un = ux * wx + uy * wy + uz * wz
            if kind < PLANE and wp.min(gap, gap - un) < 0.0:
                lx = r00 * ux + r10 * uy + r20 * uz
                ly = r01 * ux + r11 * uy + r21 * uz
                lz = r02 * ux + r12 * uy + r22 * uz
                at, ax, ay, az, met = way_in(kind, x, y, z, lx, ly, lz, sa, sb, sc)
                if met > 0.0:
                    gap = at
                    wx = r00 * ax + r01 * ay + r02 * az
                    wy = r10 * ax + r11 * ay + r12 * az
                    wz = r20 * ax + r21 * ay + r22 * az
                    un = ux * wx + uy * wy + uz * wz
            press(t, i, gap - radius, wx, wy, wz, ux, uy, uz, un, mu, LEAVE_SPEED * dt)


@wp.func
def touch_shapes_together(t: Any, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    """All particles against the shapes nearby, as `nuno.contact.shapes.touch_shapes`."""
    for k in range(t.near[0]):
        s = t.near[1 + k]
        if shapes.kind[s] < SOLID_MESH and shapes.slot[s] < 0:
            touch_still(t, n, shapes, s, dt, thread, threads)
        else:
            touch_shape(t, n, shapes, s, dt, thread, threads)
