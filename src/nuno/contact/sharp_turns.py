"""In which order, and by whom, edges and triangles are pushed out of sharp shapes.

Elements come colour by colour, those of one colour, which share no vertex, all at once on CUDA. Vertices come after
them, by themselves. Of the elements that are listed for a frame few may be near within a substep, and those are known
without a look at them: an element sleeps until anything may have come as near as it was away. Of those that are awake
again few are pushed.

So the threads of a block first queue what is awake (`nuno.contact.sharp_queue`). Then a thread takes an element, at a
box two do, for at two of its edges an element has two points; all find those at once, as they do not depend on pushes,
and only then do they push, one colour after the other. What is more than the queue has room for comes a colour at a
time, with the same bits. On the CPU a thread takes one after the other.
"""

from typing import Any

import warp as wp

from nuno.contact.between_vertices import meet_edge, meet_triangle
from nuno.contact.distances import BOX, FAR
from nuno.contact.renewal import shares_work
from nuno.contact.sharp_pose import sharp_pose
from nuno.contact.sharp_pushes import push_apart
from nuno.contact.sharp_queue import COLOUR, MOST_COLOURS, QUEUE, forget_queue, queue_awake, room_of
from nuno.contact.sharp_shapes import GONE, SOONEST, WAKE
from nuno.solver.lanes import add, anywhere, barrier, fill, largest, mul, root, sub  # noqa: F401
from nuno.solver.state import SPEED, Settings, Shapes
from nuno.solver.vec3 import vec3
from nuno.solver.warps import WARP, anyone, lowest, union_of_warp


@wp.func
def travel(t: Any, run: Settings, haste: float):
    """How far any vertex and any shape, the fastest at ``haste`` [m/s], may have gone in the substep before [m]."""
    return (largest(root(t.notes[SPEED])) + haste) * run.dt


@wp.func
def wake_up(t: Any, topo: Any, gone: float, thread: int, threads: int):
    """Wake what may be near again of the listed elements; the others get a number below zero.

    Returns:
        How many are awake of those that the thread looked at, and, if none is, when the first wakes [m].
    """
    awake = int(0)
    soon = float(FAR)
    for c in range(topo.sharp_colour.shape[0] - 1):
        first = topo.sharp_colour[c]
        for k in range(first + thread, first + t.sharp[1 + c], threads):
            element = t.sharp_list[k]
            element = wp.max(element, -1 - element)
            wake = t.sharp_wake[WAKE + k]
            if gone >= wake:
                t.sharp_wake[WAKE + k] = FAR
                awake += 1
            else:
                element = -1 - element
                soon = wp.min(soon, wake)
            t.sharp_list[k] = element
    return awake, soon


@wp.func
def first_to_wake(t: Any, soon: float, thread: int, threads: int):
    """The least of what all threads have."""
    barrier(threads)
    if thread == 0:
        t.sharp_wake[SOONEST] = FAR
    barrier(threads)
    if soon < FAR:
        wp.atomic_min(t.sharp_wake, SOONEST, soon)
    barrier(threads)
    return t.sharp_wake[SOONEST]


