"""Work queue of the edges and triangles that are active at sharp shapes, filled colour by colour by a CUDA block.

A warp takes a colour. All are counted first, and each warp then knows where what is active of its colours belongs.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import FAR
from nuno.contact.particle.feature_lists import DUE
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import lane
from nuno.numbers.warps import WARP, below_in, claim, size_of_set, sum_of_warp, vote

TALLY = wp.constant(3)
"""Place in a state's `moved`, which is zero meanwhile, of where each colour starts in the queue. Before it are how
many are queued, and the sets of colours that have first and second points to be pushed."""
QUEUE = wp.constant(35)
"""Place in it where the queue begins: places in the list, and colours."""
COLOUR = wp.constant(1 << 24)
"""By which a colour is multiplied in the queue."""
MAX_COLOURS = wp.constant(31)
"""Colours that fit the bits of a number, and the tally."""
ROOM = wp.constant(2048)
"""Elements that are queued at most."""


@wp.func
def room_of(topo: Any):
    """Return how many elements fit into the queue; none where there are more colours than it can tell apart."""
    room = int(0)
    if topo.feature_colour.shape[0] - 1 <= MAX_COLOURS:
        room = wp.clamp(4 * topo.particles - QUEUE, 0, ROOM)
    return room


@wp.func
def due_of(t: Any, k: int, last: int):
    """Return when entry k wakes [m]; never where it is not before ``last``."""
    due = float(FAR)
    if k < last:
        due = t.feature_due[DUE + k]
    return due


@wp.func
def enqueue(t: Any, travelled: float, due: float, place: int, c: int, k: int, lane: int):
    """Queue entry k where it is active; the place behind what the warp's threads queued."""
    yes = travelled >= due
    among = vote(yes)
    if yes:
        t.moved[place + below_in(among, lane)] = c * COLOUR + k
        t.feature_due[DUE + k] = FAR
    return place + size_of_set(among)


@wp.func
def queue_active(t: Any, topo: Any, travelled: float, room: int, rank: int, size: int):
    """Queue what is active of the listed elements, unless it is more than there is room for.

    Args:
        t: The state.
        topo: The surface's elements.
        travelled: How far any vertex, and any shape, may have gone since the lists were made [m].
        room: How many may be queued.
        rank: The thread's number.
        size: How many share the work, whole warps.

    Returns:
        How many are active, and, of those that the thread looked at and if none is, when the first wakes [m].
    """
    colours = topo.feature_colour.shape[0] - 1
    lane = rank % WARP
    soon = float(FAR)
    for c in range(rank / WARP, colours, size / WARP):
        first = topo.feature_colour[c]
        last = first + t.feature_shapes[1 + c]
        mine = int(0)
        # four at a time, so that a thread waits for them together
        for k in range(first, last, 4 * WARP):
            u = due_of(t, k + lane, last)
            v = due_of(t, k + lane + WARP, last)
            w = due_of(t, k + lane + 2 * WARP, last)
            z = due_of(t, k + lane + 3 * WARP, last)
            soon = wp.min(soon, wp.min(wp.min(u, v), wp.min(w, z)))
            mine += int(travelled >= u) + int(travelled >= v) + int(travelled >= w) + int(travelled >= z)
        mine = sum_of_warp(mine)
        if lane == 0:
            t.moved[TALLY + c] = mine
    barrier(size)
    if rank < WARP:
        mine = int(0)
        if rank < colours:
            mine = t.moved[TALLY + rank]
        mine = claim(t.moved, 0, mine)
        if rank < colours:
            t.moved[TALLY + rank] = mine
    barrier(size)
    active = t.moved[0]
    if active > 0 and active <= room:
        for c in range(rank / WARP, colours, size / WARP):
            place = QUEUE + t.moved[TALLY + c]
            first = topo.feature_colour[c]
            last = first + t.feature_shapes[1 + c]
            for k in range(first, last, 4 * WARP):
                u = due_of(t, k + lane, last)
                v = due_of(t, k + lane + WARP, last)
                w = due_of(t, k + lane + 2 * WARP, last)
                z = due_of(t, k + lane + 3 * WARP, last)
                place = enqueue(t, travelled, u, place, c, k + lane, lane)
                place = enqueue(t, travelled, v, place, c, k + lane + WARP, lane)
                place = enqueue(t, travelled, w, place, c, k + lane + 2 * WARP, lane)
                place = enqueue(t, travelled, z, place, c, k + lane + 3 * WARP, lane)
        barrier(size)
    return active, soon


@wp.func
def queue_active(t: Any, topo: Any, travelled: lane, room: int, rank: int, size: int):
    return int(0), float(FAR)  # lanes have a thread by itself, which needs no queue


@wp.func
def forget_queue(t: Any, topo: Any, queued: int, rank: int, size: int):
    """Make `moved` zero again, once all have read it."""
    barrier(size)
    for k in range(rank, queued, size):
        t.moved[QUEUE + k] = 0
    if rank < topo.feature_colour.shape[0] - 1:
        t.moved[TALLY + rank] = 0
    if rank == 0:
        t.moved[0] = 0
