"""A soft body's substep as a list of phases, and the kernels that walk through it.

The phases around the tetrahedra are those of a cloth (`nuno.plans.cloth_substep`); so are the plans, and what
``thread`` and ``threads`` mean.
"""

from typing import Any

import warp as wp

from nuno.constraints.cluster_elements import damp_cluster, shape_of, solve_cluster, stiffness
from nuno.constraints.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.constraints.position_shifts import clear_shifts
from nuno.contact.particle.shape_contact import touch_shapes
from nuno.numbers.element_access import corner
from nuno.numbers.lanes import LANES, add, barrier, full_like, lane_max, mul, shares_work, sub  # noqa: F401
from nuno.plans.cloth_substep import near_features, near_shapes, solve_features
from nuno.plans.simd_plan import as_lanes, by_sixteen
from nuno.plans.soft_prefetch import elastic_ahead, viscous_ahead
from nuno.state.cloth_state import CLOCK, COMPLIANT_GRIPS, DAMPING, MOTION, SHAPES, SPEED, VELOCITIES, Settings, Shapes
from nuno.state.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.state.soft_state import (
    INVERTED,
    SEEN,
    FarSides,
    Sides,
    SimdClusters,
    SoftDouble,
    SoftDoubleLanes,
    SoftFloat,
    SoftLanes,
    SoftSizes,
    Tetrahedra,
    view,
)


@wp.func
def advance_notes(t: Any, rank: int):
    """Carry what was seen in the last substep over to this one; one thread does it."""
    if rank == 0:
        t.notes[INVERTED] = t.notes[SEEN]
        t.notes[SEEN] = full_like(t.x[0], 0.0)


