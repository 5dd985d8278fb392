"""The elements of a cluster (`nuno.topology.element_clusters`), one after the other, by whoever holds their vertices.

The inner element's vertices stay at hand from the first element to the last, an outer element's own vertex while that
is solved. What the next element needs is read before the present one is solved: on CUDA reading takes as long as
solving.
"""

from typing import Any

import warp as wp

from nuno.constraints.mean_strain import MEAN, OWN, solve_mean
from nuno.constraints.tetrahedron import COLUMNS, loose_bulk, solve_tetrahedron
from nuno.constraints.viscosity import damp_tetrahedron
from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import absolute, add, anywhere, choose, full_like, lane, mul, sub  # noqa: F401
from nuno.state.soft_state import CLUSTER, SimdClusters, Tetrahedra


@wp.func_native("""
#if defined(__CUDA_ARCH__)
float4 v = reinterpret_cast<const float4*>(numbers.data)[i];
return {v.x, v.y, v.z, v.w};
#else
return numbers.data[i];
#endif
""")
def four(numbers: wp.array(dtype=wp.vec4), i: int) -> wp.vec4:
    """Element i, on CUDA by one instruction."""
    ...


@wp.func
def numbers_of(numbers: wp.array(dtype=wp.vec4), row: int):
    """An element's `nuno.constraints.tetrahedron.COLUMNS`; with sixteen elements in a vector, of all of them."""
    low = four(numbers, 2 * row)
    high = four(numbers, 2 * row + 1)
    return low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]


@wp.func
def numbers_of(numbers: wp.array(dtype=lane), row: int):
    k = row * COLUMNS
    m11 = numbers[k]
    m22 = numbers[k + 1]
    m33 = numbers[k + 2]
    m12 = numbers[k + 3]
    m13 = numbers[k + 4]
    m23 = numbers[k + 5]
    return m11, m22, m33, m12, m13, m23, numbers[k + 6], numbers[k + 7]


@wp.func
def shape_of(table: Tetrahedra, k: int):
    """Return where the numbers of cluster k begin, and how many outer elements it has."""
    return table.shape[k][0], table.shape[k][1]


@wp.func
def shape_of(table: SimdClusters, k: int):
    return k * CLUSTER, table.count[k]


@wp.func
def stiffness(t: Any, square: float):
    """Both moduli of the elements, where all have the same, times dt^2."""
    mu = t.mu[0] * square
    return mu, loose_bulk(t, mu, t.bulk[0] * square)


@wp.func
def own_stiffness(t: Any, table: Tetrahedra, k: int, slot: int, square: float, mu: Any, bulk: Any):
    """Both moduli of one element times dt^2: those of all, or its own."""
    if table.differ == 0:
        return mu, bulk
    which = table.modulus[k * CLUSTER + slot]
    own = at(t.mu, which) * square
    return own, loose_bulk(t, own, at(t.bulk, which) * square)


@wp.func
def own_stiffness(t: Any, table: SimdClusters, k: int, slot: int, square: float, mu: float, bulk: float):
    if table.differ == 0:
        return lane(mu), lane(bulk)
    which = table.modulus[k * CLUSTER + slot]
    own = at(t.mu, which) * square
    return own, loose_bulk(t, own, at(t.bulk, which) * square)


@wp.func
def own_viscosity(t: Any, table: Tetrahedra, k: int, slot: int, time: Any, eta: Any):
    """The modulus mu of one element times ``time``: that of all, or its own."""
    if table.differ == 0:
        return eta
    return at(t.mu, table.modulus[k * CLUSTER + slot]) * time


@wp.func
def own_viscosity(t: Any, table: SimdClusters, k: int, slot: int, time: float, eta: float):
    if table.differ == 0:
        return lane(eta)
    return at(t.mu, table.modulus[k * CLUSTER + slot]) * time


