"""A substep as a list of phases, and the kernels that walk through it.

Three launch plans share the phases: one thread per world (or per sixteen worlds in lanes) on the CPU, a block of
threads per world with barriers on CUDA, and one launch per phase over the whole device for scenes too large for a
block. ``thread`` and ``threads`` say which share of a phase's work is whose.
"""

from typing import Any

import warp as wp

from nuno.contact.renewal import renew_lists, shares_work
from nuno.contact.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.contact.shapes import measure_box, reset_box, select_shapes, sort_shapes, touch_shapes
from nuno.contact.sharp_shapes import GONE, SOONEST, forget_sharp, list_sharp, mark_sharp
from nuno.contact.sharp_turns import touch_awake, touch_sharp, travel
from nuno.contact.still_shapes import touch_shapes_together
from nuno.solver.bending import bend_line, bend_patch, bend_twist
from nuno.solver.cloth_ahead import bend_lines_ahead, bend_twists_ahead, shear_cells_ahead
from nuno.solver.damping import damp_bends
from nuno.solver.fine_yarns import PAIR_EDGES, WARP_EDGES, stretch_fine_yarns
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import add, barrier, div, fill, mul, sub  # noqa: F401
from nuno.solver.membrane import shear_cell, shear_triangle, stretch_triangle, stretch_yarn
from nuno.solver.sheet_strips import bend_in_strips, fits_strips
from nuno.solver.state import (
    LAYERS,
    MOTION,
    PULLS,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateFine,
    StateFineLanes,
    StateFloat,
    StateLanes,
    Topology,
    view,
)
from nuno.solver.sweeps import note_lengths, shear_cells_again, strain_triangles_again
from nuno.solver.vector import at, corner
from nuno.solver.warps import WARP, in_warps
from nuno.solver.yarns import YARN_EDGES, stretch_yarns_together

STRETCH_KINDS = wp.constant(2)
"""Numbers in ``stretch_soft`` where they are the same for all edges of a direction."""


