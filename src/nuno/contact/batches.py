"""The listing of self-contact pairs by the many threads of a CUDA block.

The pairs of blocks that may have near elements are queued. A warp takes a few of them at a time, and looks at one after
the other with its 32 threads together: what they read lies side by side, and nothing is read twice. It notes the
pairs of elements whose spheres meet, its suspects, and where these are enough for all its threads it lists those that
are near. No warp waits for another. The queue and the suspects stand in the room of the picked pairs, which are picked
anew once the list is made.
"""

import warp as wp

from nuno.contact.flat_blocks import in_flat
from nuno.contact.nearness import append, near_edges, near_triangle
from nuno.solver.lanes import barrier, window
from nuno.solver.state import StateFloat, Topology
from nuno.solver.warps import WARP, before_me, claim, lowest, size_of_set, sync_warp, told

BATCH = wp.constant(4)
"""Pairs of blocks that a warp takes from the queue at a time."""
ENOUGH = wp.constant(64)
"""Suspects from which on a warp examines them."""
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
def suspect(
    t: StateFloat, topo: Topology, a: int, b: int, far: float, room: wp.array(dtype=int), before: int, thread: int
):
    """Note the elements of two blocks whose spheres meet, behind ``before`` others; how many are noted then.

    A suspect is two numbers: the place of a vertex in the blocks and that of a triangle, or the number of particles
    plus the place of an edge and that of another.
    """
    count = int(before)
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
            own = size_of_set(ab) + size_of_set(ba) + size_of_set(bits)
            k = count + before_me(own)
            count = told(k + own, WARP - 1)
            k = note(room, k, ab, va, fb + step + v)
            k = note(room, k, ba, vb, fa + step + v)
            note(room, k, bits, topo.particles + begin, eb + step + v)
            ab = int(0)
            ba = int(0)
    return count


@wp.func
def examine(t: StateFloat, topo: Topology, far2: float, room: wp.array(dtype=int), count: int, thread: int):
    """List those of a warp's suspects that are near; what did not fit its room is passed over."""
    sync_warp()
    for k in range(thread % WARP, wp.min(count, room.shape[0] / 2), WARP):
        u = room[2 * k]
        v = room[2 * k + 1]
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
    sync_warp()


@wp.func
def queue_blocks(t: StateFloat, topo: Topology, far: float, thread: int, threads: int):
    """Queue the listed pairs of blocks whose boxes meet and where the cloth is not flat; how many these are."""
    pairs = t.near_blocks[0]
    room = t.touch_triangle.shape[0]
    barrier(threads)
    if thread == 0:
        t.touch_count[0] = 0
    barrier(threads)
    for start in range(thread - thread % WARP, pairs, threads):
        k = start + thread % WARP
        pair = int(0)
        on = int(0)
        if k < pairs:
            pair = t.near_blocks[1 + k]
            a = 6 * (pair >> 16)
            b = 6 * (pair & 0xFFFF)
            gx = wp.min(t.bounds[a + 3] - t.bounds[b], t.bounds[b + 3] - t.bounds[a])
            gy = wp.min(t.bounds[a + 4] - t.bounds[b + 1], t.bounds[b + 4] - t.bounds[a + 1])
            gz = wp.min(t.bounds[a + 5] - t.bounds[b + 2], t.bounds[b + 5] - t.bounds[a + 2])
            if wp.min(gx, wp.min(gy, gz)) + far > 0.0:
                if not in_flat(t, topo, pair >> 16, pair & 0xFFFF):
                    on = 1
        place = claim(t.touch_count, 0, on)
        if on != 0 and place < room:
            t.touch_triangle[place] = pair
    barrier(threads)
    return wp.min(t.touch_count[0], room)


@wp.func
def search_batch(t: StateFloat, topo: Topology, far: float, first: int, last: int, thread: int, threads: int):
    """List the near elements of the queued pairs first to last: a warp's work."""
    size = t.touch_edge.shape[0] / (threads / WARP)
    room = window(t.touch_edge, thread / WARP * size, size)
    count = int(0)
    k = int(first)
    while k < last:
        pair = t.touch_triangle[k]
        noted = suspect(t, topo, pair >> 16, pair & 0xFFFF, far, room, count, thread)
        # what has no room behind others is noted once more when they are out of the way
        fits = count == 0 or noted <= size / 2
        if fits:
            count = noted
            k += 1
        if not fits or count >= ENOUGH or k == last:
            examine(t, topo, far * far, room, count, thread)
            count = 0


@wp.func
def find_in_batches(t: StateFloat, topo: Topology, far: float, thread: int, threads: int):
    """List the elements of listed blocks that are nearer than ``far``; the threads are whole warps."""
    queued = queue_blocks(t, topo, far, thread, threads)
    barrier(threads)
    if thread == 0:
        t.touch_count[0] = 0
    barrier(threads)
    first = int(0)
    while first < queued:
        place = int(0)
        if thread % WARP == 0:
            place = wp.atomic_add(t.touch_count, 0, BATCH)
        first = told(place, 0)
        if first < queued:
            search_batch(t, topo, far, first, wp.min(first + BATCH, queued), thread, threads)
    barrier(threads)
