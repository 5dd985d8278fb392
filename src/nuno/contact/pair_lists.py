"""Which vertices and triangles, and which edges, of a cloth may touch: candidate lists, and how long they are good.

A list holds all pairs nearer than the thickness and a margin, and stays valid until two points of the cloth may have
moved towards each other by the margin. Its order is that of the blocks, whatever else is in it: pairs that do not
touch change nothing, so results do not depend on when a list was made, with what margin, or together with which
other worlds.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import (  # noqa: F401 (add, mul, sub: Warp takes them for the operators)
    add,
    anywhere,
    barrier,
    choose,
    fill,
    gather,
    highest,
    lane,
    lane_int,
    least,
    most,
    mul,
    over,
    root,
    size_of,
    sub,
    times,
    within,
)
from nuno.solver.state import (
    LISTINGS,
    PICK_REACH,
    PICKED,
    SPEED,
    THICKNESS,
    TRAVEL,
    Settings,
    StateFloat,
    StateLanes,
    Topology,
)

GROUP = 8
"""Consecutive blocks that are passed over together where their common box is far."""
PICK_AHEAD = wp.constant(1.5)
"""Substeps for which the pairs that may touch are picked, at the speed of the moment."""
FORGET = wp.constant(1.0e8)
"""[m] A travel beyond this says that there is no list."""
VERTEX_SHARES = 4
"""Threads among which the vertices of a block are dealt out, where many threads list pairs."""
EDGE_SHARES = 8
"""Threads among which the edges of a block are dealt out."""


@wp.func
def append(
    hit: float, count: wp.array(dtype=int), which: int, pairs: wp.array(dtype=int), a: int, b: int, c: int, d: int
):
    """Add a candidate to the list where ``hit`` is positive; what does not fit is counted but not kept."""
    if hit > 0.0:
        k = wp.atomic_add(count, which, 1)
        if 4 * k + 3 < pairs.shape[0]:
            pairs[4 * k] = a
            pairs[4 * k + 1] = b
            pairs[4 * k + 2] = c
            pairs[4 * k + 3] = d


@wp.func_native("""
unsigned mask = 0;
for (int l = 0; l < 16; ++l) mask |= unsigned(hit[l] > 0.f) << l;
while (mask) {
    int l = __builtin_ctz(mask);
    mask &= mask - 1;
    int k = count.data[which][l]++;
    if (4 * k + 3 < pairs.shape[0]) {
        pairs.data[4 * k][l] = a;
        pairs.data[4 * k + 1][l] = b;
        pairs.data[4 * k + 2][l] = c;
        pairs.data[4 * k + 3][l] = d;
    }
}
""")
def append(
    hit: lane,
    count: wp.array(dtype=lane_int),
    which: int,
    pairs: wp.array(dtype=lane_int),
    a: int,
    b: int,
    c: int,
    d: int,
): ...


@wp.func_native("""
for (int l = 0; l < 16; ++l) {
    if (hit[l] > 0.f) {
        int k = count.data[which][l]++;
        pairs.data[4 * k][l] = a[l];
        pairs.data[4 * k + 1][l] = b[l];
        pairs.data[4 * k + 2][l] = c[l];
        pairs.data[4 * k + 3][l] = d[l];
    }
}
""")
def append(
    hit: lane,
    count: wp.array(dtype=lane_int),
    which: int,
    pairs: wp.array(dtype=lane_int),
    a: lane_int,
    b: lane_int,
    c: lane_int,
    d: lane_int,
): ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
if (threads % 32 == 0)
    for (int k = 16; k > 0; k /= 2) value = fmaxf(value, __shfl_xor_sync(0xffffffffu, value, k));
#endif
return value;
""")
def most_of_warp(value: float, threads: int) -> float:
    """The largest value of the 32 threads that run together, all of which must come here."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return threads % 32 != 0 || thread % 32 == 0;
#else
return true;
#endif
""")
def leads_warp(thread: int, threads: int) -> bool:
    """Whether the thread speaks for those that `most_of_warp` has looked at."""
    ...


