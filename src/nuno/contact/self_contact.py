"""Cloth against itself: thin contact of vertices with triangles and of edges with edges.

Candidates come from blocks of neighbouring vertices whose bounding boxes meet, and stay valid until something may
have moved by half the margin. A contact's normal and weights are taken where the substep began, when nothing crossed:
that tells the side, so that a pair pressed through within a substep is put back, and what is done depends
on the present state alone, not on when the list was made.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import (
    choose,
    fill,
    gather,
    highest,
    lane,
    lane_int,
    anywhere,
    largest,
    least,
    most,
    over,
    place,
    root,
    size_of,
    times,
    within,
)
from nuno.solver.state import FRICTION, SPEED, THICKNESS, Topology

LEAVE_SPEED = wp.constant(0.5)
"""[m/s] Layers found too close part no faster than this."""
UNIT = wp.constant(1.0e-9)
"""[m] Step of the fixed-point sums: integers add up to the same whatever the order of threads."""


@wp.func
def bound_blocks(t: Any, topo: Topology, thread: int, threads: int):
    """Bounding boxes of the blocks' vertices."""
    m = topo.blocks
    for b in range(thread, m, threads):
        first = topo.block_vertex[topo.block_vertex_start[b]]
        lx = t.x[first]
        ly = t.y[first]
        lz = t.z[first]
        hx = lx
        hy = ly
        hz = lz
        for k in range(topo.block_vertex_start[b], topo.block_vertex_start[b + 1]):
            i = topo.block_vertex[k]
            lx = least(lx, t.x[i])
            ly = least(ly, t.y[i])
            lz = least(lz, t.z[i])
            hx = most(hx, t.x[i])
            hy = most(hy, t.y[i])
            hz = most(hz, t.z[i])
        t.bounds[b] = lx
        t.bounds[m + b] = ly
        t.bounds[2 * m + b] = lz
        t.bounds[3 * m + b] = hx
        t.bounds[4 * m + b] = hy
        t.bounds[5 * m + b] = hz


@wp.func
def append(hit: float, count: wp.array(dtype=int), which: int, pairs: wp.array(dtype=int), a: int, b: int, c: int, d: int):  # noqa: E501
    """Add a candidate to the list where ``hit`` is positive; what does not fit is counted but not kept."""
    if hit > 0.0:
        k = wp.atomic_add(count, which, 1)
        if 4 * k + 3 < pairs.shape[0]:
            pairs[4 * k] = a
            pairs[4 * k + 1] = b
            pairs[4 * k + 2] = c
            pairs[4 * k + 3] = d


@wp.func_native("""
for (int l = 0; l < 16; ++l) {
    if (hit[l] > 0.f) {
        int k = count.data[which][l]++;
        if (4 * k + 3 < pairs.shape[0]) {
            pairs.data[4 * k][l] = a;
            pairs.data[4 * k + 1][l] = b;
            pairs.data[4 * k + 2][l] = c;
            pairs.data[4 * k + 3][l] = d;
        }
    }
}
""")
def append(hit: lane, count: wp.array(dtype=lane_int), which: int, pairs: wp.array(dtype=lane_int), a: int, b: int, c: int, d: int): ...  # noqa: E501, F811


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
def near_triangle(t: Any, i: int, f0: int, f1: int, f2: int, far: Any, slack: float):
    """Positive where vertex i is within ``far`` of a triangle's plane and over the triangle or its margin."""
    third = 1.0 / 3.0
    ax = t.x[f1] - t.x[f0]
    ay = t.y[f1] - t.y[f0]
    az = t.z[f1] - t.z[f0]
    bx = t.x[f2] - t.x[f0]
    by = t.y[f2] - t.y[f0]
    bz = t.z[f2] - t.z[f0]
    # from the centroid
    dx = t.x[i] - t.x[f0] - (ax + bx) * third
    dy = t.y[i] - t.y[f0] - (ay + by) * third
    dz = t.z[i] - t.z[f0] - (az + bz) * third
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
    inside = least(-(v + w), least(v, w)) + nn * (third + slack)
    return least(times(nn, times(far, far)) - times(h, h), inside)