@wp.func
def solve_clusters(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The elasticity of the tetrahedra of one colour's clusters."""
    square = run.dt * run.dt
    limit = wp.min(table.speed * run.dt, 0.5 * table.height)
    mu, bulk = stiffness(t, square)
    for k in range(first + rank, last, size):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        solve_cluster(t, table, k, row, count, a, b, c, d, e, f, g, h, square, mu, bulk, limit)


@wp.func
def damp_clusters(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The viscosity of the tetrahedra of one colour's clusters, over ``run.damped`` substeps."""
    time = t.scalars[DAMPING] * (2.0 * run.dt * float(run.damped))
    eta = t.mu[0] * time
    for k in range(first + rank, last, size):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        damp_cluster(t, table, k, row, count, a, b, c, d, e, f, g, h, time, eta)


@wp.func
def viscous(t: Any, table: Any, run: Settings, rank: int, size: int):
    """One pass over the tetrahedra's viscosity, colour by colour."""
    for c in range(table.colour.shape[0] - 1):
        damp_clusters(t, table, run, table.colour[c], table.colour[c + 1], rank, size)
        barrier(size)


@wp.func
def viscous(t: SoftFloat, table: Tetrahedra, run: Settings, rank: int, size: int):
    viscous_alone(t, table, run, rank, size)


@wp.func
def viscous(t: SoftDouble, table: Tetrahedra, run: Settings, rank: int, size: int):
    viscous_alone(t, table, run, rank, size)


@wp.func
def viscous_alone(t: Any, table: Tetrahedra, run: Settings, rank: int, size: int):
    """`viscous` of one world: by threads that share it, or by one."""
    if shares_work(size):
        viscous_ahead(t, table, run, rank, size, size)
    else:
        for c in range(table.colour.shape[0] - 1):
            damp_clusters(t, table, run, table.colour[c], table.colour[c + 1], 0, 1)


@wp.func
def elastic(t: Any, table: Any, run: Settings, rank: int, size: int):
    """One pass over the tetrahedra's elasticity, colour by colour, always in this order: at rest nothing moves."""
    for c in range(table.colour.shape[0] - 1):
        solve_clusters(t, table, run, table.colour[c], table.colour[c + 1], rank, size)
        barrier(size)


@wp.func
def elastic(t: SoftFloat, table: Tetrahedra, run: Settings, rank: int, size: int):
    elastic_alone(t, table, run, rank, size)


@wp.func
def elastic(t: SoftDouble, table: Tetrahedra, run: Settings, rank: int, size: int):
    elastic_alone(t, table, run, rank, size)


@wp.func
def elastic_alone(t: Any, table: Tetrahedra, run: Settings, rank: int, size: int):
    """`elastic` of one world: by threads that share it, or by one."""
    if shares_work(size):
        elastic_ahead(t, table, run, rank, size, size)
    else:
        for c in range(table.colour.shape[0] - 1):
            solve_clusters(t, table, run, table.colour[c], table.colour[c + 1], 0, 1)


@wp.func
def touch_sides(t: Any, sides: Sides, run: Settings, shapes: Shapes, rank: int, size: int):
    """Edges and triangles against the sharp shapes nearby."""
    solve_features(t, sides, run, shapes, rank, size)


@wp.func
def touch_sides(t: Any, sides: FarSides, run: Settings, shapes: Shapes, rank: int, size: int):
    return


@wp.func
def goes_on(t: Any, sides: Sides):
    """Return whether the kernel does the substep that comes next."""
    return True


@wp.func
def goes_on(t: Any, sides: FarSides):
    return t.feature_shapes[0] == 0


@wp.func
def advance(
    t: Any, near: Any, topo: Tetrahedra, sides: Any, run: Settings, shapes: Shapes, begin: int, substeps: int,
    rank: int, size: int,
):  # fmt: skip
    """The phases of substeps ``begin`` to ``substeps``; ``near`` is as `nuno.plans.cloth_substep.advance` has it.

    Returns:
        The substep before which it stopped: ``substeps``, or with `FarSides` the first that something sharp is near in.
    """
    n = topo.particles
    done = int(begin)
    while done < substeps:
        k = int(done)
        if run.parts & MOTION != 0 and (run.first + k) % run.frame == 0:
            near_shapes(near, n, run, shapes, rank, size)
            near_features(near, sides, run, shapes, rank, size)
        if not goes_on(t, sides):
            break
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                forget_loads(t, run, rank, size)
            tick(t, run, rank)
            advance_notes(t, rank)
            if run.damped != 0 and (run.first + k) % run.frame % wp.max(run.damped, 1) == 0:
                viscous(t, topo, run, rank, size)
            predict(t, n, run, rank, size)
            barrier(size)
            hold_vertices(t, run, rank, size)
            barrier(size)
            elastic(t, topo, run, rank, size)
        if run.pulled != 0 and run.parts & COMPLIANT_GRIPS != 0:
            pull_points(t, run, rank, size)
            barrier(size)
        if run.parts & SHAPES != 0:
            touch_sides(t, sides, run, shapes, rank, size)
            read_loads(t, run, rank, size)
            barrier(size)
            touch_shapes(t, n, shapes, run.dt, rank, size)
            barrier(size)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, rank)
            barrier(size)
            clear_shifts(t, n, rank, size)
            read_velocities(t, n, run, rank, size)
            round_places(near, t, n, rank, size)
            barrier(size)
        done = k + 1
    return done


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_worlds")
def run_soft_worlds(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_lanes")
def run_soft_lanes(
    s: SoftLanes, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.func
def soft_by_sixteen(p: Any, t: Any, simd: SimdClusters, m: int):
    """`by_sixteen`, with what soft bodies alone have."""
    p = by_sixteen(p, t, simd, m)
    p.shift_x = as_lanes(t.shift_x, m)
    p.shift_y = as_lanes(t.shift_y, m)
    p.shift_z = as_lanes(t.shift_z, m)
    return p


@wp.func
def advance_simd(
    t: Any, p: Any, near: SoftFloat, nearby: SoftLanes, n: int, simd: SimdClusters, sides: Sides, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """`advance` with its loops by sixteen; ``p`` is ``t`` by sixteen particles, ``nearby`` is ``near``."""
    m = (n + LANES - 1) / LANES
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, 0, 1)
                near_features(near, sides, run, shapes, 0, 1)
                forget_loads(t, run, 0, 1)
            tick(t, run, 0)
            advance_notes(t, 0)
            if run.damped != 0 and (run.first + k) % run.frame % wp.max(run.damped, 1) == 0:
                viscous(t, simd, run, 0, 1)
            predict(p, m, run, 0, 1)
            hold_vertices(t, run, 0, 1)
            elastic(t, simd, run, 0, 1)
        if run.parts & COMPLIANT_GRIPS != 0:
            pull_points(t, run, 0, 1)
        if run.parts & SHAPES != 0:
            touch_sides(t, sides, run, shapes, 0, 1)
            read_loads(t, run, 0, 1)
            p.notes[CLOCK] = full_like(p.x[0], t.notes[CLOCK])  # moving shapes are where the clock says
            touch_shapes(p, m, shapes, run.dt, 0, 1)
        if run.parts & VELOCITIES != 0:
            reset_speed(p, 0)
            clear_shifts(p, m, 0, 1)
            read_velocities(p, m, run, 0, 1)
            round_places(nearby, p, m, 0, 1)
            t.notes[SPEED] = lane_max(p.notes[SPEED])


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_simd")
def run_soft_simd(
    s: SoftFloat, topo: Tetrahedra, simd: SimdClusters, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time."""
    n = topo.particles
    t = view(s, wp.tid(), n, sizes)
    p = soft_by_sixteen(SoftLanes(), t, simd, (n + LANES - 1) / LANES)
    advance_simd(t, p, t, p, n, simd, sides, run, shapes, substeps)


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_worlds")
def run_soft_double_worlds(
    s: SoftDouble, near: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, sizes)
    advance(t, view(near, group, n, sizes), topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_lanes")
def run_soft_double_lanes(
    s: SoftDoubleLanes, near: SoftLanes, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings,
    shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, sizes)
    advance(t, view(near, group, n, sizes), topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_simd")
def run_soft_double_simd(
    s: SoftDouble, near: SoftFloat, topo: Tetrahedra, simd: SimdClusters, sides: Sides, sizes: SoftSizes, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, sizes)
    floats = view(near, wp.tid(), n, sizes)
    p = soft_by_sixteen(SoftDoubleLanes(), t, simd, m)
    advance_simd(t, p, floats, by_sixteen(SoftLanes(), floats, simd, m), n, simd, sides, run, shapes, substeps)