@wp.func
def raise_to(values: wp.array(dtype=float), k: int, value: float, thread: int, threads: int):
    """Element k becomes the largest ``value`` of all threads where that is larger."""
    if threads > 1:
        # an atomic for each thread would have all of them queue up
        high = most_of_warp(value, threads)
        if leads_warp(thread, threads):
            wp.atomic_max(values, k, high)
    else:
        values[k] = most(values[k], value)


@wp.func
def raise_to(values: wp.array(dtype=Any), k: int, value: Any, thread: int, threads: int):
    values[k] = most(values[k], value)


@wp.func
def measure_span(t: Any, n: int, thread: int, threads: int):
    """The box, around the origin, of all displacements since the list was made: largest, and largest negative."""
    hx = fill(t.x[0], -1.0e30)
    hy = hx
    hz = hx
    lx = hx
    ly = hx
    lz = hx
    for i in range(thread, n, threads):
        dx = t.x[i] - t.listed[i]
        dy = t.y[i] - t.listed[n + i]
        dz = t.z[i] - t.listed[2 * n + i]
        hx = most(hx, dx)
        hy = most(hy, dy)
        hz = most(hz, dz)
        lx = most(lx, -dx)
        ly = most(ly, -dy)
        lz = most(lz, -dz)
    raise_to(t.listed, 3 * n, hx, thread, threads)
    raise_to(t.listed, 3 * n + 1, hy, thread, threads)
    raise_to(t.listed, 3 * n + 2, hz, thread, threads)
    raise_to(t.listed, 3 * n + 3, lx, thread, threads)
    raise_to(t.listed, 3 * n + 4, ly, thread, threads)
    raise_to(t.listed, 3 * n + 5, lz, thread, threads)


@wp.func
def middles(t: Any, topo: Topology, thread: int, threads: int):
    """Centre and radius of each triangle and each edge."""
    third = 1.0 / 3.0
    m = topo.block_face.shape[0]
    for j in range(thread, m, threads):
        f = topo.block_face[j]
        mx = (t.x[f[0]] + t.x[f[1]] + t.x[f[2]]) * third
        my = (t.y[f[0]] + t.y[f[1]] + t.y[f[2]]) * third
        mz = (t.z[f[0]] + t.z[f[1]] + t.z[f[2]]) * third
        r = fill(mx, 0.0)
        for k in range(3):
            i = f[k]
            dx = t.x[i] - mx
            dy = t.y[i] - my
            dz = t.z[i] - mz
            r = most(r, times(dx, dx) + times(dy, dy) + times(dz, dz))
        t.middle[4 * j] = mx
        t.middle[4 * j + 1] = my
        t.middle[4 * j + 2] = mz
        t.middle[4 * j + 3] = root(r)
    for j in range(thread, topo.block_edge.shape[0], threads):
        e = topo.block_edge[j]
        dx = (t.x[e[1]] - t.x[e[0]]) * 0.5
        dy = (t.y[e[1]] - t.y[e[0]]) * 0.5
        dz = (t.z[e[1]] - t.z[e[0]]) * 0.5
        k = 4 * (m + j)
        t.middle[k] = t.x[e[0]] + dx
        t.middle[k + 1] = t.y[e[0]] + dy
        t.middle[k + 2] = t.z[e[0]] + dz
        t.middle[k + 3] = root(times(dx, dx) + times(dy, dy) + times(dz, dz))