@wp.func
def near_edges(t: Any, e0: int, e1: int, f0: int, f1: int, far: Any):
    """Positive where two edges are within ``far`` of each other."""
    rx = t.x[e0] - t.x[f0]
    ry = t.y[e0] - t.y[f0]
    rz = t.z[e0] - t.z[f0]
    ax = t.x[e1] - t.x[e0]
    ay = t.y[e1] - t.y[e0]
    az = t.z[e1] - t.z[e0]
    bx = t.x[f1] - t.x[f0]
    by = t.y[f1] - t.y[f0]
    bz = t.z[f1] - t.z[f0]
    s, q = closest_on_edges(rx, ry, rz, ax, ay, az, bx, by, bz)
    cx = rx + times(s, ax) - times(q, bx)
    cy = ry + times(s, ay) - times(q, by)
    cz = rz + times(s, az) - times(q, bz)
    return times(far, far) - times(cx, cx) - times(cy, cy) - times(cz, cz)


@wp.func
def neighbours(topo: Topology, i: int, j: int):
    """Whether two vertices are so close at rest that their elements' pairs are listed beforehand."""
    return wp.length_sq(topo.rest[i] - topo.rest[j]) < topo.ring_sq


@wp.func
def find_vertex_triangle(t: Any, topo: Topology, a: int, b: int, far: Any, slack: float):
    """Vertices of block a near triangles of block b."""
    third = 1.0 / 3.0
    for j in range(topo.block_face_start[b], topo.block_face_start[b + 1]):
        f = topo.block_face[j]
        f0 = f[0]
        f1 = f[1]
        f2 = f[2]
        mx = (t.x[f0] + t.x[f1] + t.x[f2]) * third
        my = (t.y[f0] + t.y[f1] + t.y[f2]) * third
        mz = (t.z[f0] + t.z[f1] + t.z[f2]) * third
        reach = far + fill(far, topo.block_face_reach[j])
        reach = times(reach, reach)
        for k in range(topo.block_vertex_start[a], topo.block_vertex_start[a + 1]):
            i = topo.block_vertex[k]
            dx = t.x[i] - mx
            dy = t.y[i] - my
            dz = t.z[i] - mz
            hit = reach - times(dx, dx) - times(dy, dy) - times(dz, dz)
            if anywhere(hit):
                if not (neighbours(topo, i, f0) or neighbours(topo, i, f1) or neighbours(topo, i, f2)):
                    hit = near_triangle(t, i, f0, f1, f2, far, slack)
                    append(hit, t.pair_count, 0, t.vertex_triangle, i, f0, f1, f2)


@wp.func
def find_edge_edge(t: Any, topo: Topology, a: int, b: int, far: Any):
    """Edges of block a near edges of another block b."""
    for j in range(topo.block_edge_start[a], topo.block_edge_start[a + 1]):
        e = topo.block_edge[j]
        e0 = e[0]
        e1 = e[1]
        mx = (t.x[e0] + t.x[e1]) * 0.5
        my = (t.y[e0] + t.y[e1]) * 0.5
        mz = (t.z[e0] + t.z[e1]) * 0.5
        for k in range(topo.block_edge_start[b], topo.block_edge_start[b + 1]):
            f = topo.block_edge[k]
            f0 = f[0]
            f1 = f[1]
            reach = far + fill(far, topo.block_edge_reach[j] + topo.block_edge_reach[k])
            dx = mx - (t.x[f0] + t.x[f1]) * 0.5
            dy = my - (t.y[f0] + t.y[f1]) * 0.5
            dz = mz - (t.z[f0] + t.z[f1]) * 0.5
            hit = times(reach, reach) - times(dx, dx) - times(dy, dy) - times(dz, dz)
            if anywhere(hit):
                if not (
                    neighbours(topo, e0, f0)
                    or neighbours(topo, e0, f1)
                    or neighbours(topo, e1, f0)
                    or neighbours(topo, e1, f1)
                ):
                    hit = near_edges(t, e0, e1, f0, f1, far)
                    append(hit, t.pair_count, 1, t.edge_edge, e0, e1, f0, f1)


