"""The phases in which many blocks of a CUDA device list the self-contact pairs of one world together.

What `nuno.contact.self.list_rebuild` does, in phases between which all threads of a block group wait
(`nuno.numbers.block_group`). First pairs of leaves are noted, a leaf by a warp, which passes over far regions at a
comparison each. Then a thread looks at two elements of a noted pair at a time.
"""

from typing import Any

import warp as wp

from nuno.contact.self.block_flat_regions import in_flat, mark_flat, mark_uncreased
from nuno.contact.self.list_rebuild import look_ahead
from nuno.contact.self.list_skin import (
    REGION,
    box_moves,
    group_count,
    join_boxes,
    max_used_up,
    moves_start,
    region_count,
)
from nuno.contact.self.narrow_phase import append, bound_leaves, middles, near_edges, near_triangle, next_place
from nuno.contact.self.neighbour_lists import FORGET, begin_list, find_creases, make_inner_list, swept
from nuno.numbers.block_group import BlockGroup, grid_barrier
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import subarray
from nuno.numbers.warps import WARP, in_warps, leads_warp, lowest, vote, warp_max
from nuno.state.cloth_state import (
    INNER_REACH,
    INNER_TRAVEL,
    LISTINGS,
    THICKNESS,
    TRAVEL,
    Settings,
    StateFloat,
    Topology,
)

ROOM = 24
"""Pairs of leaves, over the number of leaves, that there is room to note; where they are more, all are gone through."""
ITEMS = 32
"""Threads that share a pair of leaves."""


@wp.struct
class Lists:
    """Scratch arrays of the search: pairs of leaves, their number in each world, flags of flat regions."""

    noted: wp.array(dtype=int)
    pairs: wp.array(dtype=wp.vec2i)
    flat: wp.array(dtype=int)


def make_lists(topology: Any, worlds: int, device: str) -> Any:
    """Room for the listing of so many worlds."""
    lists: Any = Lists()
    lists.noted = wp.zeros(worlds, dtype=int, device=device)
    lists.pairs = wp.zeros(worlds * int(ROOM * topology.leaves), dtype=wp.vec2i, device=device)
    lists.flat = wp.zeros(2 * worlds * topology.particles, dtype=int, device=device)
    return lists


@wp.func
def margin_left(t: StateFloat, run: Settings):
    """Return how far points may have come closer since pairs were listed, for the list to be good [m]."""
    return run.margin - swept(t, run)


@wp.func
def list_reach(t: StateFloat, run: Settings):
    """Return the greatest distance of listed elements [m]; the last percent is for rounding."""
    return t.scalars[THICKNESS] + 1.01 * run.margin


@wp.func
def measure_closing(t: StateFloat, topo: Topology, run: Settings, rank: int, size: int):
    """Raise the figure behind the listed positions to what is used up of the margin at most; whole warps come here."""
    worst = max_used_up(t, topo, t.scalars[THICKNESS] + run.margin, margin_left(t, run), rank, size)
    k = 3 * topo.particles
    high = warp_max(worst, size)
    if leads_warp(rank, size) and high > t.reference[k]:
        wp.atomic_max(t.reference, k, high)


@wp.func
def keep_places(t: StateFloat, topo: Topology, run: Settings, rank: int, size: int):
    """Store where everything is now: particles, centres of elements, boxes of leaves, flat squares of the grid."""
    n = topo.particles
    mark_uncreased(t, topo, list_reach(t, run), rank, size)
    for i in range(rank, n, size):
        t.reference[i] = t.x[i]
        t.reference[n + i] = t.y[i]
        t.reference[2 * n + i] = t.z[i]
    middles(t, topo, rank, size)
    bound_leaves(t, topo, rank, size)


@wp.func
def outside(t: StateFloat, b: int, x: float, y: float, z: float):
    """Return how far a point is outside of a leaf's box, along the axis where it is most."""
    k = 6 * b
    gx = wp.max(t.bounds[k] - x, x - t.bounds[k + 3])
    gy = wp.max(t.bounds[k + 1] - y, y - t.bounds[k + 4])
    gz = wp.max(t.bounds[k + 2] - z, z - t.bounds[k + 5])
    return wp.max(gx, wp.max(gy, gz))


