"""The order in which manifolds are solved: one after the other, or by colours that many threads share.

One after the other, what is lower comes first, so that in one pass the ground carries the lowest body, that the next,
and so on up. A colour is a set of manifolds of which no two move the same body, so that the order within it does not
matter. Both orders go by the ranks of parts: the rows in which parts are listed depend on what came and went before,
and two worlds that are alike must go on alike.
"""

from typing import Any

import warp as wp

from nuno.numbers.block_group import wait_for
from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import COLOURS, COUNTS, ENTRIES, WAITING, Contacts
from nuno.rigid.rigid_body import RigidState


@wp.func
def may_act(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, p: int):
    """Return True if the entry is in use and one of its bodies can be moved."""
    result = int(0)
    q = c.partner[e]
    if q >= 0 and parts.slot[p] >= 0:
        b = parts.slot[q]
        if b >= 0:
            if s.weight[world * s.capacity + parts.slot[p]] + s.weight[world * s.capacity + b] > 0.0:
                result = 1
    return result


@wp.func
def height_of(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, up: wp.vec3):
    """Return how high the bodies of an entry stand, twice their mean, of those that move [m]."""
    i = world * s.capacity + parts.slot[(e - world * c.parts * c.row) / c.row]
    j = world * s.capacity + parts.slot[c.partner[e]]
    high = float(0.0)
    if s.weight[i] > 0.0:
        high = high + wp.dot(up, s.position[i])
    if s.weight[j] > 0.0:
        high = high + wp.dot(up, s.position[j])
    if s.weight[i] == 0.0 or s.weight[j] == 0.0:
        high = 2.0 * high
    return high


@wp.func
def rank_of_partner(parts: Parts, c: Contacts, e: int):
    """A number by which the entries of one part are in order: by their partners' ranks, and patch by patch."""
    return parts.rank[c.partner[e]] * 16 + c.patch[e]


@wp.func
def comes_after(parts: Parts, c: Contacts, base: int, a: int, b: int):
    """Return True if entry a comes after entry b: by height, then by the ranks of part and partner, and patch."""
    result = c.height[a] > c.height[b]
    if c.height[a] == c.height[b]:
        first = parts.rank[(a - base) / c.row]
        second = parts.rank[(b - base) / c.row]
        result = first > second
        if first == second:
            result = rank_of_partner(parts, c, a) > rank_of_partner(parts, c, b)
    return result


@wp.func
def sift(parts: Parts, c: Contacts, base: int, root: int, end: int):
    """Let an entry sink to its place in the heap of the first ``end``."""
    at = int(root)
    while 2 * at + 1 < end:
        child = 2 * at + 1
        if child + 1 < end:
            if comes_after(parts, c, base, c.order[base + child + 1], c.order[base + child]):
                child = child + 1
        if comes_after(parts, c, base, c.order[base + child], c.order[base + at]):
            kept = c.order[base + at]
            c.order[base + at] = c.order[base + child]
            c.order[base + child] = kept
            at = child
        else:
            break


@wp.func
def line_up(s: RigidState, parts: Parts, c: Contacts, world: int, up: wp.vec3):
    """One pass over all entries with points, the lowest first (a heap sort), of those that are listed as in use."""
    base = world * c.parts * c.row
    count = int(0)
    for k in range(c.counts[world * COUNTS + WAITING]):
        e = c.waiting[base + k]
        if c.count[e] > 0:
            if may_act(s, parts, c, world, e, (e - base) / c.row) == 1:
                c.height[e] = height_of(s, parts, c, world, e, up)
                c.order[base + count] = e
                count = count + 1
    for k in range(count / 2):
        sift(parts, c, base, count / 2 - 1 - k, count)
    for k in range(count - 1):
        last = count - 1 - k
        kept = c.order[base]
        c.order[base] = c.order[base + last]
        c.order[base + last] = kept
        sift(parts, c, base, 0, last)
    c.counts[world * COUNTS + ENTRIES] = count
    c.counts[world * COUNTS + COLOURS] = 1
    c.bounds[base] = 0
    c.bounds[base + 1] = count


@wp.func
def priority(parts: Parts, c: Contacts, world: int, e: int):
    """A number for each manifold, like a die's but always the same, and no two alike (Jones and Plassmann 1993).

    By height it would take as many colours as the heap is deep, several times as many.
    """
    local = e - world * c.parts * c.row
    mixed = wp.uint32(parts.rank[local / c.row]) * wp.uint32(0x1E3779B1)
    mixed = (mixed ^ (mixed >> wp.uint32(15))) + wp.uint32(rank_of_partner(parts, c, e) + 1)
    mixed = mixed * wp.uint32(0x05EBCA77)
    mixed = mixed ^ (mixed >> wp.uint32(13))
    return (wp.uint64(mixed) << wp.uint64(32)) | wp.uint64(local + 1)


@wp.func
def sort_colours(s: RigidState, parts: Parts, c: Contacts, world: int, rank: int, size: int, crew: Any):
    """Sort the entries with points by colour, by all threads of ``crew``, of a block or a block group.

    For each colour every entry bids its priority for its two bodies, and those that win both have it.
    """
    base = world * c.parts * c.row
    count = world * COUNTS
    bodies = world * s.capacity
    if rank == 0:
        c.counts[count + ENTRIES] = 0
        c.counts[count + WAITING] = 0
        c.counts[count + COLOURS] = 0
        c.bounds[base] = 0
    for k in range(rank, s.capacity, size):
        c.winner[bodies + k] = wp.uint64(0)
    wait_for(crew)
    for local in range(rank, parts.count * c.row, size):
        e = base + local
        if c.count[e] > 0:
            if may_act(s, parts, c, world, e, local / c.row) == 1:
                c.waiting[base + wp.atomic_add(c.counts, count + WAITING, 1)] = e
    wait_for(crew)
    waiting = c.counts[count + WAITING]
    done = int(0)
    colours = int(0)
    while done < waiting:
        for k in range(rank, waiting, size):
            e = c.waiting[base + k]
            if e >= 0:
                bid = priority(parts, c, world, e)
                i = bodies + parts.slot[(e - base) / c.row]
                j = bodies + parts.slot[c.partner[e]]
                if s.weight[i] > 0.0:
                    wp.atomic_max(c.winner, i, bid)
                if s.weight[j] > 0.0:
                    wp.atomic_max(c.winner, j, bid)
        wait_for(crew)
        for k in range(rank, waiting, size):
            e = c.waiting[base + k]
            if e >= 0:
                bid = priority(parts, c, world, e)
                i = bodies + parts.slot[(e - base) / c.row]
                j = bodies + parts.slot[c.partner[e]]
                if (s.weight[i] == 0.0 or c.winner[i] == bid) and (s.weight[j] == 0.0 or c.winner[j] == bid):
                    c.order[base + wp.atomic_add(c.counts, count + ENTRIES, 1)] = e
                    c.waiting[base + k] = -1
        wait_for(crew)
        for k in range(rank, s.capacity, size):
            c.winner[bodies + k] = wp.uint64(0)
        done = c.counts[count + ENTRIES]
        colours = colours + 1
        if rank == 0:
            c.bounds[base + colours] = done
        wait_for(crew)
    if rank == 0:
        c.counts[count + COLOURS] = colours
    wait_for(crew)