@wp.func
def blocks_meet(t: Any, topo: Topology, a: int, b: int, reach: Any):
    """The largest of reach^2 - distance^2 over vertices of two blocks that are no neighbours at rest."""
    best = float(-1.0)
    for k in range(topo.block_vertex_start[a], topo.block_vertex_start[a + 1]):
        i = topo.block_vertex[k]
        for m in range(topo.block_vertex_start[b], topo.block_vertex_start[b + 1]):
            j = topo.block_vertex[m]
            dx = t.x[i] - t.x[j]
            dy = t.y[i] - t.y[j]
            dz = t.z[i] - t.z[j]
            hit = largest(reach - times(dx, dx) - times(dy, dy) - times(dz, dz))
            if hit > best:
                if not neighbours(topo, i, j):
                    best = hit
    return best


@wp.func
def find_pairs(t: Any, topo: Topology, margin: float, slack: float, thread: int, threads: int):
    """List all pairs nearer than the thickness and the margin.

    Elements of neighbouring cells come from a list made beforehand. For all others, elements that touch have
    vertices within an edge's length of each other: a flat cloth has none, and costs a look at its blocks.
    """
    m = topo.blocks
    far = t.scalars[THICKNESS] + fill(t.x[0], margin)
    reach = far + fill(far, topo.contact_reach)
    reach2 = times(reach, reach)
    for a in range(thread, m, threads):
        lx = t.bounds[a] - reach
        ly = t.bounds[m + a] - reach
        lz = t.bounds[2 * m + a] - reach
        hx = t.bounds[3 * m + a] + reach
        hy = t.bounds[4 * m + a] + reach
        hz = t.bounds[5 * m + a] + reach
        for b in range(a + 1, m):
            gx = most(lx - t.bounds[3 * m + b], t.bounds[b] - hx)
            gy = most(ly - t.bounds[4 * m + b], t.bounds[m + b] - hy)
            gz = most(lz - t.bounds[5 * m + b], t.bounds[2 * m + b] - hz)
            if anywhere(-most(gx, most(gy, gz))):
                if blocks_meet(t, topo, a, b, reach2) > 0.0:
                    find_vertex_triangle(t, topo, a, b, far, slack)
                    find_vertex_triangle(t, topo, b, a, far, slack)
                    find_edge_edge(t, topo, a, b, far)
    for k in range(thread, topo.ring_triangle.shape[0], threads):
        q = topo.ring_triangle[k]
        hit = near_triangle(t, q[0], q[1], q[2], q[3], far, slack)
        append(hit, t.pair_count, 0, t.vertex_triangle, q[0], q[1], q[2], q[3])
    for k in range(thread, topo.ring_edge.shape[0], threads):
        q = topo.ring_edge[k]
        hit = near_edges(t, q[0], q[1], q[2], q[3], far)
        append(hit, t.pair_count, 1, t.edge_edge, q[0], q[1], q[2], q[3])


@wp.func
def move(t: Any, n: int, i: int, dx: float, dy: float, dz: float, s: float, threads: int):
    """Move particle i by s (dx, dy, dz): at once where one thread works, summed in fixed point where many do."""
    if threads > 1:
        if s != 0.0:
            wp.atomic_add(t.moved, i, int(wp.rint(dx * s / UNIT)))
            wp.atomic_add(t.moved, n + i, int(wp.rint(dy * s / UNIT)))
            wp.atomic_add(t.moved, 2 * n + i, int(wp.rint(dz * s / UNIT)))
            wp.atomic_add(t.moved, 3 * n + i, 1)
    else:
        t.x[i] = t.x[i] + dx * s
        t.y[i] = t.y[i] + dy * s
        t.z[i] = t.z[i] + dz * s


@wp.func
def move(t: Any, n: int, i: Any, dx: Any, dy: Any, dz: Any, s: Any, threads: int):  # noqa: F811
    place(t.x, i, gather(t.x, i) + times(dx, s))
    place(t.y, i, gather(t.y, i) + times(dy, s))
    place(t.z, i, gather(t.z, i) + times(dz, s))


