"""Cloth against itself: contact and Coulomb friction of vertices with triangles and of edges with edges.

Candidates come from groups of neighbouring vertices whose bounding boxes meet, and stay valid until something may
have moved by half the margin. A contact's normal and weights are taken where the substep began, when nothing crossed:
that tells the side, so that a pair pressed through within a substep is put back, and what is done depends
on the present state alone, not on when the list was made.
"""

from typing import Any

import warp as wp

from nuno.contact.self.narrow_phase import closest_on_edges
from nuno.contact.self.neighbour_lists import swept
from nuno.numbers.element_access import at
from nuno.numbers.lanes import (  # noqa: F401 (add, div, mul, sub: Warp takes them for the operators)
    absolute,
    add,
    anywhere,
    choose,
    div,
    full_like,
    gather,
    lane_max_int,
    maximum,
    minimum,
    mul,
    place,
    relative_to,
    sqrt,
    sub,
    within,
)
from nuno.state.cloth_state import DEEPEST, FRICTION, THICKNESS, Settings

LEAVE_SPEED = wp.constant(0.5)
"""[m/s] Layers found too close part no faster than this."""
UNIT = wp.constant(1.0e-8)
"""[m] Step of the fixed-point sums: integers add up to the same whatever the order of threads."""
MAX_WEIGHT = wp.constant(63.0)
"""The greatest weight of a pair in the mean over a particle's contacts, where one that barely touches has 1."""


@wp.func
def move(t: Any, n: int, i: int, dx: float, dy: float, dz: float, s: float, g: int, size: int):
    """Move particle i by s (dx, dy, dz): at once where one thread works, summed in fixed point where many do.

    In the sum a contact counts ``g`` times.
    """
    if size > 1:
        if s != 0.0:
            wp.atomic_add(t.moved, i, g * int(wp.rint(dx * s / UNIT)))
            wp.atomic_add(t.moved, n + i, g * int(wp.rint(dy * s / UNIT)))
            wp.atomic_add(t.moved, 2 * n + i, g * int(wp.rint(dz * s / UNIT)))
            wp.atomic_add(t.moved, 3 * n + i, g)
    else:
        t.x[i] = t.x[i] + dx * s
        t.y[i] = t.y[i] + dy * s
        t.z[i] = t.z[i] + dz * s


@wp.func
def move(t: Any, n: int, i: Any, dx: Any, dy: Any, dz: Any, s: Any, g: int, size: int):
    place(t.x, i, gather(t.x, i) + dx * s)
    place(t.y, i, gather(t.y, i) + dy * s)
    place(t.z, i, gather(t.z, i) + dz * s)


@wp.func
def contact_weight(t: Any, gap: float):
    """Return the weight of a pair in the mean over a particle's contacts: the more, the deeper it is.

    Where all count alike, the many shallow contacts of a tight fold outvote the one that is about to be pressed
    through, and it is.
    """
    deep = wp.clamp(-gap / t.scalars[THICKNESS], 0.0, 1.0)
    return 1 + int(MAX_WEIGHT * deep * deep * deep)


@wp.func
def contact_weight(t: Any, gap: Any):
    return 1


@wp.func
def note_depth(notes: wp.array(dtype=float), far: float, size: int):
    """Keep how far a pair was within its thickness: on the other side it may stay (see `nuno.world.impacts`)."""
    if far > notes[DEEPEST]:
        if size > 1:
            wp.atomic_max(notes, DEEPEST, far)
        else:
            notes[DEEPEST] = far


@wp.func
def note_depth(notes: wp.array(dtype=Any), far: Any, size: int):
    notes[DEEPEST] = maximum(notes[DEEPEST], far)


@wp.func
def span(x: Any, a: Any, b: Any, c: Any, d: Any, ka: Any, kb: Any, kc: Any, kd: Any):
    """The sum of k_i x_i, the k adding up to zero."""
    base = gather(x, a)
    near = ka * relative_to(base, base) + kb * relative_to(gather(x, b), base)
    return near + kc * relative_to(gather(x, c), base) + kd * relative_to(gather(x, d), base)


