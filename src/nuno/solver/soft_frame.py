"""A soft body's substep as a list of phases, and the kernels that walk through it.

The phases around the tetrahedra are those of a cloth (`nuno.solver.frame`); so are the plans, and what ``thread`` and
``threads`` mean.
"""

from typing import Any

import warp as wp

from nuno.contact.renewal import shares_work
from nuno.contact.shapes import touch_shapes
from nuno.solver.frame import near_shapes
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import LANES, add, barrier, fill, largest, mul, over, sub, times  # noqa: F401
from nuno.solver.shared import BLOCKS_AT_ONCE
from nuno.solver.shared_memory import (
    FINE_PARTICLES,
    ROOMY_PARTICLES,
    SHARED_PARTICLES,
    column,
    figures,
    fine_column,
)
from nuno.solver.soft_ahead import elastic_ahead, viscous_ahead
from nuno.solver.soft_stars import damp_star, shape_of, solve_star, stiffness
from nuno.solver.soft_state import (
    CRUMPLED,
    SEEN,
    SoftFine,
    SoftFineLanes,
    SoftFloat,
    SoftLanes,
    SoftSizes,
    Tetrahedra,
    WideTetrahedra,
    view,
)
from nuno.solver.state import CLOCK, DAMPING, MOTION, PULLS, SHAPES, SPEED, VELOCITIES, Settings, Shapes
from nuno.solver.vector import corner
from nuno.solver.wide import by_sixteen


@wp.func
def turn_notes(t: Any, thread: int):
    """What was seen in the last substep holds in this one; one thread does it."""
    if thread == 0:
        t.notes[CRUMPLED] = t.notes[SEEN]
        t.notes[SEEN] = fill(t.x[0], 0.0)