@wp.func
def part(t: Any, n: int, a: Any, b: Any, c: Any, d: Any, ka: Any, kb: Any, kc: Any, kd: Any, nx: Any, ny: Any, nz: Any, on: Any, leave: Any, threads: int):  # noqa: E501
    """Keep sum k_i x_i at least a thickness along the normal, with friction; ``on`` is positive where it counts."""
    zero = fill(ka, 0.0)
    pxs = times(ka, gather(t.px, a)) + times(kb, gather(t.px, b)) + times(kc, gather(t.px, c)) + times(kd, gather(t.px, d))
    pys = times(ka, gather(t.py, a)) + times(kb, gather(t.py, b)) + times(kc, gather(t.py, c)) + times(kd, gather(t.py, d))
    pzs = times(ka, gather(t.pz, a)) + times(kb, gather(t.pz, b)) + times(kc, gather(t.pz, c)) + times(kd, gather(t.pz, d))
    gx = times(ka, gather(t.x, a)) + times(kb, gather(t.x, b)) + times(kc, gather(t.x, c)) + times(kd, gather(t.x, d))
    gy = times(ka, gather(t.y, a)) + times(kb, gather(t.y, b)) + times(kc, gather(t.y, c)) + times(kd, gather(t.y, d))
    gz = times(ka, gather(t.z, a)) + times(kb, gather(t.z, b)) + times(kc, gather(t.z, c)) + times(kd, gather(t.z, d))
    gap = times(gx, nx) + times(gy, ny) + times(gz, nz) - t.scalars[THICKNESS]
    on = least(on, -gap)
    if anywhere(on):
        ux = gx - pxs
        uy = gy - pys
        uz = gz - pzs
        un = times(ux, nx) + times(uy, ny) + times(uz, nz)
        push = least(-gap, most(-un, zero) + leave)
        tx = ux - times(un, nx)
        ty = uy - times(un, ny)
        tz = uz - times(un, nz)
        slip = root(times(tx, tx) + times(ty, ty) + times(tz, tz) + fill(ka, 1.0e-24))
        hold = least(over(times(t.scalars[FRICTION], push), slip), fill(ka, 1.0))
        dx = times(push, nx) - times(hold, tx)
        dy = times(push, ny) - times(hold, ty)
        dz = times(push, nz) - times(hold, tz)
        wa = times(ka, gather(t.w, a))
        wb = times(kb, gather(t.w, b))
        wc = times(kc, gather(t.w, c))
        wd = times(kd, gather(t.w, d))
        weight = times(wa, ka) + times(wb, kb) + times(wc, kc) + times(wd, kd) + fill(ka, 1.0e-9)
        s = choose(on, over(fill(ka, 1.0), weight), zero)
        move(t, n, a, dx, dy, dz, times(s, wa), threads)
        move(t, n, b, dx, dy, dz, times(s, wb), threads)
        move(t, n, c, dx, dy, dz, times(s, wc), threads)
        move(t, n, d, dx, dy, dz, times(s, wd), threads)


@wp.func
def touch_vertex_triangle(t: Any, n: int, dt: float, thread: int, threads: int):
    """Vertices against triangles, where the vertex stood over the triangle when the substep began."""
    like = t.x[0]
    count = wp.min(highest(t.pair_count[0]), t.vertex_triangle.shape[0] / 4)
    # what was farther than this when the substep began is not reached in it
    reach = t.scalars[THICKNESS] + root(t.notes[SPEED]) * (3.0 * dt) + fill(like, 10.0 * dt * dt)
    leave = fill(like, LEAVE_SPEED * dt)
    one = fill(like, 1.0)
    for k in range(thread, count, threads):
        a = t.vertex_triangle[4 * k]
        b = t.vertex_triangle[4 * k + 1]
        c = t.vertex_triangle[4 * k + 2]
        d = t.vertex_triangle[4 * k + 3]
        bx = gather(t.px, b)
        by = gather(t.py, b)
        bz = gather(t.pz, b)
        rx = gather(t.px, a) - bx
        ry = gather(t.py, a) - by
        rz = gather(t.pz, a) - bz
        ex = gather(t.px, c) - bx
        ey = gather(t.py, c) - by
        ez = gather(t.pz, c) - bz
        fx = gather(t.px, d) - bx
        fy = gather(t.py, d) - by
        fz = gather(t.pz, d) - bz
        nx = times(ey, fz) - times(ez, fy)
        ny = times(ez, fx) - times(ex, fz)
        nz = times(ex, fy) - times(ey, fx)
        nn = times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(like, 1.0e-20)
        length = root(nn)
        h = over(times(rx, nx) + times(ry, ny) + times(rz, nz), length)
        on = times(within(like, k, t.pair_count[0]), reach - size_of(h))
        if anywhere(on):
            v = over(
                times(times(ry, fz) - times(rz, fy), nx)
                + times(times(rz, fx) - times(rx, fz), ny)
                + times(times(rx, fy) - times(ry, fx), nz),
                nn,
            )
            w = over(
                times(times(ey, rz) - times(ez, ry), nx)
                + times(times(ez, rx) - times(ex, rz), ny)
                + times(times(ex, ry) - times(ey, rx), nz),
                nn,
            )
            u = one - v - w
            # edges of the triangle belong to the edge contacts; a little overlap does no harm
            on = least(on, least(u, least(v, w)) + fill(like, 1.0e-3))
            s = over(choose(h, one, -one), length)
            part(t, n, a, b, c, d, one, -u, -v, -w, times(nx, s), times(ny, s), times(nz, s), on, leave, threads)


