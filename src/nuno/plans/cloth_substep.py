"""A substep as a list of phases, and the kernels that walk through it.

Three launch plans share the phases: one thread per world (or per sixteen worlds in lanes) on the CPU, a block of
threads per world with barriers on CUDA, and one launch per phase over the whole device for scenes too large for a
block. ``thread`` and ``threads`` say which share of a phase's work is whose.
"""

from typing import Any

import warp as wp

from nuno.constraints.bending import bend_alpha, bend_line, bend_patch, bend_twist
from nuno.constraints.damping import damp_bends
from nuno.constraints.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.constraints.membrane import shear_alpha, shear_cell, shear_triangle, stretch_grid_line, stretch_triangle
from nuno.constraints.sweeps import note_lengths, shear_cells_again, strain_triangles_again
from nuno.contact.particle.feature_contact import push_active, push_features, travel_of_substep
from nuno.contact.particle.feature_lists import EARLIEST, TRAVELLED, clear_features, list_features, mark_features
from nuno.contact.particle.shape_contact import measure_box, reset_box, select_shapes, sort_shapes, touch_shapes
from nuno.contact.particle.static_shape_contact import touch_shapes_together
from nuno.contact.self.list_rebuild import rebuild_lists
from nuno.contact.self.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.numbers.element_access import at, corner
from nuno.numbers.lanes import add, barrier, div, full_like, mul, product, shares_work, sub  # noqa: F401
from nuno.numbers.warp_lanes import lane_of
from nuno.numbers.warps import WARP, in_warps
from nuno.plans.cloth_prefetch import bend_lines_ahead, bend_twists_ahead, shear_cells_ahead
from nuno.plans.grid_lines_by_threads import GRID_LINE_EDGES, stretch_grid_lines_by_threads
from nuno.plans.grid_lines_by_warp import PAIR_EDGES, WARP_EDGES, stretch_double_grid_lines
from nuno.plans.sheet_strips import bend_in_strips, fits_strips
from nuno.state.cloth_state import (
    COMPLIANT_GRIPS,
    MOTION,
    SELF_CONTACT,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateDouble,
    StateDoubleLanes,
    StateFloat,
    StateLanes,
    Topology,
    view,
)
from nuno.state.integrate import predict, read_velocities, reset_speed, round_places, tick

STRETCH_KINDS = wp.constant(2)
"""Numbers in ``stretch_compliance`` where they are the same for all edges of a direction."""


