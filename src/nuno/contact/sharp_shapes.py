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
from nuno.contact.led import led_pose
from nuno.contact.shapes import COLUMNS, origin_of, reach_of_frame, rotation_of, three_of
from nuno.solver.lanes import add, anywhere, barrier, largest, least, most, mul, root, size_of, sub  # noqa: F401
from nuno.solver.state import CLOCK, THICKNESS, Settings, Shapes
from nuno.solver.vec3 import position, transposed_mul, vec3

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
    origin = origin_of(t)
    centre = three_of(like, t, shapes, s * COLUMNS) - origin
    turn = rotation_of(like, t, shapes, s * COLUMNS)
    slot = shapes.slot[s]
    if slot >= 0:
        centre, turn = led_pose(like, shapes, slot, clock, t.group, t.worlds, origin)
    return centre, turn


@wp.func
def sharp_features(
    kind: int, p: Any, h: Any, sa: Any, sb: Any, sc: Any, broad: float
):  # fmt: skip
    """Whether what is within a box about p (half sides h, all in the shape's frame) may touch between vertices.

    Returns:
        Two numbers, positive where it may: between the ends of an edge, as along an edge of a box, and inside of a
        triangle, as at its corner. A radius of ``broad`` [m] or more counts as flat.
    """
    x = size_of(p.x)
    y = size_of(p.y)
    z = size_of(p.z)
    # how far the box ends beyond the shape's sides: a face has two of three well inside, an edge one, a corner none
    apart = x
    along = x
    point = x
    if kind == BOX:
        qx = x + h.x - sa
        qy = y + h.y - sb
        qz = z + h.z - sc
        apart = most(most(x - h.x - sa, y - h.y - sb), z - h.z - sc)
        along = most(most(least(qx, qy), least(qy, qz)), least(qx, qz))
        point = least(least(qx, qy), qz)
    else:
        slim = broad - sa
        rho = root(x * x + y * y)
        wide = root(h.x * h.x + h.y * h.y)
        if kind == CYLINDER:
            apart = most(rho - wide - sa, z - h.z - sb)
            rim = least(rho + wide - sa, z + h.z - sb)
            along = most(rim, slim)
            point = least(rim, slim)
        else:
            beyond = most(z - sb, 0.0)
            size = root(wide * wide + h.z * h.z)
            apart = root(rho * rho + beyond * beyond) - size - sa
            # the outermost point is on the half ball of one end, which may stand through by half a cell
            stands = most(sa, broad * (0.5 / ROUND) - sa)
            point = least(slim, size + stands - root(rho * rho + (z - sb) * (z - sb)))
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
    grow = reach_of_frame(t, shapes, float(run.frame) * run.dt) + QUICK * run.dt
    # no point of an edge or triangle is farther from the nearest of its vertices than 0.6 of its longest edge
    around = grow + 0.6 * topo.longest
    # and within a substep
    soon = t.scalars[THICKNESS] * 0.5 + (QUICK * run.dt + 0.6 * topo.longest)
    broad = ROUND * run.cell
    found = int(0)
    for near in range(t.near[0]):
        s = t.near[1 + near]
        kind = shapes.kind[s]
        if kind < PLANE:
            centre, r = pose_of(like, t, shapes, s, clock)
            extent = three_of(like, t, shapes, s * COLUMNS + 12)
            # the cloth's box as the shape sees it
            low = vec3(t.box[0], t.box[1], t.box[2])
            high = vec3(t.box[3], t.box[4], t.box[5])
            middle = (low + high) * 0.5 - centre
            w = (high - low) * 0.5
            h = vec3(
                size_of(r.x.x) * w.x + size_of(r.y.x) * w.y + size_of(r.z.x) * w.z + grow,
                size_of(r.x.y) * w.x + size_of(r.y.y) * w.y + size_of(r.z.y) * w.z + grow,
                size_of(r.x.z) * w.x + size_of(r.y.z) * w.y + size_of(r.z.z) * w.z + grow,
            )
            along, point = sharp_features(kind, transposed_mul(r, middle), h, extent.x, extent.y, extent.z, broad)
            if anywhere(along):
                if found == 0:
                    for i in range(thread, topo.particles, threads):
                        t.sharp_mark[i] = 0
                if thread == 0:
                    t.sharp[topo.sharp_colour.shape[0] + found] = s
                found = found + 1
                for i in range(thread, topo.particles, threads):
                    p = transposed_mul(r, position(t, i) - centre)
                    along, point = sharp_features(
                        kind, p, vec3(around, around, around), extent.x, extent.y, extent.z, broad
                    )  # fmt: skip
                    if anywhere(along):
                        at_once, _point = sharp_features(
                            kind, p, vec3(soon, soon, soon), extent.x, extent.y, extent.z, broad
                        )  # fmt: skip
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