@wp.func
def elastic_numbers(t: Any, table: Any, k: int, row: int, slot: int, square: float, mu: Any, bulk: Any):
    """Return what `solve_tetrahedron` asks of an element."""
    own, firm = own_stiffness(t, table, k, slot, square, mu, bulk)
    m11, m22, m33, m12, m13, m23, inverse, filled = numbers_of(table.number, row + slot)
    return m11, m22, m33, m12, m13, m23, inverse, own * filled, firm * filled


@wp.func
def viscous_numbers(t: Any, table: Any, k: int, row: int, slot: int, time: Any, eta: Any):
    """Return what `damp_tetrahedron` asks of an element."""
    own = own_viscosity(t, table, k, slot, time, eta)
    m11, m22, m33, m12, m13, m23, inverse, filled = numbers_of(table.number, row + slot)
    return m11, m22, m33, m12, m13, m23, inverse, own * absolute(filled)


@wp.func
def place_of(t: Any, i: Any):
    """Return where vertex i is [m], and its inverse mass [1/kg]."""
    return at(t.x, i), at(t.y, i), at(t.z, i), at(t.w, i)


@wp.func
def speed_of(t: Any, i: Any):
    """Vertex i's velocity [m/s]."""
    return at(t.vx, i), at(t.vy, i), at(t.vz, i)


@wp.func
def put_place(t: Any, i: Any, x: Any, y: Any, z: Any):
    """Put vertex i there [m]."""
    put(t.x, i, x)
    put(t.y, i, y)
    put(t.z, i, z)


@wp.func
def put_speed(t: Any, i: Any, x: Any, y: Any, z: Any):
    """Give vertex i this velocity [m/s]."""
    put(t.vx, i, x)
    put(t.vy, i, y)
    put(t.vz, i, z)


@wp.func
def put_inner(
    x: Any, y: Any, z: Any, a: Any, b: Any, c: Any, d: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any,
    cx: Any, cy: Any, cz: Any, dx: Any, dy: Any, dz: Any,
):  # fmt: skip
    """Put the inner element's four vertices, or their velocities."""
    put(x, a, ax)
    put(y, a, ay)
    put(z, a, az)
    put(x, b, bx)
    put(y, b, by)
    put(z, b, bz)
    put(x, c, cx)
    put(y, c, cy)
    put(z, c, cz)
    put(x, d, dx)
    put(y, d, dy)
    put(z, d, dz)