@wp.func
def bound_blocks(t: Any, topo: Topology, thread: int, threads: int):
    """Bounding boxes of the blocks' vertices and elements: the lower corner, and the upper one."""
    for b in range(thread, topo.blocks, threads):
        first = topo.block_corner[topo.block_corner_start[b]]
        lx = t.x[first]
        ly = t.y[first]
        lz = t.z[first]
        hx = lx
        hy = ly
        hz = lz
        for k in range(topo.block_corner_start[b] + 1, topo.block_corner_start[b + 1]):
            i = topo.block_corner[k]
            lx = least(lx, t.x[i])
            ly = least(ly, t.y[i])
            lz = least(lz, t.z[i])
            hx = most(hx, t.x[i])
            hy = most(hy, t.y[i])
            hz = most(hz, t.z[i])
        t.bounds[6 * b] = lx
        t.bounds[6 * b + 1] = ly
        t.bounds[6 * b + 2] = lz
        t.bounds[6 * b + 3] = hx
        t.bounds[6 * b + 4] = hy
        t.bounds[6 * b + 5] = hz


@wp.func
def bound_groups(t: Any, topo: Topology, thread: int, threads: int):
    """Bounding boxes of groups of consecutive blocks."""
    m = topo.blocks
    for g in range(thread, (m + GROUP - 1) / GROUP, threads):
        k = 6 * (m + g)
        for c in range(6):
            v = t.bounds[6 * GROUP * g + c]
            for b in range(GROUP * g + 1, wp.min(GROUP * g + GROUP, m)):
                if c < 3:
                    v = least(v, t.bounds[6 * b + c])
                else:
                    v = most(v, t.bounds[6 * b + c])
            t.bounds[k + c] = v


@wp.func
def closest_on_edges(rx: Any, ry: Any, rz: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any):
    """Parameters in [0, 1] of the closest points of two edges with directions a and b, r from b's start to a's."""
    zero = fill(rx, 0.0)
    one = fill(rx, 1.0)
    tiny = fill(rx, 1.0e-16)
    aa = times(ax, ax) + times(ay, ay) + times(az, az) + tiny
    bb = times(bx, bx) + times(by, by) + times(bz, bz) + tiny
    ab = times(ax, bx) + times(ay, by) + times(az, bz)
    ar = times(ax, rx) + times(ay, ry) + times(az, rz)
    br = times(bx, rx) + times(by, ry) + times(bz, rz)
    det = times(aa, bb) - times(ab, ab)
    s = over(times(ab, br) - times(ar, bb), most(det, times(aa, bb) * 1.0e-6))
    s = least(most(s, zero), one)
    q = least(most(over(times(ab, s) + br, bb), zero), one)
    s = least(most(over(times(ab, q) - ar, aa), zero), one)
    return s, q


@wp.func
def near_triangle(t: Any, i: Any, f0: Any, f1: Any, f2: Any, far2: Any):
    """Positive where vertex i may be nearer to a triangle than the root of ``far2``.

    Height over the plane and the excess over the worst of the three edge lines bound the distance from below.
    """
    ax = gather(t.x, f1) - gather(t.x, f0)
    ay = gather(t.y, f1) - gather(t.y, f0)
    az = gather(t.z, f1) - gather(t.z, f0)
    bx = gather(t.x, f2) - gather(t.x, f0)
    by = gather(t.y, f2) - gather(t.y, f0)
    bz = gather(t.z, f2) - gather(t.z, f0)
    dx = gather(t.x, i) - gather(t.x, f0)
    dy = gather(t.y, i) - gather(t.y, f0)
    dz = gather(t.z, i) - gather(t.z, f0)
    cx = bx - ax
    cy = by - ay
    cz = bz - az
    nx = times(ay, bz) - times(az, by)
    ny = times(az, bx) - times(ax, bz)
    nz = times(ax, by) - times(ay, bx)
    h = times(dx, nx) + times(dy, ny) + times(dz, nz)
    nn = times(nx, nx) + times(ny, ny) + times(nz, nz)
    v = times(times(dy, bz) - times(dz, by), nx)
    v = v + times(times(dz, bx) - times(dx, bz), ny)
    v = v + times(times(dx, by) - times(dy, bx), nz)
    w = times(times(ay, dz) - times(az, dy), nx)
    w = w + times(times(az, dx) - times(ax, dz), ny)
    w = w + times(times(ax, dy) - times(ay, dx), nz)
    outside = least(least(nn - v - w, fill(h, 0.0)), least(v, w))
    aa = times(ax, ax) + times(ay, ay) + times(az, az)
    bb = times(bx, bx) + times(by, by) + times(bz, bz)
    cc = times(cx, cx) + times(cy, cy) + times(cz, cz)
    longest = most(aa, most(bb, cc))
    return times(longest, times(far2, nn) - times(h, h)) - times(outside, outside)


