"""The plan for one world alone on the CPU: sixteen elements of a colour, or sixteen particles, at a time.

The tables repeat the cloth's elements by groups of sixteen. A group that would be short repeats its last element,
which then is written several times with the same values. The phases are those of `nuno.solver.frame`, in the same
order, so that a world gives the same bits here as in the lanes of a batch.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from nuno.contact.renewal import renew_lists
from nuno.contact.self_contact import touch_edge_edge, touch_vertex_triangle
from nuno.contact.shapes import touch_shapes
from nuno.solver.damping import damp_bends
from nuno.solver.fine import fine, fine_lane
from nuno.solver.frame import (
    bend_lines,
    bend_patches,
    bend_twists,
    meet_sharp,
    near_shapes,
    near_sharp,
    shear_cells,
    strain_triangles,
)
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import LANES, fill, lane, lane_int, largest
from nuno.solver.membrane import stretch_yarn
from nuno.solver.state import (
    CLOCK,
    LAYERS,
    MOTION,
    NOTES,
    PULLS,
    SCALARS,
    SHAPES,
    SPEED,
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


@wp.struct
class Wide:
    """The elements by groups of sixteen, under the names that `Topology` has for them; room for the yarns."""

    edge: wp.array(dtype=lane_int)
    edge_rest: wp.array(dtype=lane)
    edge_scale: wp.array(dtype=lane)
    edge_soft: wp.array(dtype=lane_int)
    yarn: wp.array(dtype=int)
    yarn_kind: wp.array(dtype=int)
    cell: wp.array(dtype=lane_int)
    cell_scale: wp.array(dtype=lane)
    cell_soft: wp.array(dtype=lane_int)
    cell_colour: wp.array(dtype=int)
    triangle: wp.array(dtype=lane_int)
    triangle_u: wp.array(dtype=lane)
    triangle_v: wp.array(dtype=lane)
    triangle_area: wp.array(dtype=lane)
    triangle_soft: wp.array(dtype=lane_int)
    triangle_colour: wp.array(dtype=int)
    line: wp.array(dtype=lane_int)
    line_scale: wp.array(dtype=lane)
    line_soft: wp.array(dtype=lane_int)
    line_colour: wp.array(dtype=int)
    twist: wp.array(dtype=lane_int)
    twist_scale: wp.array(dtype=lane)
    twist_soft: wp.array(dtype=lane_int)
    twist_colour: wp.array(dtype=int)
    patch: wp.array(dtype=lane_int)
    patch_weight: wp.array(dtype=lane)
    patch_rest: wp.array(dtype=lane)
    patch_curved: wp.array(dtype=lane)
    patch_soft: wp.array(dtype=lane_int)
    patch_colour: wp.array(dtype=int)
    yarn_gain: wp.array(dtype=lane)
    yarn_pull: wp.array(dtype=lane)
    yarn_inverse: wp.array(dtype=lane)
    yarn_goal: wp.array(dtype=lane)
    cell_sum: wp.array(dtype=lane)
    triangle_sum: wp.array(dtype=lane)
    scalars: wp.array(dtype=lane)
    notes: wp.array(dtype=lane)


@wp.func
def as_lanes(a: wp.array(dtype=float), count: int):
    """``a`` as ``count`` vectors of sixteen; its memory must reach that far."""
    return wp.array(ptr=a.ptr, shape=(count,), dtype=lane)


@wp.func
def as_lanes(a: wp.array(dtype=fine), count: int):
    return wp.array(ptr=a.ptr, shape=(count,), dtype=fine_lane)


@wp.func
def by_sixteen(p: Any, t: Any, wide: Any, m: int):
    """The particles of one world as m vectors of sixteen, for the loops over particles; ``p`` is empty."""
    p.group = t.group
    p.worlds = t.worlds
    p.x = as_lanes(t.x, m)
    p.y = as_lanes(t.y, m)
    p.z = as_lanes(t.z, m)
    p.px = as_lanes(t.px, m)
    p.py = as_lanes(t.py, m)
    p.pz = as_lanes(t.pz, m)
    p.vx = as_lanes(t.vx, m)
    p.vy = as_lanes(t.vy, m)
    p.vz = as_lanes(t.vz, m)
    p.w = as_lanes(t.w, m)
    p.fx = as_lanes(t.fx, m)
    p.fy = as_lanes(t.fy, m)
    p.fz = as_lanes(t.fz, m)
    p.scalars = wide.scalars
    p.notes = wide.notes
    p.near = t.near
    for k in range(SCALARS):
        p.scalars[k] = fill(p.x[0], t.scalars[k])
    return p


@wp.func
def elastic_wide(t: Any, wide: Wide, run: Settings):
    """One pass over the elastic constraints: `nuno.solver.frame.elastic` by sixteen."""
    for c in range(wide.patch_colour.shape[0] - 1):
        bend_patches(t, wide, run, wide.patch_colour[c], wide.patch_colour[c + 1], 0, 1)
    for c in range(wide.twist_colour.shape[0] - 1):
        bend_twists(t, wide, run, wide.twist_colour[c], wide.twist_colour[c + 1], 0, 1)
    for c in range(wide.line_colour.shape[0] - 1):
        bend_lines(t, wide, run, wide.line_colour[c], wide.line_colour[c + 1], 0, 1)
    if run.sweeps > 0:
        sweep_wide(t, wide, run)
    else:
        for c in range(wide.cell_colour.shape[0] - 1):
            shear_cells(t, wide, run, wide.cell_colour[c], wide.cell_colour[c + 1], 0, 1)
        for c in range(wide.triangle_colour.shape[0] - 1):
            strain_triangles(t, wide, run, wide.triangle_colour[c], wide.triangle_colour[c + 1], 0, 1)
        stretch_wide(t, wide, wide.edge_rest, run, 0, wide.yarn_kind[wide.yarn_kind.shape[0] - 1])


@wp.func
def stretch_wide(t: Any, wide: Wide, rest: wp.array(dtype=lane), run: Settings, first: int, last: int):
    """The groups of sixteen yarns first to last."""
    rate = 1.0 / (run.dt * run.dt)
    for k in range(first, last):
        start = wide.yarn[k]
        end = wide.yarn[k + 1]
        stretch_yarn(t, wide, rest, wide.yarn_gain, wide.yarn_pull, wide.yarn_inverse, start, end, rate)


@wp.func
def sweep_wide(t: Any, wide: Wide, run: Settings):
    """`nuno.solver.frame.sweep_membrane` by sixteen."""
    for sweep in range(run.sweeps):
        for c in range(wide.cell_colour.shape[0] - 1):
            last = wide.cell_colour[c + 1]
            shear_cells_again(t, wide, wide.cell_sum, run, sweep, wide.cell_colour[c], last, 0, 1)
        for c in range(wide.triangle_colour.shape[0] - 1):
            last = wide.triangle_colour[c + 1]
            strain_triangles_again(t, wide, wide.triangle_sum, run, sweep, wide.triangle_colour[c], last, 0, 1)
        for c in range(wide.yarn_kind.shape[0] - 1):
            first = wide.yarn_kind[c]
            last = wide.yarn_kind[c + 1]
            if sweep == 0:
                stretch_wide(t, wide, wide.edge_rest, run, first, last)
            else:
                stretch_wide(t, wide, wide.yarn_goal, run, first, last)
            if sweep + 1 < run.sweeps:
                note_lengths(t, wide, wide.yarn_goal, wide.yarn[first], wide.yarn[last], 0, 1)


@wp.func
def advance_wide(
    t: Any, p: Any, near: StateFloat, nearby: StateLanes, topo: Topology, wide: Wide, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """`nuno.solver.frame.advance` with its loops by sixteen; ``p`` is ``t`` by sixteen, ``nearby`` is ``near``."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                near_shapes(near, n, run, shapes, 0, 1)
                near_sharp(near, topo, run, shapes, 0, 1)
                forget_loads(t, run, 0, 1)
            tick(t, run, 0)
            if run.touching != 0:
                renew_lists(near, topo, run, 0, 1)
            if run.damped != 0:
                damp_bends(t, wide, run, 0, 1, 1)
            predict(p, m, run, 0, 1)
            hold_vertices(t, run, 0, 1)
            elastic_wide(t, wide, run)
        if run.parts & PULLS != 0:
            pull_points(t, run, 0, 1)
        if run.touching != 0 and run.parts & LAYERS != 0:
            for _again in range(run.passes):
                touch_edge_edge(t, n, run, 0, 1)
                touch_vertex_triangle(t, n, run, 0, 1)
        if run.parts & SHAPES != 0:
            meet_sharp(t, topo, run, shapes, 0, 1)
            read_loads(t, run, 0, 1)
            p.notes[CLOCK] = fill(p.x[0], t.notes[CLOCK])  # moving shapes are where the clock says
            touch_shapes(p, m, shapes, run.dt, 0, 1)
        if run.parts & VELOCITIES != 0:
            reset_speed(p, 0)
            read_velocities(p, m, run, 0, 1)
            round_places(nearby, p, m, 0, 1)
            t.notes[SPEED] = largest(p.notes[SPEED])