@wp.func
def bend_lines(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The line bends of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = bend_alpha(at(t.bend_compliance, table.line_compliance[k]), table.line_scale[k], rate)
        a = corner(table.line, k, 0, 3)
        b = corner(table.line, k, 1, 3)
        c = corner(table.line, k, 2, 3)
        bend_line(t, a, b, c, alpha)


@wp.func
def bend_twists(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The cell twists of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = bend_alpha(at(t.bend_compliance, table.twist_compliance[k]), table.twist_scale[k], rate)
        a = corner(table.twist, k, 0, 4)
        b = corner(table.twist, k, 1, 4)
        c = corner(table.twist, k, 2, 4)
        d = corner(table.twist, k, 3, 4)
        bend_twist(t, a, b, c, d, alpha)


@wp.func
def bend_patches(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The triangles' curvatures of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        alpha = product(at(t.bend_compliance, table.patch_compliance[k]), rate)
        bend_patch(t, table, k, alpha)


@wp.func
def shear_cells(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The cell shears of one colour; 4 scale is 1 / area."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        scale = table.cell_scale[k]
        alpha = shear_alpha(at(t.shear_compliance, table.cell_compliance[k]), scale, rate)
        a = corner(table.cell, k, 0, 4)
        b = corner(table.cell, k, 1, 4)
        c = corner(table.cell, k, 2, 4)
        d = corner(table.cell, k, 3, 4)
        shear_cell(t, a, b, c, d, scale, alpha, full_like(alpha, 0.0), 0.0, 0.0)


@wp.func
def strain_triangles(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The triangles of one colour: shear, then stretch along weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        area = table.triangle_area[k]
        scale = rate / area
        a = corner(table.triangle, k, 0, 3)
        b = corner(table.triangle, k, 1, 3)
        c = corner(table.triangle, k, 2, 3)
        alpha = at(t.shear_compliance, corner(table.triangle_compliance, k, 2, 3)) * scale
        zero = full_like(alpha, 0.0)
        shear_triangle(t, table, k, a, b, c, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_compliance, corner(table.triangle_compliance, k, 1, 3)) * scale
        ka = corner(table.triangle_v, k, 0, 3)
        kb = corner(table.triangle_v, k, 1, 3)
        kc = corner(table.triangle_v, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)
        alpha = at(t.stretch_compliance, corner(table.triangle_compliance, k, 0, 3)) * scale
        ka = corner(table.triangle_u, k, 0, 3)
        kb = corner(table.triangle_u, k, 1, 3)
        kc = corner(table.triangle_u, k, 2, 3)
        stretch_triangle(t, a, b, c, ka, kb, kc, alpha, zero, 0.0, 0.0)


@wp.func
def stretch_grid_lines(
    t: StateFloat, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    """The grid lines of one direction, which are equally long: on CUDA each by a few threads, else by one.

    ``rest`` is as `nuno.constraints.membrane.stretch_grid_line` has it.
    """
    rate = 1.0 / (run.dt * run.dt)
    count = int(0)
    if in_warps(size) and first < last:
        count = table.grid_line[first + 1] - table.grid_line[first]
    if count > 0 and count <= GRID_LINE_EDGES:
        varied = sweep > 0 or t.stretch_compliance.shape[0] > STRETCH_KINDS
        stretch_grid_lines_by_threads(
            t, table, rest, table.grid_line[first], count, last - first, varied, rate, lane_of(rank, size)
        )  # fmt: skip
    else:
        for k in range(first + rank, last, size):
            start = table.grid_line[k]
            stretch_grid_line(
                t,
                table,
                rest,
                t.grid_line_gain,
                t.grid_line_pull,
                t.grid_line_inverse,
                start,
                table.grid_line[k + 1],
                rate,
            )


@wp.func
def stretch_grid_lines(
    t: StateDouble, table: Topology, rest: wp.array(dtype=float), run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    rate = 1.0 / (run.dt * run.dt)
    if in_warps(size):
        warps = size / WARP
        k = int(first + rank / WARP)
        while k < last:
            start = table.grid_line[k]
            stop = table.grid_line[k + 1]
            other = int(0)
            end = int(0)
            if k + warps < last:
                other = table.grid_line[k + warps]
                end = table.grid_line[k + warps + 1]
            if wp.max(stop - start, end - other) > PAIR_EDGES:
                end = other
            if stop - start <= WARP_EDGES:
                stretch_double_grid_lines(t, table, rest, start, stop, other, end, rate, lane_of(rank, size))
            elif rank % WARP == 0:
                stretch_grid_line(
                    t, table, rest, t.grid_line_gain, t.grid_line_pull, t.grid_line_inverse, start, stop, rate
                )
            k += wp.where(end > other, 2 * warps, warps)
    else:
        for k in range(first + rank, last, size):
            start = table.grid_line[k]
            stretch_grid_line(
                t,
                table,
                rest,
                t.grid_line_gain,
                t.grid_line_pull,
                t.grid_line_inverse,
                start,
                table.grid_line[k + 1],
                rate,
            )


@wp.func
def stretch_grid_lines(
    t: Any, table: Any, rest: Any, run: Settings, sweep: int, first: int, last: int,
    rank: int, size: int,
):  # fmt: skip
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + rank, last, size):
        start = table.grid_line[k]
        stretch_grid_line(
            t, table, rest, t.grid_line_gain, t.grid_line_pull, t.grid_line_inverse, start, table.grid_line[k + 1], rate
        )


@wp.func
def bend_sheet(t: Any, topo: Topology, run: Settings, rank: int, size: int):
    """A sheet's twists, bends and, where they are not swept, shears."""
    for c in range(topo.twist_colour.shape[0] - 1):
        bend_twists(t, topo, run, topo.twist_colour[c], topo.twist_colour[c + 1], rank, size)
        barrier(size)
    for c in range(topo.line_colour.shape[0] - 1):
        bend_lines(t, topo, run, topo.line_colour[c], topo.line_colour[c + 1], rank, size)
        barrier(size)
    if run.sweeps == 0:
        for c in range(topo.cell_colour.shape[0] - 1):
            shear_cells(t, topo, run, topo.cell_colour[c], topo.cell_colour[c + 1], rank, size)
            barrier(size)


@wp.func
def bend_sheet(t: StateFloat, topo: Topology, run: Settings, rank: int, size: int):
    if in_warps(size) and fits_strips(topo):
        bend_in_strips(t, topo, run, rank, size)
    else:
        bend_one_sheet(t, topo, run, rank, size)


@wp.func
def bend_sheet(t: StateDouble, topo: Topology, run: Settings, rank: int, size: int):
    bend_one_sheet(t, topo, run, rank, size)


@wp.func
def bend_one_sheet(t: Any, topo: Topology, run: Settings, rank: int, size: int):
    """`bend_sheet` of one world: by threads that share it, or by one."""
    if shares_work(size):
        bend_twists_ahead(t, topo, run, rank, size)
        bend_lines_ahead(t, topo, run, rank, size)
        if run.sweeps == 0:
            shear_cells_ahead(t, topo, run, rank, size)
    else:
        for c in range(topo.twist_colour.shape[0] - 1):
            bend_twists(t, topo, run, topo.twist_colour[c], topo.twist_colour[c + 1], 0, 1)
        for c in range(topo.line_colour.shape[0] - 1):
            bend_lines(t, topo, run, topo.line_colour[c], topo.line_colour[c + 1], 0, 1)
        if run.sweeps == 0:
            for c in range(topo.cell_colour.shape[0] - 1):
                shear_cells(t, topo, run, topo.cell_colour[c], topo.cell_colour[c + 1], 0, 1)


@wp.func
def sweep_membrane(t: Any, topo: Topology, run: Settings, rank: int, size: int):
    """Shear and stretch in ``run.sweeps`` sweeps, grid lines last in each."""
    for sweep in range(run.sweeps):
        for c in range(topo.cell_colour.shape[0] - 1):
            first = topo.cell_colour[c]
            shear_cells_again(t, topo, t.cell_sum, run, sweep, first, topo.cell_colour[c + 1], rank, size)
            barrier(size)
        for c in range(topo.triangle_colour.shape[0] - 1):
            first = topo.triangle_colour[c]
            last = topo.triangle_colour[c + 1]
            strain_triangles_again(t, topo, t.triangle_sum, run, sweep, first, last, rank, size)
            barrier(size)
        for c in range(topo.grid_line_kind.shape[0] - 1):
            first = topo.grid_line_kind[c]
            last = topo.grid_line_kind[c + 1]
            if sweep == 0:
                stretch_grid_lines(t, topo, topo.edge_rest, run, sweep, first, last, rank, size)
            else:
                stretch_grid_lines(t, topo, t.grid_line_goal, run, sweep, first, last, rank, size)
            barrier(size)
            if sweep + 1 < run.sweeps:
                note_lengths(t, topo, t.grid_line_goal, topo.grid_line[first], topo.grid_line[last], rank, size)
                barrier(size)


@wp.func
def elastic(t: Any, topo: Topology, run: Settings, rank: int, size: int):
    """The elastic constraints, the stiffest last: one pass over all, or more over those in the cloth's plane."""
    for c in range(topo.patch_colour.shape[0] - 1):
        bend_patches(t, topo, run, topo.patch_colour[c], topo.patch_colour[c + 1], rank, size)
        barrier(size)
    bend_sheet(t, topo, run, rank, size)
    if run.sweeps > 0:
        sweep_membrane(t, topo, run, rank, size)
    else:
        for c in range(topo.triangle_colour.shape[0] - 1):
            strain_triangles(t, topo, run, topo.triangle_colour[c], topo.triangle_colour[c + 1], rank, size)
            barrier(size)
        for c in range(topo.grid_line_kind.shape[0] - 1):
            last = topo.grid_line_kind[c + 1]
            stretch_grid_lines(t, topo, topo.edge_rest, run, 0, topo.grid_line_kind[c], last, rank, size)
            barrier(size)


@wp.func
def meet_shapes(t: Any, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    """All particles against the shapes nearby."""
    touch_shapes(t, n, shapes, dt, rank, size)


@wp.func
def meet_shapes(t: StateFloat, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    meet_shapes_alone(t, n, shapes, dt, rank, size)


@wp.func
def meet_shapes(t: StateDouble, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    meet_shapes_alone(t, n, shapes, dt, rank, size)


@wp.func
def meet_shapes_alone(t: Any, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    """`meet_shapes` of one world: by threads that share it, or by one."""
    if shares_work(size):
        touch_shapes_together(t, n, shapes, dt, rank, size)
    else:
        touch_shapes(t, n, shapes, dt, rank, size)


@wp.func
def near_shapes(t: Any, n: int, run: Settings, shapes: Shapes, rank: int, size: int):
    """Choose the shapes that matter for the next frame."""
    barrier(size)
    reset_box(t, rank)
    barrier(size)
    measure_box(t, n, rank, size)
    barrier(size)
    select_shapes(t, shapes, float(run.frame) * run.dt, rank, size)
    barrier(size)
    sort_shapes(t, rank)
    barrier(size)


@wp.func
def near_features(t: Any, topo: Any, run: Settings, shapes: Shapes, rank: int, size: int):
    """Choose the edges and triangles that sharp shapes may touch in the next frame; after `near_shapes`."""
    clear_features(t, topo, rank)
    barrier(size)
    mark_features(t, topo, run, shapes, rank, size)
    barrier(size)
    list_features(t, topo, rank, size)
    barrier(size)


@wp.func
def solve_features(t: Any, topo: Any, run: Settings, shapes: Shapes, rank: int, size: int):
    """Edges and triangles against sharp shapes, where there are any nearby."""
    if t.feature_shapes[0] > 0:
        push_features(t, topo, run, shapes, rank, size)


@wp.func
def advance(t: Any, near: Any, topo: Topology, run: Settings, shapes: Shapes, substeps: int, rank: int, size: int):
    """The phases of ``substeps`` substeps: all of them, or those of the parts that are asked for.

    ``near`` is the same state with coordinates as floats, for lists of what is near; ``t`` itself where they are.
    """
    n = topo.particles
    # kept by each thread: most often there is nothing more to ask about sharp shapes
    shape_speed = shapes.shape_speed[0]
    travelled = t.feature_due[TRAVELLED]
    earliest = t.feature_due[EARLIEST]
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, rank, size)
                near_features(near, topo, run, shapes, rank, size)
                travelled = float(0.0)
                earliest = t.feature_due[EARLIEST]
                forget_loads(t, run, rank, size)
            # before the listing, which asks how far anything went in the substep before
            tick(t, run, rank)
            barrier(size)
            if run.touching != 0:
                rebuild_lists(near, topo, run, rank, size)
            if run.damped != 0:
                damp_bends(t, topo, run, rank, size, size)
            predict(t, n, run, rank, size)
            barrier(size)
            hold_vertices(t, run, rank, size)
            barrier(size)
            elastic(t, topo, run, rank, size)
        if run.pulled != 0 and run.parts & COMPLIANT_GRIPS != 0:
            pull_points(t, run, rank, size)
            barrier(size)
        if run.touching != 0 and run.parts & SELF_CONTACT != 0:
            for _again in range(run.passes):
                touch_edge_edge(t, n, run, rank, size)
                touch_vertex_triangle(t, n, run, rank, size)
                barrier(size)
                take_moves(t, n, rank, size)
                barrier(size)
        if run.parts & SHAPES != 0:
            travelled += travel_of_substep(t, run, shape_speed)
            if travelled >= earliest:
                earliest = push_active(t, topo, run, shapes, travelled, rank, size)
                barrier(size)
            read_loads(t, run, rank, size)
            barrier(size)
            meet_shapes(t, n, shapes, run.dt, rank, size)
            barrier(size)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, rank)
            barrier(size)
            read_velocities(t, n, run, rank, size)
            round_places(near, t, n, rank, size)
            barrier(size)
    if rank == 0:
        t.feature_due[TRAVELLED] = travelled
        t.feature_due[EARLIEST] = earliest


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, module="nuno.plans.run_worlds")
def run_worlds(s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_lanes")
def run_lanes(s: StateLanes, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_double_worlds")
def run_double_worlds(
    s: StateDouble,
    near: StateFloat,
    topo: Topology,
    sizes: Sizes,
    run: Settings,
    shapes: Shapes,
    first: int,
    substeps: int,
):
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, sizes)
    advance(t, view(near, group, topo.particles, sizes), topo, run, shapes, substeps, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.plans.run_double_lanes")
def run_double_lanes(
    s: StateDoubleLanes, near: StateLanes, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, sizes)
    advance(t, view(near, group, topo.particles, sizes), topo, run, shapes, substeps, 0, 1)