@wp.func
def try_vertex(t: StateFloat, topo: Topology, k: int, j: int, b: int, far: float):
    """List vertex k and triangle j of leaf b, both in the order of the leaves, where they are near."""
    i = topo.leaf_vertex[k]
    f = topo.leaf_face[j]
    centre = wp.vec3(t.middle[4 * j], t.middle[4 * j + 1], t.middle[4 * j + 2])
    reach = far + t.middle[4 * j + 3]
    x = wp.vec3(t.x[i], t.y[i], t.z[i])
    if wp.length_sq(x - centre) < reach * reach and outside(t, b, x[0], x[1], x[2]) < far:
        if i != f[0] and i != f[1] and i != f[2]:
            hit = near_triangle(t, i, f[0], f[1], f[2], far * far)
            append(hit, t.pair_count, 0, t.vertex_triangle, i, f[0], f[1], f[2])


@wp.func
def try_edge(t: StateFloat, topo: Topology, j: int, k: int, far: float):
    """List edges j and k, in the order of the leaves, where they are near."""
    e = topo.leaf_edge[j]
    f = topo.leaf_edge[k]
    m = 4 * (topo.leaf_face.shape[0] + j)
    n = 4 * (topo.leaf_face.shape[0] + k)
    between = wp.vec3(t.middle[m] - t.middle[n], t.middle[m + 1] - t.middle[n + 1], t.middle[m + 2] - t.middle[n + 2])
    reach = far + t.middle[m + 3] + t.middle[n + 3]
    if wp.length_sq(between) < reach * reach:
        if e[0] != f[0] and e[0] != f[1] and e[1] != f[0] and e[1] != f[1]:
            hit = near_edges(t, e[0], e[1], f[0], f[1], far * far)
            append(hit, t.pair_count, 1, t.edge_edge, e[0], e[1], f[0], f[1])


@wp.func
def search(t: StateFloat, topo: Topology, a: int, b: int, far: float, item: int, items: int):
    """List what is near of two leaves; of ``items`` threads each looks at its share of the pairs of elements."""
    va = topo.leaf_vertex_start[a]
    vb = topo.leaf_vertex_start[b]
    fa = topo.leaf_face_start[a]
    fb = topo.leaf_face_start[b]
    ea = topo.leaf_edge_start[a]
    eb = topo.leaf_edge_start[b]
    faces_a = topo.leaf_face_start[a + 1] - fa
    faces_b = topo.leaf_face_start[b + 1] - fb
    edges_b = topo.leaf_edge_start[b + 1] - eb
    ahead = (topo.leaf_vertex_start[a + 1] - va) * faces_b
    vertices = ahead
    if a != b:
        vertices += (topo.leaf_vertex_start[b + 1] - vb) * faces_a
    for k in range(item, vertices + (topo.leaf_edge_start[a + 1] - ea) * edges_b, items):
        if k < vertices:
            vertex = va
            face = fb
            count = faces_b
            owner = b
            own = k
            if k >= ahead:
                vertex = vb
                face = fa
                count = faces_a
                owner = a
                own = k - ahead
            try_vertex(t, topo, vertex + own / count, face + own % count, owner, far)
        else:
            one = ea + (k - vertices) / edges_b
            other = eb + (k - vertices) % edges_b
            # each pair once
            if a != b or other > one:
                try_edge(t, topo, one, other, far)


@wp.func
def are_near(t: StateFloat, a: int, b: int, far: float):
    """Return True if boxes a and b are nearer to each other than ``far``."""
    i = 6 * a
    j = 6 * b
    gap = wp.min(t.bounds[i + 3] - t.bounds[j], t.bounds[j + 3] - t.bounds[i])
    gap = wp.min(gap, wp.min(t.bounds[i + 4] - t.bounds[j + 1], t.bounds[j + 4] - t.bounds[i + 1]))
    gap = wp.min(gap, wp.min(t.bounds[i + 5] - t.bounds[j + 2], t.bounds[j + 5] - t.bounds[i + 2]))
    return gap + far > 0.0


@wp.func
def note_pairs(t: StateFloat, topo: Topology, run: Settings, lists: Lists, world: int, rank: int, size: int):
    """Note the pairs of leaves that are near each other and not flat; those without room are counted.

    A warp takes a leaf, and each lane a region, then a leaf of one region after the other that is near. On CUDA whole
    warps come here.
    """
    m = topo.leaves
    regions = region_count(m)
    above = m + group_count(m)
    room = lists.pairs.shape[0] / t.worlds
    far = list_reach(t, run)
    lanes = int(1)
    if in_warps(size):
        lanes = WARP
    lane = rank % lanes
    for a in range(rank / lanes, m, size / lanes):
        for start in range(a / REGION, regions, lanes):
            r = start + lane
            on = bool(False)
            if r < regions:
                on = are_near(t, a, above + r, far)
            left = vote(on)
            while left != 0:
                first = (start + lowest(left)) * REGION
                left = left & (left - 1)
                for b in range(wp.max(first, a) + lane, wp.min(first + REGION, m), lanes):
                    if are_near(t, a, b, far) and not in_flat(t, topo, a, b):
                        place = next_place(lists.noted, world)
                        if place < room:
                            lists.pairs[world * room + place] = wp.vec2i(a, b)


