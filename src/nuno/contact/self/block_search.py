"""The listing of self-contact pairs by the many threads of a CUDA block.

The pairs of leaves that may have near elements are queued. A warp takes a few of them at a time, and looks at four
together, with eight threads each, for a leaf of a sheet has eight triangles and eight edges. It notes the pairs of
elements whose spheres meet, its suspects, and where these are enough for all its threads it lists those that are near.
No warp waits for another. The queue and the suspects stand in the room of the picked pairs, which are picked anew once
the list is made.
"""

import warp as wp

from nuno.contact.self.block_flat_regions import in_flat
from nuno.contact.self.narrow_phase import append, near_edges, near_triangle
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import subarray
from nuno.numbers.warps import WARP, claim, sync_warp, warp_broadcast
from nuno.state.cloth_state import MISSED_ELEMENTS, StateFloat, Topology

BATCH, LONG_BATCH = wp.constant(8), wp.constant(24)
"""Pairs of leaves that a warp takes from the queue at a time, where blocks help and where none does."""
TOGETHER = wp.constant(4)
"""Pairs of leaves that it looks at side by side."""
ENOUGH = wp.constant(128)
"""Suspects from which on a warp examines them."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const unsigned all = 0xffffffffu;
const int lane = threadIdx.x % 32, v = lane % 8, k = first + lane / 8;
const bool on = k < last;
const int pair = queue.data[on ? k : first], a = pair >> 16, b = pair & 0xffff;
const int va = vertex_start.data[a], na = vertex_start.data[a + 1] - va;
const int vb = vertex_start.data[b], nb = vertex_start.data[b + 1] - vb;
const int fa = face_start.data[a], fb = face_start.data[b];
const int ea = edge_start.data[a], eb = edge_start.data[b];
const int faces = on && a != b ? face_start.data[a + 1] - fa : 0, others = on ? face_start.data[b + 1] - fb : 0;
const int rows = on ? edge_start.data[a + 1] - ea : 0, edges = on ? edge_start.data[b + 1] - eb : 0;
const float4* spheres = reinterpret_cast<const float4*>(middle.data);
// which of some vertices, four at most, the sphere of a triangle reaches
auto vertices = [&](int f, int begin, int count) {
    const float4 s = spheres[f];
    const int f0 = face.data[f][0], f1 = face.data[f][1], f2 = face.data[f][2];
    const float reach = s.w + far;
    int bits = 0;
    for (int row = 0; row < count; ++row) {
        const int i = vertex.data[begin + row];
        const float dx = x.data[i] - s.x, dy = y.data[i] - s.y, dz = z.data[i] - s.z;
        const bool near = dx * dx + dy * dy + dz * dz < reach * reach;
        if (near && i != f0 && i != f1 && i != f2) bits |= 1 << row;
    }
    return bits;
};
int2* notes = reinterpret_cast<int2*>(room.data);
// triangles in the first half of the room, edges in the second
const int half = room.shape[0] / 4;
int counts = before;
const int longest = max(max(faces, others), edges);
for (int step = v; __any_sync(all, step - v < longest); step += 8) {
    int ab = step < others ? vertices(fb + step, va, na) : 0;
    int ba = step < faces ? vertices(fa + step, vb, nb) : 0;
    for (int begin = 0; begin == 0 || __any_sync(all, begin < rows); begin += 32) {
        int bits = 0;
        if (step < edges) {
            const float4 s = spheres[offset + eb + step];
            const int g0 = edge.data[eb + step][0], g1 = edge.data[eb + step][1];
            // of a leaf with itself each pair once
            const int stop = min(begin + 32, a == b ? step : rows);
            for (int row = begin; row < stop; ++row) {
                const float4 r = spheres[offset + ea + row];
                const int e0 = edge.data[ea + row][0], e1 = edge.data[ea + row][1];
                const float dx = r.x - s.x, dy = r.y - s.y, dz = r.z - s.z, reach = r.w + s.w + far;
                const bool near = dx * dx + dy * dy + dz * dz < reach * reach;
                if (near && e0 != g0 && e0 != g1 && e1 != g0 && e1 != g1) bits |= 1 << (row - begin);
            }
        }
        const int own = __popc(ab) + __popc(ba) + (__popc(bits) << 16);
        if (__any_sync(all, own)) {
            int sum = own;
            for (int d = 1; d < 32; d *= 2) {
                const int below = __shfl_up_sync(all, sum, d);
                if (lane >= d) sum += below;
            }
            const int place = counts + sum - own;
            int i = place & 0xffff, j = place >> 16;
            for (; ab; ab &= ab - 1, ++i) if (i < half) notes[i] = make_int2(va + __ffs(ab) - 1, fb + step);
            for (; ba; ba &= ba - 1, ++i) if (i < half) notes[i] = make_int2(vb + __ffs(ba) - 1, fa + step);
            for (; bits; bits &= bits - 1, ++j)
                if (j < half) notes[half + j] = make_int2(ea + begin + __ffs(bits) - 1, eb + step);
            counts += __shfl_sync(all, sum, 31);
        }
    }
}
return counts;
#else
return 0;
#endif
""")
def suspect(
    queue: wp.array(dtype=int),
    first: int,
    last: int,
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    vertex_start: wp.array(dtype=int),
    vertex: wp.array(dtype=int),
    face_start: wp.array(dtype=int),
    face: wp.array(dtype=wp.vec3i),
    edge_start: wp.array(dtype=int),
    edge: wp.array(dtype=wp.vec2i),
    middle: wp.array(dtype=float),
    offset: int,
    far: float,
    room: wp.array(dtype=int),
    before: int,
) -> int:
    """Note the elements of four pairs of leaves whose spheres meet: eight threads a pair, each an element of one.

    A suspect is two numbers. The places in the leaves of a vertex and a triangle are noted in the first half of the
    room, those of two edges in the second.

    Args:
        queue: Pairs of leaves.
        first: The first of these four.
        last: One past the last in the queue.
        x: Coordinates; so are ``y`` and ``z`` [m].
        y: See ``x``.
        z: See ``x``.
        vertex_start: Where the vertices of each leaf start; so for faces and edges.
        vertex: The leaves' vertices.
        face_start: See ``vertex_start``.
        face: Their triangles.
        edge_start: See ``vertex_start``.
        edge: Their edges.
        middle: Spheres of the triangles, and from number ``offset`` on of the edges.
        offset: See ``middle``.
        far: Distance up to which elements are near [m].
        room: Where they are noted; what does not fit is counted but not kept.
        before: What was noted before.

    Returns:
        How many vertices and triangles are noted, plus 65,536 times how many pairs of edges.
    """
    ...