@wp.func
def near_edges(t: Any, e0: Any, e1: Any, f0: Any, f1: Any, far2: Any):
    """Positive where two edges are nearer to each other than the root of ``far2``."""
    rx = gather(t.x, e0) - gather(t.x, f0)
    ry = gather(t.y, e0) - gather(t.y, f0)
    rz = gather(t.z, e0) - gather(t.z, f0)
    ax = gather(t.x, e1) - gather(t.x, e0)
    ay = gather(t.y, e1) - gather(t.y, e0)
    az = gather(t.z, e1) - gather(t.z, e0)
    bx = gather(t.x, f1) - gather(t.x, f0)
    by = gather(t.y, f1) - gather(t.y, f0)
    bz = gather(t.z, f1) - gather(t.z, f0)
    s, q = closest_on_edges(rx, ry, rz, ax, ay, az, bx, by, bz)
    cx = rx + times(s, ax) - times(q, bx)
    cy = ry + times(s, ay) - times(q, by)
    cz = rz + times(s, az) - times(q, bz)
    return far2 - times(cx, cx) - times(cy, cy) - times(cz, cz)


@wp.func
def find_vertex_triangle(t: Any, topo: Topology, a: int, b: int, far: Any, far2: Any):
    """Vertices of block a near triangles of block b."""
    lx = t.bounds[6 * b] - far
    ly = t.bounds[6 * b + 1] - far
    lz = t.bounds[6 * b + 2] - far
    hx = t.bounds[6 * b + 3] + far
    hy = t.bounds[6 * b + 4] + far
    hz = t.bounds[6 * b + 5] + far
    first = topo.block_face_start[b]
    last = topo.block_face_start[b + 1]
    for k in range(topo.block_vertex_start[a], topo.block_vertex_start[a + 1]):
        i = topo.block_vertex[k]
        x = t.x[i]
        y = t.y[i]
        z = t.z[i]
        if anywhere(least(least(x - lx, hx - x), least(least(y - ly, hy - y), least(z - lz, hz - z)))):
            for j in range(first, last):
                dx = x - t.middle[4 * j]
                dy = y - t.middle[4 * j + 1]
                dz = z - t.middle[4 * j + 2]
                reach = far + t.middle[4 * j + 3]
                if anywhere(times(reach, reach) - times(dx, dx) - times(dy, dy) - times(dz, dz)):
                    f = topo.block_face[j]
                    if i != f[0] and i != f[1] and i != f[2]:
                        hit = near_triangle(t, i, f[0], f[1], f[2], far2)
                        append(hit, t.pair_count, 0, t.vertex_triangle, i, f[0], f[1], f[2])


