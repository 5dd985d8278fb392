"""The listing of self-contact pairs by the many threads of a CUDA block.

They list in three rounds, each evenly dealt out: the pairs of blocks that meet, the pairs of elements whose spheres
meet, and those that are near. The first two rounds' lists stand in the room of the picked pairs, which are picked anew
once the list is made. What does not fit there is dealt with on the spot, so that nothing is lost. Sixteen worlds in
lanes have one thread and no rounds.
"""

import warp as wp

from nuno.contact.nearness import append, near_edges, near_triangle
from nuno.solver.lanes import (  # noqa: F401 (add, mul, sub: Warp takes them for the operators)
    add,
    lane,
    mul,
    sub,
)
from nuno.solver.state import StateFloat, StateLanes, Topology

VERTEX_SHARES = 4
"""Threads among which the vertices of a block are dealt out, where many threads list pairs."""
EDGE_SHARES = 8
"""Threads among which the edges of a block are dealt out."""


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