@wp.func
def solve_stars(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The elasticity of the tetrahedra of one colour's stars."""
    square = run.dt * run.dt
    limit = wp.min(table.speed * run.dt, 0.5 * table.height)
    mu, bulk = stiffness(t, square)
    for k in range(first + thread, last, threads):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        solve_star(t, table, k, row, count, a, b, c, d, e, f, g, h, square, mu, bulk, limit)


@wp.func
def damp_stars(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The viscosity of the tetrahedra of one colour's stars, over ``run.damped`` substeps."""
    time = t.scalars[DAMPING] * (2.0 * run.dt * float(run.damped))
    eta = times(t.mu[0], time)
    for k in range(first + thread, last, threads):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        damp_star(t, table, k, row, count, a, b, c, d, e, f, g, h, time, eta)


@wp.func
def viscous(t: Any, table: Any, run: Settings, thread: int, threads: int):
    """One pass over the tetrahedra's viscosity, colour by colour."""
    for c in range(table.colour.shape[0] - 1):
        damp_stars(t, table, run, table.colour[c], table.colour[c + 1], thread, threads)
        barrier(threads)


@wp.func
def viscous(t: SoftFloat, table: Tetrahedra, run: Settings, thread: int, threads: int):
    viscous_alone(t, table, run, thread, threads)


@wp.func
def viscous(t: SoftFine, table: Tetrahedra, run: Settings, thread: int, threads: int):
    viscous_alone(t, table, run, thread, threads)


@wp.func
def viscous_alone(t: Any, table: Tetrahedra, run: Settings, thread: int, threads: int):
    """`viscous` of one world: by threads that share it, or by one."""
    if shares_work(threads):
        viscous_ahead(t, table, run, thread, threads)
    else:
        for c in range(table.colour.shape[0] - 1):
            damp_stars(t, table, run, table.colour[c], table.colour[c + 1], 0, 1)


@wp.func
def elastic(t: Any, table: Any, run: Settings, thread: int, threads: int):
    """One pass over the tetrahedra's elasticity, colour by colour, always in this order: at rest nothing moves."""
    for c in range(table.colour.shape[0] - 1):
        solve_stars(t, table, run, table.colour[c], table.colour[c + 1], thread, threads)
        barrier(threads)


@wp.func
def elastic(t: SoftFloat, table: Tetrahedra, run: Settings, thread: int, threads: int):
    elastic_alone(t, table, run, thread, threads)


@wp.func
def elastic(t: SoftFine, table: Tetrahedra, run: Settings, thread: int, threads: int):
    elastic_alone(t, table, run, thread, threads)


@wp.func
def elastic_alone(t: Any, table: Tetrahedra, run: Settings, thread: int, threads: int):
    """`elastic` of one world: by threads that share it, or by one."""
    if shares_work(threads):
        elastic_ahead(t, table, run, thread, threads)
    else:
        for c in range(table.colour.shape[0] - 1):
            solve_stars(t, table, run, table.colour[c], table.colour[c + 1], 0, 1)


@wp.func
def advance(
    t: Any, near: Any, topo: Tetrahedra, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int
):
    """The phases of ``substeps`` substeps; ``near`` is as `nuno.solver.frame.advance` has it."""
    n = topo.particles
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, thread, threads)
                forget_loads(t, run, thread, threads)
            tick(t, run, thread)
            turn_notes(t, thread)
            if run.damped != 0 and (run.first + k) % run.frame % wp.max(run.damped, 1) == 0:
                viscous(t, topo, run, thread, threads)
            predict(t, n, run, thread, threads)
            barrier(threads)
            hold_vertices(t, run, thread, threads)
            barrier(threads)
            elastic(t, topo, run, thread, threads)
        if run.pulled != 0 and run.parts & PULLS != 0:
            pull_points(t, run, thread, threads)
            barrier(threads)
        if run.parts & SHAPES != 0:
            read_loads(t, run, thread, threads)
            barrier(threads)
            touch_shapes(t, n, shapes, run.dt, thread, threads)
            barrier(threads)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, thread)
            barrier(threads)
            read_velocities(t, n, run, thread, threads)
            round_places(near, t, n, thread, threads)
            barrier(threads)


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_worlds")
def run_soft_worlds(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, first: int, substeps: int
):
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_lanes")
def run_soft_lanes(
    s: SoftLanes, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, first: int, substeps: int
):
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.func
def advance_wide(
    t: Any, p: Any, near: SoftFloat, nearby: SoftLanes, n: int, wide: WideTetrahedra, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """`advance` with its loops by sixteen; ``p`` is ``t`` by sixteen particles, ``nearby`` is ``near``."""
    m = (n + LANES - 1) / LANES
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, 0, 1)
                forget_loads(t, run, 0, 1)
            tick(t, run, 0)
            turn_notes(t, 0)
            if run.damped != 0 and (run.first + k) % run.frame % wp.max(run.damped, 1) == 0:
                viscous(t, wide, run, 0, 1)
            predict(p, m, run, 0, 1)
            hold_vertices(t, run, 0, 1)
            elastic(t, wide, run, 0, 1)
        if run.parts & PULLS != 0:
            pull_points(t, run, 0, 1)
        if run.parts & SHAPES != 0:
            read_loads(t, run, 0, 1)
            p.notes[CLOCK] = fill(p.x[0], t.notes[CLOCK])  # moving shapes are where the clock says
            touch_shapes(p, m, shapes, run.dt, 0, 1)
        if run.parts & VELOCITIES != 0:
            reset_speed(p, 0)
            read_velocities(p, m, run, 0, 1)
            round_places(nearby, p, m, 0, 1)
            t.notes[SPEED] = largest(p.notes[SPEED])


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_wide")
def run_soft_wide(
    s: SoftFloat, topo: Tetrahedra, wide: WideTetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int
):
    """One world by one thread, sixteen tetrahedra or particles at a time."""
    n = topo.particles
    t = view(s, wp.tid(), n, size)
    p = by_sixteen(SoftLanes(), t, wide, (n + LANES - 1) / LANES)
    advance_wide(t, p, t, p, n, wide, run, shapes, substeps)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_worlds")
