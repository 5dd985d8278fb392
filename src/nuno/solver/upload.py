"""A cloth's elements on a device, where all its worlds share them."""

from typing import Any

import numpy as np
import warp as wp

from nuno.scene.blocks import Blocks
from nuno.scene.cloth import ClothTopology
from nuno.scene.yarns import string_yarns

BLOCK_ARRAYS = {
    "block_vertex": "vertex", "block_vertex_start": "vertex_start", "block_face": "face",
    "block_face_start": "face_start", "block_edge": "edge", "block_edge_start": "edge_start",
    "block_corner": "corner", "block_corner_start": "corner_start", "crease": "crease",
    "region_corner": "region_corner", "region_start": "region_start", "block_span": "span",
    "crease_window": "crease_window",
}  # fmt: skip
"""The arrays of a `nuno.solver.state.Topology` that come from `nuno.scene.blocks.Blocks`, and their names there."""


def upload(topology: ClothTopology, device: str) -> dict[str, wp.array]:
    """The topology's arrays on a device, made once."""
    found = topology.device_arrays.get(device)
    if found is not None:
        return found

    def put(values: np.ndarray, dtype: Any) -> wp.array:
        return _put(values, dtype, device)

    t = topology
    order, starts, kinds = string_yarns(t.edges)
    made = dict(
        edge=put(t.edges.vertices[order], wp.vec2i), edge_rest=put(t.edges.extra["rest"][order], float),
        edge_scale=put(t.edges.scale[order], float), edge_soft=put(t.edges.axis[order], int),
        yarn=put(starts, int), yarn_kind=put(kinds, int),
        cell=put(t.cells.vertices, wp.vec4i), cell_scale=put(t.cells.extra["quarter"], float),
        cell_colour=put(t.cells.offsets, int), cell_soft=put(t.cells.axis, int),
        triangle=put(t.triangles.vertices, wp.vec3i), triangle_u=put(t.triangles.extra["u"], wp.vec3),
        triangle_v=put(t.triangles.extra["v"], wp.vec3), triangle_area=put(t.triangles.extra["area"], float),
        triangle_colour=put(t.triangles.offsets, int),
        triangle_soft=put(np.zeros((len(t.triangles), 3)), wp.vec3i),
        line=put(t.lines.vertices, wp.vec3i), line_scale=put(t.lines.scale, float),
        line_colour=put(t.lines.offsets, int), line_soft=put(t.lines.axis, int),
        twist=put(t.twists.vertices, wp.vec4i), twist_scale=put(t.twists.scale, float),
        twist_colour=put(t.twists.offsets, int), twist_soft=put(t.twists.axis, int),
        patch=put(t.patches.vertices.ravel(), int), patch_weight=put(t.patches.extra["weight"].ravel(), float),
        patch_rest=put(t.patches.extra["rest"].ravel(), float), patch_curved=put(t.patches.extra["curved"], float),
        patch_colour=put(t.patches.offsets, int), patch_soft=put(t.patches.axis, int),
    )  # fmt: skip
    made |= _upload_blocks(topology.blocks, device)
    topology.device_arrays[device] = made
    return made


def upload_blocks(topology: ClothTopology, guarded: bool, device: str) -> dict[str, wp.array]:
    """The arrays of `ClothTopology.blocks`, or of ``guarded_blocks``, on a device, made once."""
    if not guarded or not len(topology.cells):
        made = upload(topology, device)
        return {name: made[name] for name in BLOCK_ARRAYS}
    key = f"guarded on {device}"
    if key not in topology.device_arrays:
        topology.device_arrays[key] = _upload_blocks(topology.guarded_blocks, device)
    found: dict[str, wp.array] = topology.device_arrays[key]
    return found


def _upload_blocks(blocks: Blocks, device: str) -> dict[str, wp.array]:
    kinds = {"face": wp.vec3i, "edge": wp.vec2i, "crease": wp.vec4i}
    return {
        name: _put(getattr(blocks, column), kinds.get(column, int), device) for name, column in BLOCK_ARRAYS.items()
    }


def _put(values: np.ndarray, dtype: Any, device: str) -> wp.array:
    kind = np.int32 if dtype in (int, wp.vec2i, wp.vec3i, wp.vec4i) else np.float32
    return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)
