"""One world alone on the CPU: sixteen elements of a colour, or sixteen particles, in the lanes of a vector.

The tables repeat the cloth's elements by groups of sixteen. A group that would be short repeats its last element,
which then is written several times with the same values. Colours and phases come in the order that they have in all
plans, so that a world gives the same bits here as in the lanes of a batch.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.lanes import LANES, full_like, lane, lane_int
from nuno.state.cloth_state import NOTES, SCALARS, make_struct
from nuno.topology.cloth_topology import ELEMENT_KINDS

_LANES, _INDICES, _INTS = wp.array(dtype=lane), wp.array(dtype=lane_int), wp.array(dtype=int)


def _element_fields() -> dict[str, Any]:
    fields: dict[str, Any] = {"edge": _INDICES, "edge_rest": _LANES, "edge_scale": _LANES, "edge_compliance": _INDICES}
    fields |= {"grid_line": _INTS, "grid_line_kind": _INTS}
    for kind in ELEMENT_KINDS:
        fields[kind.name] = _INDICES
        fields |= {f"{kind.name}_{name}": _LANES for name in kind.columns}
        fields |= {f"{kind.name}_compliance": _INDICES, f"{kind.name}_colour": _INTS}
    return fields


_ROOM = (
    "grid_line_gain", "grid_line_pull", "grid_line_inverse", "grid_line_goal", "cell_sum", "triangle_sum", "scalars",
    "notes",
)  # fmt: skip
SimdElements = make_struct(
    "SimdElements", __name__, {"particles": int} | _element_fields() | dict.fromkeys(_ROOM, _LANES)
)
"""The elements by groups of sixteen, under the names that `Topology` has for them; room for the grid lines."""


@wp.func
def as_lanes(a: wp.array(dtype=float), count: int):
    """``a`` as ``count`` vectors of sixteen; its memory must reach that far."""
    return wp.array(ptr=a.ptr, shape=(count,), dtype=lane)


@wp.func
def as_lanes(a: wp.array(dtype=float64), count: int):
    return wp.array(ptr=a.ptr, shape=(count,), dtype=double_lane)


@wp.func
def by_sixteen(p: Any, t: Any, simd: Any, m: int):
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
    p.scalars = simd.scalars
    p.notes = simd.notes
    p.shape_list = t.shape_list
    for k in range(SCALARS):
        p.scalars[k] = full_like(p.x[0], t.scalars[k])
    return p


def pack_topology(topology: Any, arrays: Any) -> Any:
    """Return `SimdElements` for one world on the CPU.

    Args:
        topology: `ClothTopology`, for where the colours start.
        arrays: The solver's `Topology`, whose compliance indices are set.
    """
    simd = SimdElements()
    simd.particles = arrays.particles

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

    for kind in ELEMENT_KINDS:
        elements = getattr(topology, kind.elements)
        rows, starts = groups(elements.offsets)
        setattr(simd, f"{kind.name}_colour", wp.array(starts, dtype=int, device="cpu"))
        for full in (kind.name, *(f"{kind.name}_{column}" for column in (*kind.columns, "compliance"))):
            values = getattr(arrays, full).numpy()
            # a flat table has the elements' rows one after the other
            setattr(simd, full, gathered(values.reshape(len(elements), -1) if len(elements) else values[:0], rows))
    _pack_grid_lines(simd, arrays, gathered)
    simd.grid_line_goal = wp.zeros(simd.grid_line_pull.shape, dtype=lane, device="cpu")
    simd.cell_sum = wp.zeros(max(1, simd.cell_scale.shape[0]), dtype=lane, device="cpu")
    simd.triangle_sum = wp.zeros(max(1, 3 * simd.triangle_area.shape[0]), dtype=lane, device="cpu")
    simd.scalars = wp.zeros(SCALARS, dtype=lane, device="cpu")
    simd.notes = wp.zeros(NOTES, dtype=lane, device="cpu")
    return simd


def _pack_grid_lines(simd: Any, arrays: Any, gathered: Any) -> None:
    """Sixteen grid lines of one direction and length side by side."""
    starts, kinds = arrays.grid_line.numpy(), arrays.grid_line_kind.numpy()
    rows, firsts, groups = [], [0], [0]
    for low, high in pairwise(kinds.tolist()):
        for first in range(low, high, LANES):
            grid_lines = np.minimum(first + np.arange(LANES), high - 1)
            length = starts[grid_lines[0] + 1] - starts[grid_lines[0]]
            rows.append(starts[grid_lines][None] + np.arange(length)[:, None])
            firsts.append(firsts[-1] + length)
        groups.append(len(rows))
    table = np.concatenate(rows or [np.zeros((0, LANES), int)]).astype(int)
    simd.grid_line = wp.array(np.array(firsts, np.int32), dtype=int, device="cpu")
    simd.grid_line_kind = wp.array(np.array(groups, np.int32), dtype=int, device="cpu")
    for name in ("edge", "edge_rest", "edge_scale", "edge_compliance"):
        setattr(simd, name, gathered(getattr(arrays, name).numpy(), table))
    for name in ("grid_line_gain", "grid_line_pull", "grid_line_inverse"):
        setattr(simd, name, wp.zeros(max(1, len(table)), dtype=lane, device="cpu"))
