"""The listing of one world's self-contact pairs on the CPU, sixteen elements at a time.

The sixteen worlds of a lane vector fold in different places and at different times. So each is listed by itself, when
it needs it: its positions are copied out of the lanes, and the vector then holds sixteen boxes, triangles or edges of
that one world. One world alone is listed by the same code.

The order of a list is that of the vertices and edges sorted by leaf, whatever its margin and the moment it was made.
Pairs that touch are solved one after the other on the CPU, and so in the same order in every plan.
"""

from typing import Any

import warp as wp

from nuno.contact.self.cpu_creases import mark_creases
from nuno.contact.self.cpu_flat_regions import survey_world
from nuno.contact.self.cpu_inner_lists import pairs_of
from nuno.contact.self.cpu_scratch import ROOM, bound_world, copy_world
from nuno.contact.self.simd_tests import KEEP, NEAR_EDGES, NEAR_TRIANGLES, PRELUDE
from nuno.state.cloth_state import MAX_NEIGHBOURS, Topology
from nuno.topology.leaves import FLAT_SIDE

RANGES = 48
"""Ranges of consecutive leaves near a leaf that are kept apart."""


@wp.func_native(
    PRELUDE
    + ROOM
    + NEAR_TRIANGLES
    + NEAR_EDGES
    + KEEP
    + """
const int spans = boxes;
const int *face_start = leaf_face_start.data, *edge_start = leaf_edge_start.data;
const V limit = (V){} + far * far;
auto overlaps = [&](const float* rows, int count, int k, const float* low, const float* high) {
    V gap = (V){} + 1e30f;
    for (int c = 0; c < 3; ++c) {
        gap = minimum(gap, *(const V*)(rows + (c + 3) * count + k) - low[c]);
        gap = minimum(gap, high[c] - *(const V*)(rows + c * count + k));
    }
    return bits(gap > 0.f);
};
auto within = [&](const float* rows, int count, int k, float x, float y, float z, float reach) {
    const V dx = x - *(const V*)(rows + k), dy = y - *(const V*)(rows + count + k);
    const V dz = z - *(const V*)(rows + 2 * count + k), r = reach + *(const V*)(rows + 3 * count + k);
    return r * r > dx * dx + dy * dy + dz * dz;
};
// the spheres that reach into a box
auto reach = [&](const float* rows, int count, int k, const float* low, const float* high) {
    const V r = *(const V*)(rows + 3 * count + k);
    V gap = (V){} + 1e30f;
    for (int c = 0; c < 3; ++c) {
        const V x = *(const V*)(rows + c * count + k);
        gap = minimum(gap, minimum(x - low[c], high[c] - x));
    }
    return gap + r > 0.f;
};
// the leaves, of sixteen, that fit a tame square together with leaf a: no two of their elements are near
auto safe = [&](int a, int start) ALONE {
    const int* span = leaf_span.data;
    const I left = smaller(*(const I*)(span + start), span[a]);
    const I right = larger(*(const I*)(span + spans + start), span[spans + a]);
    const I low = smaller(*(const I*)(span + 2 * spans + start), span[2 * spans + a]);
    const I high = larger(*(const I*)(span + 3 * spans + start), span[3 * spans + a]);
    const I at = smaller(low, points / columns - FLAT_SIDE) * columns + smaller(left, columns - FLAT_SIDE);
    return bits((right - left < FLAT_SIDE) & (high - low < FLAT_SIDE) & take_int(tame, at));
};
// the edges whose boxes meet a box
auto meet = [&](const float* rows, int count, int k, const float* low, const float* high) {
    V gap = (V){} + 1e30f;
    for (int c = 0; c < 3; ++c) {
        const V x = *(const V*)(rows + c * count + k), half = *(const V*)(rows + (c + 3) * count + k);
        gap = minimum(gap, minimum(x - low[c], high[c] - x) + maximum(half, -half));
    }
    return gap > 0.f;
};
int* counted[2] = {(int*)pair_count, (int*)pair_count + lanes};
for (int c = 0; c < 2; ++c) {
    int* max_counted = counted[c] + MAX_NEIGHBOURS * lanes;
    if (*counted[c] > *max_counted) *max_counted = *counted[c];
    *counted[c] = 0;
}
// suspects wait until there are sixteen
int vertex_of[32], face_of[32], edge_of[32], other_of[32], faces_waiting = 0, edges_waiting = 0;
auto test_faces = [&](int count) ALONE {
    const I i = *(const I*)vertex_of, f = *(const I*)face_of;
    const I a = take_int(corner, f), b = take_int(corner + faces, f), c = take_int(corner + 2 * faces, f);
    const unsigned hit = bits(near_triangles(point, point + 1, point + 2, 4, i, a, b, c, limit, 1e9f) > 0.f);
    keep(hit & ((1u << count) - 1), i, a, b, c, *counted[0], (int*)triangles, 1, max_triangles, max_triangles);
};
auto test_edges = [&](int count) ALONE {
    const I e = *(const I*)edge_of, f = *(const I*)other_of;
    const I a = take_int(end, e), b = take_int(end + edges, e), c = take_int(end, f), d = take_int(end + edges, f);
    const unsigned hit = bits(near_edges(point, point + 1, point + 2, 4, a, b, c, d, limit) > 0.f);
    keep(hit & ((1u << count) - 1), a, b, c, d, *counted[1], (int*)pairs, 1, max_pairs, max_pairs);
};
for (int l = 0; l < 32; ++l) vertex_of[l] = face_of[l] = edge_of[l] = other_of[l] = 0;
for (int a = 0; a < leaves; ++a) {
    float low[3], high[3];
    for (int c = 0; c < 3; ++c) {
        low[c] = box[c * boxes + a] - far;
        high[c] = box[(c + 3) * boxes + a] + far;
    }
    // ranges of consecutive leaves that meet leaf a; where there are too many, the last one stretches
    int first[RANGES], last[RANGES], ranges = 0;
    for (int g = 0; g < leaves_16; g += 16)
        for (unsigned some = overlaps(group, groups, g, low, high); some; some &= some - 1) {
            const int start = 16 * (g + __builtin_ctz(some));
            unsigned near = overlaps(box, boxes, start, low, high);
            if (near && columns > 0) near &= ~safe(a, start);
            while (near) {
                const int skip = __builtin_ctz(near), length = __builtin_ctz(~(near >> skip));
                near &= ~(((1u << length) - 1) << skip);
                const bool apart = ranges == 0 || last[ranges - 1] != start + skip;
                if (apart && ranges < RANGES) first[ranges++] = start + skip;
                last[ranges - 1] = start + skip + length;
            }
        }
    if (ranges == 0) continue;
    // the elements near the leaf, side by side
    int face_count = 0, edge_count = 0;
    for (int r = 0; r < ranges; ++r) {
        const int face_stop = face_start[last[r]], edge_stop = edge_start[last[r]];
        for (int j = face_start[first[r]]; j < face_stop; j += 16) {
            const unsigned some = bits(reach(ball, faces, j, low, high) & (OWN + j < face_stop));
            if (some == 0) continue;
            ROLLED for (int c = 0; c < 4; ++c)
                pack((int*)near_ball + c * faces, face_count, *(const I*)(ball + c * faces + j), some);
            ROLLED for (int c = 0; c < 3; ++c)
                pack(near_corner + c * faces, face_count, *(const I*)(corner + c * faces + j), some);
            face_count = pack(near_face, face_count, OWN + j, some);
        }
        const int begin = edge_start[first[r]];
        for (int j = begin > edge_start[a] ? begin : edge_start[a]; j < edge_stop; j += 16) {
            const unsigned some = bits(meet(rod, edges, j, low, high) & (OWN + j < edge_stop));
            if (some == 0) continue;
            ROLLED for (int c = 0; c < 6; ++c)
                pack((int*)near_rod + c * edges, edge_count, *(const I*)(rod + c * edges + j), some);
            ROLLED for (int c = 0; c < 2; ++c)
                pack(near_end + c * edges, edge_count, *(const I*)(end + c * edges + j), some);
            edge_count = pack(near_edge, edge_count, OWN + j, some);
        }
    }
    for (int k = leaf_vertex_start.data[a]; k < leaf_vertex_start.data[a + 1]; ++k) {
        const int i = leaf_vertex.data[k];
        const float x = point[4 * i], y = point[4 * i + 1], z = point[4 * i + 2];
        for (int j = 0; j < face_count; j += 16) {
            I near = within(near_ball, faces, j, x, y, z, far) & (OWN + j < face_count);
            for (int c = 0; c < 3; ++c) near &= *(const I*)(near_corner + c * faces + j) != i;
            const unsigned some = bits(near);
            if (some) {
                *(I*)(vertex_of + faces_waiting) = (I){} + i;
                faces_waiting = pack(face_of, faces_waiting, *(const I*)(near_face + j), some);
                if (faces_waiting >= 16) {
                    test_faces(16);
                    faces_waiting -= 16;
                    *(I*)vertex_of = *(const I*)(vertex_of + 16);
                    *(I*)face_of = *(const I*)(face_of + 16);
                }
            }
        }
    }
    for (int k = edge_start[a]; k < edge_start[a + 1]; ++k) {
        const float x = rod[k], y = rod[edges + k], z = rod[2 * edges + k];
        const float ax = rod[3 * edges + k], ay = rod[4 * edges + k], az = rod[5 * edges + k];
        const int p = end[k], q = end[edges + k];
        for (int j = 0; j < edge_count; j += 16) {
            const I other = *(const I*)(near_edge + j);
            // no nearer to each other than along the line between their middles
            auto load = [&](int row) { return *(const V*)(near_rod + row * edges + j); };
            const V dx = x - load(0), dy = y - load(1), dz = z - load(2), bx = load(3), by = load(4), bz = load(5);
            const V first = ax * dx + ay * dy + az * dz, second = bx * dx + by * dy + bz * dz;
            const V square = dx * dx + dy * dy + dz * dz;
            const V gap = square - maximum(first, -first) - maximum(second, -second);
            I near = (gap * maximum(gap, -gap) <= limit * square) & (OWN + j < edge_count) & (other > k);
            for (int c = 0; c < 2; ++c) {
                const I ends = *(const I*)(near_end + c * edges + j);
                near &= (ends != p) & (ends != q);
            }
            const unsigned some = bits(near);
            if (some) {
                *(I*)(edge_of + edges_waiting) = (I){} + k;
                edges_waiting = pack(other_of, edges_waiting, other, some);
                if (edges_waiting >= 16) {
                    test_edges(16);
                    edges_waiting -= 16;
                    *(I*)edge_of = *(const I*)(edge_of + 16);
                    *(I*)other_of = *(const I*)(other_of + 16);
                }
            }
        }
    }
}
if (faces_waiting) test_faces(faces_waiting);
if (edges_waiting) test_edges(edges_waiting);
const int creases = crease.shape[0];
int crease_of[32], creases_waiting = 0;
for (int l = 0; l < 32; ++l) crease_of[l] = 0;
auto test_creases = [&](int count) ALONE {
    const I row = *(const I*)crease_of * 4;
    const int* table = (const int*)crease.data;
    const I a = take_int(table, row), b = take_int(table + 1, row);
    const I c = take_int(table + 2, row), d = take_int(table + 3, row);
    const unsigned hit = bits(near_edges(point, point + 1, point + 2, 4, a, b, c, d, limit) > 0.f);
    keep(hit & ((1u << count) - 1), a, b, c, d, *counted[1], (int*)pairs, 1, max_pairs, max_pairs);
};
for (int k = 0; k < creases; k += 16) {
    I near = OWN + k < creases;
    if (columns > 0) near &= take_int(creased, take_int(crease_key.data, smaller(OWN + k, creases - 1)));
    creases_waiting = pack(crease_of, creases_waiting, OWN + k, bits(near));
    if (creases_waiting >= 16) {
        test_creases(16);
        creases_waiting -= 16;
        *(I*)crease_of = *(const I*)(crease_of + 16);
    }
}
if (creases_waiting) test_creases(creases_waiting);
#endif
""".replace("RANGES", str(RANGES))
    .replace("FLAT_SIDE", str(FLAT_SIDE))
    .replace("MAX_NEIGHBOURS", str(MAX_NEIGHBOURS))
)
def search_world(
    face: wp.array(dtype=wp.vec3i),
    edge: wp.array(dtype=wp.vec2i),
    leaf_vertex: wp.array(dtype=int),
    leaf_vertex_start: wp.array(dtype=int),
    leaf_face_start: wp.array(dtype=int),
    leaf_edge_start: wp.array(dtype=int),
    leaf_span: wp.array(dtype=int),
    crease: wp.array(dtype=wp.vec4i),
    crease_key: wp.array(dtype=int),
    columns: int,
    points: int,
    leaves: int,
    room: wp.uint64,
    far: float,
    lanes: int,
    pair_count: wp.uint64,
    triangles: wp.uint64,
    max_triangles: int,
    pairs: wp.uint64,
    max_pairs: int,
):
    """List the pairs that share no vertex and are nearer than ``far`` [m].

    The lists have every ``lanes``-th number; what does not fit is counted but not kept.
    """
    ...


