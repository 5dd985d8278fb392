"""Those of one world's listed pairs that may touch, on the CPU: soon, and within the coming substep.

Sixteen pairs of the one world are tested at a time, as `nuno.contact.self.cpu_search` lists them.
"""

from typing import Any

import warp as wp

from nuno.contact.self.simd_tests import KEEP, NEAR_EDGES, NEAR_TRIANGLES, PRELUDE


@wp.func_native(
    PRELUDE
    + NEAR_TRIANGLES
    + NEAR_EDGES
    + KEEP
    + """
const float *x0 = (const float*)x, *y0 = (const float*)y, *z0 = (const float*)z;
const V limit = (V){} + far * far;
const int* from[2] = {(const int*)triangles, (const int*)pairs};
int* to[2] = {(int*)near_triangles_out, (int*)near_pairs_out};
const int room[2] = {max_triangles, max_pairs};
for (int kind = 0; kind < 2; ++kind) {
    const int found = ((const int*)counts)[kind * lanes], count = found < room[kind] ? found : room[kind];
    int near_count = 0;
    for (int k = 0; k < count; k += 16) {
        I q[4];
        for (int c = 0; c < 4; ++c) q[c] = *(const I*)(from[kind] + c * room[kind] + k);
        V near;
        if (kind == 0)
            near = near_triangles(x0, y0, z0, lanes, q[0], q[1], q[2], q[3], limit, rim);
        else
            near = near_edges(x0, y0, z0, lanes, q[0], q[1], q[2], q[3], limit);
        const unsigned hit = bits((near > 0.f) & (OWN + k < count));
        keep(hit, q[0], q[1], q[2], q[3], near_count, to[kind], next, next == 1 ? room[kind] : lanes, room[kind]);
    }
    ((int*)near_counts)[kind * lanes] = near_count;
}
#endif
"""
)
def filter_world(
    x: wp.uint64,
    y: wp.uint64,
    z: wp.uint64,
    far: float,
    lanes: int,
    counts: wp.uint64,
    triangles: wp.uint64,
    max_triangles: int,
    pairs: wp.uint64,
    max_pairs: int,
    near_counts: wp.uint64,
    near_triangles_out: wp.uint64,
    near_pairs_out: wp.uint64,
    next: int,
    rim: float,
):
    """Copy those pairs of a list that are nearer than ``far`` [m] to another, in their order.

    The other list is one like the first where ``next`` is 1; where it is 4 ``lanes`` it has every ``lanes``-th number.
    """
    ...


@wp.func
def pairs_of(pairs: wp.array(dtype=Any), which: int):
    """Return where the list of world ``which`` of a vector stands: first vertices, then second ones, and so on."""
    return pairs.ptr + wp.uint64(4 * which) * wp.uint64(pairs.shape[0])


@wp.func
def make_inner_list_of_world(t: Any, far: float, which: int, lanes: int):
    """Pick the listed pairs of world ``which`` of the ``lanes`` worlds in a vector that are nearer than ``far`` [m]."""
    skip = wp.uint64(4 * which)
    filter_world(
        t.x.ptr + skip,
        t.y.ptr + skip,
        t.z.ptr + skip,
        far,
        lanes,
        t.pair_count.ptr + skip,
        pairs_of(t.vertex_triangle, which),
        t.vertex_triangle.shape[0] / 4,
        pairs_of(t.edge_edge, which),
        t.edge_edge.shape[0] / 4,
        t.inner_count.ptr + skip,
        pairs_of(t.inner_triangle, which),
        pairs_of(t.inner_edge, which),
        1,
        1.0e9,
    )


@wp.func
def reach_world(t: Any, far: float, which: int, lanes: int):
    """Find the pairs of world ``which`` in its inner list that are nearer than ``far`` [m], and so may touch now.

    It takes the worlds of a vector together, as many pairs as the one of them has that has the most.
    """
    skip = wp.uint64(4 * which)
    filter_world(
        t.x.ptr + skip,
        t.y.ptr + skip,
        t.z.ptr + skip,
        far,
        lanes,
        t.inner_count.ptr + skip,
        pairs_of(t.inner_triangle, which),
        t.inner_triangle.shape[0] / 4,
        pairs_of(t.inner_edge, which),
        t.inner_edge.shape[0] / 4,
        t.active_count.ptr + skip,
        t.active_triangle.ptr + skip,
        t.active_edge.ptr + skip,
        4 * lanes,
        2.0e-3,
    )