@wp.func
def examine(t: StateFloat, topo: Topology, far2: float, room: wp.array(dtype=int), counts: int, rank: int):
    """List those of a warp's suspects that are near; what did not fit its room is passed over."""
    sync_warp()
    half = room.shape[0] / 4
    for k in range(rank % WARP, wp.min(counts & 0xFFFF, half), WARP):
        f = topo.leaf_face[room[2 * k + 1]]
        i = topo.leaf_vertex[room[2 * k]]
        hit = near_triangle(t, i, f[0], f[1], f[2], far2)
        append(hit, t.pair_count, 0, t.vertex_triangle, i, f[0], f[1], f[2])
    for k in range(rank % WARP, wp.min(counts >> 16, half), WARP):
        e = topo.leaf_edge[room[2 * (half + k)]]
        g = topo.leaf_edge[room[2 * (half + k) + 1]]
        near = near_edges(t, e[0], e[1], g[0], g[1], far2)
        append(near, t.pair_count, 1, t.edge_edge, e[0], e[1], g[0], g[1])
    sync_warp()


@wp.func
def queue_leaf_pairs(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """Queue the listed pairs of leaves whose boxes meet and where the cloth is not flat; how many these are."""
    pairs = t.leaf_pairs[0]
    room = t.active_triangle.shape[0]
    barrier(size)
    if rank == 0:
        t.active_count[0] = 0
    barrier(size)
    for start in range(rank - rank % WARP, pairs, size):
        k = start + rank % WARP
        pair = int(0)
        on = int(0)
        if k < pairs:
            pair = t.leaf_pairs[1 + k]
            a = subarray(t.bounds, 6 * (pair >> 16), 6)
            b = subarray(t.bounds, 6 * (pair & 0xFFFF), 6)
            gx = wp.min(a[3] - b[0], b[3] - a[0])
            gy = wp.min(a[4] - b[1], b[4] - a[1])
            gz = wp.min(a[5] - b[2], b[5] - a[2])
            if wp.min(gx, wp.min(gy, gz)) + far > 0.0:
                if not in_flat(t, topo, pair >> 16, pair & 0xFFFF):
                    on = 1
        place = claim(t.active_count, 0, on)
        if on != 0 and place < room:
            t.active_triangle[place] = pair
    barrier(size)
    return wp.min(t.active_count[0], room)


@wp.func
def search_batch(t: StateFloat, topo: Topology, far: float, first: int, last: int, rank: int, size: int):
    """List the near elements of the queued pairs first to last: a warp's work."""
    # two halves of pairs of numbers
    half = t.active_edge.shape[0] / (size / WARP) / 4
    room = subarray(t.active_edge, rank / WARP * 4 * half, 4 * half)
    counts = int(0)
    together = int(TOGETHER)
    k = int(first)
    while k < last:
        noted = suspect(
            t.active_triangle, k, wp.min(k + together, last), t.x, t.y, t.z, topo.leaf_vertex_start, topo.leaf_vertex,
            topo.leaf_face_start, topo.leaf_face, topo.leaf_edge_start, topo.leaf_edge, t.middle,
            topo.leaf_face.shape[0], far, room, counts,
        )  # fmt: skip
        # what has no room behind others is noted once more when they are out of the way, at last by itself
        fits = (noted & 0xFFFF) <= half and (noted >> 16) <= half
        if fits or (counts == 0 and together == 1):
            if not fits and rank % WARP == 0:
                wp.atomic_max(t.pair_count, MISSED_ELEMENTS, wp.max(noted & 0xFFFF, noted >> 16))
            counts = noted
            k += together
            together = TOGETHER
        elif counts == 0:
            together = 1
        if not fits or (counts & 0xFFFF) + (counts >> 16) >= ENOUGH or k >= last:
            examine(t, topo, far * far, room, counts, rank)
            counts = 0


@wp.func
def find_in_batches(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """List the elements of listed leaves that are nearer than ``far``; the threads are whole warps."""
    queued = queue_leaf_pairs(t, topo, far, rank, size)
    barrier(size)
    if rank == 0:
        t.active_count[0] = 0
    barrier(size)
    first = int(0)
    while first < queued:
        place = int(0)
        if rank % WARP == 0:
            place = wp.atomic_add(t.active_count, 0, LONG_BATCH)
        first = warp_broadcast(place, 0)
        if first < queued:
            search_batch(t, topo, far, first, wp.min(first + LONG_BATCH, queued), rank, size)
    barrier(size)
