"""The pairs of blocks that may come near each other, and how far they moved, by the threads of a CUDA block.

The list of elements is good until two of its blocks may have moved towards each other by the margin: what hangs from a
hand and what lies on the table move far, but not near each other. Which blocks those are is listed with a wider margin,
and stays true until any two points of the cloth may have come closer by the difference.
"""

import warp as wp

from nuno.contact.nearness import GROUP, raise_to
from nuno.solver.lanes import barrier, window
from nuno.solver.state import MANY_BLOCKS, THICKNESS, StateFloat, Topology
from nuno.solver.warps import WARP, claim, lowest

WIDE = wp.constant(5.0)
"""Margin of the list of blocks over that of the list of elements."""
GONE, WIDTH = wp.constant(6), wp.constant(7)
"""Places after the span in `State.listed`: how far any two points came closer since the blocks were listed, and the
margin that was used [m]."""


@wp.func
def travelled(topo: Topology):
    """Where the boxes of the blocks' displacements start in `State.bounds`."""
    return 6 * (topo.blocks + (topo.blocks + GROUP - 1) / GROUP)


@wp.func
def measure_blocks(t: StateFloat, topo: Topology, thread: int, threads: int):
    """The boxes of the blocks' displacements since elements were listed, and the span of all, as `measure_span`."""
    n = topo.particles
    place = travelled(topo)
    # the box of nothing, upside down, where a thread has no block
    hx = float(-1.0e30)
    hy = float(-1.0e30)
    hz = float(-1.0e30)
    lx = float(1.0e30)
    ly = float(1.0e30)
    lz = float(1.0e30)
    for b in range(thread, topo.blocks, threads):
        bhx = float(-1.0e30)
        bhy = float(-1.0e30)
        bhz = float(-1.0e30)
        blx = float(1.0e30)
        bly = float(1.0e30)
        blz = float(1.0e30)
        for k in range(topo.block_corner_start[b], topo.block_corner_start[b + 1]):
            i = topo.block_corner[k]
            dx = t.x[i] - t.listed[i]
            dy = t.y[i] - t.listed[n + i]
            dz = t.z[i] - t.listed[2 * n + i]
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
    raise_to(t.listed, 3 * n, hx, thread, threads)
    raise_to(t.listed, 3 * n + 1, hy, thread, threads)
    raise_to(t.listed, 3 * n + 2, hz, thread, threads)
    raise_to(t.listed, 3 * n + 3, -lx, thread, threads)
    raise_to(t.listed, 3 * n + 4, -ly, thread, threads)
    raise_to(t.listed, 3 * n + 5, -lz, thread, threads)


@wp.func
def closed_in(t: StateFloat, topo: Topology, margin: float, thread: int, threads: int):
    """How much of the margin is used up at most [m], by the pairs of blocks that are this thread's share.

    That is how far two of their points came closer; blocks that were apart by more than the margin had more.
    """
    place = travelled(topo)
    far = t.scalars[THICKNESS] + margin
    most = float(0.0)
    for k in range(thread, t.near_blocks[0], threads):
        pair = t.near_blocks[1 + k]
        a = window(t.bounds, 6 * (pair >> 16), 6)
        b = window(t.bounds, 6 * (pair & 0xFFFF), 6)
        gx = wp.max(a[0] - b[3], b[0] - a[3])
        gy = wp.max(a[1] - b[4], b[1] - a[4])
        gz = wp.max(a[2] - b[5], b[2] - a[5])
        spare = wp.max(wp.max(gx, wp.max(gy, gz)) - far, 0.0)
        a = window(a, place, 6)
        b = window(b, place, 6)
        dx = wp.max(a[3] - b[0], b[3] - a[0])
        dy = wp.max(a[4] - b[1], b[4] - a[1])
        dz = wp.max(a[5] - b[2], b[5] - a[2])
        most = wp.max(most, wp.sqrt(dx * dx + dy * dy + dz * dz) - spare)
    return most


@wp.func
def meet(t: StateFloat, far: float, m: int, thread: int, threads: int):
    """List the pairs of blocks whose boxes are nearer than ``far``, each pair once."""
    for a in range(thread / WARP, m, threads / WARP):
        own = window(t.bounds, 6 * a, 6)
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
                b = begin + WARP * j + thread % WARP
                if b < m:
                    other = window(t.bounds, 6 * b, 6)
                    gx = wp.min(other[3] - lx, hx - other[0])
                    gy = wp.min(other[4] - ly, hy - other[1])
                    gz = wp.min(other[5] - lz, hz - other[2])
                    if wp.min(gx, wp.min(gy, gz)) > 0.0:
                        bits = bits | (1 << j)
                        count += 1
            place = claim(t.touch_count, 0, count)
            while bits != 0:
                if place + 1 < t.near_blocks.shape[0]:
                    t.near_blocks[1 + place] = (a << 16) | (begin + WARP * lowest(bits) + thread % WARP)
                place += 1
                bits = bits & (bits - 1)


@wp.func
def list_blocks(t: StateFloat, topo: Topology, margin: float, thread: int, threads: int):
    """List the blocks that may come near: within the widest margin that there is room for."""
    width = float(WIDE * margin)
    count = int(-1)
    room = t.near_blocks.shape[0] - 1
    while count < 0:
        barrier(threads)
        if thread == 0:
            t.touch_count[0] = 0
        barrier(threads)
        # the last percent is for rounding, as in the list of elements
        meet(t, t.scalars[THICKNESS] + 1.01 * width, topo.blocks, thread, threads)
        barrier(threads)
        count = t.touch_count[0]
        if count > room and width > margin:
            width = wp.max(0.5 * width, margin)
            count = -1
    if thread == 0:
        t.near_blocks[0] = wp.min(count, room)
        if count > room:
            t.pair_count[MANY_BLOCKS] = wp.max(t.pair_count[MANY_BLOCKS], count)
        t.listed[3 * topo.particles + GONE] = 0.0
        t.listed[3 * topo.particles + WIDTH] = width
    barrier(threads)
