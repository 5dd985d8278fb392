"""Contact of edges and triangles with sharp shapes: their order, and the threads that push them out.

Elements come colour by colour, those of one colour, which share no vertex, all at once on CUDA. Vertices come after
them, by themselves. Of the elements that are listed for a frame few may be near within a substep, and those are known
without a look at them: an element sleeps until anything may have come as near as it was away. Of those that are active
again few are pushed.

So the threads of a block first queue what is active (`nuno.contact.particle.feature_queue`). Then a thread takes an
element, at a box or a hull two do, for at two of its edges an element has two points; all find those at once, as they
do not depend on pushes, and only then do they push, one colour after the other. What is more than the queue has room
for comes a colour at a time, with the same bits. On the CPU a thread takes one after the other.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import BOX, FAR, HULL
from nuno.contact.particle.feature_lists import DUE, EARLIEST, TRAVELLED, element_of, names_sets, set_of, sets_in
from nuno.contact.particle.feature_points import edge_point, triangle_point
from nuno.contact.particle.feature_pose import feature_pose
from nuno.contact.particle.feature_push import push_apart
from nuno.contact.particle.feature_queue import COLOUR, MAX_COLOURS, QUEUE, forget_queue, queue_active, room_of
from nuno.contact.particle.shape_contact import shape_speed_of
from nuno.numbers.crew import barrier, shares_work
from nuno.numbers.lane_masks import ALL_LANES, in_lanes, lanes_without, lanes_without_bits
from nuno.numbers.lanes import (  # noqa: F401
    add,
    anywhere,
    full_like,
    lane,
    lane_max,
    mul,
    sqrt,
    sub,
)
from nuno.numbers.vec3 import vec3
from nuno.numbers.warps import WARP, anyone, lowest, union_of_warp
from nuno.state.cloth_state import SPEED, Settings, Shapes


@wp.func
def travel_of_substep(t: Any, run: Settings, shape_speed: Any):
    """Return the way that vertices and shapes, up to ``shape_speed`` [m/s], may have gone in the substep before [m]."""
    return (sqrt(t.notes[SPEED]) + shape_speed) * run.dt


@wp.func
def find_active_features(t: Any, topo: Any, travelled: float, rank: int, size: int):
    """Wake what may be near again of the listed elements; the others get a number below zero.

    Returns:
        How many are active of those that the thread looked at, if none is when the first wakes [m], and the sets of
        shapes that they may touch.
    """
    active = int(0)
    sets = int(0)
    soon = float(FAR)
    for c in range(topo.feature_colour.shape[0] - 1):
        first = topo.feature_colour[c]
        for k in range(first + rank, first + t.feature_shapes[1 + c], size):
            element = t.feature_list[k]
            element = wp.max(element, -1 - element)
            due = t.feature_due[DUE + k]
            if travelled >= due:
                t.feature_due[DUE + k] = FAR
                active += 1
                sets = sets | sets_in(element)
            else:
                element = -1 - element
                soon = wp.min(soon, due)
            t.feature_list[k] = element
    return active, soon, sets


@wp.func
def find_active_features(t: Any, topo: Any, travelled: lane, rank: int, size: int):
    active = int(0)
    sets = int(0)
    soon = float(FAR)
    for c in range(topo.feature_colour.shape[0] - 1):
        first = topo.feature_colour[c]
        for k in range(first + rank, first + t.feature_shapes[1 + c], size):
            element = t.feature_list[k]
            element = wp.max(element, -1 - element)
            due = t.feature_due[DUE + k]
            if lane_max(travelled - due) >= 0.0:
                now = lanes_without(due - travelled)
                t.feature_due[DUE + k] = in_lanes(due, now, FAR)
                t.feature_asleep[k] = ALL_LANES ^ now
                active += 1
                sets = sets | sets_in(element)
            else:
                element = -1 - element
                soon = wp.min(soon, -lane_max(-1.0 * due))
            t.feature_list[k] = element
    return active, soon, sets


@wp.func
def asleep(like: float, t: Any, k: int):
    """The lanes, bit by bit, in which an active element sleeps."""
    return int(0)


@wp.func
def asleep(like: lane, t: Any, k: int):
    return t.feature_asleep[k]


@wp.func
def not_marked(like: float, t: Any, topo: Any, element: int, own: int, named: bool):
    """The lanes, bit by bit, in which an element that is listed in others is not, or not for a set of shapes."""
    return int(0)


@wp.func
def not_marked(like: lane, t: Any, topo: Any, element: int, own: int, named: bool):
    edges = topo.side.shape[0]
    flag = int(1)
    corners = wp.vec3i(0, 0, 0)
    if element < edges:
        e = topo.side[element]
        corners = wp.vec3i(e[0], e[1], e[1])
    else:
        flag = int(2)
        f = topo.face[element - edges]
        corners = wp.vec3i(f[0], f[1], f[2])
    a = t.feature_mark[corners[0]]
    b = t.feature_mark[corners[1]]
    c = t.feature_mark[corners[2]]
    found = lanes_without_bits(a, b, c, flag)
    if named:
        found = found | lanes_without_bits(a, b, c, own)
    return found


@wp.func
def earliest_due(t: Any, travelled: lane, soon: float, rank: int, size: int):
    return soon


@wp.func
def earliest_due(t: Any, travelled: float, soon: float, rank: int, size: int):
    """The least of what all threads have."""
    barrier(size)
    if rank == 0:
        t.feature_due[EARLIEST] = FAR
    barrier(size)
    if soon < FAR:
        wp.atomic_min(t.feature_due, EARLIEST, soon)
    barrier(size)
    return t.feature_due[EARLIEST]


@wp.func
def push_elements(
    t: Any, topo: Any, run: Settings, shapes: Shapes, s: int, own: int, travelled: Any, queued: int, rank: int,
    size: int,
):  # fmt: skip
    """The elements that are active against one shape: those ``queued``, or all of them in turn where that is 0.

    Only those that may touch a shape of its set, whose bit is ``own``.
    """
    named = names_sets(topo)
    like = full_like(t.x[0], 0.0)
    zero = full_like(like, 0.0)
    one = full_like(like, 1.0)
    h = feature_pose(like, t, run, shapes, s)
    edges = topo.side.shape[0]
    colours = topo.feature_colour.shape[0] - 1
    unlisted = t.feature_shapes[topo.feature_colour.shape[0] + shapes.count + s]
    # at a box or a hull each edge has two points
    points = int(1)
    if (h.kind == BOX or h.kind == HULL) and shares_work(size):
        points = 2
    together = size / points
    mine = rank / points
    c = int(0)
    start = int(0)
    while c < colours:
        entry = int(-1)
        colour = int(c)
        if queued > 0:
            if start + mine < queued:
                place = t.moved[QUEUE + start + mine]
                entry = place % COLOUR
                colour = place / COLOUR
        elif start + mine < t.feature_shapes[1 + c]:
            entry = topo.feature_colour[c] + start + mine
        element = int(-1)
        without = int(unlisted)
        if entry >= 0:
            element = t.feature_list[entry]
            without = unlisted | asleep(like, t, entry)
            if queued > 0:
                # its sign tells of another time
                element = wp.max(element, -1 - element)
            element = element_of(element, own, named)
            if element >= 0:
                without = without | not_marked(like, t, topo, element, own, named)
        point_index = rank % points
        more = int(1)
        if (element < 0 or without == ALL_LANES) and not shares_work(size):
            more = 0
        while more > 0:
            more = 0
            on = -one
            i = int(0)
            j = int(0)
            k = int(0)
            bi = zero
            bj = zero
            bk = zero
            point = vec3(zero, zero, zero)
            normal = vec3(zero, zero, zero)
            gap = zero
            if element >= edges:
                if point_index == 0:
                    corners = topo.face[element - edges]
                    i = corners[0]
                    j = corners[1]
                    k = corners[2]
                    on, bj, bk, point, normal, gap = triangle_point(
                        t, h, shapes, s, entry, travelled, without, i, j, k, run.cell
                    )  # fmt: skip
                    bi = one - bj - bk
            elif element >= 0:
                ends = topo.side[element]
                i = ends[0]
                j = ends[1]
                k = i
                on, more, bj, point, normal, gap = edge_point(
                    t, h, shapes, s, entry, travelled, without, i, j, point_index, run.cell
                )  # fmt: skip
                bi = one - bj
            if shares_work(size):
                more = 0
                first = 1 << wp.min(c, MAX_COLOURS)
                second = wp.where(points > 1, first, 0)
                if queued > 0:
                    for which in range(points):
                        bits = int(0)
                        if point_index == which and anywhere(on):
                            bits = 1 << colour
                        bits = union_of_warp(bits)
                        if rank % WARP == 0 and bits != 0:
                            wp.atomic_or(t.moved, 1 + which, bits)
                    barrier(size)
                    second = t.moved[2]
                    first = t.moved[1] | second
                    barrier(size)
                    if first != 0 and rank < 2:
                        t.moved[1 + rank] = 0
                elif t.feature_shapes[1 + c] == 0:
                    first = 0
                while first != 0:
                    now = lowest(first)
                    for which in range(1 + ((second >> now) & 1)):
                        if point_index == which and wp.min(colour, MAX_COLOURS) == now and anywhere(on):
                            push_apart(t, h, i, j, k, bi, bj, bk, point, normal, gap, on)
                        barrier(size)
                    first = first & (first - 1)
            else:
                if anywhere(on):
                    push_apart(t, h, i, j, k, bi, bj, bk, point, normal, gap, on)
                more = more * (1 - point_index)
                point_index = 1
        start += together
        if queued > 0:
            c = wp.where(start < queued, 0, colours)
        elif start >= t.feature_shapes[1 + c]:
            c += 1
            start = 0


@wp.func
def push_active(t: Any, topo: Any, run: Settings, shapes: Shapes, travelled: Any, rank: int, size: int):
    """Push the active ones of the listed edges and triangles out of the sharp shapes nearby.

    Args:
        t: The state.
        topo: The surface's elements.
        run: The run's settings.
        shapes: All shapes.
        travelled: How far any vertex, and any shape, may have gone since the lists were made [m].
        rank: The thread's number.
        size: How many share the work.

    Returns:
        How far these must have gone before anything is active again [m].
    """
    queued = int(0)
    active = int(0)
    soon = float(FAR)
    room = int(0)
    sets = int(0)
    if shares_work(size):
        room = room_of(topo)
    if room > 0:
        active, soon = queue_active(t, topo, travelled, room, rank, size)
        queued = active
    if queued > room:
        forget_queue(t, topo, 0, rank, size)
        queued = 0
    if room == 0 or active > room:
        active, soon, sets = find_active_features(t, topo, travelled, rank, size)
        if shares_work(size):
            active = int(anyone(active > 0))
    if active > 0:
        soon = lane_max(travelled)
        for k in range(t.feature_shapes[0]):
            s = t.feature_shapes[topo.feature_colour.shape[0] + k]
            own = set_of(s)
            if shares_work(size) or (sets & own) != 0 or not names_sets(topo):
                push_elements(t, topo, run, shapes, s, own, travelled, queued, rank, size)
        if queued > 0:
            forget_queue(t, topo, queued, rank, size)
    elif shares_work(size):
        soon = earliest_due(t, travelled, soon, rank, size)
    return soon


@wp.func
def push_features(t: Any, topo: Any, run: Settings, shapes: Shapes, rank: int, size: int):
    """All listed edges and triangles against the sharp shapes nearby; what was gone until now is in `State`."""
    travelled = t.feature_due[TRAVELLED] + travel_of_substep(t, run, shape_speed_of(t, shapes))
    earliest = lane_max(t.feature_due[EARLIEST])
    # once all know
    barrier(size)
    if lane_max(travelled) >= earliest:
        earliest = push_active(t, topo, run, shapes, travelled, rank, size)
        barrier(size)
    if rank == 0:
        t.feature_due[TRAVELLED] = travelled
        t.feature_due[EARLIEST] = full_like(travelled, earliest)
