"""The pairs of leaves that may come near each other, and how far they moved, by the threads of a CUDA block.

The list of elements is good until two of its leaves may have moved towards each other by the margin: what hangs from a
hand and what lies on the table move far, but not near each other. Which leaves those are is listed with a wider margin,
and stays true until any two points of the cloth may have come closer by the difference.
"""

import warp as wp

from nuno.contact.self.narrow_phase import GROUP, raise_to
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import subarray
from nuno.numbers.warps import WARP, claim, lowest
from nuno.state.cloth_state import MISSED_LEAVES, THICKNESS, StateFloat, Topology

WIDEST_SKIN = wp.constant(5.0)
"""Margin of the list of leaves over that of the list of elements."""
TRAVELLED, WIDTH = wp.constant(6), wp.constant(7)
"""Places after the span in `State.reference`: how far any two points came closer since the leaves were listed, and the
margin that was used [m]."""


@wp.func
def travelled(topo: Topology):
    """Return where the boxes of the leaves' displacements start in `State.bounds`."""
    return 6 * (topo.leaves + (topo.leaves + GROUP - 1) / GROUP)


@wp.func
def measure_leaves(t: StateFloat, topo: Topology, rank: int, size: int):
    """The boxes of the leaves' displacements since elements were listed, and the span of all."""
    n = topo.particles
    place = travelled(topo)
    # the box of nothing, upside down, where a thread has no leaf
    hx = float(-1.0e30)
    hy = float(-1.0e30)
    hz = float(-1.0e30)
    lx = float(1.0e30)
    ly = float(1.0e30)
    lz = float(1.0e30)
    for b in range(rank, topo.leaves, size):
        bhx = float(-1.0e30)
        bhy = float(-1.0e30)
        bhz = float(-1.0e30)
        blx = float(1.0e30)
        bly = float(1.0e30)
        blz = float(1.0e30)
        for k in range(topo.leaf_corner_start[b], topo.leaf_corner_start[b + 1]):
            i = topo.leaf_corner[k]
            dx = t.x[i] - t.reference[i]
            dy = t.y[i] - t.reference[n + i]
            dz = t.z[i] - t.reference[2 * n + i]
            bhx = wp.max(bhx, dx)
            bhy = wp.max(bhy, dy)
            bhz = wp.max(bhz, dz)
            blx = wp.min(blx, dx)
            bly = wp.min(bly, dy)
            blz = wp.min(blz, dz)
        m = place + 6 * b
        t.bounds[m] = blx
        t.bounds[m + 1] = bly
        t.bounds[m + 2] = blz
        t.bounds[m + 3] = bhx
        t.bounds[m + 4] = bhy
        t.bounds[m + 5] = bhz
        hx = wp.max(hx, bhx)
        hy = wp.max(hy, bhy)
        hz = wp.max(hz, bhz)
        lx = wp.min(lx, blx)
        ly = wp.min(ly, bly)
        lz = wp.min(lz, blz)
    raise_to(t.reference, 3 * n, hx, rank, size)
    raise_to(t.reference, 3 * n + 1, hy, rank, size)
    raise_to(t.reference, 3 * n + 2, hz, rank, size)
    raise_to(t.reference, 3 * n + 3, -lx, rank, size)
    raise_to(t.reference, 3 * n + 4, -ly, rank, size)
    raise_to(t.reference, 3 * n + 5, -lz, rank, size)


@wp.func
def closed_in(t: StateFloat, topo: Topology, margin: float, rank: int, size: int):
    """Return how much of the margin is used up at most [m], by the pairs of leaves that are this thread's share.

    That is how far two of their points came closer; leaves that were apart by more than the margin had more.
    """
    place = travelled(topo)
    far = t.scalars[THICKNESS] + margin
    worst = float(0.0)
    for k in range(rank, t.leaf_pairs[0], size):
        pair = t.leaf_pairs[1 + k]
        a = subarray(t.bounds, 6 * (pair >> 16), 6)
        b = subarray(t.bounds, 6 * (pair & 0xFFFF), 6)
        gx = wp.max(a[0] - b[3], b[0] - a[3])
        gy = wp.max(a[1] - b[4], b[1] - a[4])
        gz = wp.max(a[2] - b[5], b[2] - a[5])
        spare = wp.max(wp.max(gx, wp.max(gy, gz)) - far, 0.0)
        a = subarray(a, place, 6)
        b = subarray(b, place, 6)
        dx = wp.max(a[3] - b[0], b[3] - a[0])
        dy = wp.max(a[4] - b[1], b[4] - a[1])
        dz = wp.max(a[5] - b[2], b[5] - a[2])
        worst = wp.max(worst, wp.sqrt(dx * dx + dy * dy + dz * dz) - spare)
    return worst


@wp.func
def pair_leaves(t: StateFloat, far: float, m: int, rank: int, size: int):
    """List the pairs of leaves whose boxes are nearer than ``far``, each pair once."""
    for a in range(rank / WARP, m, size / WARP):
        own = subarray(t.bounds, 6 * a, 6)
        lx = own[0] - far
        ly = own[1] - far
        lz = own[2] - far
        hx = own[3] + far
        hy = own[4] + far
        hz = own[5] + far
        for begin in range(a, m, 32 * WARP):
            bits = int(0)
            count = int(0)
            for j in range(wp.min(32, (m - begin + WARP - 1) / WARP)):
                b = begin + WARP * j + rank % WARP
                if b < m:
                    other = subarray(t.bounds, 6 * b, 6)
                    gx = wp.min(other[3] - lx, hx - other[0])
                    gy = wp.min(other[4] - ly, hy - other[1])
                    gz = wp.min(other[5] - lz, hz - other[2])
                    if wp.min(gx, wp.min(gy, gz)) > 0.0:
                        bits = bits | (1 << j)
                        count += 1
            place = claim(t.active_count, 0, count)
            while bits != 0:
                if place + 1 < t.leaf_pairs.shape[0]:
                    t.leaf_pairs[1 + place] = (a << 16) | (begin + WARP * lowest(bits) + rank % WARP)
                place += 1
                bits = bits & (bits - 1)


@wp.func
def list_leaf_pairs(t: StateFloat, topo: Topology, margin: float, rank: int, size: int):
    """List the leaves that may come near: within the widest margin that there is room for."""
    width = float(WIDEST_SKIN * margin)
    count = int(-1)
    room = t.leaf_pairs.shape[0] - 1
    while count < 0:
        barrier(size)
        if rank == 0:
            t.active_count[0] = 0
        barrier(size)
        # the last percent is for rounding, as in the list of elements
        pair_leaves(t, t.scalars[THICKNESS] + 1.01 * width, topo.leaves, rank, size)
        barrier(size)
        count = t.active_count[0]
        if count > room and width > margin:
            width = wp.max(0.5 * width, margin)
            count = -1
    if rank == 0:
        t.leaf_pairs[0] = wp.min(count, room)
        if count > room:
            t.pair_count[MISSED_LEAVES] = wp.max(t.pair_count[MISSED_LEAVES], count)
        t.reference[3 * topo.particles + TRAVELLED] = 0.0
        t.reference[3 * topo.particles + WIDTH] = width
    barrier(size)
