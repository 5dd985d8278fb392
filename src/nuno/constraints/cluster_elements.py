"""The elements of a cluster (`nuno.topology.element_clusters`), one after the other, by whoever holds their vertices.

The inner element's vertices stay at hand from the first element to the last, an outer element's own vertex while that
is solved. What the next element needs is read before the present one is solved: on CUDA reading takes as long as
solving.
"""

from typing import Any

import warp as wp

from nuno.constraints.mean_strain import MEAN, OWN, solve_mean
from nuno.constraints.tetrahedron import COLUMNS, element, loose_bulk, solve_tetrahedron
from nuno.constraints.viscosity import damp_tetrahedron
from nuno.numbers.element_access import at
from nuno.numbers.lanes import absolute, add, anywhere, choose, full_like, lane, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.vec3 import position, put_position, put_velocity, velocity
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
    """An element's rest shape and its filled fraction; with sixteen elements in a vector, those of all of them."""
    low = four(numbers, 2 * row)
    high = four(numbers, 2 * row + 1)
    return element(low[0], low[1], low[2], low[3], high[0], high[1], high[2]), high[3]


@wp.func
def numbers_of(numbers: wp.array(dtype=lane), row: int):
    k = row * COLUMNS
    shape = element(
        numbers[k], numbers[k + 1], numbers[k + 2], numbers[k + 3], numbers[k + 4], numbers[k + 5], numbers[k + 6]
    )
    return shape, numbers[k + 7]


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
    """An element's rest shape and moduli, as `solve_tetrahedron` asks for them."""
    own, firm = own_stiffness(t, table, k, slot, square, mu, bulk)
    shape, filled = numbers_of(table.number, row + slot)
    return shape, own * filled, firm * filled


@wp.func
def viscous_numbers(t: Any, table: Any, k: int, row: int, slot: int, time: Any, eta: Any):
    """An element's rest shape and viscosity, as `damp_tetrahedron` asks for them."""
    own = own_viscosity(t, table, k, slot, time, eta)
    shape, filled = numbers_of(table.number, row + slot)
    return shape, own * absolute(filled)


@wp.func
def vertex(t: Any, i: Any):
    """Vertex i's position [m], and its inverse mass [1/kg]."""
    return position(t, i), at(t.w, i)


@wp.func
def put_inner(t: Any, i: Any, j: Any, k: Any, m: Any, a: Any, b: Any, c: Any, d: Any):
    """Put the inner element's four vertices."""
    put_position(t, i, a)
    put_position(t, j, b)
    put_position(t, k, c)
    put_position(t, m, d)


@wp.func
def put_inner_velocities(t: Any, i: Any, j: Any, k: Any, m: Any, a: Any, b: Any, c: Any, d: Any):
    """Give the inner element's four vertices their velocities."""
    put_velocity(t, i, a)
    put_velocity(t, j, b)
    put_velocity(t, k, c)
    put_velocity(t, m, d)