@wp.func
def list_world(t: Any, topo: Topology, far: float, which: int, lanes: int):
    """List anew the pairs of world ``which`` of the ``lanes`` worlds in a vector that are nearer than ``far`` [m]."""
    n = topo.particles
    skip = wp.uint64(4 * which)
    room = t.middle.ptr
    copy_world(t.x.ptr + skip, t.y.ptr + skip, t.z.ptr + skip, t.reference.ptr + skip, lanes, n, room)
    bound_world(
        topo.leaf_face,
        topo.leaf_edge,
        topo.leaf_corner,
        topo.leaf_corner_start,
        n,
        topo.leaves,
        room,
        lanes,
        t.bounds.ptr + skip,
    )
    if topo.columns > 0:
        survey_world(topo.leaf_face, topo.leaf_edge, topo.columns, n, topo.leaves, room, far)
        if topo.crease.shape[0] > 0:
            mark_creases(topo.leaf_face, topo.leaf_edge, topo.columns, n, topo.leaves, room, far)
    search_world(
        topo.leaf_face,
        topo.leaf_edge,
        topo.leaf_vertex,
        topo.leaf_vertex_start,
        topo.leaf_face_start,
        topo.leaf_edge_start,
        topo.leaf_span,
        topo.crease,
        topo.crease_key,
        topo.columns,
        n,
        topo.leaves,
        room,
        far,
        lanes,
        t.pair_count.ptr + skip,
        pairs_of(t.vertex_triangle, which),
        t.vertex_triangle.shape[0] / 4,
        pairs_of(t.edge_edge, which),
        t.edge_edge.shape[0] / 4,
    )