@wp.func
def search_noted(t: StateFloat, topo: Topology, run: Settings, lists: Lists, world: int, rank: int, size: int):
    """Look through the noted pairs, a vertex or an edge at a time; through all pairs where not all were noted."""
    m = topo.leaves
    room = lists.pairs.shape[0] / t.worlds
    far = list_reach(t, run)
    noted = lists.noted[world]
    every = noted > room
    if every:
        noted = m
    for k in range(rank, noted * ITEMS, size):
        a = k / ITEMS
        b = a + k % ITEMS
        end = m
        if not every:
            pair = lists.pairs[world * room + k / ITEMS]
            a = pair[0]
            b = pair[1]
            end = b + 1
        while b < end:
            if not every or are_near(t, a, b, far):
                search(t, topo, a, b, far, wp.where(every, 0, k % ITEMS), wp.where(every, 1, ITEMS))
            b += ITEMS


@wp.func
def list_anew(t: StateFloat, topo: Topology, run: Settings, lists: Lists, world: int, block_group: BlockGroup):
    """List the pairs that are nearer than the thickness and the margin, by a block group."""
    if block_group.rank == 0:
        lists.noted[world] = 0
        begin_list(t)
    # the flags of flat regions where `nuno.contact.self.block_flat_regions` has them
    moved = t.moved
    t.moved = subarray(lists.flat, 2 * topo.particles * world, 2 * topo.particles)
    keep_places(t, topo, run, block_group.rank, block_group.size)
    grid_barrier(block_group)
    join_boxes(t, topo, 0, block_group.rank, block_group.size)
    mark_flat(t, topo, list_reach(t, run), block_group.rank, block_group.size)
    grid_barrier(block_group)
    note_pairs(t, topo, run, lists, world, block_group.rank, block_group.size)
    find_creases(t, topo, list_reach(t, run) * list_reach(t, run), block_group.rank, block_group.size)
    grid_barrier(block_group)
    search_noted(t, topo, run, lists, world, block_group.rank, block_group.size)
    t.moved = moved


@wp.func
def rebuild_by_group(t: StateFloat, topo: Topology, run: Settings, lists: Lists, world: int, block_group: BlockGroup):
    """List anew what may have come too close for the list, and pick the pairs that may touch soon.

    Every block has figures of its own in ``t.notes``, the same in all of them.
    """
    n = topo.particles
    left = margin_left(t, run)
    if t.notes[TRAVEL] * 2.0 > left:
        if block_group.rank == 0:
            t.reference[3 * n] = 0.0
        box_moves(t, topo, block_group.rank, block_group.size)
        grid_barrier(block_group)
        join_boxes(t, topo, moves_start(topo.leaves), block_group.rank, block_group.size)
        grid_barrier(block_group)
        measure_closing(t, topo, run, block_group.rank, block_group.size)
        grid_barrier(block_group)
        worst = wp.max(t.reference[3 * n], t.notes[TRAVEL] - FORGET)
        fresh = worst > left
        if fresh:
            list_anew(t, topo, run, lists, world, block_group)
        barrier(block_group.block_size)
        if block_group.rank_in_block == 0:
            t.notes[TRAVEL] = 0.5 * worst
            if fresh:
                t.notes[TRAVEL] = 0.0
                t.notes[INNER_TRAVEL] = FORGET
                t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
        barrier(block_group.block_size)
    approach = swept(t, run)
    if t.notes[INNER_TRAVEL] * 2.0 + approach > t.notes[INNER_REACH]:
        ahead = look_ahead(t, run, approach)
        if block_group.rank == 0:
            t.active_count[0] = 0
            t.active_count[1] = 0
        grid_barrier(block_group)
        make_inner_list(t, t.scalars[THICKNESS] + 1.01 * ahead, block_group.rank, block_group.size)
        if block_group.rank_in_block == 0:
            t.notes[INNER_TRAVEL] = 0.0
            t.notes[INNER_REACH] = ahead
        grid_barrier(block_group)