@wp.func
def find_edge_edge(t: Any, topo: Topology, a: int, b: int, far: Any, far2: Any):
    """Edges of block a near edges of block b, each pair once where both are the same block."""
    lx = t.bounds[6 * b] - far
    ly = t.bounds[6 * b + 1] - far
    lz = t.bounds[6 * b + 2] - far
    hx = t.bounds[6 * b + 3] + far
    hy = t.bounds[6 * b + 4] + far
    hz = t.bounds[6 * b + 5] + far
    offset = topo.block_face.shape[0]
    last = topo.block_edge_start[b + 1]
    for j in range(topo.block_edge_start[a], topo.block_edge_start[a + 1]):
        m = 4 * (offset + j)
        x = t.middle[m]
        y = t.middle[m + 1]
        z = t.middle[m + 2]
        r = t.middle[m + 3]
        inside = least(least(x - lx, hx - x), least(least(y - ly, hy - y), least(z - lz, hz - z)))
        if anywhere(inside + r):
            e = topo.block_edge[j]
            r = r + far
            first = topo.block_edge_start[b]
            if a == b:
                first = j + 1
            for k in range(first, last):
                m = 4 * (offset + k)
                dx = x - t.middle[m]
                dy = y - t.middle[m + 1]
                dz = z - t.middle[m + 2]
                reach = r + t.middle[m + 3]
                if anywhere(times(reach, reach) - times(dx, dx) - times(dy, dy) - times(dz, dz)):
                    f = topo.block_edge[k]
                    if e[0] != f[0] and e[0] != f[1] and e[1] != f[0] and e[1] != f[1]:
                        hit = near_edges(t, e[0], e[1], f[0], f[1], far2)
                        append(hit, t.pair_count, 1, t.edge_edge, e[0], e[1], f[0], f[1])


@wp.func
def find_creases(t: Any, topo: Topology, far2: Any, thread: int, threads: int):
    """The further pairs of edges that are near each other."""
    for k in range(thread, topo.crease.shape[0], threads):
        q = topo.crease[k]
        hit = near_edges(t, q[0], q[1], q[2], q[3], far2)
        append(hit, t.pair_count, 1, t.edge_edge, q[0], q[1], q[2], q[3])


# Many threads list in three rounds, each evenly dealt out: the pairs of blocks that meet, the pairs of elements whose
# spheres meet, and those that are near. The first two rounds' lists stand in the room of the picked pairs, which are
# picked anew once the list is made. What does not fit there is dealt with on the spot, so that nothing is lost.


@wp.func
def put_off(t: StateFloat, a: int, b: int, threads: int):
    """Note two blocks that meet for the next round; 0 where they are to be looked at right away."""
    if threads > 1:
        k = wp.atomic_add(t.touch_count, 0, 1)
        if 2 * k + 1 < t.touch_triangle.shape[0]:
            t.touch_triangle[2 * k] = a
            t.touch_triangle[2 * k + 1] = b
            return 1
    return 0


@wp.func
def put_off(t: StateLanes, a: int, b: int, threads: int):
    return 0


@wp.func
def examine_pair(t: StateFloat, topo: Topology, u: int, v: int, far2: float):
    """List a suspect if it is near: vertex u and triangle v, or edges -1 - u and v."""
    if u >= 0:
        f = topo.block_face[v]
        hit = near_triangle(t, u, f[0], f[1], f[2], far2)
        append(hit, t.pair_count, 0, t.vertex_triangle, u, f[0], f[1], f[2])
    else:
        e = topo.block_edge[-1 - u]
        g = topo.block_edge[v]
        near = near_edges(t, e[0], e[1], g[0], g[1], far2)
        append(near, t.pair_count, 1, t.edge_edge, e[0], e[1], g[0], g[1])


@wp.func
def suspect(t: StateFloat, topo: Topology, u: int, first: int, bits: int, count: int, far2: float):
    """Note the suspects u and ``first`` plus the places of the set ``bits``, ``count`` of them."""
    if count > 0:
        # one atomic for all, for each takes its time to answer
        k = wp.atomic_add(t.touch_count, 1, count)
        left = bits
        v = first
        while left != 0:
            if left & 1 != 0:
                if 2 * k + 1 < t.touch_edge.shape[0]:
                    t.touch_edge[2 * k] = u
                    t.touch_edge[2 * k + 1] = v
                else:
                    examine_pair(t, topo, u, v, far2)
                k += 1
            left = left >> 1
            v += 1