@wp.func
def bend_lines(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The line bends of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        alpha = at(t.bend_soft, table.line_soft[k]) * (table.line_scale[k] * rate)
        a = corner(table.line, k, 0, 3)
        b = corner(table.line, k, 1, 3)
        c = corner(table.line, k, 2, 3)
        bend_line(t, a, b, c, alpha)


@wp.func
def bend_twists(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The cell twists of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        alpha = at(t.bend_soft, table.twist_soft[k]) * (table.twist_scale[k] * rate)
        a = corner(table.twist, k, 0, 4)
        b = corner(table.twist, k, 1, 4)
        c = corner(table.twist, k, 2, 4)
        d = corner(table.twist, k, 3, 4)
        bend_twist(t, a, b, c, d, alpha)


@wp.func
def bend_patches(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The triangles' curvatures of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        alpha = at(t.bend_soft, table.patch_soft[k]) * rate
        bend_patch(t, table, k, alpha)


@wp.func
def shear_cells(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The cell shears of one colour; 4 scale is 1 / area."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        scale = table.cell_scale[k]
        alpha = at(t.shear_soft, table.cell_soft[k]) * (scale * 4.0 * rate)
        a = corner(table.cell, k, 0, 4)
        b = corner(table.cell, k, 1, 4)
        c = corner(table.cell, k, 2, 4)
        d = corner(table.cell, k, 3, 4)
        shear_cell(t, a, b, c, d, scale, alpha, fill(alpha, 0.0), 0.0, 0.0)


@wp.func
def strain_triangles(t: Any, table: Any, run: Settings, first: int, last: int, thread: int, threads: int):
    """The triangles of one colour: shear, then stretch along weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        area = table.triangle_area[k]
        scale = rate / area
        a = corner(table.triangle, k, 0, 3)
        b = corner(table.triangle, k, 1, 3)
        c = corner(table.triangle, k, 2, 3)
        alpha = at(t.shear_soft, corner(table.triangle_soft, k, 2, 3)) * scale
        zero = fill(alpha, 0.0)
        shear_triangle(t, table, k, a, b, c, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_soft, corner(table.triangle_soft, k, 1, 3)) * scale
        ka = corner(table.triangle_v, k, 0, 3)
        kb = corner(table.triangle_v, k, 1, 3)
        kc = corner(table.triangle_v, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_soft, corner(table.triangle_soft, k, 0, 3)) * scale
        ka = corner(table.triangle_u, k, 0, 3)
        kb = corner(table.triangle_u, k, 1, 3)
        kc = corner(table.triangle_u, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)


@wp.func
def stretch_yarns(
    t: StateFloat, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    thread: int, threads: int,
):  # fmt: skip
    """The yarns of one direction, which are equally long: on CUDA each by a few threads, else by one.

    ``rest`` is as `nuno.solver.membrane.stretch_yarn` has it.
    """
    rate = 1.0 / (run.dt * run.dt)
    count = int(0)
    if in_warps(threads) and first < last:
        count = table.yarn[first + 1] - table.yarn[first]
    if count > 0 and count <= YARN_EDGES:
        stretch_yarns_together(
            t.x, t.y, t.z, t.w, t.stretch_soft, table.edge, rest, table.edge_scale, table.edge_soft, table.yarn[first],
            count, last - first, sweep > 0 or t.stretch_soft.shape[0] > STRETCH_KINDS, rate, threads,
        )  # fmt: skip
    else:
        for k in range(first + thread, last, threads):
            start = table.yarn[k]
            stretch_yarn(t, table, rest, t.yarn_gain, t.yarn_pull, t.yarn_inverse, start, table.yarn[k + 1], rate)


@wp.func
def stretch_yarns(
    t: StateFine, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    thread: int, threads: int,
):  # fmt: skip
    rate = 1.0 / (run.dt * run.dt)
    if in_warps(threads):
        warps = threads / WARP
        k = int(first + thread / WARP)
        while k < last:
            start = table.yarn[k]
            stop = table.yarn[k + 1]
            other = int(0)
            end = int(0)
            if k + warps < last:
                other = table.yarn[k + warps]
                end = table.yarn[k + warps + 1]
            if wp.max(stop - start, end - other) > PAIR_EDGES:
                end = other
            if stop - start <= WARP_EDGES:
                stretch_fine_yarns(
                    t.x, t.y, t.z, t.w, t.stretch_soft, table.edge, rest, table.edge_scale, table.edge_soft, start,
                    stop, other, end, rate,
                )  # fmt: skip
            elif thread % WARP == 0:
                stretch_yarn(t, table, rest, t.yarn_gain, t.yarn_pull, t.yarn_inverse, start, stop, rate)
            k += wp.where(end > other, 2 * warps, warps)
    else:
        for k in range(first + thread, last, threads):
            start = table.yarn[k]
            stretch_yarn(t, table, rest, t.yarn_gain, t.yarn_pull, t.yarn_inverse, start, table.yarn[k + 1], rate)


@wp.func
def stretch_yarns(
    t: Any, table: Any, rest: Any, run: Settings, sweep: int, first: int, last: int,
    thread: int, threads: int,
):  # fmt: skip
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        start = table.yarn[k]
        stretch_yarn(t, table, rest, t.yarn_gain, t.yarn_pull, t.yarn_inverse, start, table.yarn[k + 1], rate)


@wp.func
def bend_sheet(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """A sheet's twists, bends and, where they are not swept, shears."""
    for c in range(topo.twist_colour.shape[0] - 1):
        bend_twists(t, topo, run, topo.twist_colour[c], topo.twist_colour[c + 1], thread, threads)
        barrier(threads)
    for c in range(topo.line_colour.shape[0] - 1):
        bend_lines(t, topo, run, topo.line_colour[c], topo.line_colour[c + 1], thread, threads)
        barrier(threads)
    if run.sweeps == 0:
        for c in range(topo.cell_colour.shape[0] - 1):
            shear_cells(t, topo, run, topo.cell_colour[c], topo.cell_colour[c + 1], thread, threads)
            barrier(threads)


@wp.func
def bend_sheet(t: StateFloat, topo: Topology, run: Settings, thread: int, threads: int):
    if in_warps(threads) and fits_strips(topo):
        bend_in_strips(t, topo, run, threads)
    else:
        bend_one_sheet(t, topo, run, thread, threads)


@wp.func
def bend_sheet(t: StateFine, topo: Topology, run: Settings, thread: int, threads: int):
    bend_one_sheet(t, topo, run, thread, threads)


@wp.func
def bend_one_sheet(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """`bend_sheet` of one world: by threads that share it, or by one."""
    if shares_work(threads):
        bend_twists_ahead(t, topo, run, thread, threads)
        bend_lines_ahead(t, topo, run, thread, threads)
        if run.sweeps == 0:
            shear_cells_ahead(t, topo, run, thread, threads)
    else:
        for c in range(topo.twist_colour.shape[0] - 1):
            bend_twists(t, topo, run, topo.twist_colour[c], topo.twist_colour[c + 1], 0, 1)
        for c in range(topo.line_colour.shape[0] - 1):
            bend_lines(t, topo, run, topo.line_colour[c], topo.line_colour[c + 1], 0, 1)
        if run.sweeps == 0:
            for c in range(topo.cell_colour.shape[0] - 1):
                shear_cells(t, topo, run, topo.cell_colour[c], topo.cell_colour[c + 1], 0, 1)


@wp.func
def sweep_membrane(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """Shear and stretch in ``run.sweeps`` sweeps, yarns last in each."""
    for sweep in range(run.sweeps):
        for c in range(topo.cell_colour.shape[0] - 1):
            first = topo.cell_colour[c]
            shear_cells_again(t, topo, t.cell_sum, run, sweep, first, topo.cell_colour[c + 1], thread, threads)
            barrier(threads)
        for c in range(topo.triangle_colour.shape[0] - 1):
            first = topo.triangle_colour[c]
            last = topo.triangle_colour[c + 1]
            strain_triangles_again(t, topo, t.triangle_sum, run, sweep, first, last, thread, threads)
            barrier(threads)
        for c in range(topo.yarn_kind.shape[0] - 1):
            first = topo.yarn_kind[c]
            last = topo.yarn_kind[c + 1]
            if sweep == 0:
                stretch_yarns(t, topo, topo.edge_rest, run, sweep, first, last, thread, threads)
            else:
                stretch_yarns(t, topo, t.yarn_goal, run, sweep, first, last, thread, threads)
            barrier(threads)
            if sweep + 1 < run.sweeps:
                note_lengths(t, topo, t.yarn_goal, topo.yarn[first], topo.yarn[last], thread, threads)
                barrier(threads)


@wp.func
def elastic(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """The elastic constraints, the stiffest last: one pass over all, or more over those in the cloth's plane."""
    for c in range(topo.patch_colour.shape[0] - 1):
        bend_patches(t, topo, run, topo.patch_colour[c], topo.patch_colour[c + 1], thread, threads)
        barrier(threads)
    bend_sheet(t, topo, run, thread, threads)
    if run.sweeps > 0:
        sweep_membrane(t, topo, run, thread, threads)
    else:
        for c in range(topo.triangle_colour.shape[0] - 1):
            strain_triangles(t, topo, run, topo.triangle_colour[c], topo.triangle_colour[c + 1], thread, threads)
            barrier(threads)
        for c in range(topo.yarn_kind.shape[0] - 1):
            last = topo.yarn_kind[c + 1]
            stretch_yarns(t, topo, topo.edge_rest, run, 0, topo.yarn_kind[c], last, thread, threads)
            barrier(threads)


@wp.func
def meet_shapes(t: Any, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    """All particles against the shapes nearby."""
    touch_shapes(t, n, shapes, dt, thread, threads)


@wp.func
def meet_shapes(t: StateFloat, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    meet_shapes_alone(t, n, shapes, dt, thread, threads)


@wp.func
def meet_shapes(t: StateFine, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    meet_shapes_alone(t, n, shapes, dt, thread, threads)


@wp.func
def meet_shapes_alone(t: Any, n: int, shapes: Shapes, dt: float, thread: int, threads: int):
    """`meet_shapes` of one world: by threads that share it, or by one."""
    if shares_work(threads):
        touch_shapes_together(t, n, shapes, dt, thread, threads)
    else:
        touch_shapes(t, n, shapes, dt, thread, threads)


@wp.func
def near_shapes(t: Any, n: int, run: Settings, shapes: Shapes, thread: int, threads: int):
    """Choose the shapes that matter for the next frame."""
    barrier(threads)
    reset_box(t, thread)
    barrier(threads)
    measure_box(t, n, thread, threads)
    barrier(threads)
    select_shapes(t, shapes, float(run.frame) * run.dt, thread, threads)
    barrier(threads)
    sort_shapes(t, thread)
    barrier(threads)


@wp.func
def near_sharp(t: Any, topo: Any, run: Settings, shapes: Shapes, thread: int, threads: int):
    """Choose the edges and triangles that sharp shapes may touch in the next frame; after `near_shapes`."""
    forget_sharp(t, topo, thread)
    barrier(threads)
    mark_sharp(t, topo, run, shapes, thread, threads)
    barrier(threads)
    list_sharp(t, topo, thread, threads)
    barrier(threads)


@wp.func
def meet_sharp(t: Any, topo: Any, run: Settings, shapes: Shapes, thread: int, threads: int):
    """Edges and triangles against sharp shapes, where there are any nearby."""
    if t.sharp[0] > 0:
        touch_sharp(t, topo, run, shapes, thread, threads)


@wp.func
def advance(t: Any, near: Any, topo: Topology, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int):
    """The phases of ``substeps`` substeps: all of them, or those of the parts that are asked for.

    ``near`` is the same state with coordinates as floats, for lists of what is near; ``t`` itself where they are.
    """
    n = topo.particles
    # kept by each thread: most often there is nothing more to ask about sharp shapes
    haste = shapes.haste[0]
    gone = t.sharp_wake[GONE]
    soonest = t.sharp_wake[SOONEST]
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, thread, threads)
                near_sharp(near, topo, run, shapes, thread, threads)
                gone = float(0.0)
                soonest = t.sharp_wake[SOONEST]
                forget_loads(t, run, thread, threads)
            # before the listing, which asks how far anything went in the substep before
            tick(t, run, thread)
            barrier(threads)
            if run.touching != 0:
                renew_lists(near, topo, run, thread, threads)
            if run.damped != 0:
                damp_bends(t, topo, run, thread, threads, threads)
            predict(t, n, run, thread, threads)
            barrier(threads)
            hold_vertices(t, run, thread, threads)
            barrier(threads)
            elastic(t, topo, run, thread, threads)
        if run.pulled != 0 and run.parts & PULLS != 0:
            pull_points(t, run, thread, threads)
            barrier(threads)
        if run.touching != 0 and run.parts & LAYERS != 0:
            for _again in range(run.passes):
                touch_edge_edge(t, n, run, thread, threads)
                touch_vertex_triangle(t, n, run, thread, threads)
                barrier(threads)
                take_moves(t, n, thread, threads)
                barrier(threads)
        if run.parts & SHAPES != 0:
            gone += travel(t, run, haste)
            if gone >= soonest:
                soonest = touch_awake(t, topo, run, shapes, gone, thread, threads)
                barrier(threads)
            read_loads(t, run, thread, threads)
            barrier(threads)
            meet_shapes(t, n, shapes, run.dt, thread, threads)
            barrier(threads)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, thread)
            barrier(threads)
            read_velocities(t, n, run, thread, threads)
            round_places(near, t, n, thread, threads)
            barrier(threads)
    if thread == 0:
        t.sharp_wake[GONE] = gone
        t.sharp_wake[SOONEST] = soonest


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, module="nuno.solver.run_worlds")
def run_worlds(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_lanes")
def run_lanes(s: StateLanes, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, size)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_fine_worlds")
def run_fine_worlds(
    s: StateFine,
    near: StateFloat,
    topo: Topology,
    size: Sizes,
    run: Settings,
    shapes: Shapes,
    first: int,
    substeps: int,
):
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, size)
    advance(t, view(near, group, topo.particles, size), topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.run_fine_lanes")
def run_fine_lanes(
    s: StateFineLanes, near: StateLanes, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, size)
    advance(t, view(near, group, topo.particles, size), topo, run, shapes, substeps, 0, 1)
