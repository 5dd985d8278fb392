"""A substep as a list of phases, and the kernels that walk through it.

Three launch plans share the phases: one thread per world (or per sixteen worlds in lanes) on the CPU, a block of
threads per world with barriers on CUDA, and one launch per phase over the whole device for scenes too large for a
block. ``thread`` and ``threads`` say which share of a phase's work is whose.
"""

from typing import Any

import warp as wp

from nuno.contact.self_contact import (
    bound_blocks,
    find_pairs,
    take_moves,
    touch_edge_edge,
    touch_vertex_triangle,
)
from nuno.contact.shapes import measure_box, reset_box, select_shapes, sort_shapes, touch_shapes
from nuno.solver.bending import bend_hinge, bend_line
from nuno.solver.grips import hold_vertices, pull_points
from nuno.solver.integrate import predict, read_velocities, reset_speed, tick
from nuno.solver.lanes import barrier, fill, largest
from nuno.solver.membrane import shear_cell, shear_triangle, stretch, stretch_triangle
from nuno.solver.state import (
    DAMPING,
    LISTINGS,
    TRAVEL,
    Settings,
    Shapes,
    Sizes,
    StateFloat,
    StateLanes,
    Topology,
    view,
)


@wp.func
def bend_lines(t: Any, topo: Topology, run: Settings, first: int, last: int, thread: int, threads: int):
    """The line bends of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    gamma = t.scalars[DAMPING] * (1.0 / run.dt)
    for k in range(first + thread, last, threads):
        bend_line(t, topo.line[k], t.bend_soft[topo.line_soft[k]] * (topo.line_scale[k] * rate), run.damped, gamma)


@wp.func
def bend_hinges(t: Any, topo: Topology, run: Settings, first: int, last: int, thread: int, threads: int):
    """The hinges and cell twists of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    gamma = t.scalars[DAMPING] * (1.0 / run.dt)
    for k in range(first + thread, last, threads):
        alpha = t.bend_soft[topo.hinge_soft[k]] * (topo.hinge_scale[k] * rate)
        bend_hinge(t, topo.hinge[k], topo.hinge_weight[k], topo.hinge_rest[k], alpha, run.damped, gamma)


@wp.func
def shear_cells(t: Any, topo: Topology, run: Settings, first: int, last: int, thread: int, threads: int):
    """The cell shears of one colour; 4 scale is 1 / area."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        scale = topo.cell_scale[k]
        shear_cell(t, topo.cell[k], scale, t.shear_soft[topo.cell_soft[k]] * (4.0 * scale * rate))


@wp.func
def strain_triangles(t: Any, topo: Topology, run: Settings, first: int, last: int, thread: int, threads: int):
    """The triangles of one colour: shear, then stretch along weft and warp."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first + thread, last, threads):
        tri = topo.triangle[k]
        u = topo.triangle_u[k]
        v = topo.triangle_v[k]
        soft = topo.triangle_soft[k]
        scale = rate / topo.triangle_area[k]
        shear_triangle(t, tri, u, v, t.shear_soft[soft[2]] * scale)
        stretch_triangle(t, tri, v, t.stretch_soft[soft[1]] * scale)
        stretch_triangle(t, tri, u, t.stretch_soft[soft[0]] * scale)


@wp.func
def stretch_edges(t: Any, topo: Topology, run: Settings, first: int, last: int, thread: int, threads: int):
    """The edges of one colour."""
    rate = 1.0 / (run.dt * run.dt)
    gamma = t.scalars[DAMPING] * (1.0 / run.dt)
    for k in range(first + thread, last, threads):
        e = topo.edge[k]
        alpha = t.stretch_soft[topo.edge_soft[k]] * (topo.edge_scale[k] * rate)
        stretch(t, e[0], e[1], topo.edge_rest[k], alpha, run.relax, run.damped, gamma)


@wp.func
def find_contacts(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """List self-contact pairs anew where what moved since may have used up the margin."""
    # the coming substep counts too, at up to twice the present speed
    if 2.0 * largest(t.notes[TRAVEL]) + 0.25 * run.margin > run.margin:
        barrier(threads)
        if thread == 0:
            t.pair_count[0] = t.pair_count[0] * 0
            t.pair_count[1] = t.pair_count[1] * 0
            t.notes[TRAVEL] = fill(t.x[0], 0.0)
            t.notes[LISTINGS] = t.notes[LISTINGS] + fill(t.x[0], 1.0)
        bound_blocks(t, topo, thread, threads)
        barrier(threads)
        find_pairs(t, topo, run.margin, run.slack, thread, threads)
        barrier(threads)


@wp.func
def elastic(t: Any, topo: Topology, run: Settings, thread: int, threads: int):
    """One pass over the elastic constraints, the stiffest last."""
    for c in range(topo.hinge_colour.shape[0] - 1):
        bend_hinges(t, topo, run, topo.hinge_colour[c], topo.hinge_colour[c + 1], thread, threads)
        barrier(threads)
    for c in range(topo.line_colour.shape[0] - 1):
        bend_lines(t, topo, run, topo.line_colour[c], topo.line_colour[c + 1], thread, threads)
        barrier(threads)
    for c in range(topo.cell_colour.shape[0] - 1):
        shear_cells(t, topo, run, topo.cell_colour[c], topo.cell_colour[c + 1], thread, threads)
        barrier(threads)
    for c in range(topo.triangle_colour.shape[0] - 1):
        strain_triangles(t, topo, run, topo.triangle_colour[c], topo.triangle_colour[c + 1], thread, threads)
        barrier(threads)
    for c in range(topo.edge_colour.shape[0] - 1):
        stretch_edges(t, topo, run, topo.edge_colour[c], topo.edge_colour[c + 1], thread, threads)
        barrier(threads)


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
def advance(t: Any, topo: Topology, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int):
    """All phases of ``substeps`` substeps."""
    n = topo.particles
    for k in range(substeps):
        if k % run.frame == 0:
            near_shapes(t, n, run, shapes, thread, threads)
        if run.touching != 0:
            find_contacts(t, topo, run, thread, threads)
        tick(t, run, thread)
        predict(t, n, run, thread, threads)
        barrier(threads)
        hold_vertices(t, run, thread, threads)
        barrier(threads)
        elastic(t, topo, run, thread, threads)
        pull_points(t, run, thread, threads)
        barrier(threads)
        if run.touching != 0:
            touch_edge_edge(t, n, run.dt, thread, threads)
            touch_vertex_triangle(t, n, run.dt, thread, threads)
            barrier(threads)
            take_moves(t, n, thread, threads)
            barrier(threads)
        touch_shapes(t, n, shapes, run.dt, thread, threads)
        barrier(threads)
        reset_speed(t, thread)
        barrier(threads)
        read_velocities(t, n, run, thread, threads)
        barrier(threads)


@wp.kernel(enable_backward=False, launch_bounds=(256, 1))
def run_worlds(s: Any, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int, threads: int):  # noqa: E501
    """Every world by itself: one thread on the CPU, a block of ``threads`` threads on CUDA."""
    tid = wp.tid()
    group = first + tid / threads
    t = view(s, group, topo.particles, size)
    advance(t, topo, run, shapes, substeps, tid % threads, threads)


wp.overload(run_worlds, [StateFloat, Topology, Sizes, Settings, Shapes, int, int, int])
wp.overload(run_worlds, [StateLanes, Topology, Sizes, Settings, Shapes, int, int, int])