@wp.func
def suspect_vertices(t: StateFloat, topo: Topology, far: float, far2: float, thread: int, threads: int):
    """Vertices and triangles of the blocks that meet whose spheres do; a thread takes a vertex or few."""
    pairs = wp.min(t.touch_count[0], t.touch_triangle.shape[0] / 2)
    for item in range(thread, 2 * VERTEX_SHARES * pairs, threads):
        p = item / (2 * VERTEX_SHARES)
        share = item % (2 * VERTEX_SHARES)
        a = t.touch_triangle[2 * p]
        b = t.touch_triangle[2 * p + 1]
        start = topo.block_vertex_start[a] + share
        stop = topo.block_vertex_start[a + 1]
        if share >= VERTEX_SHARES:
            start = topo.block_vertex_start[b] + share - VERTEX_SHARES
            stop = topo.block_vertex_start[b + 1]
            if a == b:
                stop = start
            b = a
        for k in range(start, stop, VERTEX_SHARES):
            i = topo.block_vertex[k]
            x = t.x[i]
            y = t.y[i]
            z = t.z[i]
            gx = wp.min(x - t.bounds[6 * b], t.bounds[6 * b + 3] - x)
            gy = wp.min(y - t.bounds[6 * b + 1], t.bounds[6 * b + 4] - y)
            gz = wp.min(z - t.bounds[6 * b + 2], t.bounds[6 * b + 5] - z)
            if wp.min(gx, wp.min(gy, gz)) + far > 0.0:
                last = topo.block_face_start[b + 1]
                for first in range(topo.block_face_start[b], last, 30):
                    bits = int(0)
                    count = int(0)
                    for j in range(first, wp.min(first + 30, last)):
                        dx = x - t.middle[4 * j]
                        dy = y - t.middle[4 * j + 1]
                        dz = z - t.middle[4 * j + 2]
                        reach = far + t.middle[4 * j + 3]
                        f = topo.block_face[j]
                        if reach * reach - dx * dx - dy * dy - dz * dz > 0.0:
                            if i != f[0] and i != f[1] and i != f[2]:
                                bits = bits | (1 << (j - first))
                                count += 1
                    suspect(t, topo, i, first, bits, count, far2)


@wp.func
def suspect_edges(t: StateFloat, topo: Topology, far: float, far2: float, thread: int, threads: int):
    """Edges of the blocks that meet whose spheres do; a thread takes an edge or few."""
    pairs = wp.min(t.touch_count[0], t.touch_triangle.shape[0] / 2)
    offset = topo.block_face.shape[0]
    for item in range(thread, EDGE_SHARES * pairs, threads):
        p = item / EDGE_SHARES
        a = t.touch_triangle[2 * p]
        b = t.touch_triangle[2 * p + 1]
        last = topo.block_edge_start[b + 1]
        for j in range(topo.block_edge_start[a] + item % EDGE_SHARES, topo.block_edge_start[a + 1], EDGE_SHARES):
            m = 4 * (offset + j)
            x = t.middle[m]
            y = t.middle[m + 1]
            z = t.middle[m + 2]
            r = t.middle[m + 3] + far
            gx = wp.min(x - t.bounds[6 * b], t.bounds[6 * b + 3] - x)
            gy = wp.min(y - t.bounds[6 * b + 1], t.bounds[6 * b + 4] - y)
            gz = wp.min(z - t.bounds[6 * b + 2], t.bounds[6 * b + 5] - z)
            if wp.min(gx, wp.min(gy, gz)) + r > 0.0:
                e = topo.block_edge[j]
                begin = topo.block_edge_start[b]
                if a == b:
                    begin = j + 1
                for first in range(begin, last, 30):
                    bits = int(0)
                    count = int(0)
                    for k in range(first, wp.min(first + 30, last)):
                        q = 4 * (offset + k)
                        dx = x - t.middle[q]
                        dy = y - t.middle[q + 1]
                        dz = z - t.middle[q + 2]
                        reach = r + t.middle[q + 3]
                        f = topo.block_edge[k]
                        if reach * reach - dx * dx - dy * dy - dz * dz > 0.0:
                            if e[0] != f[0] and e[0] != f[1] and e[1] != f[0] and e[1] != f[1]:
                                bits = bits | (1 << (k - first))
                                count += 1
                    suspect(t, topo, -1 - j, first, bits, count, far2)