@wp.func
def solve_cluster(
    t: Any, table: Any, k: int, row: int, count: int, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any,
    square: float, stiff: Any, bulky: Any, limit: float,
):  # fmt: skip
    """The elasticity of cluster k: of the inner element (a, b, c, d), then of ``count`` outer ones.

    Args:
        t: The state.
        table: The clusters.
        k: Which.
        row: Where its numbers begin.
        count: How many outer elements it has.
        a: The inner element's first vertex.
        b: Its second.
        c: Its third.
        d: Its fourth.
        e: The vertex of the outer element across from the first.
        f: From the second.
        g: From the third.
        h: From the fourth.
        square: dt^2 [s2].
        stiff: The moduli where all elements have the same, as `stiffness` gives them.
        bulky: The second.
        limit: As `solve_tetrahedron` has it [m].
    """
    ax, ay, az, wa = place_of(t, a)
    bx, by, bz, wb = place_of(t, b)
    cx, cy, cz, wc = place_of(t, c)
    dx, dy, dz, wd = place_of(t, d)
    m11, m22, m33, m12, m13, m23, inverse, mu, bulk = elastic_numbers(t, table, k, row, 0, square, stiff, bulky)
    own = full_like(mu, 1.0)
    if anywhere(0.0 - mu):  # a negative filled fraction: the voxel's mean has the rest of the stiffness
        part = choose(mu, 0.0, MEAN)
        own = choose(mu, own, OWN)
        mu = absolute(mu)
        bulk = absolute(bulk)
        ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz = solve_mean(
            t, e, f, g, h, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, wa, wb, wc, wd,
            m11, m22, m33, m12, m13, m23, inverse, part * mu, part * bulk,
        )  # fmt: skip
    n11, n22, n33, n12, n13, n23, there, nu, firm = elastic_numbers(t, table, k, row, 1, square, stiff, bulky)
    ex, ey, ez, we = place_of(t, e)
    ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz = solve_tetrahedron(
        t, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, wa, wb, wc, wd,
        m11, m22, m33, m12, m13, m23, inverse, own * mu, own * bulk, limit,
    )  # fmt: skip
    if count < 1:
        put_inner(t.x, t.y, t.z, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz)
        return
    m11, m22, m33, m12, m13, m23, inverse, mu, bulk = elastic_numbers(t, table, k, row, 2, square, stiff, bulky)
    fx, fy, fz, wf = place_of(t, f)
    ex, ey, ez, bx, by, bz, dx, dy, dz, cx, cy, cz = solve_tetrahedron(
        t, e, b, d, c, ex, ey, ez, bx, by, bz, dx, dy, dz, cx, cy, cz, we, wb, wd, wc,
        n11, n22, n33, n12, n13, n23, there, own * nu, own * firm, limit,
    )  # fmt: skip
    put_place(t, e, ex, ey, ez)
    if count < 2:
        put_inner(t.x, t.y, t.z, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz)
        return
    n11, n22, n33, n12, n13, n23, there, nu, firm = elastic_numbers(t, table, k, row, 3, square, stiff, bulky)
    gx, gy, gz, wg = place_of(t, g)
    fx, fy, fz, ax, ay, az, cx, cy, cz, dx, dy, dz = solve_tetrahedron(
        t, f, a, c, d, fx, fy, fz, ax, ay, az, cx, cy, cz, dx, dy, dz, wf, wa, wc, wd,
        m11, m22, m33, m12, m13, m23, inverse, own * mu, own * bulk, limit,
    )  # fmt: skip
    put_place(t, f, fx, fy, fz)
    if count < 3:
        put_inner(t.x, t.y, t.z, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz)
        return
    m11, m22, m33, m12, m13, m23, inverse, mu, bulk = elastic_numbers(t, table, k, row, 4, square, stiff, bulky)
    hx, hy, hz, wh = place_of(t, h)
    gx, gy, gz, dx, dy, dz, bx, by, bz, ax, ay, az = solve_tetrahedron(
        t, g, d, b, a, gx, gy, gz, dx, dy, dz, bx, by, bz, ax, ay, az, wg, wd, wb, wa,
        n11, n22, n33, n12, n13, n23, there, own * nu, own * firm, limit,
    )  # fmt: skip
    put_place(t, g, gx, gy, gz)
    if count < 4:
        put_inner(t.x, t.y, t.z, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz)
        return
    hx, hy, hz, cx, cy, cz, ax, ay, az, bx, by, bz = solve_tetrahedron(
        t, h, c, a, b, hx, hy, hz, cx, cy, cz, ax, ay, az, bx, by, bz, wh, wc, wa, wb,
        m11, m22, m33, m12, m13, m23, inverse, own * mu, own * bulk, limit,
    )  # fmt: skip
    put_place(t, h, hx, hy, hz)
    put_inner(t.x, t.y, t.z, a, b, c, d, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz)


