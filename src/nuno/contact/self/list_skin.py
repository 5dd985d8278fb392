"""The skin of a neighbour (Verlet) list: how far points of a cloth came closer, by the threads of a device.

A list holds until two points that were near may have moved towards each other by the margin. What hangs from a hand and
what lies on the table move far, but are not near each other: so it is asked for each two leaves, and first for groups
of leaves and regions of groups, for most of those are so far apart that nothing more need be known of them. Boxes of
where the vertices were when pairs were listed, and boxes of what they moved since, lie behind one another in
`State.bounds`: of all leaves, of all groups, of all regions, and then the same of what they moved.
"""

import warp as wp

from nuno.contact.self.narrow_phase import GROUP
from nuno.numbers.warps import WARP, in_warps, lowest, vote
from nuno.state.cloth_state import StateFloat, Topology

REGION = 64
"""Consecutive leaves whose boxes are first looked at together, in groups of `GROUP`."""


def boxes(leaves: int) -> int:
    """Boxes of so many leaves, of their groups and their regions."""
    return leaves + -(-leaves // GROUP) + -(-leaves // REGION)


@wp.func
def group_count(m: int):
    """Groups of m leaves."""
    return (m + GROUP - 1) / GROUP


@wp.func
def region_count(m: int):
    """Regions of m leaves."""
    return (m + REGION - 1) / REGION


@wp.func
def moves_start(m: int):
    """Return where the boxes of what m leaves moved begin in `State.bounds`."""
    return 6 * (m + group_count(m) + region_count(m))


@wp.func
def box_moves(t: StateFloat, topo: Topology, rank: int, size: int):
    """The boxes of what each leaf's vertices moved since pairs were listed."""
    n = topo.particles
    place = moves_start(topo.leaves)
    for b in range(rank, topo.leaves, size):
        lo = wp.vec3(1.0e30, 1.0e30, 1.0e30)
        hi = -lo
        stop = topo.leaf_corner_start[b + 1]
        for k in range(topo.leaf_corner_start[b], stop, 4):
            for j in range(4):  # which Warp unrolls: four wait for memory together
                i = topo.leaf_corner[wp.min(k + j, stop - 1)]
                d = wp.vec3(t.x[i] - t.reference[i], t.y[i] - t.reference[n + i], t.z[i] - t.reference[2 * n + i])
                lo = wp.min(lo, d)
                hi = wp.max(hi, d)
        for c in range(3):
            t.bounds[place + 6 * b + c] = lo[c]
            t.bounds[place + 6 * b + 3 + c] = hi[c]


@wp.func
def join_boxes(t: StateFloat, topo: Topology, place: int, rank: int, size: int):
    """The boxes of groups and regions, of those of the leaves from ``place`` on: a thread takes one side of a box."""
    m = topo.leaves
    groups = group_count(m)
    for k in range(rank, 6 * (groups + region_count(m)), size):
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
    """Return the margin used up at most by points of boxes a and b, which had what is between them and far."""
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
def max_used_up(t: StateFloat, topo: Topology, far: float, left: float, rank: int, size: int):
    """Return the margin used up at most [m] by this thread's share; all threads of a warp come here.

    Two regions that used up no more than is ``left`` are not looked into, nor are two groups.
    """
    m = topo.leaves
    groups = group_count(m)
    regions = region_count(m)
    place = moves_start(m)
    lanes = int(1)
    if in_warps(size):
        lanes = WARP
    lane = rank % lanes
    warps = size / lanes
    per = REGION / GROUP
    highest = float(0.0)
    for start in range(rank / lanes, regions * regions, size):
        # neighbours, which are looked into, fall to different warps
        k = start + lane * warps
        worst = float(0.0)
        if k < regions * regions and k / regions <= k % regions:
            worst = used_up(t, m + groups + k / regions, m + groups + k % regions, place, far)
        doubtful = vote(worst > left)
        if worst <= left:
            highest = wp.max(highest, worst)
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
                    highest = wp.max(highest, worst)
                while inner != 0:
                    r = begin + lowest(inner)
                    inner = inner & (inner - 1)
                    g = pair / regions * per + r / per
                    h = pair % regions * per + r % per
                    for p in range(lane, GROUP * GROUP, lanes):
                        a = g * GROUP + p / GROUP
                        b = h * GROUP + p % GROUP
                        if a < m and b < m:
                            highest = wp.max(highest, used_up(t, a, b, place, far))
    return highest