@wp.func
def examine(t: StateFloat, topo: Topology, far2: float, thread: int, threads: int):
    """List those suspects that are near."""
    for k in range(thread, wp.min(t.touch_count[1], t.touch_edge.shape[0] / 2), threads):
        examine_pair(t, topo, t.touch_edge[2 * k], t.touch_edge[2 * k + 1], far2)


@wp.func
def suspect_vertices(t: StateLanes, topo: Topology, far: lane, far2: lane, thread: int, threads: int):
    pass


@wp.func
def suspect_edges(t: StateLanes, topo: Topology, far: lane, far2: lane, thread: int, threads: int):
    pass


@wp.func
def examine(t: StateLanes, topo: Topology, far2: lane, thread: int, threads: int):
    pass


@wp.func
def find_pairs(t: Any, topo: Topology, margin: float, thread: int, threads: int):
    """List all pairs that share no vertex and are nearer than the thickness and the margin."""
    m = topo.blocks
    # the last percent is for rounding, in here and in the displacements
    far = t.scalars[THICKNESS] + fill(t.x[0], 1.01 * margin)
    far2 = times(far, far)
    for a in range(thread, m, threads):
        lx = t.bounds[6 * a] - far
        ly = t.bounds[6 * a + 1] - far
        lz = t.bounds[6 * a + 2] - far
        hx = t.bounds[6 * a + 3] + far
        hy = t.bounds[6 * a + 4] + far
        hz = t.bounds[6 * a + 5] + far
        for g in range(a / GROUP, (m + GROUP - 1) / GROUP):
            k = 6 * (m + g)
            gx = least(t.bounds[k + 3] - lx, hx - t.bounds[k])
            gy = least(t.bounds[k + 4] - ly, hy - t.bounds[k + 1])
            gz = least(t.bounds[k + 5] - lz, hz - t.bounds[k + 2])
            if anywhere(least(gx, least(gy, gz))):
                for b in range(wp.max(a, GROUP * g), wp.min(GROUP * g + GROUP, m)):
                    k = 6 * b
                    gx = least(t.bounds[k + 3] - lx, hx - t.bounds[k])
                    gy = least(t.bounds[k + 4] - ly, hy - t.bounds[k + 1])
                    gz = least(t.bounds[k + 5] - lz, hz - t.bounds[k + 2])
                    if anywhere(least(gx, least(gy, gz))):
                        if put_off(t, a, b, threads) == 0:
                            find_vertex_triangle(t, topo, a, b, far, far2)
                            if a != b:
                                find_vertex_triangle(t, topo, b, a, far, far2)
                            find_edge_edge(t, topo, a, b, far, far2)
    find_creases(t, topo, far2, thread, threads)
    if threads > 1:
        barrier(threads)
        suspect_vertices(t, topo, far, far2, thread, threads)
        suspect_edges(t, topo, far, far2, thread, threads)
        barrier(threads)
        examine(t, topo, far2, thread, threads)


@wp.func
def swept(t: Any, run: Settings):
    """How far beyond its thickness a pair is looked at [m], when a substep begins.

    Little, for a pair that comes in from farther away is found one substep later, unless it is so fast that it
    could be on the other side by then.
    """
    like = t.x[0]
    thickness = t.scalars[THICKNESS]
    go = root(t.notes[SPEED]) * (3.0 * run.dt) + fill(like, 10.0 * run.dt * run.dt)
    return least(most(go - thickness, thickness * 0.1), fill(like, run.reach))


