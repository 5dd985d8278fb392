"""A soft body's substep as a list of phases, and the kernels that walk through it.

The phases around the tetrahedra are those of a cloth (`nuno.solver.frame`); so are the plans, and what ``thread`` and
``threads`` mean.
"""

from typing import Any

import warp as wp

from nuno.contact.renewal import shares_work
from nuno.contact.shapes import touch_shapes
from nuno.solver.frame import meet_sharp, near_shapes, near_sharp
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.idle import forget_idle
from nuno.solver.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import LANES, add, barrier, fill, largest, mul, sub  # noqa: F401
from nuno.solver.soft_ahead import elastic_ahead, viscous_ahead
from nuno.solver.soft_stars import damp_star, shape_of, solve_star, stiffness
from nuno.solver.soft_state import (
    CRUMPLED,
    SEEN,
    FarSides,
    Sides,
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
from nuno.solver.wide import as_lanes, by_sixteen


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
    eta = t.mu[0] * time
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
        viscous_ahead(t, table, run, thread, threads, threads)
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
        elastic_ahead(t, table, run, thread, threads, threads)
    else:
        for c in range(table.colour.shape[0] - 1):
            solve_stars(t, table, run, table.colour[c], table.colour[c + 1], 0, 1)


@wp.func
def touch_sides(t: Any, sides: Sides, run: Settings, shapes: Shapes, thread: int, threads: int):
    """Edges and triangles against the sharp shapes nearby."""
    meet_sharp(t, sides, run, shapes, thread, threads)


@wp.func
def touch_sides(t: Any, sides: FarSides, run: Settings, shapes: Shapes, thread: int, threads: int):
    return


@wp.func
def goes_on(t: Any, sides: Sides):
    """Whether the kernel does the substep that comes next."""
    return True


@wp.func
def goes_on(t: Any, sides: FarSides):
    return t.sharp[0] == 0


@wp.func
def advance(
    t: Any, near: Any, topo: Tetrahedra, sides: Any, run: Settings, shapes: Shapes, begin: int, substeps: int,
    thread: int, threads: int,
):  # fmt: skip
    """The phases of substeps ``begin`` to ``substeps``; ``near`` is as `nuno.solver.frame.advance` has it.

    Returns:
        The substep before which it stopped: ``substeps``, or with `FarSides` the first that something sharp is near in.
    """
    n = topo.particles
    done = int(begin)
    while done < substeps:
        k = int(done)
        if run.parts & MOTION != 0 and (run.first + k) % run.frame == 0:
            near_shapes(near, n, run, shapes, thread, threads)
            near_sharp(near, sides, run, shapes, thread, threads)
        if not goes_on(t, sides):
            break
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
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
            touch_sides(t, sides, run, shapes, thread, threads)
            read_loads(t, run, thread, threads)
            barrier(threads)
            touch_shapes(t, n, shapes, run.dt, thread, threads)
            barrier(threads)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, thread)
            barrier(threads)
            forget_idle(t, n, thread, threads)
            read_velocities(t, n, run, thread, threads)
            round_places(near, t, n, thread, threads)
            barrier(threads)
        done = k + 1
    return done


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_worlds")
def run_soft_worlds(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_lanes")
def run_soft_lanes(
    s: SoftLanes, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.func
def soft_by_sixteen(p: Any, t: Any, wide: WideTetrahedra, m: int):
    """`by_sixteen`, with what soft bodies alone have."""
    p = by_sixteen(p, t, wide, m)
    p.idle_x = as_lanes(t.idle_x, m)
    p.idle_y = as_lanes(t.idle_y, m)
    p.idle_z = as_lanes(t.idle_z, m)
    return p


@wp.func
def advance_wide(
    t: Any, p: Any, near: SoftFloat, nearby: SoftLanes, n: int, wide: WideTetrahedra, sides: Sides, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """`advance` with its loops by sixteen; ``p`` is ``t`` by sixteen particles, ``nearby`` is ``near``."""
    m = (n + LANES - 1) / LANES
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, 0, 1)
                near_sharp(near, sides, run, shapes, 0, 1)
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
            touch_sides(t, sides, run, shapes, 0, 1)
            read_loads(t, run, 0, 1)
            p.notes[CLOCK] = fill(p.x[0], t.notes[CLOCK])  # moving shapes are where the clock says
            touch_shapes(p, m, shapes, run.dt, 0, 1)
        if run.parts & VELOCITIES != 0:
            reset_speed(p, 0)
            forget_idle(p, m, 0, 1)
            read_velocities(p, m, run, 0, 1)
            round_places(nearby, p, m, 0, 1)
            t.notes[SPEED] = largest(p.notes[SPEED])


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_wide")
def run_soft_wide(
    s: SoftFloat, topo: Tetrahedra, wide: WideTetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time."""
    n = topo.particles
    t = view(s, wp.tid(), n, size)
    p = soft_by_sixteen(SoftLanes(), t, wide, (n + LANES - 1) / LANES)
    advance_wide(t, p, t, p, n, wide, sides, run, shapes, substeps)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_worlds")
def run_soft_fine_worlds(
    s: SoftFine, near: SoftFloat, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, size)
    advance(t, view(near, group, n, size), topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_lanes")
def run_soft_fine_lanes(
    s: SoftFineLanes, near: SoftLanes, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, size)
    advance(t, view(near, group, n, size), topo, sides, run, shapes, 0, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_soft_fine_wide")
def run_soft_fine_wide(
    s: SoftFine, near: SoftFloat, topo: Tetrahedra, wide: WideTetrahedra, sides: Sides, size: SoftSizes, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, size)
    floats = view(near, wp.tid(), n, size)
    p = soft_by_sixteen(SoftFineLanes(), t, wide, m)
    advance_wide(t, p, floats, by_sixteen(SoftLanes(), floats, wide, m), n, wide, sides, run, shapes, substeps)