@wp.func
def solve_cluster(
    t: Any, table: Any, k: int, row: int, count: int, i0: Any, i1: Any, i2: Any, i3: Any, i4: Any, i5: Any, i6: Any,
    i7: Any, square: float, stiff: Any, bulky: Any, limit: float,
):  # fmt: skip
    """The elasticity of cluster k: of the inner element (a, b, c, d), then of ``count`` outer ones.

    Args:
        t: The state.
        table: The clusters.
        k: Which.
        row: Where its numbers begin.
        count: How many outer elements it has.
        i0: The inner element's first vertex.
        i1: Its second.
        i2: Its third.
        i3: Its fourth.
        i4: The vertex of the outer element across from the first.
        i5: From the second.
        i6: From the third.
        i7: From the fourth.
        square: dt^2 [s2].
        stiff: The moduli where all elements have the same, as `stiffness` gives them.
        bulky: The second.
        limit: As `solve_tetrahedron` has it [m].
    """
    a, wa = vertex(t, i0)
    b, wb = vertex(t, i1)
    c, wc = vertex(t, i2)
    d, wd = vertex(t, i3)
    shape, mu, bulk = elastic_numbers(t, table, k, row, 0, square, stiff, bulky)
    own = full_like(mu, 1.0)
    if anywhere(0.0 - mu):  # a negative filled fraction: the voxel's mean has the rest of the stiffness
        part = choose(mu, 0.0, MEAN)
        own = choose(mu, own, OWN)
        mu = absolute(mu)
        bulk = absolute(bulk)
        a, b, c, d = solve_mean(t, i4, i5, i6, i7, a, b, c, d, wa, wb, wc, wd, shape, part * mu, part * bulk)
    other, nu, firm = elastic_numbers(t, table, k, row, 1, square, stiff, bulky)
    e, we = vertex(t, i4)
    a, b, c, d = solve_tetrahedron(t, i0, i1, i2, i3, a, b, c, d, wa, wb, wc, wd, shape, own * mu, own * bulk, limit)
    if count < 1:
        put_inner(t, i0, i1, i2, i3, a, b, c, d)
        return
    shape, mu, bulk = elastic_numbers(t, table, k, row, 2, square, stiff, bulky)
    f, wf = vertex(t, i5)
    e, b, d, c = solve_tetrahedron(t, i4, i1, i3, i2, e, b, d, c, we, wb, wd, wc, other, own * nu, own * firm, limit)
    put_position(t, i4, e)
    if count < 2:
        put_inner(t, i0, i1, i2, i3, a, b, c, d)
        return
    other, nu, firm = elastic_numbers(t, table, k, row, 3, square, stiff, bulky)
    g, wg = vertex(t, i6)
    f, a, c, d = solve_tetrahedron(t, i5, i0, i2, i3, f, a, c, d, wf, wa, wc, wd, shape, own * mu, own * bulk, limit)
    put_position(t, i5, f)
    if count < 3:
        put_inner(t, i0, i1, i2, i3, a, b, c, d)
        return
    shape, mu, bulk = elastic_numbers(t, table, k, row, 4, square, stiff, bulky)
    h, wh = vertex(t, i7)
    g, d, b, a = solve_tetrahedron(t, i6, i3, i1, i0, g, d, b, a, wg, wd, wb, wa, other, own * nu, own * firm, limit)
    put_position(t, i6, g)
    if count < 4:
        put_inner(t, i0, i1, i2, i3, a, b, c, d)
        return
    h, c, a, b = solve_tetrahedron(t, i7, i2, i0, i1, h, c, a, b, wh, wc, wa, wb, shape, own * mu, own * bulk, limit)
    put_position(t, i7, h)
    put_inner(t, i0, i1, i2, i3, a, b, c, d)


@wp.func
def damp_cluster(
    t: Any, table: Any, k: int, row: int, count: int, i0: Any, i1: Any, i2: Any, i3: Any, i4: Any, i5: Any, i6: Any,
    i7: Any, time: Any, every: Any,
):  # fmt: skip
    """The viscosity of cluster k, as `solve_cluster`.

    ``time`` is 2 tau dt [s2], ``every`` is mu times that where all elements have the same.
    """
    a, wa = vertex(t, i0)
    b, wb = vertex(t, i1)
    c, wc = vertex(t, i2)
    d, wd = vertex(t, i3)
    va = velocity(t, i0)
    vb = velocity(t, i1)
    vc = velocity(t, i2)
    vd = velocity(t, i3)
    shape, eta = viscous_numbers(t, table, k, row, 0, time, every)
    other, thick = viscous_numbers(t, table, k, row, 1, time, every)
    e, we = vertex(t, i4)
    ve = velocity(t, i4)
    va, vb, vc, vd = damp_tetrahedron(a, b, c, d, va, vb, vc, vd, wa, wb, wc, wd, shape, eta)
    if count < 1:
        put_inner_velocities(t, i0, i1, i2, i3, va, vb, vc, vd)
        return
    shape, eta = viscous_numbers(t, table, k, row, 2, time, every)
    f, wf = vertex(t, i5)
    vf = velocity(t, i5)
    ve, vb, vd, vc = damp_tetrahedron(e, b, d, c, ve, vb, vd, vc, we, wb, wd, wc, other, thick)
    put_velocity(t, i4, ve)
    if count < 2:
        put_inner_velocities(t, i0, i1, i2, i3, va, vb, vc, vd)
        return
    other, thick = viscous_numbers(t, table, k, row, 3, time, every)
    g, wg = vertex(t, i6)
    vg = velocity(t, i6)
    vf, va, vc, vd = damp_tetrahedron(f, a, c, d, vf, va, vc, vd, wf, wa, wc, wd, shape, eta)
    put_velocity(t, i5, vf)
    if count < 3:
        put_inner_velocities(t, i0, i1, i2, i3, va, vb, vc, vd)
        return
    shape, eta = viscous_numbers(t, table, k, row, 4, time, every)
    h, wh = vertex(t, i7)
    vh = velocity(t, i7)
    vg, vd, vb, va = damp_tetrahedron(g, d, b, a, vg, vd, vb, va, wg, wd, wb, wa, other, thick)
    put_velocity(t, i6, vg)
    if count < 4:
        put_inner_velocities(t, i0, i1, i2, i3, va, vb, vc, vd)
        return
    vh, vc, va, vb = damp_tetrahedron(h, c, a, b, vh, vc, va, vb, wh, wc, wa, wb, shape, eta)
    put_velocity(t, i7, vh)
    put_inner_velocities(t, i0, i1, i2, i3, va, vb, vc, vd)
