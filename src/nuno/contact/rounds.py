"""The listing of self-contact pairs by the many threads of a CUDA block.

They list in two rounds: the pairs of elements whose spheres meet, and those that are near. In the first a warp's 32
threads look at a pair of blocks together: what they read lies side by side, nothing is read twice, and all pay for one
atomic. The first round's list stands in the room of the picked pairs, which are picked anew once the list is made;
where that is too small, the rounds take fewer blocks at a time.
"""

import warp as wp

from nuno.contact.flat_blocks import in_flat
from nuno.contact.nearness import append, near_edges, near_triangle
from nuno.solver.lanes import barrier
from nuno.solver.state import StateFloat, Topology
from nuno.solver.warps import WARP, claim, lowest, size_of_set, told, vote

COLUMNS = wp.constant(16)
"""Elements of one block that a warp looks at side by side, its two halves at different ones of the other block."""


@wp.func
def note(room: wp.array(dtype=int), k: int, bits: int, first: int, other: int):
    """Write the pairs of ``first`` + j, for the numbers j of the set ``bits``, with ``other`` from place k on."""
    place = int(k)
    left = int(bits)
    while left != 0:
        if 2 * place + 1 < room.shape[0]:
            room[2 * place] = first + lowest(left)
            room[2 * place + 1] = other
        place += 1
        left = left & (left - 1)
    return place


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const int lane = threadIdx.x % 32;
const int v = first + lane % 16;
const bool own = v < last;
const int k = own ? v : last - 1;
const float4 s = reinterpret_cast<const float4*>(middle.data)[k];
const int f0 = face.data[k][0], f1 = face.data[k][1], f2 = face.data[k][2];
const float reach = s.w + far;
int bits = 0;
for (int row = lane / 16; row < rows; row += 2) {
    const int i = vertex.data[begin + row];
    const float dx = x.data[i] - s.x, dy = y.data[i] - s.y, dz = z.data[i] - s.z;
    const bool near = own && dx * dx + dy * dy + dz * dz < reach * reach;
    if (near && i != f0 && i != f1 && i != f2) bits |= 1 << row;
}
return bits;
#else
return 0;
#endif
""")
def vertices_near(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    vertex: wp.array(dtype=int),
    begin: int,
    rows: int,
    middle: wp.array(dtype=float),
    face: wp.array(dtype=wp.vec3i),
    first: int,
    last: int,
    far: float,
) -> int:
    """Which of the vertices from ``begin`` on, 32 at most, the sphere of the thread's triangle reaches.

    The thread's is one of sixteen triangles from ``first`` on, and the vertices are every other one.
    """
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const int lane = threadIdx.x % 32;
const int v = first + lane % 16;
const bool own = v < last;
const int k = own ? v : last - 1;
const float4* spheres = reinterpret_cast<const float4*>(middle.data) + offset;
const float4 s = spheres[k];
const int g0 = edge.data[k][0], g1 = edge.data[k][1];
// few of the one block's edges reach the other's box
bool reaches = begin + lane < stop;
if (reaches) {
    const float4 r = spheres[begin + lane];
    const float* box = bounds.data + 6 * b;
    const float gx = fminf(r.x - box[0], box[3] - r.x);
    const float gy = fminf(r.y - box[1], box[4] - r.y);
    const float gz = fminf(r.z - box[2], box[5] - r.z);
    reaches = fminf(gx, fminf(gy, gz)) + r.w + far > 0.f;
}
unsigned left = __ballot_sync(0xffffffffu, reaches) & (lane < 16 ? 0x55555555u : 0xaaaaaaaau);
int bits = 0;
while (left != 0) {
    const int row = __ffs(left) - 1;
    left &= left - 1;
    const float4 r = spheres[begin + row];
    const float dx = r.x - s.x, dy = r.y - s.y, dz = r.z - s.z, reach = r.w + s.w + far;
    if (own && dx * dx + dy * dy + dz * dz < reach * reach) {
        const int e0 = edge.data[begin + row][0], e1 = edge.data[begin + row][1];
        if (e0 != g0 && e0 != g1 && e1 != g0 && e1 != g1) bits |= 1 << row;
    }
}
__syncwarp();
return bits;
#else
return 0;
#endif
""")
def edges_near(
    middle: wp.array(dtype=float),
    offset: int,
    bounds: wp.array(dtype=float),
    b: int,
    edge: wp.array(dtype=wp.vec2i),
    begin: int,
    stop: int,
    first: int,
    last: int,
    far: float,
) -> int:
    """Which of the edges from ``begin`` on, 32 at most, have spheres that meet that of the thread's edge.

    The thread's is one of sixteen edges of block b from ``first`` on, and the others are every other one.
    """
    ...


