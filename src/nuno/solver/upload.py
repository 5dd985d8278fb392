"""A cloth's elements on a device, where all its worlds share them."""

from typing import Any

import numpy as np
import warp as wp

from nuno.scene.cloth import ClothTopology
from nuno.scene.yarns import string_yarns


def upload(topology: ClothTopology, device: str) -> dict[str, wp.array]:
    """The topology's arrays on a device, made once."""
    found = topology.device_arrays.get(device)
    if found is not None:
        return found

    def put(values: np.ndarray, dtype: Any) -> wp.array:
        kind = np.int32 if dtype in (int, wp.vec2i, wp.vec3i, wp.vec4i) else np.float32
        return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)

    t, b = topology, topology.blocks
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
        block_vertex=put(b.vertex, int), block_vertex_start=put(b.vertex_start, int),
        block_face=put(b.face, wp.vec3i), block_face_start=put(b.face_start, int),
        block_edge=put(b.edge, wp.vec2i), block_edge_start=put(b.edge_start, int),
        block_corner=put(b.corner, int), block_corner_start=put(b.corner_start, int),
        crease=put(b.crease, wp.vec4i),
        region_corner=put(b.region_corner, int), region_start=put(b.region_start, int), block_span=put(b.span, int),
        crease_window=put(b.crease_window, int),
    )  # fmt: skip
    topology.device_arrays[device] = made
    return made