@wp.func
def touch_listed(
    t: Any, topo: Any, run: Settings, shapes: Shapes, s: int, gone: float, queued: int, thread: int, threads: int
):
    """The elements that are awake against one shape: those ``queued``, or all of them in turn where that is 0."""
    like = fill(t.x[0], 0.0)
    zero = fill(like, 0.0)
    one = fill(like, 1.0)
    h = sharp_pose(like, t, run, shapes, s)
    edges = topo.side.shape[0]
    colours = topo.sharp_colour.shape[0] - 1
    # of a box's edges each has two points
    points = int(1)
    if h.kind == BOX and shares_work(threads):
        points = 2
    together = threads / points
    mine = thread / points
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
        elif start + mine < t.sharp[1 + c]:
            entry = topo.sharp_colour[c] + start + mine
        element = int(-1)
        if entry >= 0:
            element = t.sharp_list[entry]
            if queued > 0:
                # its sign tells of another time
                element = wp.max(element, -1 - element)
        turn = thread % points
        more = int(1)
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
                if turn == 0:
                    corners = topo.face[element - edges]
                    i = corners[0]
                    j = corners[1]
                    k = corners[2]
                    on, bj, bk, point, normal, gap = meet_triangle(t, h, entry, gone, i, j, k, run.cell)
                    bi = one - bj - bk
            elif element >= 0:
                ends = topo.side[element]
                i = ends[0]
                j = ends[1]
                k = i
                on, more, bj, point, normal, gap = meet_edge(t, h, entry, gone, i, j, turn, run.cell)
                bi = one - bj
            if shares_work(threads):
                more = 0
                first = 1 << wp.min(c, MOST_COLOURS)
                second = wp.where(points > 1, first, 0)
                if queued > 0:
                    for which in range(points):
                        bits = int(0)
                        if turn == which and anywhere(on):
                            bits = 1 << colour
                        bits = union_of_warp(bits)
                        if thread % WARP == 0 and bits != 0:
                            wp.atomic_or(t.moved, 1 + which, bits)
                    barrier(threads)
                    second = t.moved[2]
                    first = t.moved[1] | second
                    barrier(threads)
                    if first != 0 and thread < 2:
                        t.moved[1 + thread] = 0
                elif t.sharp[1 + c] == 0:
                    first = 0
                while first != 0:
                    now = lowest(first)
                    for which in range(1 + ((second >> now) & 1)):
                        if turn == which and wp.min(colour, MOST_COLOURS) == now and anywhere(on):
                            push_apart(t, h, i, j, k, bi, bj, bk, point, normal, gap, on)
                        barrier(threads)
                    first = first & (first - 1)
            else:
                if anywhere(on):
                    push_apart(t, h, i, j, k, bi, bj, bk, point, normal, gap, on)
                more = more * (1 - turn)
                turn = 1
        start += together
        if queued > 0:
            c = wp.where(start < queued, 0, colours)
        elif start >= t.sharp[1 + c]:
            c += 1
            start = 0


@wp.func
def touch_awake(t: Any, topo: Any, run: Settings, shapes: Shapes, gone: float, thread: int, threads: int):
    """What is awake of the listed edges and triangles against the sharp shapes nearby.

    Args:
        t: The state.
        topo: The surface's elements.
        run: The run's settings.
        shapes: All shapes.
        gone: How far any vertex, and any shape, may have gone since the lists were made [m].
        thread: The thread's number.
        threads: How many share the work.

    Returns:
        How far these must have gone before anything is awake again [m].
    """
    queued = int(0)
    awake = int(0)
    soon = float(FAR)
    room = int(0)
    if shares_work(threads):
        room = room_of(topo)
    if room > 0:
        awake, soon = queue_awake(t, topo, gone, room, thread, threads)
        queued = awake
    if queued > room:
        forget_queue(t, topo, 0, thread, threads)
        queued = 0
    if room == 0 or awake > room:
        awake, soon = wake_up(t, topo, gone, thread, threads)
        if shares_work(threads):
            awake = int(anyone(awake > 0))
    if awake > 0:
        soon = gone
        for k in range(t.sharp[0]):
            s = t.sharp[topo.sharp_colour.shape[0] + k]
            touch_listed(t, topo, run, shapes, s, gone, queued, thread, threads)
        if queued > 0:
            forget_queue(t, topo, queued, thread, threads)
    elif shares_work(threads):
        soon = first_to_wake(t, soon, thread, threads)
    return soon


@wp.func
def touch_sharp(t: Any, topo: Any, run: Settings, shapes: Shapes, thread: int, threads: int):
    """All listed edges and triangles against the sharp shapes nearby; what was gone until now is in `State`."""
    gone = t.sharp_wake[GONE] + travel(t, run, shapes.haste[0])
    soonest = t.sharp_wake[SOONEST]
    # once all know
    barrier(threads)
    if gone >= soonest:
        soonest = touch_awake(t, topo, run, shapes, gone, thread, threads)
        barrier(threads)
    if thread == 0:
        t.sharp_wake[GONE] = gone
        t.sharp_wake[SOONEST] = soonest
