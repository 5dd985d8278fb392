"""Shapes that are sharp or small enough to stand through between vertices, and the edges and triangles near them.

Vertices alone keep a cloth off a flat face, and off a ball many cells wide. The edge of a box or a hull, the rim of a
cylinder and a ball as small as a cell touch the cloth's edges and triangles between them. Once a frame it is found
which of those may come that near within the frame (`nuno.contact.particle.feature_contact` looks at them); where a
cloth lies on a table, far from its rim, that is one question about its bounding box. What does not touch changes no
bit, so that it does not matter what else is listed.

What goes farther than was expected may touch what it was not listed for. Lanes of worlds share the lists, so each keeps
what it would list alone: its own marks, with the sets of shapes that elements look at, and when its own elements wake.
An element's number in a list has the sets of all lanes.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import BOX, CYLINDER, FAR, HULL, PLANE
from nuno.contact.particle.hull import box_clearance, meets_corners, meets_ridges
from nuno.contact.particle.kinematic_pose import kinematic_pose
from nuno.contact.particle.shape_contact import COLUMNS, origin_of, reach_of_frame, rotation_of, three_of
from nuno.numbers.lane_masks import lanes_without
from nuno.numbers.lanes import (  # noqa: F401
    LANES,
    absolute,
    add,
    anywhere,
    full_like,
    lane,
    lane_int,
    lane_max,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
)
from nuno.numbers.vec3 import position, transposed_mul, vec3
from nuno.state.cloth_state import CLOCK, SPEED, THICKNESS, Settings, Shapes

ROUND = wp.constant(3.0)
"""Cells. What is curved less than with a radius of so many is left to the vertices: a straight edge of a cell cuts a
twenty-fourth of it into such a ball, its diagonal a twelfth."""
QUICK = wp.constant(3.0)
"""[m/s] What comes nearer faster than this, where the surfaces do not yet touch, may be seen a substep late."""
TRAVELLED, EARLIEST, DUE = wp.constant(0), wp.constant(1), wp.constant(2)
"""Places in `State.feature_due`: how far anything may have gone since the lists were made, and from when on the first
element wakes, and each, by how far anything has gone then [m]."""


MAX_SLACK = wp.constant(1.0)
"""[m] As far as a mark counts."""
SLACK_STEP = wp.constant(3.2e-5)
"""[m] Slack is noted in whole numbers of this, of 15 bits."""
SHAPE_SETS = wp.constant(14)
"""Sets of shapes that a mark tells apart; those whose numbers differ by a multiple of it are in one."""
SETS = wp.constant(17)
"""Bit from which on marks and listed elements have those sets."""


@wp.func
def pose_of(like: Any, t: Any, shapes: Shapes, s: int, clock: int, substep: int):
    """Place [m] and rotation (row major, shape to world) of a shape: see `kinematic_pose`."""
    origin = origin_of(t)
    centre = three_of(like, t, shapes, s * COLUMNS) - origin
    turn = rotation_of(like, t, shapes, s * COLUMNS)
    slot = shapes.slot[s]
    if slot >= 0:
        centre, turn = kinematic_pose(like, shapes, slot, clock, substep, t.group, t.worlds, origin)
    return centre, turn


@wp.func
def stands_between(
    shapes: Shapes, s: int, kind: int, p: Any, h: Any, ball: Any, sa: Any, sb: Any, sc: Any, broad: float
):  # fmt: skip
    """Return True if what is within a box about p (half sides h, all in the shape's frame) may touch between vertices.

    It is in a ball about p of radius ``ball`` [m], too.

    Returns:
        Two numbers, positive where it may: between the ends of an edge, as along an edge of a box, and inside of a
        triangle, as at its corner. A radius of ``broad`` [m] or more counts as flat.
    """
    if kind == HULL:
        clearance = box_clearance(p, h, vec3(sa, sb, sc))
        if not anywhere(-clearance):
            return -clearance, -clearance
        ridge = minimum(meets_ridges(shapes, s, p, h, ball), -clearance)
        return ridge, minimum(meets_corners(shapes, s, p, ball, broad / ROUND), ridge)
    x = absolute(p.x)
    y = absolute(p.y)
    z = absolute(p.z)
    # how far the box ends beyond the shape's sides: a face has two of three well inside, an edge one, a corner none
    apart = x
    along = x
    point = x
    if kind == BOX:
        qx = x + h.x - sa
        qy = y + h.y - sb
        qz = z + h.z - sc
        apart = maximum(maximum(x - h.x - sa, y - h.y - sb), z - h.z - sc)
        along = maximum(maximum(minimum(qx, qy), minimum(qy, qz)), minimum(qx, qz))
        point = minimum(minimum(qx, qy), qz)
    else:
        slim = broad - sa
        rho = sqrt(x * x + y * y)
        diagonal = sqrt(h.x * h.x + h.y * h.y)
        if kind == CYLINDER:
            apart = maximum(rho - diagonal - sa, z - h.z - sb)
            rim = minimum(rho + diagonal - sa, z + h.z - sb)
            along = maximum(rim, slim)
            point = minimum(rim, slim)
        else:
            beyond = maximum(z - sb, 0.0)
            size = sqrt(diagonal * diagonal + h.z * h.z)
            apart = sqrt(rho * rho + beyond * beyond) - size - sa
            # the outermost point is on the half ball of one end, which may stand through by half a cell
            stands = maximum(sa, broad * (0.5 / ROUND) - sa)
            point = minimum(slim, size + stands - sqrt(rho * rho + (z - sb) * (z - sb)))
            along = slim
    return minimum(along, -apart), minimum(point, -apart)


@wp.func
def clear_features(t: Any, topo: Any, rank: int):
    """Start the lists anew; one thread does it.

    `State.feature_shapes` has how many shapes are listed, how many elements of each colour, then the shapes, and for
    each shape there is the lanes that would not list it, bit by bit.
    """
    if rank == 0:
        for k in range(topo.feature_colour.shape[0]):
            t.feature_shapes[k] = 0
        t.feature_due[TRAVELLED] = full_like(t.notes[SPEED], 0.0)


@wp.func
def mark_features(t: Any, topo: Any, run: Settings, shapes: Shapes, rank: int, size: int):
    """List the sharp shapes near the cloth, and mark the vertices by which they may touch within the frame.

    By 1 where an edge at the vertex may be touched, by 2 where a triangle may, by four times how far anything must go
    before, and by which sets of shapes.
    """
    like = t.x[0]
    clock = int(lane_max(t.notes[CLOCK]))
    grow = reach_of_frame(t, shapes, float(run.frame) * run.dt) + QUICK * run.dt
    # no point of an edge or triangle is farther from the nearest of its vertices than 0.6 of its longest edge
    around = grow + 0.6 * topo.longest
    # and within a substep
    soon = t.scalars[THICKNESS] * 0.5 + (QUICK * run.dt + 0.6 * topo.longest)
    broad = ROUND * run.cell
    found = int(0)
    for near in range(t.shape_list[0]):
        s = t.shape_list[1 + near]
        kind = shapes.kind[s]
        if kind < PLANE or kind == HULL:
            centre, r = pose_of(like, t, shapes, s, clock, clock + 1)
            extent = three_of(like, t, shapes, s * COLUMNS + 12)
            # the cloth's box as the shape sees it
            low = vec3(t.box[0], t.box[1], t.box[2])
            high = vec3(t.box[3], t.box[4], t.box[5])
            middle = (low + high) * 0.5 - centre
            w = (high - low) * 0.5
            h = vec3(
                absolute(r.x.x) * w.x + absolute(r.y.x) * w.y + absolute(r.z.x) * w.z + grow,
                absolute(r.x.y) * w.x + absolute(r.y.y) * w.y + absolute(r.z.y) * w.z + grow,
                absolute(r.x.z) * w.x + absolute(r.y.z) * w.y + absolute(r.z.z) * w.z + grow,
            )
            ball = sqrt(h.x * h.x + h.y * h.y + h.z * h.z)
            along, point = stands_between(
                shapes, s, kind, transposed_mul(r, middle), h, ball, extent.x, extent.y, extent.z, broad
            )  # fmt: skip
            if anywhere(along):
                if found == 0:
                    for i in range(rank, topo.particles, size):
                        t.feature_mark[i] = unmarked(like)
                whole = along
                if rank == 0:
                    t.feature_shapes[topo.feature_colour.shape[0] + found] = s
                    t.feature_shapes[topo.feature_colour.shape[0] + shapes.count + s] = lanes_without(along)
                own = set_of(s)
                found = found + 1
                for i in range(rank, topo.particles, size):
                    p = transposed_mul(r, position(t, i) - centre)
                    along, point = stands_between(
                        shapes, s, kind, p, vec3(around, around, around), around, extent.x, extent.y, extent.z, broad
                    )  # fmt: skip
                    if anywhere(along):
                        at_once, _point = stands_between(
                            shapes, s, kind, p, vec3(soon, soon, soon), soon, extent.x, extent.y, extent.z, broad
                        )  # fmt: skip
                        mark_vertex(t, i, minimum(along, whole), point, at_once, own)
    if rank == 0:
        t.feature_shapes[0] = found
        t.feature_due[EARLIEST] = full_like(t.notes[SPEED], wp.where(found > 0, 0.0, FAR))


@wp.func
def set_of(s: int):
    """Return the bit of the set that a shape is in."""
    return 1 << (SETS + s % SHAPE_SETS)


@wp.func
def slack_in(mark: int):
    """Return the slack in a vertex's mark, in steps."""
    return (mark >> 2) & ((1 << (SETS - 2)) - 1)


@wp.func
def sets_in(number: int):
    """Return the sets of shapes in a mark, in what `slack_of` returns, or in an element's number in a list."""
    return number >> SETS << SETS


@wp.func
def names_sets(topo: Any):
    """Return True where listed elements have the sets of shapes that they may touch: there are not too many of them."""
    return topo.side.shape[0] + topo.face.shape[0] <= 1 << SETS


@wp.func
def element_of(number: int, sets: int, named: bool):
    """Return the element of a number in a list; -1 where it sleeps, or may touch none of some sets of shapes."""
    element = number
    if named and number >= 0:
        element = wp.where((number & sets) != 0, number & ((1 << SETS) - 1), -1)
    return element


@wp.func
def unmarked(like: float):
    """The mark of a vertex by which nothing may be touched."""
    return int(0)


@wp.func
def unmarked(like: lane):
    return lane_int()


@wp.func
def marked(mark: int, point: float, at_once: float, own: int):
    """Return a vertex's mark with that of one more shape, of the set whose bit is ``own``."""
    slack = int(wp.clamp(-at_once, 0.0, MAX_SLACK) / SLACK_STEP)
    if mark != 0:
        slack = wp.min(slack, slack_in(mark))
    found = (mark & 3) | 1
    if point > 0.0:
        found = found | 2
    return found | slack << 2 | sets_in(mark) | own


@wp.func
def mark_vertex(t: Any, i: int, along: float, point: float, at_once: float, own: int):
    """Mark vertex i where ``along`` is positive, for triangles where ``point`` is too, as `stands_between` says."""
    t.feature_mark[i] = marked(t.feature_mark[i], point, at_once, own)


@wp.func
def mark_vertex(t: Any, i: int, along: lane, point: lane, at_once: lane, own: int):
    marks = t.feature_mark[i]
    lanes = int(LANES)  # a variable, or Warp would unroll the loop
    for k in range(lanes):
        if along[k] > 0.0:
            marks[k] = marked(marks[k], point[k], at_once[k], own)
    t.feature_mark[i] = marks


@wp.func
def mark_in(mark: int, k: int):
    """The mark in lane k."""
    return mark


@wp.func
def mark_in(mark: lane_int, k: int):
    return mark[k]


@wp.func
def slack_of(t: Any, topo: Any, k: int, world: int):
    """Return the way that anything must go before element k may be touched in a lane, in steps.

    With the sets of those shapes; below zero for never.
    """
    edges = topo.side.shape[0]
    mark = int(0)
    sets = int(0)
    slack = int(MAX_SLACK / SLACK_STEP)
    if k < edges:
        e = topo.side[k]
        for c in range(2):
            at = mark_in(t.feature_mark[e[c]], world)
            mark = mark | (at & 1)
            sets = sets | sets_in(at)
            slack = wp.min(slack, wp.where(at != 0, slack_in(at), slack))
    elif k < edges + topo.face.shape[0]:
        f = topo.face[k - edges]
        for c in range(3):
            at = mark_in(t.feature_mark[f[c]], world)
            mark = mark | (at & 2)
            sets = sets | sets_in(at)
            slack = wp.min(slack, wp.where(at != 0, slack_in(at), slack))
    return wp.where(mark != 0, slack | sets, -1)


@wp.func
def place_of(t: Any, topo: Any, k: int, sets: int):
    """List element k, which may touch some sets of shapes; its place in the list."""
    c = int(0)
    while k >= topo.feature_colour[c + 1]:
        c += 1
    place = topo.feature_colour[c] + wp.atomic_add(t.feature_shapes, 1 + c, 1)
    t.feature_list[place] = wp.where(names_sets(topo), k | sets, k)
    return place


@wp.func
def way_of(slack: int):
    """Return the way in what `slack_of` returns [m]."""
    return SLACK_STEP * float(slack & ((1 << SETS) - 1))


@wp.func
def note_feature_shape(t: Any, topo: Any, k: int, slack: int):
    """List element k where its slack is not below zero."""
    if slack >= 0:
        place = place_of(t, topo, k, sets_in(slack))
        t.feature_due[DUE + place] = way_of(slack)


@wp.func
def list_marked(like: float, t: Any, topo: Any, rank: int, size: int):
    """List the edges and triangles with marked vertices."""
    for k in range(rank, topo.side.shape[0] + topo.face.shape[0], 4 * size):
        # four at a time, so that a thread waits for all their marks together
        a = slack_of(t, topo, k, 0)
        b = slack_of(t, topo, k + size, 0)
        c = slack_of(t, topo, k + 2 * size, 0)
        d = slack_of(t, topo, k + 3 * size, 0)
        note_feature_shape(t, topo, k, a)
        note_feature_shape(t, topo, k + size, b)
        note_feature_shape(t, topo, k + 2 * size, c)
        note_feature_shape(t, topo, k + 3 * size, d)


@wp.func
def list_marked(like: lane, t: Any, topo: Any, rank: int, size: int):
    lanes = int(LANES)
    for k in range(rank, topo.side.shape[0] + topo.face.shape[0], size):
        due = full_like(like, FAR)
        sets = int(0)
        for world in range(lanes):
            slack = slack_of(t, topo, k, world)
            if slack >= 0:
                sets = sets | sets_in(slack)
                due[world] = way_of(slack)
        if sets != 0:
            place = place_of(t, topo, k, sets)
            t.feature_due[DUE + place] = due


@wp.func
def list_features(t: Any, topo: Any, rank: int, size: int):
    """List the edges and triangles with marked vertices, once all are marked."""
    if t.feature_shapes[0] > 0:
        list_marked(t.notes[SPEED], t, topo, rank, size)
