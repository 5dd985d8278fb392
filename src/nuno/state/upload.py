"""A cloth's elements on a device, where all its worlds share them."""

from typing import Any

import numpy as np
import warp as wp

from nuno.topology.cloth_topology import ClothTopology
from nuno.topology.grid_lines import find_grid_lines
from nuno.topology.leaves import Leaves

BLOCK_ARRAYS = {
    "leaf_vertex": "vertex", "leaf_vertex_start": "vertex_start", "leaf_face": "face",
    "leaf_face_start": "face_start", "leaf_edge": "edge", "leaf_edge_start": "edge_start",
    "leaf_corner": "corner", "leaf_corner_start": "corner_start", "crease": "crease",
    "region_corner": "region_corner", "region_start": "region_start", "leaf_span": "span",
    "crease_corner": "crease_corner",
}  # fmt: skip
"""The arrays of a `nuno.state.cloth_state.Topology` that come from `nuno.topology.leaves.Leaves`, and their names
there."""


def upload(topology: ClothTopology, device: str) -> dict[str, wp.array]:
    """The topology's arrays on a device, made once."""
    found = topology.device_arrays.get(device)
    if found is not None:
        return found

    def put(values: np.ndarray, dtype: Any) -> wp.array:
        return _put(values, dtype, device)

    t = topology
    order, starts, kinds = find_grid_lines(t.edges)
    made = dict(
        edge=put(t.edges.vertices[order], wp.vec2i), edge_rest=put(t.edges.extra["rest"][order], float),
        edge_scale=put(t.edges.scale[order], float), edge_compliance=put(t.edges.axis[order], int),
        grid_line=put(starts, int), grid_line_kind=put(kinds, int),
        cell=put(t.cells.vertices, wp.vec4i), cell_scale=put(t.cells.extra["quarter"], float),
        cell_colour=put(t.cells.offsets, int), cell_compliance=put(t.cells.axis, int),
        triangle=put(t.triangles.vertices, wp.vec3i), triangle_u=put(t.triangles.extra["u"], wp.vec3),
        triangle_v=put(t.triangles.extra["v"], wp.vec3), triangle_area=put(t.triangles.extra["area"], float),
        triangle_colour=put(t.triangles.offsets, int),
        triangle_compliance=put(np.zeros((len(t.triangles), 3)), wp.vec3i),
        line=put(t.lines.vertices, wp.vec3i), line_scale=put(t.lines.scale, float),
        line_colour=put(t.lines.offsets, int), line_compliance=put(t.lines.axis, int),
        twist=put(t.twists.vertices, wp.vec4i), twist_scale=put(t.twists.scale, float),
        twist_colour=put(t.twists.offsets, int), twist_compliance=put(t.twists.axis, int),
        patch=put(t.patches.vertices.ravel(), int), patch_weight=put(t.patches.extra["weight"].ravel(), float),
        patch_rest=put(t.patches.extra["rest"].ravel(), float), patch_curved=put(t.patches.extra["curved"], float),
        patch_colour=put(t.patches.offsets, int), patch_compliance=put(t.patches.axis, int),
    )  # fmt: skip
    made |= _upload_blocks(topology.leaves, device)
    topology.device_arrays[device] = made
    return made


def upload_blocks(topology: ClothTopology, guarded: bool, device: str) -> dict[str, wp.array]:
    """The arrays of `ClothTopology.leaves`, or of ``guarded_blocks``, on a device, made once."""
    if not guarded or not len(topology.cells):
        made = upload(topology, device)
        return {name: made[name] for name in BLOCK_ARRAYS}
    key = f"guarded on {device}"
    if key not in topology.device_arrays:
        topology.device_arrays[key] = _upload_blocks(topology.guarded_blocks, device)
    found: dict[str, wp.array] = topology.device_arrays[key]
    return found


def _upload_blocks(leaves: Leaves, device: str) -> dict[str, wp.array]:
    kinds = {"face": wp.vec3i, "edge": wp.vec2i, "crease": wp.vec4i}
    return {
        name: _put(getattr(leaves, column), kinds.get(column, int), device) for name, column in BLOCK_ARRAYS.items()
    }


def _put(values: np.ndarray, dtype: Any, device: str) -> wp.array:
    kind = np.int32 if dtype in (int, wp.vec2i, wp.vec3i, wp.vec4i) else np.float32
    return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)
