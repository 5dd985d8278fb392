"""Line tension: what a sheet's grid lines are stretched by, against the tension that its substeps bear."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.state.pack import pack_positions

EDGES = 4
"""Edges that follow one another over whose mean a tension is taken: one alone jerks where something strikes it."""


@wp.kernel(enable_backward=False, module="nuno.solvers.line_tension")
def find_tension(
    point: wp.array2d(dtype=wp.vec3), edge: wp.array(dtype=wp.vec2i), rest: wp.array(dtype=float),
    compliance: wp.array2d(dtype=float), place: wp.array(dtype=int), grid_line: wp.array(dtype=int),
    tension: wp.array(dtype=float),
):  # fmt: skip
    """The highest mean tension T = k (l / l0 - 1) of `EDGES` neighbours in a grid line, k their stiffness [N/m]."""
    world, line = wp.tid()
    row = wp.min(world, compliance.shape[0] - 1)
    first = grid_line[line]
    end = grid_line[line + 1]
    count = wp.min(EDGES, end - first)
    highest = float(0.0)
    for start in range(first, end - count + 1):
        total = float(0.0)
        for k in range(start, start + count):
            ends = edge[k]
            length = wp.length(point[world, ends[1]] - point[world, ends[0]])
            total += (length / rest[k] - 1.0) / compliance[row, place[k]]
        highest = wp.max(highest, total / float(count))
    wp.atomic_max(tension, world, highest)


def line_tension(solver: Any) -> np.ndarray:
    """The highest tension along a sheet's grid lines, as its strains say.

    Returns:
        (worlds,) float32 [N/m], 0 where nothing is taut and for cloth meshes, which have no grid lines.
    """
    worlds, n, device, topology = solver.world_count, solver.particle_count, solver.device, solver.device_topology
    tension = wp.zeros(worlds, dtype=float, device=device)
    lines = topology.grid_line.shape[0] - 1
    if lines > 0:
        point = pack_positions(solver.state, worlds, n, solver.lanes, device)
        inputs = [
            point, topology.edge, topology.edge_rest, solver.stretch_table, topology.edge_compliance,
            topology.grid_line, tension,
        ]  # fmt: skip
        wp.launch(find_tension, dim=(worlds, lines), inputs=inputs, device=device)
    return np.asarray(tension.numpy())