@wp.func
def pick_touching(t: Any, run: Settings, fresh: int, thread: int, threads: int):
    """Pick the listed pairs that may touch within the next few substeps, each world as many as its speed asks for.

    Few of the listed pairs ever touch before the list is made anew, and solving looks at each in every substep.
    """
    like = t.x[0]
    near = swept(t, run)
    if fresh != 0 or anywhere(t.notes[PICKED] * 2.0 + near - t.notes[PICK_REACH]):
        ahead = near + root(t.notes[SPEED]) * (2.0 * PICK_AHEAD * run.dt) + fill(like, 0.1 * run.reach)
        barrier(threads)
        if thread == 0:
            t.touch_count[0] = t.touch_count[0] * 0
            t.touch_count[1] = t.touch_count[1] * 0
            t.notes[PICKED] = fill(like, 0.0)
            t.notes[PICK_REACH] = ahead
        barrier(threads)
        far = t.scalars[THICKNESS] + ahead * 1.01
        far2 = times(far, far)
        none = fill(like, -1.0)
        for k in range(thread, wp.min(highest(t.pair_count[0]), t.vertex_triangle.shape[0] / 4), threads):
            a = t.vertex_triangle[4 * k]
            b = t.vertex_triangle[4 * k + 1]
            c = t.vertex_triangle[4 * k + 2]
            d = t.vertex_triangle[4 * k + 3]
            hit = choose(within(like, k, t.pair_count[0]), near_triangle(t, a, b, c, d, far2), none)
            append(hit, t.touch_count, 0, t.touch_triangle, a, b, c, d)
        for k in range(thread, wp.min(highest(t.pair_count[1]), t.edge_edge.shape[0] / 4), threads):
            a = t.edge_edge[4 * k]
            b = t.edge_edge[4 * k + 1]
            c = t.edge_edge[4 * k + 2]
            d = t.edge_edge[4 * k + 3]
            hit = choose(within(like, k, t.pair_count[1]), near_edges(t, a, b, c, d, far2), none)
            append(hit, t.touch_count, 1, t.touch_edge, a, b, c, d)
        barrier(threads)


@wp.func
def find_contacts(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """List self-contact pairs anew where two points may have come closer by the margin since.

    Twice the sum of the largest speeds is a bound on that; where it is used up, the displacements are measured.
    """
    n = topo.particles
    fresh = int(0)
    left = fill(t.x[0], run.margin) - swept(t, run)
    if anywhere(t.notes[TRAVEL] * 2.0 - left):
        barrier(threads)
        if thread == 0:
            for k in range(6):
                t.listed[3 * n + k] = fill(left, -1.0e30)
        barrier(threads)
        measure_span(t, n, thread, threads)
        barrier(threads)
        dx = t.listed[3 * n] + t.listed[3 * n + 3]
        dy = t.listed[3 * n + 1] + t.listed[3 * n + 4]
        dz = t.listed[3 * n + 2] + t.listed[3 * n + 5]
        span = root(times(dx, dx) + times(dy, dy) + times(dz, dz))
        span = most(span, t.notes[TRAVEL] - fill(left, FORGET))
        barrier(threads)
        if anywhere(span - left):
            fresh = 1
            if thread == 0:
                t.pair_count[0] = t.pair_count[0] * 0
                t.pair_count[1] = t.pair_count[1] * 0
                t.touch_count[0] = t.touch_count[0] * 0
                t.touch_count[1] = t.touch_count[1] * 0
                t.notes[TRAVEL] = fill(left, 0.0)
                t.notes[LISTINGS] = t.notes[LISTINGS] + fill(left, 1.0)
            for i in range(thread, n, threads):
                t.listed[i] = t.x[i]
                t.listed[n + i] = t.y[i]
                t.listed[2 * n + i] = t.z[i]
            middles(t, topo, thread, threads)
            bound_blocks(t, topo, thread, threads)
            barrier(threads)
            bound_groups(t, topo, thread, threads)
            barrier(threads)
            find_pairs(t, topo, run.margin, thread, threads)
        else:
            if thread == 0:
                t.notes[TRAVEL] = span * 0.5
        barrier(threads)
    pick_touching(t, run, fresh, thread, threads)