@wp.func
def damp_cluster(
    t: Any, table: Any, k: int, row: int, count: int, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any,
    time: Any, every: Any,
):  # fmt: skip
    """The viscosity of cluster k, as `solve_cluster`.

    ``time`` is 2 tau dt [s2], ``every`` is mu times that where all elements have the same.
    """
    ax, ay, az, wa = place_of(t, a)
    bx, by, bz, wb = place_of(t, b)
    cx, cy, cz, wc = place_of(t, c)
    dx, dy, dz, wd = place_of(t, d)
    sax, say, saz = speed_of(t, a)
    sbx, sby, sbz = speed_of(t, b)
    scx, scy, scz = speed_of(t, c)
    sdx, sdy, sdz = speed_of(t, d)
    m11, m22, m33, m12, m13, m23, inverse, eta = viscous_numbers(t, table, k, row, 0, time, every)
    n11, n22, n33, n12, n13, n23, there, thick = viscous_numbers(t, table, k, row, 1, time, every)
    ex, ey, ez, we = place_of(t, e)
    sex, sey, sez = speed_of(t, e)
    sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz = damp_tetrahedron(
        ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz,
        sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz, wa, wb, wc, wd,
        m11, m22, m33, m12, m13, m23, inverse, eta,
    )  # fmt: skip
    if count < 1:
        put_inner(t.vx, t.vy, t.vz, a, b, c, d, sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz)
        return
    m11, m22, m33, m12, m13, m23, inverse, eta = viscous_numbers(t, table, k, row, 2, time, every)
    fx, fy, fz, wf = place_of(t, f)
    sfx, sfy, sfz = speed_of(t, f)
    sex, sey, sez, sbx, sby, sbz, sdx, sdy, sdz, scx, scy, scz = damp_tetrahedron(
        ex, ey, ez, bx, by, bz, dx, dy, dz, cx, cy, cz,
        sex, sey, sez, sbx, sby, sbz, sdx, sdy, sdz, scx, scy, scz, we, wb, wd, wc,
        n11, n22, n33, n12, n13, n23, there, thick,
    )  # fmt: skip
    put_speed(t, e, sex, sey, sez)
    if count < 2:
        put_inner(t.vx, t.vy, t.vz, a, b, c, d, sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz)
        return
    n11, n22, n33, n12, n13, n23, there, thick = viscous_numbers(t, table, k, row, 3, time, every)
    gx, gy, gz, wg = place_of(t, g)
    sgx, sgy, sgz = speed_of(t, g)
    sfx, sfy, sfz, sax, say, saz, scx, scy, scz, sdx, sdy, sdz = damp_tetrahedron(
        fx, fy, fz, ax, ay, az, cx, cy, cz, dx, dy, dz,
        sfx, sfy, sfz, sax, say, saz, scx, scy, scz, sdx, sdy, sdz, wf, wa, wc, wd,
        m11, m22, m33, m12, m13, m23, inverse, eta,
    )  # fmt: skip
    put_speed(t, f, sfx, sfy, sfz)
    if count < 3:
        put_inner(t.vx, t.vy, t.vz, a, b, c, d, sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz)
        return
    m11, m22, m33, m12, m13, m23, inverse, eta = viscous_numbers(t, table, k, row, 4, time, every)
    hx, hy, hz, wh = place_of(t, h)
    shx, shy, shz = speed_of(t, h)
    sgx, sgy, sgz, sdx, sdy, sdz, sbx, sby, sbz, sax, say, saz = damp_tetrahedron(
        gx, gy, gz, dx, dy, dz, bx, by, bz, ax, ay, az,
        sgx, sgy, sgz, sdx, sdy, sdz, sbx, sby, sbz, sax, say, saz, wg, wd, wb, wa,
        n11, n22, n33, n12, n13, n23, there, thick,
    )  # fmt: skip
    put_speed(t, g, sgx, sgy, sgz)
    if count < 4:
        put_inner(t.vx, t.vy, t.vz, a, b, c, d, sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz)
        return
    shx, shy, shz, scx, scy, scz, sax, say, saz, sbx, sby, sbz = damp_tetrahedron(
        hx, hy, hz, cx, cy, cz, ax, ay, az, bx, by, bz,
        shx, shy, shz, scx, scy, scz, sax, say, saz, sbx, sby, sbz, wh, wc, wa, wb,
        m11, m22, m33, m12, m13, m23, inverse, eta,
    )  # fmt: skip
    put_speed(t, h, shx, shy, shz)
    put_inner(t.vx, t.vy, t.vz, a, b, c, d, sax, say, saz, sbx, sby, sbz, scx, scy, scz, sdx, sdy, sdz)