@wp.func
def touch_edge_edge(t: Any, n: int, dt: float, thread: int, threads: int):
    """Edges against edges, along the line between their closest points when the substep began."""
    like = t.x[0]
    count = wp.min(highest(t.pair_count[1]), t.edge_edge.shape[0] / 4)
    reach = t.scalars[THICKNESS] + root(t.notes[SPEED]) * (3.0 * dt) + fill(like, 10.0 * dt * dt)
    reach2 = times(reach, reach)
    leave = fill(like, LEAVE_SPEED * dt)
    one = fill(like, 1.0)
    for k in range(thread, count, threads):
        a = t.edge_edge[4 * k]
        b = t.edge_edge[4 * k + 1]
        c = t.edge_edge[4 * k + 2]
        d = t.edge_edge[4 * k + 3]
        x0 = gather(t.px, a)
        y0 = gather(t.py, a)
        z0 = gather(t.pz, a)
        x1 = gather(t.px, c)
        y1 = gather(t.py, c)
        z1 = gather(t.pz, c)
        ex = gather(t.px, b) - x0
        ey = gather(t.py, b) - y0
        ez = gather(t.pz, b) - z0
        fx = gather(t.px, d) - x1
        fy = gather(t.py, d) - y1
        fz = gather(t.pz, d) - z1
        rx = x0 - x1
        ry = y0 - y1
        rz = z0 - z1
        s, q = closest_on_edges(rx, ry, rz, ex, ey, ez, fx, fy, fz)
        cx = rx + times(s, ex) - times(q, fx)
        cy = ry + times(s, ey) - times(q, fy)
        cz = rz + times(s, ez) - times(q, fz)
        cc = times(cx, cx) + times(cy, cy) + times(cz, cz)
        on = times(within(like, k, t.pair_count[1]), reach2 - cc)
        if anywhere(on):
            inv = over(one, root(cc + fill(like, 1.0e-20)))
            part(t, n, a, b, c, d, one - s, s, q - one, -q, times(cx, inv), times(cy, inv), times(cz, inv), on, leave, threads)  # noqa: E501


@wp.func
def take_moves(t: Any, n: int, thread: int, threads: int):
    """Apply the summed moves of many threads: the mean over each particle's contacts."""
    if threads > 1:
        for i in range(thread, n, threads):
            count = t.moved[3 * n + i]
            if count > 0:
                s = UNIT / float(count)
                apply_move(t.x, i, float(t.moved[i]) * s)
                apply_move(t.y, i, float(t.moved[n + i]) * s)
                apply_move(t.z, i, float(t.moved[2 * n + i]) * s)
                t.moved[i] = 0
                t.moved[n + i] = 0
                t.moved[2 * n + i] = 0
                t.moved[3 * n + i] = 0


@wp.func
def apply_move(x: Any, i: int, d: float):
    """Add a float to element i."""
    x[i] = x[i] + fill(x[i], d)
