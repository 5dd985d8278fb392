"""Which of the elements listed at sharp shapes are awake, colour by colour, as a block's threads find it on CUDA.

A warp takes a colour. All are counted first, and each warp then knows where what is awake of its colours belongs.
"""

from typing import Any

import warp as wp

from nuno.contact.distances import FAR
from nuno.contact.sharp_shapes import WAKE
from nuno.solver.lanes import barrier
from nuno.solver.warps import WARP, below_in, claim, size_of_set, sum_of_warp, vote

TALLY = wp.constant(3)
"""Where in a state's `moved`, which is zero meanwhile, begins where each colour starts in the queue. Before it are how
many are queued, and the sets of colours that have first and second points to be pushed."""
QUEUE = wp.constant(35)
"""Where in it the queue begins: places in the list, and colours."""
COLOUR = wp.constant(1 << 24)
"""By which a colour is multiplied in the queue."""
MOST_COLOURS = wp.constant(31)
"""Colours that fit the bits of a number, and the tally."""
ROOM = wp.constant(2048)
"""Elements that are queued at most."""


@wp.func
def room_of(topo: Any):
    """How many elements fit into the queue; none where there are more colours than it can tell apart."""
    room = int(0)
    if topo.sharp_colour.shape[0] - 1 <= MOST_COLOURS:
        room = wp.clamp(4 * topo.particles - QUEUE, 0, ROOM)
    return room


@wp.func
def wake_of(t: Any, k: int, last: int):
    """When entry k wakes [m]; never where it is not before ``last``."""
    wake = float(FAR)
    if k < last:
        wake = t.sharp_wake[WAKE + k]
    return wake


@wp.func
def enqueue(t: Any, gone: float, wake: float, place: int, c: int, k: int, lane: int):
    """Queue entry k where it is awake; the place behind what the warp's threads queued."""
    yes = gone >= wake
    among = vote(yes)
    if yes:
        t.moved[place + below_in(among, lane)] = c * COLOUR + k
        t.sharp_wake[WAKE + k] = FAR
    return place + size_of_set(among)


@wp.func
def queue_awake(t: Any, topo: Any, gone: float, room: int, thread: int, threads: int):
    """Queue what is awake of the listed elements, unless it is more than there is room for.

    Args:
        t: The state.
        topo: The surface's elements.
        gone: How far any vertex, and any shape, may have gone since the lists were made [m].
        room: How many may be queued.
        thread: The thread's number.
        threads: How many share the work, whole warps.

    Returns:
        How many are awake, and, of those that the thread looked at and if none is, when the first wakes [m].
    """
    colours = topo.sharp_colour.shape[0] - 1
    lane = thread % WARP
    soon = float(FAR)
    for c in range(thread / WARP, colours, threads / WARP):
        first = topo.sharp_colour[c]
        last = first + t.sharp[1 + c]
        mine = int(0)
        # four at a time, so that a thread waits for them together
        for k in range(first, last, 4 * WARP):
            u = wake_of(t, k + lane, last)
            v = wake_of(t, k + lane + WARP, last)
            w = wake_of(t, k + lane + 2 * WARP, last)
            z = wake_of(t, k + lane + 3 * WARP, last)
            soon = wp.min(soon, wp.min(wp.min(u, v), wp.min(w, z)))
            mine += int(gone >= u) + int(gone >= v) + int(gone >= w) + int(gone >= z)
        mine = sum_of_warp(mine)
        if lane == 0:
            t.moved[TALLY + c] = mine
    barrier(threads)
    if thread < WARP:
        mine = int(0)
        if thread < colours:
            mine = t.moved[TALLY + thread]
        mine = claim(t.moved, 0, mine)
        if thread < colours:
            t.moved[TALLY + thread] = mine
    barrier(threads)
    awake = t.moved[0]
    if awake > 0 and awake <= room:
        for c in range(thread / WARP, colours, threads / WARP):
            place = QUEUE + t.moved[TALLY + c]
            first = topo.sharp_colour[c]
            last = first + t.sharp[1 + c]
            for k in range(first, last, 4 * WARP):
                u = wake_of(t, k + lane, last)
                v = wake_of(t, k + lane + WARP, last)
                w = wake_of(t, k + lane + 2 * WARP, last)
                z = wake_of(t, k + lane + 3 * WARP, last)
                place = enqueue(t, gone, u, place, c, k + lane, lane)
                place = enqueue(t, gone, v, place, c, k + lane + WARP, lane)
                place = enqueue(t, gone, w, place, c, k + lane + 2 * WARP, lane)
                place = enqueue(t, gone, z, place, c, k + lane + 3 * WARP, lane)
        barrier(threads)
    return awake, soon


@wp.func
def forget_queue(t: Any, topo: Any, queued: int, thread: int, threads: int):
    """Make `moved` zero again, once all have read it."""
    barrier(threads)
    for k in range(thread, queued, threads):
        t.moved[QUEUE + k] = 0
    if thread < topo.sharp_colour.shape[0] - 1:
        t.moved[TALLY + thread] = 0
    if thread == 0:
        t.moved[0] = 0
