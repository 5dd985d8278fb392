"""Narrow phase of self-contact: tests of distance, bounds of leaves and of displacements, and appending to lists.

A pair that a test lets through although it is not near costs time only, for solving it changes nothing.
"""

from typing import Any

import warp as wp

from nuno.numbers.lanes import add, div, full_like, lane, lane_int, maximum, minimum, mul, sqrt, sub  # noqa: F401 (add, div, mul, sub: Warp takes them for the operators)
from nuno.numbers.vec3 import cross, dot, gather_position
from nuno.numbers.warps import leads_warp, warp_max
from nuno.state.cloth_state import Topology

GROUP = 8
"""Consecutive leaves that are passed over together where their common box is far."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int* at = count.data + which;
if (__isShared(at)) return atomicAdd(at, 1);
// a hundred thousand threads that count on one number of the device's memory queue up: one counts for those beside it
const unsigned active = __activemask();
const int leader = __ffs(active) - 1, lane = threadIdx.x % 32;
int first = 0;
if (lane == leader) first = atomicAdd(at, __popc(active));
return __shfl_sync(active, first, leader) + __popc(active & ((1u << lane) - 1u));
#else
return count.data[which]++;
#endif
""")
def next_place(count: wp.array(dtype=int), which: int) -> int:
    """Raise a count by one; what it was before."""
    ...


@wp.func
def append(
    hit: float, count: wp.array(dtype=int), which: int, pairs: wp.array(dtype=int), a: int, b: int, c: int, d: int
):
    """Add a candidate to the list where ``hit`` is positive; what does not fit is counted but not kept."""
    if hit > 0.0:
        k = next_place(count, which)
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


@wp.func
def raise_to(values: wp.array(dtype=float), k: int, value: float, rank: int, size: int):
    """Element k becomes the largest ``value`` of all threads where that is larger."""
    if size > 1:
        # an atomic for each thread would have all of them queue up
        high = warp_max(value, size)
        if leads_warp(rank, size):
            wp.atomic_max(values, k, high)
    else:
        values[k] = maximum(values[k], value)


@wp.func
def middles(t: Any, topo: Topology, rank: int, size: int):
    """Centre and radius of each triangle and each edge."""
    third = 1.0 / 3.0
    m = topo.leaf_face.shape[0]
    for j in range(rank, m, size):
        f = topo.leaf_face[j]
        mx = (t.x[f[0]] + t.x[f[1]] + t.x[f[2]]) * third
        my = (t.y[f[0]] + t.y[f[1]] + t.y[f[2]]) * third
        mz = (t.z[f[0]] + t.z[f[1]] + t.z[f[2]]) * third
        r = full_like(mx, 0.0)
        for k in range(3):
            i = f[k]
            dx = t.x[i] - mx
            dy = t.y[i] - my
            dz = t.z[i] - mz
            r = maximum(r, dx * dx + dy * dy + dz * dz)
        t.middle[4 * j] = mx
        t.middle[4 * j + 1] = my
        t.middle[4 * j + 2] = mz
        t.middle[4 * j + 3] = sqrt(r)
    for j in range(rank, topo.leaf_edge.shape[0], size):
        e = topo.leaf_edge[j]
        dx = (t.x[e[1]] - t.x[e[0]]) * 0.5
        dy = (t.y[e[1]] - t.y[e[0]]) * 0.5
        dz = (t.z[e[1]] - t.z[e[0]]) * 0.5
        k = 4 * (m + j)
        t.middle[k] = t.x[e[0]] + dx
        t.middle[k + 1] = t.y[e[0]] + dy
        t.middle[k + 2] = t.z[e[0]] + dz
        t.middle[k + 3] = sqrt(dx * dx + dy * dy + dz * dz)


@wp.func
def bound_leaves(t: Any, topo: Topology, rank: int, size: int):
    """Bounding boxes of the leaves' vertices and elements: the lower corner, and the upper one."""
    for b in range(rank, topo.leaves, size):
        first = topo.leaf_corner[topo.leaf_corner_start[b]]
        lx = t.x[first]
        ly = t.y[first]
        lz = t.z[first]
        hx = lx
        hy = ly
        hz = lz
        for k in range(topo.leaf_corner_start[b] + 1, topo.leaf_corner_start[b + 1]):
            i = topo.leaf_corner[k]
            lx = minimum(lx, t.x[i])
            ly = minimum(ly, t.y[i])
            lz = minimum(lz, t.z[i])
            hx = maximum(hx, t.x[i])
            hy = maximum(hy, t.y[i])
            hz = maximum(hz, t.z[i])
        t.bounds[6 * b] = lx
        t.bounds[6 * b + 1] = ly
        t.bounds[6 * b + 2] = lz
        t.bounds[6 * b + 3] = hx
        t.bounds[6 * b + 4] = hy
        t.bounds[6 * b + 5] = hz


@wp.func
def closest_on_edges(rx: Any, ry: Any, rz: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any):
    """Parameters in [0, 1] of the closest points of two edges with directions a and b, r from b's start to a's."""
    zero = full_like(rx, 0.0)
    one = full_like(rx, 1.0)
    tiny = full_like(rx, 1.0e-16)
    aa = ax * ax + ay * ay + az * az + tiny
    bb = bx * bx + by * by + bz * bz + tiny
    ab = ax * bx + ay * by + az * bz
    ar = ax * rx + ay * ry + az * rz
    br = bx * rx + by * ry + bz * rz
    det = aa * bb - ab * ab
    s = (ab * br - ar * bb) / maximum(det, aa * bb * 1.0e-6)
    s = minimum(maximum(s, zero), one)
    q = minimum(maximum((ab * s + br) / bb, zero), one)
    s = minimum(maximum((ab * q - ar) / aa, zero), one)
    return s, q


@wp.func
def near_triangle(t: Any, i: Any, f0: Any, f1: Any, f2: Any, far2: Any):
    """Positive where vertex i may be nearer to a triangle than the root of ``far2``.

    Height over the plane and the excess over the worst of the three edge lines bound the distance from below.
    """
    corner = gather_position(t, f0)
    a = gather_position(t, f1) - corner
    b = gather_position(t, f2) - corner
    d = gather_position(t, i) - corner
    c = b - a
    n = cross(a, b)
    h = dot(d, n)
    nn = dot(n, n)
    # weights of the corners b and a, times nn, where the vertex is over the triangle
    v = dot(cross(d, b), n)
    w = dot(cross(a, d), n)
    outside = minimum(minimum(nn - v - w, 0.0), minimum(v, w))
    longest = maximum(dot(a, a), maximum(dot(b, b), dot(c, c)))
    return longest * (far2 * nn - h * h) - outside * outside


@wp.func
def near_edges(t: Any, e0: Any, e1: Any, f0: Any, f1: Any, far2: Any):
    """Positive where two edges are nearer to each other than the root of ``far2``."""
    first = gather_position(t, e0)
    second = gather_position(t, f0)
    r = first - second
    a = gather_position(t, e1) - first
    b = gather_position(t, f1) - second
    s, q = closest_on_edges(r.x, r.y, r.z, a.x, a.y, a.z, b.x, b.y, b.z)
    c = r + s * a - q * b
    return far2 - c.x * c.x - c.y * c.y - c.z * c.z