@wp.func
def part(
    t: Any,
    n: int,
    a: Any,
    b: Any,
    c: Any,
    d: Any,
    ka: Any,
    kb: Any,
    kc: Any,
    kd: Any,
    nx: Any,
    ny: Any,
    nz: Any,
    on: Any,
    leave: Any,
    size: int,
):
    """Keep sum k_i x_i at least a thickness along the normal, with friction; ``on`` is positive where it counts."""
    zero = full_like(ka, 0.0)
    pxs = span(t.px, a, b, c, d, ka, kb, kc, kd)
    pys = span(t.py, a, b, c, d, ka, kb, kc, kd)
    pzs = span(t.pz, a, b, c, d, ka, kb, kc, kd)
    gx = span(t.x, a, b, c, d, ka, kb, kc, kd)
    gy = span(t.y, a, b, c, d, ka, kb, kc, kd)
    gz = span(t.z, a, b, c, d, ka, kb, kc, kd)
    gap = gx * nx + gy * ny + gz * nz - t.scalars[THICKNESS]
    on = minimum(on, -gap)
    if anywhere(on):
        note_depth(t.notes, choose(on, -gap, zero), size)
        ux = gx - pxs
        uy = gy - pys
        uz = gz - pzs
        un = ux * nx + uy * ny + uz * nz
        away = maximum(-un, zero) + leave
        if size > 1:
            # what an earlier pass did counts
            away = maximum(leave - un, zero)
        push = minimum(-gap, away)
        tx = ux - un * nx
        ty = uy - un * ny
        tz = uz - un * nz
        slip = sqrt(tx * tx + ty * ty + tz * tz + 1.0e-24)
        hold = minimum(t.scalars[FRICTION] * push / slip, 1.0)
        dx = push * nx - hold * tx
        dy = push * ny - hold * ty
        dz = push * nz - hold * tz
        wa = ka * gather(t.w, a)
        wb = kb * gather(t.w, b)
        wc = kc * gather(t.w, c)
        wd = kd * gather(t.w, d)
        weight = wa * ka + wb * kb + wc * kc + wd * kd + 1.0e-9
        s = choose(on, 1.0 / weight, zero)
        g = contact_weight(t, gap)
        move(t, n, a, dx, dy, dz, s * wa, g, size)
        move(t, n, b, dx, dy, dz, s * wb, g, size)
        move(t, n, c, dx, dy, dz, s * wc, g, size)
        move(t, n, d, dx, dy, dz, s * wd, g, size)


@wp.func
def touch_vertex_triangle(t: Any, n: int, run: Settings, rank: int, size: int):
    """Vertices against triangles, where the vertex stood over the triangle when the substep began."""
    like = full_like(t.x[0], 0.0)
    count = wp.min(lane_max_int(t.active_count[0]), t.active_triangle.shape[0] / 4)
    # what was farther than this when the substep began is not reached in it
    reach = t.scalars[THICKNESS] + swept(t, run)
    leave = full_like(like, LEAVE_SPEED * run.dt)
    one = full_like(like, 1.0)
    for k in range(rank, count, size):
        a = at(t.active_triangle, 4 * k)
        b = at(t.active_triangle, 4 * k + 1)
        c = at(t.active_triangle, 4 * k + 2)
        d = at(t.active_triangle, 4 * k + 3)
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
        nx = ey * fz - ez * fy
        ny = ez * fx - ex * fz
        nz = ex * fy - ey * fx
        nn = nx * nx + ny * ny + nz * nz + 1.0e-20
        length = sqrt(nn)
        h = (rx * nx + ry * ny + rz * nz) / length
        on = within(like, k, t.active_count[0]) * (reach - absolute(h))
        if anywhere(on):
            v = ((ry * fz - rz * fy) * nx + (rz * fx - rx * fz) * ny + (rx * fy - ry * fx) * nz) / nn
            w = ((ey * rz - ez * ry) * nx + (ez * rx - ex * rz) * ny + (ex * ry - ey * rx) * nz) / nn
            u = one - v - w
            # edges of the triangle belong to the edge contacts; a little overlap does no harm
            on = minimum(on, minimum(u, minimum(v, w)) + 1.0e-3)
            s = choose(h, one, -one) / length
            part(t, n, a, b, c, d, one, -u, -v, -w, nx * s, ny * s, nz * s, on, leave, size)


@wp.func
def touch_edge_edge(t: Any, n: int, run: Settings, rank: int, size: int):
    """Edges against edges, along the line between their closest points when the substep began."""
    like = full_like(t.x[0], 0.0)
    count = wp.min(lane_max_int(t.active_count[1]), t.active_edge.shape[0] / 4)
    reach = t.scalars[THICKNESS] + swept(t, run)
    reach2 = reach * reach
    leave = full_like(like, LEAVE_SPEED * run.dt)
    one = full_like(like, 1.0)
    for k in range(rank, count, size):
        a = at(t.active_edge, 4 * k)
        b = at(t.active_edge, 4 * k + 1)
        c = at(t.active_edge, 4 * k + 2)
        d = at(t.active_edge, 4 * k + 3)
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
        cx = rx + s * ex - q * fx
        cy = ry + s * ey - q * fy
        cz = rz + s * ez - q * fz
        cc = cx * cx + cy * cy + cz * cz
        on = within(like, k, t.active_count[1]) * (reach2 - cc)
        if anywhere(on):
            inv = one / sqrt(cc + 1.0e-20)
            part(
                t,
                n,
                a,
                b,
                c,
                d,
                one - s,
                s,
                q - one,
                -q,
                cx * inv,
                cy * inv,
                cz * inv,
                on,
                leave,
                size,
            )


@wp.func
def take_moves(t: Any, n: int, rank: int, size: int):
    """Apply the summed moves of many threads: the weighed mean over each particle's contacts."""
    if size > 1:
        # far away on CUDA: the next is fetched while one is looked at
        ahead = int(0)
        if rank < n:
            ahead = t.moved[3 * n + rank]
        for i in range(rank, n, size):
            count = ahead
            if i + size < n:
                ahead = t.moved[3 * n + i + size]
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
    x[i] = x[i] + d