def run_soft_fine_worlds(
    s: SoftFine, near: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, size)
    advance(t, view(near, group, n, size), topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_lanes")
def run_soft_fine_lanes(
    s: SoftFineLanes, near: SoftLanes, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, size)
    advance(t, view(near, group, n, size), topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_wide")
def run_soft_fine_wide(
    s: SoftFine, near: SoftFloat, topo: Tetrahedra, wide: WideTetrahedra, size: SoftSizes, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, size)
    floats = view(near, wp.tid(), n, size)
    p = by_sixteen(SoftFineLanes(), t, wide, m)
    advance_wide(t, p, floats, by_sixteen(SoftLanes(), floats, wide, m), n, wide, run, shapes, substeps)


FEW_THREADS, MANY_THREADS, MANY_AT_ONCE = 256, 128, 4
"""Threads of a block, and of one where worlds queue up for multiprocessors and have all but the substep's start in
their memory, in which four worlds fit at once. A colour of such a body has about 128 stars: more threads would only
wait for them. The bits are the same."""

# quotients and roots as the processor has them: see `nuno.solver.shared`
for _name in (
    "blocks", "blocks_partly", "few_partly", "blocks_shared", "few_shared", "fine_blocks", "fine_blocks_partly",
):  # fmt: skip
    wp.get_module(f"nuno.solver.run_soft_{_name}").options["fast_math"] = True


@wp.kernel(
    enable_backward=False, launch_bounds=(FEW_THREADS, BLOCKS_AT_ONCE), module="nuno.solver.run_soft_blocks"
)  # fmt: skip
def run_soft_blocks(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """Every world by a block of ``threads`` threads."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    advance(t, t, topo, run, shapes, substeps, tid % threads, threads)


@wp.func
def advance_block(
    t: Any, near: Any, topo: Tetrahedra, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int
):
    """`advance` with the world's scalars and notes in shared memory for as long as the launch takes."""
    scalars = t.scalars
    notes = t.notes
    t.scalars = figures(0)
    t.notes = figures(8)
    near.scalars = figures(0)
    near.notes = figures(8)
    if thread == 0:
        for k in range(7):
            t.scalars[k] = scalars[k]
        for k in range(6):
            t.notes[k] = notes[k]
    barrier(threads)
    advance(t, near, topo, run, shapes, substeps, thread, threads)
    barrier(threads)
    if thread == 0:
        for k in range(6):
            notes[k] = t.notes[k]


@wp.func
def run_partly(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, tid: int,
    threads: int,
):  # fmt: skip
    """A world by a block with x, y, z and w in shared memory for as long as the launch takes."""
    n = topo.particles
    thread = tid % threads
    t = view(s, tid / threads, n, size)
    outside = view(s, tid / threads, n, size)
    t.x = column(0)
    t.y = column(SHARED_PARTICLES)
    t.z = column(2 * SHARED_PARTICLES)
    t.w = column(3 * SHARED_PARTICLES)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
    advance_block(t, t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]


@wp.func
def run_shared(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, tid: int,
    threads: int,
):  # fmt: skip
    """A world by a block with x, y, z, w and v in shared memory."""
    n = topo.particles
    thread = tid % threads
    t = view(s, tid / threads, n, size)
    outside = view(s, tid / threads, n, size)
    t.x = column(0)
    t.y = column(ROOMY_PARTICLES)
    t.z = column(2 * ROOMY_PARTICLES)
    t.w = column(3 * ROOMY_PARTICLES)
    t.vx = column(4 * ROOMY_PARTICLES)
    t.vy = column(5 * ROOMY_PARTICLES)
    t.vz = column(6 * ROOMY_PARTICLES)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
        t.vx[i] = outside.vx[i]
        t.vy[i] = outside.vy[i]
        t.vz[i] = outside.vz[i]
    advance_block(t, t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]
        outside.vx[i] = t.vx[i]
        outside.vy[i] = t.vy[i]
        outside.vz[i] = t.vz[i]


@wp.kernel(
    enable_backward=False, launch_bounds=(FEW_THREADS, BLOCKS_AT_ONCE), module="nuno.solver.run_soft_blocks_partly"
)
def run_soft_blocks_partly(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """Worlds that queue up for multiprocessors, and of which not all fits."""
    run_partly(s, topo, size, run, shapes, substeps, wp.tid(), threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_soft_few_partly")
def run_soft_few_partly(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """Worlds that have a multiprocessor each, and so all of its registers, and of which not all fits."""
    run_partly(s, topo, size, run, shapes, substeps, wp.tid(), threads)


@wp.kernel(
    enable_backward=False, launch_bounds=(MANY_THREADS, MANY_AT_ONCE), module="nuno.solver.run_soft_blocks_shared"
)  # fmt: skip
def run_soft_blocks_shared(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """Worlds that queue up for multiprocessors."""
    run_shared(s, topo, size, run, shapes, substeps, wp.tid(), threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_soft_few_shared")
def run_soft_few_shared(
    s: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """Worlds that have a multiprocessor each, and so all of its registers."""
    run_shared(s, topo, size, run, shapes, substeps, wp.tid(), threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_soft_fine_blocks")
def run_soft_fine_blocks(
    s: SoftFine, floats: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
    threads: int,
):  # fmt: skip
    """Every world by a block, coordinates as doubles."""
    tid = wp.tid()
    n = topo.particles
    t = view(s, tid / threads, n, size)
    advance_block(t, view(floats, tid / threads, n, size), topo, run, shapes, substeps, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_soft_fine_blocks_partly")
def run_soft_fine_blocks_partly(
    s: SoftFine, floats: SoftFloat, topo: Tetrahedra, size: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
    threads: int,
):  # fmt: skip
    """The same with x, y and z in shared memory for as long as the launch takes."""
    tid = wp.tid()
    n = topo.particles
    thread = tid % threads
    t = view(s, tid / threads, n, size)
    outside = view(s, tid / threads, n, size)
    t.x = fine_column(0)
    t.y = fine_column(FINE_PARTICLES)
    t.z = fine_column(2 * FINE_PARTICLES)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
    advance_block(t, view(floats, tid / threads, n, size), topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]