@wp.kernel(enable_backward=False)
def run_wide(s: StateFloat, topo: Topology, wide: Wide, size: Sizes, run: Settings, shapes: Shapes, substeps: int):
    """One world by one thread."""
    n = topo.particles
    t = view(s, wp.tid(), n, size)
    p = by_sixteen(StateLanes(), t, wide, (n + LANES - 1) / LANES)
    advance_wide(t, p, t, p, topo, wide, run, shapes, substeps)


@wp.kernel(enable_backward=False, module="nuno.solver.run_fine_wide")
def run_fine_wide(
    s: StateFine, near: StateFloat, topo: Topology, wide: Wide, size: Sizes, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """One world by one thread, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, size)
    floats = view(near, wp.tid(), n, size)
    p = by_sixteen(StateFineLanes(), t, wide, m)
    advance_wide(t, p, floats, by_sixteen(StateLanes(), floats, wide, m), topo, wide, run, shapes, substeps)


def widen_topology(topology: Any, arrays: Any) -> Any:
    """Return `Wide` for one world on the CPU.

    Args:
        topology: `ClothTopology`, for where the colours start.
        arrays: The solver's `Topology`, whose compliance indices are set.
    """
    wide = Wide()

    def groups(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of sixteen elements, colour by colour, and where each colour starts among the rows."""
        rows, starts = [], [0]
        for first, last in pairwise(offsets.tolist()):
            count = -(-(last - first) // LANES)
            rows.append(np.minimum(first + np.arange(count * LANES), last - 1).reshape(count, LANES))
            starts.append(starts[-1] + count)
        return np.concatenate(rows or [np.zeros((0, LANES), int)]).astype(int), np.array(starts, dtype=np.int32)

    def gathered(values: np.ndarray, rows: np.ndarray) -> wp.array:
        """The columns of an array by rows of sixteen: (rows * columns) vectors."""
        whole = np.issubdtype(values.dtype, np.integer)
        table = values.reshape(len(values), math.prod(values.shape[1:]))[rows].transpose(0, 2, 1).reshape(-1, LANES)
        table = np.ascontiguousarray(table, dtype=np.int32 if whole else np.float32)
        return wp.array(table, dtype=lane_int if whole else lane, device="cpu")

    kinds = {"cell": ("scale", "soft"), "line": ("scale", "soft"), "twist": ("scale", "soft")}
    kinds["triangle"] = ("u", "v", "area", "soft")
    kinds["patch"] = ("weight", "rest", "curved", "soft")
    for name, columns in kinds.items():
        elements = topology.patches if name == "patch" else getattr(topology, name + "s")
        rows, starts = groups(elements.offsets)
        setattr(wide, name + "_colour", wp.array(starts, dtype=int, device="cpu"))
        for full in (name, *(f"{name}_{column}" for column in columns)):
            values = getattr(arrays, full).numpy()
            # a flat table has the elements' rows one after the other
            setattr(wide, full, gathered(values.reshape(len(elements), -1) if len(elements) else values[:0], rows))
    _widen_yarns(wide, arrays, gathered)
    wide.yarn_goal = wp.zeros(wide.yarn_pull.shape, dtype=lane, device="cpu")
    wide.cell_sum = wp.zeros(max(1, wide.cell_scale.shape[0]), dtype=lane, device="cpu")
    wide.triangle_sum = wp.zeros(max(1, 3 * wide.triangle_area.shape[0]), dtype=lane, device="cpu")
    wide.scalars = wp.zeros(SCALARS, dtype=lane, device="cpu")
    wide.notes = wp.zeros(NOTES, dtype=lane, device="cpu")
    return wide


def _widen_yarns(wide: Any, arrays: Any, gathered: Any) -> None:
    """Sixteen yarns of one direction and length side by side."""
    starts, kinds = arrays.yarn.numpy(), arrays.yarn_kind.numpy()
    rows, firsts, groups = [], [0], [0]
    for low, high in pairwise(kinds.tolist()):
        for first in range(low, high, LANES):
            yarns = np.minimum(first + np.arange(LANES), high - 1)
            length = starts[yarns[0] + 1] - starts[yarns[0]]
            rows.append(starts[yarns][None] + np.arange(length)[:, None])
            firsts.append(firsts[-1] + length)
        groups.append(len(rows))
    table = np.concatenate(rows or [np.zeros((0, LANES), int)]).astype(int)
    wide.yarn = wp.array(np.array(firsts, np.int32), dtype=int, device="cpu")
    wide.yarn_kind = wp.array(np.array(groups, np.int32), dtype=int, device="cpu")
    for name in ("edge", "edge_rest", "edge_scale", "edge_soft"):
        setattr(wide, name, gathered(getattr(arrays, name).numpy(), table))
    for name in ("yarn_gain", "yarn_pull", "yarn_inverse"):
        setattr(wide, name, wp.zeros(max(1, len(table)), dtype=lane, device="cpu"))
