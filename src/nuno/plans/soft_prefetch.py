"""The clusters by the threads of one CUDA block or several: each reads which its next one is while it works on one.

A colour of a body that fits a block has about as many clusters as the block has threads, and all wait for each other
before the next colour. Read only then, a cluster's vertices would come from far away in every colour anew.
"""

from typing import Any

import warp as wp

from nuno.constraints.cluster_elements import damp_cluster, solve_cluster, stiffness
from nuno.numbers.block_group import wait_for
from nuno.state.cloth_state import DAMPING, Settings
from nuno.state.soft_state import Tetrahedra


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int4 v = reinterpret_cast<const int4*>(corners.data)[i];
return {v.x, v.y, v.z, v.w};
#else
return corners.data[i];
#endif
""")
def four_corners(corners: wp.array(dtype=wp.vec4i), i: int) -> wp.vec4i:
    """Element i, on CUDA by one instruction."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int2 v = reinterpret_cast<const int2*>(pairs.data)[i];
return {v.x, v.y};
#else
return pairs.data[i];
#endif
""")
def pair(pairs: wp.array(dtype=wp.vec2i), i: int) -> wp.vec2i:
    """Element i, on CUDA by one instruction."""
    ...


@wp.func
def read_cluster(table: Tetrahedra, k: int):
    """The vertices of cluster k, and its shape; of the last cluster beyond it."""
    i = wp.min(k, table.rows - 1)
    return four_corners(table.inner, i), four_corners(table.outer, i), pair(table.shape, i)


@wp.func
def elastic_ahead(t: Any, table: Tetrahedra, run: Settings, crew: Any):
    """Go over the tetrahedra's elasticity once: `nuno.plans.soft_elastic.solve_colours` by a crew of many threads."""
    square = run.dt * run.dt
    limit = wp.min(table.speed * run.dt, 0.5 * table.height)
    mu, bulk = stiffness(t, square)
    colours = table.colour.shape[0] - 1
    first = table.colour[0]
    last = table.colour[1]
    inner, outer, shape = read_cluster(table, first + crew.rank)
    for colour in range(colours):
        stop = table.colour[wp.min(colour + 2, colours)]
        k = first + crew.rank
        if k >= last:
            inner, outer, shape = read_cluster(table, last + crew.rank)
        while k < last:
            p = inner
            q = outer
            now = shape
            inner, outer, shape = read_cluster(table, wp.where(k + crew.size < last, k + crew.size, last + crew.rank))
            solve_cluster(
                t, table, k, now[0], now[1], p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], square, mu, bulk, limit
            )
            k += crew.size
        first = last
        last = stop
        wait_for(crew)


@wp.func
def viscous_ahead(t: Any, table: Tetrahedra, run: Settings, crew: Any):
    """One pass over the tetrahedra's viscosity: `nuno.plans.soft_elastic.damp_colours` by a crew of many threads."""
    time = t.scalars[DAMPING] * (2.0 * run.dt * float(run.damped))
    eta = t.mu[0] * time
    colours = table.colour.shape[0] - 1
    first = table.colour[0]
    last = table.colour[1]
    inner, outer, shape = read_cluster(table, first + crew.rank)
    for colour in range(colours):
        stop = table.colour[wp.min(colour + 2, colours)]
        k = first + crew.rank
        if k >= last:
            inner, outer, shape = read_cluster(table, last + crew.rank)
        while k < last:
            p = inner
            q = outer
            now = shape
            inner, outer, shape = read_cluster(table, wp.where(k + crew.size < last, k + crew.size, last + crew.rank))
            damp_cluster(t, table, k, now[0], now[1], p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], time, eta)
            k += crew.size
        first = last
        last = stop
        wait_for(crew)
