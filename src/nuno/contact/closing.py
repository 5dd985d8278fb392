"""How long a list of pairs is good: how far points of a cloth came closer to each other, by the threads of a device.

A list holds until two points that were near may have moved towards each other by the margin. What hangs from a hand and
what lies on the table move far, but are not near each other: so it is asked for each two blocks, and first for groups
of blocks and regions of groups, for most of those are so far apart that nothing more need be known of them. Boxes of
where the vertices were when pairs were listed, and boxes of what they moved since, lie behind one another in
`State.bounds`: of all blocks, of all groups, of all regions, and then the same of what they moved.
"""

import warp as wp

from nuno.contact.nearness import GROUP
from nuno.solver.state import StateFloat, Topology
from nuno.solver.warps import WARP, in_warps, lowest, vote

REGION = 64
"""Consecutive blocks whose boxes are first looked at together, in groups of `GROUP`."""


def boxes(blocks: int) -> int:
    """Boxes of so many blocks, of their groups and their regions."""
    return blocks + -(-blocks // GROUP) + -(-blocks // REGION)


@wp.func
def group_count(m: int):
    """Groups of m blocks."""
    return (m + GROUP - 1) / GROUP


@wp.func
def region_count(m: int):
    """Regions of m blocks."""
    return (m + REGION - 1) / REGION


@wp.func
def moves_start(m: int):
    """Where the boxes of what m blocks moved begin in `State.bounds`."""
    return 6 * (m + group_count(m) + region_count(m))


@wp.func
def box_moves(t: StateFloat, topo: Topology, thread: int, threads: int):
    """The boxes of what each block's vertices moved since pairs were listed."""
    n = topo.particles
    place = moves_start(topo.blocks)
    for b in range(thread, topo.blocks, threads):
        lo = wp.vec3(1.0e30, 1.0e30, 1.0e30)
        hi = -lo
        stop = topo.block_corner_start[b + 1]
        for k in range(topo.block_corner_start[b], stop, 4):
            for j in range(4):  # which Warp unrolls: four wait for memory together
                i = topo.block_corner[wp.min(k + j, stop - 1)]
                d = wp.vec3(t.x[i] - t.listed[i], t.y[i] - t.listed[n + i], t.z[i] - t.listed[2 * n + i])
                lo = wp.min(lo, d)
                hi = wp.max(hi, d)
        for c in range(3):
            t.bounds[place + 6 * b + c] = lo[c]
            t.bounds[place + 6 * b + 3 + c] = hi[c]


@wp.func
def join_boxes(t: StateFloat, topo: Topology, place: int, thread: int, threads: int):
    """The boxes of groups and regions, of those of the blocks from ``place`` on: a thread takes one side of a box."""
    m = topo.blocks
    groups = group_count(m)
    for k in range(thread, 6 * (groups + region_count(m)), threads):
        box = k / 6
        side = k % 6
        count = int(GROUP)
        first = box * GROUP
        if box >= groups:
            count = REGION
            first = (box - groups) * REGION
        # the largest of what is counted upwards on the upper sides and downwards on the lower ones
        sign = wp.where(side < 3, -1.0, 1.0)
        v = float(-1.0e30)
        last = wp.min(first + count, m) - 1
        for b in range(first, last + 1, GROUP):
            for j in range(GROUP):  # which Warp unrolls: all wait for memory together
                v = wp.max(v, sign * t.bounds[place + 6 * wp.min(b + j, last) + side])
        t.bounds[place + 6 * m + k] = sign * v


@wp.func
def used_up(t: StateFloat, a: int, b: int, place: int, far: float):
    """How much of the margin is used up at most by points of boxes a and b, which had what is between them and far."""
    i = 6 * a
    j = 6 * b
    gx = wp.max(t.bounds[i] - t.bounds[j + 3], t.bounds[j] - t.bounds[i + 3])
    gy = wp.max(t.bounds[i + 1] - t.bounds[j + 4], t.bounds[j + 1] - t.bounds[i + 4])
    gz = wp.max(t.bounds[i + 2] - t.bounds[j + 5], t.bounds[j + 2] - t.bounds[i + 5])
    spare = wp.max(wp.max(gx, wp.max(gy, gz)) - far, 0.0)
    i += place
    j += place
    dx = wp.max(t.bounds[i + 3] - t.bounds[j], t.bounds[j + 3] - t.bounds[i])
    dy = wp.max(t.bounds[i + 4] - t.bounds[j + 1], t.bounds[j + 4] - t.bounds[i + 1])
    dz = wp.max(t.bounds[i + 5] - t.bounds[j + 2], t.bounds[j + 5] - t.bounds[i + 2])
    return wp.sqrt(dx * dx + dy * dy + dz * dz) - spare


@wp.func
def most_used_up(t: StateFloat, topo: Topology, far: float, left: float, thread: int, threads: int):
    """How much of the margin is used up at most [m] by what is this thread's share; all threads of a warp come here.

    Two regions that used up no more than is ``left`` are not looked into, nor are two groups.
    """
    m = topo.blocks
    groups = group_count(m)
    regions = region_count(m)
    place = moves_start(m)
    lanes = int(1)
    if in_warps(threads):
        lanes = WARP
    lane = thread % lanes
    warps = threads / lanes
    per = REGION / GROUP
    most = float(0.0)
    for start in range(thread / lanes, regions * regions, threads):
        # neighbours, which are looked into, fall to different warps
        k = start + lane * warps
        worst = float(0.0)
        if k < regions * regions and k / regions <= k % regions:
            worst = used_up(t, m + groups + k / regions, m + groups + k % regions, place, far)
        doubtful = vote(worst > left)
        if worst <= left:
            most = wp.max(most, worst)
        while doubtful != 0:
            # the lanes look together at the groups of one pair of regions after the other
            pair = start + lowest(doubtful) * warps
            doubtful = doubtful & (doubtful - 1)
            for begin in range(0, per * per, lanes):
                q = begin + lane
                g = pair / regions * per + q / per
                h = pair % regions * per + q % per
                worst = float(0.0)
                if g < groups and h < groups and g <= h:
                    worst = used_up(t, m + g, m + h, place, far)
                inner = vote(worst > left)
                if worst <= left:
                    most = wp.max(most, worst)
                while inner != 0:
                    r = begin + lowest(inner)
                    inner = inner & (inner - 1)
                    g = pair / regions * per + r / per
                    h = pair % regions * per + r % per
                    for p in range(lane, GROUP * GROUP, lanes):
                        a = g * GROUP + p / GROUP
                        b = h * GROUP + p % GROUP
                        if a < m and b < m:
                            most = wp.max(most, used_up(t, a, b, place, far))
    return most
