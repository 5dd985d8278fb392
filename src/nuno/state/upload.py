"""A cloth's elements on a device, where all its worlds share them."""

from typing import Any

import numpy as np
import warp as wp

from nuno.state.cloth_state import column_type, vertex_type
from nuno.topology.cloth_topology import ELEMENT_KINDS, ClothTopology
from nuno.topology.grid_lines import find_grid_lines
from nuno.topology.leaves import Leaves

LEAF_ARRAYS = {
    "leaf_vertex": "vertex", "leaf_vertex_start": "vertex_start", "leaf_face": "face",
    "leaf_face_start": "face_start", "leaf_edge": "edge", "leaf_edge_start": "edge_start",
    "leaf_corner": "corner", "leaf_corner_start": "corner_start", "crease": "crease",
    "region_corner": "region_corner", "region_start": "region_start", "leaf_span": "span",
    "crease_corner": "crease_corner", "crease_key": "crease_key",
}  # fmt: skip
"""The arrays of a `nuno.state.cloth_state.Topology` that come from `nuno.topology.leaves.Leaves`, and their names
there."""


def upload(topology: ClothTopology, device: str) -> dict[str, wp.array]:
    """The topology's arrays on a device, made once; which compliance an element takes is for its material to say."""
    found = topology.device_arrays.get(device)
    if found is not None:
        return found

    def put(values: np.ndarray, dtype: Any) -> wp.array:
        return _put(values, dtype, device)

    t = topology
    order, starts, kinds = find_grid_lines(t.edges)
    made = dict(
        edge=put(t.edges.vertices[order], wp.vec2i), edge_rest=put(t.edges.extra["rest"][order], float),
        edge_scale=put(t.edges.scale[order], float),
        grid_line=put(starts, int), grid_line_kind=put(kinds, int),
    )  # fmt: skip
    for kind in ELEMENT_KINDS:
        elements = getattr(topology, kind.elements)
        made[kind.name] = put(elements.vertices, vertex_type(kind))
        made[f"{kind.name}_colour"] = put(elements.offsets, int)
        for name, (column, size) in kind.columns.items():
            made[f"{kind.name}_{name}"] = put(elements.column(column), column_type(size))
    made |= _upload_leaves(topology.leaves, device)
    topology.device_arrays[device] = made
    return made


def upload_leaves(topology: ClothTopology, guarded: bool, device: str) -> dict[str, wp.array]:
    """The arrays of `ClothTopology.leaves`, or of ``guarded_leaves``, on a device, made once."""
    if not guarded or not len(topology.cells):
        made = upload(topology, device)
        return {name: made[name] for name in LEAF_ARRAYS}
    key = f"guarded on {device}"
    if key not in topology.device_arrays:
        topology.device_arrays[key] = _upload_leaves(topology.guarded_leaves, device)
    found: dict[str, wp.array] = topology.device_arrays[key]
    return found


def _upload_leaves(leaves: Leaves, device: str) -> dict[str, wp.array]:
    kinds = {"face": wp.vec3i, "edge": wp.vec2i, "crease": wp.vec4i}
    return {name: _put(getattr(leaves, column), kinds.get(column, int), device) for name, column in LEAF_ARRAYS.items()}


def _put(values: np.ndarray, dtype: Any, device: str) -> wp.array:
    kind = np.int32 if dtype in (int, wp.vec2i, wp.vec3i, wp.vec4i) else np.float32
    flat = values.ravel() if dtype in (int, float) else values
    return wp.array(np.ascontiguousarray(flat, dtype=kind), dtype=dtype, device=device)
