"""Which shapes are sharp or small enough to stand through between a cloth's vertices, and what of the cloth is near.

Vertices alone keep a cloth off a flat face, and off a ball many cells wide. The edge of a box, the rim of a cylinder
and a ball as small as a cell touch the cloth's edges and triangles between them. Once a frame it is found which of
those may come that near within the frame (`nuno.contact.sharp_turns` looks at them); where a cloth lies on a
table, far from its rim, that is one question about its bounding box. What does not touch changes no bit, so that it
does not matter what else is listed.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import BOX, CYLINDER, FAR, PLANE
from nuno.contact.led import led_place, led_turn
from nuno.contact.shapes import COLUMNS, reach_of_frame
from nuno.solver.lanes import (  # noqa: F401
    add,
    anywhere,
    barrier,
    fill,
    largest,
    least,
    most,
    mul,
    per_world,
    root,
    size_of,
    sub,
    times,
)
from nuno.solver.state import CLOCK, ORIGIN, THICKNESS, Settings, Shapes

ROUND = wp.constant(3.0)
"""Cells. What is curved less than with a radius of so many is left to the vertices: a straight edge of a cell cuts a
twenty-fourth of it into such a ball, its diagonal a twelfth."""
QUICK = wp.constant(3.0)
"""[m/s] What comes nearer faster than this, where the surfaces do not yet touch, may be seen a substep late."""
GONE, SOONEST, WAKE = wp.constant(0), wp.constant(1), wp.constant(2)
"""Places in `State.sharp_wake`: how far anything may have gone since the lists were made, and from when on the first
element wakes, and each, by how far anything has gone then [m]."""


MOST_SLACK = wp.constant(100.0)
"""[m] As far as a mark counts."""


@wp.func
def pose_of(like: Any, t: Any, shapes: Shapes, s: int, clock: int):
    """Place [m] and rotation (row major, shape to world) of a shape after ``clock`` substeps."""
    row = s * COLUMNS
    stride = shapes.stride
    ox = t.scalars[ORIGIN]
    oy = t.scalars[ORIGIN + 1]
    oz = t.scalars[ORIGIN + 2]
    cx = per_world(like, shapes.table, t.group, stride, t.worlds, row) - ox
    cy = per_world(like, shapes.table, t.group, stride, t.worlds, row + 1) - oy
    cz = per_world(like, shapes.table, t.group, stride, t.worlds, row + 2) - oz
    r00 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 3)
    r01 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 4)
    r02 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 5)
    r10 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 6)
    r11 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 7)
    r12 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 8)
    r20 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 9)
    r21 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 10)
    r22 = per_world(like, shapes.table, t.group, stride, t.worlds, row + 11)
    slot = shapes.slot[s]
    if slot >= 0:
        cx, cy, cz = led_place(like, shapes, slot, clock, t.group, t.worlds, ox, oy, oz)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = led_turn(like, shapes, slot, clock, t.group, t.worlds)
    return cx, cy, cz, r00, r01, r02, r10, r11, r12, r20, r21, r22


@wp.func
def sharp_features(
    kind: int, x: Any, y: Any, z: Any, hx: Any, hy: Any, hz: Any, sa: Any, sb: Any, sc: Any, broad: float
):  # fmt: skip
    """Whether what is within a box about x, y, z (half sides h, all in the shape's frame) may touch between vertices.

    Returns:
        Two numbers, positive where it may: between the ends of an edge, as along an edge of a box, and inside of a
        triangle, as at its corner. A radius of ``broad`` [m] or more counts as flat.
    """
    x = size_of(x)
    y = size_of(y)
    z = size_of(z)
    # how far the box ends beyond the shape's sides: a face has two of three well inside, an edge one, a corner none
    apart = x
    along = x
    point = x
    if kind == BOX:
        qx = x + hx - sa
        qy = y + hy - sb
        qz = z + hz - sc
        apart = most(most(x - hx - sa, y - hy - sb), z - hz - sc)
        along = most(most(least(qx, qy), least(qy, qz)), least(qx, qz))
        point = least(least(qx, qy), qz)
    else:
        slim = fill(x, broad) - sa
        rho = root(times(x, x) + times(y, y))
        wide = root(times(hx, hx) + times(hy, hy))
        if kind == CYLINDER:
            apart = most(rho - wide - sa, z - hz - sb)
            rim = least(rho + wide - sa, z + hz - sb)
            along = most(rim, slim)
            point = least(rim, slim)
        else:
            beyond = most(z - sb, fill(x, 0.0))
            size = root(times(wide, wide) + times(hz, hz))
            apart = root(times(rho, rho) + times(beyond, beyond)) - size - sa
            # the outermost point is on the half ball of one end, which may stand through by half a cell
            stands = most(sa, fill(x, broad * (0.5 / ROUND)) - sa)
            point = least(slim, size + stands - root(times(rho, rho) + times(z - sb, z - sb)))
            along = slim
    return least(along, -apart), least(point, -apart)


@wp.func
def forget_sharp(t: Any, topo: Any, thread: int):
    """Start the lists anew; one thread does it.

    `State.sharp` has how many shapes are listed, how many elements of each colour, and then the shapes.
    """
    if thread == 0:
        for k in range(topo.sharp_colour.shape[0]):
            t.sharp[k] = 0
        t.sharp_wake[GONE] = 0.0


@wp.func
def mark_sharp(t: Any, topo: Any, run: Settings, shapes: Shapes, thread: int, threads: int):
    """List the sharp shapes near the cloth, and mark the vertices by which they may touch within the frame.

    By 1 where an edge at the vertex may be touched, by 2 where a triangle may, and by four times how far anything must
    go before [um].
    """
    like = t.x[0]
    clock = int(largest(t.notes[CLOCK]))
    grow = reach_of_frame(t, shapes, float(run.frame) * run.dt) + fill(like, QUICK * run.dt)
    # no point of an edge or triangle is farther from the nearest of its vertices than 0.6 of its longest edge
    around = grow + fill(like, 0.6 * topo.longest)
    # and within a substep
    soon = t.scalars[THICKNESS] * 0.5 + fill(like, QUICK * run.dt + 0.6 * topo.longest)
    broad = ROUND * run.cell
    found = int(0)
    for near in range(t.near[0]):
        s = t.near[1 + near]
        kind = shapes.kind[s]
        if kind < PLANE:
            cx, cy, cz, r00, r01, r02, r10, r11, r12, r20, r21, r22 = pose_of(like, t, shapes, s, clock)
            row = s * COLUMNS
            sa = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 12)
            sb = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 13)
            sc = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 14)
            # the cloth's box as the shape sees it
            dx = (t.box[0] + t.box[3]) * 0.5 - cx
            dy = (t.box[1] + t.box[4]) * 0.5 - cy
            dz = (t.box[2] + t.box[5]) * 0.5 - cz
            wx = (t.box[3] - t.box[0]) * 0.5
            wy = (t.box[4] - t.box[1]) * 0.5
            wz = (t.box[5] - t.box[2]) * 0.5
            hx = times(size_of(r00), wx) + times(size_of(r10), wy) + times(size_of(r20), wz) + grow
            hy = times(size_of(r01), wx) + times(size_of(r11), wy) + times(size_of(r21), wz) + grow
            hz = times(size_of(r02), wx) + times(size_of(r12), wy) + times(size_of(r22), wz) + grow
            x = times(r00, dx) + times(r10, dy) + times(r20, dz)
            y = times(r01, dx) + times(r11, dy) + times(r21, dz)
            z = times(r02, dx) + times(r12, dy) + times(r22, dz)
            along, point = sharp_features(kind, x, y, z, hx, hy, hz, sa, sb, sc, broad)
            if anywhere(along):
                if found == 0:
                    for i in range(thread, topo.particles, threads):
                        t.sharp_mark[i] = 0
                if thread == 0:
                    t.sharp[topo.sharp_colour.shape[0] + found] = s
                found = found + 1
                for i in range(thread, topo.particles, threads):
                    dx = t.x[i] - cx
                    dy = t.y[i] - cy
                    dz = t.z[i] - cz
                    x = times(r00, dx) + times(r10, dy) + times(r20, dz)
                    y = times(r01, dx) + times(r11, dy) + times(r21, dz)
                    z = times(r02, dx) + times(r12, dy) + times(r22, dz)
                    along, point = sharp_features(kind, x, y, z, around, around, around, sa, sb, sc, broad)
                    if anywhere(along):
                        at_once, _point = sharp_features(kind, x, y, z, soon, soon, soon, sa, sb, sc, broad)
                        slack = int(1.0e6 * wp.clamp(-largest(at_once), 0.0, MOST_SLACK))
                        mark = t.sharp_mark[i]
                        if mark != 0:
                            slack = wp.min(slack, mark >> 2)
                        mark = (mark & 3) | 1
                        if anywhere(point):
                            mark = mark | 2
                        t.sharp_mark[i] = mark | slack << 2
    if thread == 0:
        t.sharp[0] = found
        t.sharp_wake[SOONEST] = wp.where(found > 0, 0.0, FAR)


@wp.func
def slack_of(t: Any, topo: Any, k: int):
    """How far anything must go before element k may be touched [um], by its marked vertices; below zero for never."""
    edges = topo.side.shape[0]
    mark = int(0)
    slack = int(1.0e6 * MOST_SLACK)
    if k < edges:
        e = topo.side[k]
        for c in range(2):
            at = t.sharp_mark[e[c]]
            mark = mark | (at & 1)
            slack = wp.min(slack, wp.where(at != 0, at >> 2, slack))
    elif k < edges + topo.face.shape[0]:
        f = topo.face[k - edges]
        for c in range(3):
            at = t.sharp_mark[f[c]]
            mark = mark | (at & 2)
            slack = wp.min(slack, wp.where(at != 0, at >> 2, slack))
    return wp.where(mark != 0, slack, -1)


@wp.func
def note_sharp(t: Any, topo: Any, k: int, slack: int):
    """List element k where its slack is not below zero."""
    if slack >= 0:
        c = int(0)
        while k >= topo.sharp_colour[c + 1]:
            c += 1
        place = topo.sharp_colour[c] + wp.atomic_add(t.sharp, 1 + c, 1)
        t.sharp_list[place] = k
        t.sharp_wake[WAKE + place] = 1.0e-6 * float(slack)


@wp.func
def list_sharp(t: Any, topo: Any, thread: int, threads: int):
    """List the edges and triangles with marked vertices, once all are marked."""
    if t.sharp[0] > 0:
        for k in range(thread, topo.side.shape[0] + topo.face.shape[0], 4 * threads):
            # four at a time, so that a thread waits for all their marks together
            a = slack_of(t, topo, k)
            b = slack_of(t, topo, k + threads)
            c = slack_of(t, topo, k + 2 * threads)
            d = slack_of(t, topo, k + 3 * threads)
            note_sharp(t, topo, k, a)
            note_sharp(t, topo, k + threads, b)
            note_sharp(t, topo, k + 2 * threads, c)
            note_sharp(t, topo, k + 3 * threads, d)