@wp.func
def suspect_of(t: StateFloat, topo: Topology, a: int, b: int, far: float, thread: int):
    """Note the elements of two blocks whose spheres meet: a warp's work.

    A suspect is two numbers: the place of a vertex in the blocks and that of a triangle, or the number of particles
    plus the place of an edge and that of another.
    """
    v = thread % COLUMNS
    offset = topo.block_face.shape[0]
    va = topo.block_vertex_start[a]
    vb = topo.block_vertex_start[b]
    na = topo.block_vertex_start[a + 1] - va
    nb = topo.block_vertex_start[b + 1] - vb
    ea = topo.block_edge_start[a]
    ea2 = topo.block_edge_start[a + 1]
    eb = topo.block_edge_start[b]
    eb2 = topo.block_edge_start[b + 1]
    fa = topo.block_face_start[a]
    fa2 = topo.block_face_start[a + 1]
    fb = topo.block_face_start[b]
    fb2 = topo.block_face_start[b + 1]
    for step in range(0, wp.max(eb2 - eb, wp.max(fa2 - fa, fb2 - fb)), COLUMNS):
        ab = int(0)
        ba = int(0)
        if fb + step < fb2:
            ab = vertices_near(t.x, t.y, t.z, topo.block_vertex, va, na, t.middle, topo.block_face, fb + step, fb2, far)
        if a != b and fa + step < fa2:
            ba = vertices_near(t.x, t.y, t.z, topo.block_vertex, vb, nb, t.middle, topo.block_face, fa + step, fa2, far)
        for begin in range(ea, wp.max(ea2, ea + 1), WARP):
            bits = int(0)
            if eb + step < eb2:
                bits = edges_near(t.middle, offset, t.bounds, b, topo.block_edge, begin, ea2, eb + step, eb2, far)
                if a == b:
                    # each pair once: those whose number is below that of the other
                    below = wp.max(eb + step + v - begin, 0)
                    if below < 32:
                        bits = bits & ((1 << below) - 1)
            k = claim(t.touch_count, 1, size_of_set(ab) + size_of_set(ba) + size_of_set(bits))
            k = note(t.touch_edge, k, ab, va, fb + step + v)
            k = note(t.touch_edge, k, ba, vb, fa + step + v)
            note(t.touch_edge, k, bits, topo.particles + begin, eb + step + v)
            ab = int(0)
            ba = int(0)


@wp.func
def suspect(t: StateFloat, topo: Topology, far: float, first: int, last: int, thread: int, threads: int):
    """Note the suspects of the listed pairs of blocks first to last, where boxes meet and the cloth is not flat."""
    for start in range(first + thread - thread % WARP, last, threads):
        k = start + thread % WARP
        pair = int(0)
        on = bool(False)
        if k < last:
            pair = t.near_blocks[1 + k]
            a = 6 * (pair >> 16)
            b = 6 * (pair & 0xFFFF)
            gx = wp.min(t.bounds[a + 3] - t.bounds[b], t.bounds[b + 3] - t.bounds[a])
            gy = wp.min(t.bounds[a + 4] - t.bounds[b + 1], t.bounds[b + 4] - t.bounds[a + 1])
            gz = wp.min(t.bounds[a + 5] - t.bounds[b + 2], t.bounds[b + 5] - t.bounds[a + 2])
            on = wp.min(gx, wp.min(gy, gz)) + far > 0.0
            if on:
                on = not in_flat(t, topo, pair >> 16, pair & 0xFFFF)
        left = vote(on)
        while left != 0:
            chosen = told(pair, lowest(left))
            suspect_of(t, topo, chosen >> 16, chosen & 0xFFFF, far, thread)
            left = left & (left - 1)


@wp.func
def examine(t: StateFloat, topo: Topology, far2: float, count: int, thread: int, threads: int):
    """List those suspects that are near."""
    for k in range(thread, count, threads):
        u = t.touch_edge[2 * k]
        v = t.touch_edge[2 * k + 1]
        if u < topo.particles:
            f = topo.block_face[v]
            i = topo.block_vertex[u]
            hit = near_triangle(t, i, f[0], f[1], f[2], far2)
            append(hit, t.pair_count, 0, t.vertex_triangle, i, f[0], f[1], f[2])
        else:
            e = topo.block_edge[u - topo.particles]
            g = topo.block_edge[v]
            near = near_edges(t, e[0], e[1], g[0], g[1], far2)
            append(near, t.pair_count, 1, t.edge_edge, e[0], e[1], g[0], g[1])


@wp.func
def find_in_rounds(t: StateFloat, topo: Topology, far: float, thread: int, threads: int):
    """List the elements of listed blocks that are nearer than ``far``; the threads are whole warps."""
    pairs = t.near_blocks[0]
    room = t.touch_edge.shape[0] / 2
    rows = int(pairs)
    first = int(0)
    while first < pairs:
        barrier(threads)
        if thread == 0:
            t.touch_count[1] = 0
        barrier(threads)
        last = wp.min(first + rows, pairs)
        suspect(t, topo, far, first, last, thread, threads)
        barrier(threads)
        count = t.touch_count[1]
        # what two blocks have is taken as far as there is room: the lists themselves have no more
        if rows > 1 and count > room:
            rows = wp.max(rows / 4, 1)
        else:
            examine(t, topo, far * far, wp.min(count, room), thread, threads)
            first = last
