"""Threads of a CUDA warp or block played on the CPU, one after the other: see `nuno.numbers.warp_lanes`.

A kernel goes through all threads a number of times, each time from the start, and keeps what they write the last time:
by then everything that one thread hands to another is what it would be if they ran side by side.
"""

from typing import Any

import numpy as np
import warp as wp

from nuno.constraints.compliances import compliances
from nuno.numbers.doubles import float64
from nuno.numbers.warp_lanes import Lane
from nuno.state.cloth_state import StateDouble, StateFloat, Topology
from nuno.state.upload import upload
from nuno.topology.cloth_topology import ClothTopology

SUBSTEP = 1.0 / 60.0 / 20.0
"""[s]"""


@wp.func
def put_back(t: Any, n: int, start: Any):
    """Set the positions of n particles, in rows of x, y and z."""
    for i in range(n):
        t.x[i] = start[i]
        t.y[i] = start[n + i]
        t.z[i] = start[2 * n + i]


@wp.func
def keep_moved(t: Any, n: int, start: Any, out: Any):
    """Copy what a thread has written."""
    for i in range(n):
        if t.x[i] != start[i] or t.y[i] != start[n + i] or t.z[i] != start[2 * n + i]:
            out[i] = t.x[i]
            out[n + i] = t.y[i]
            out[2 * n + i] = t.z[i]


@wp.func
def played_lane(lane: int, exchanged: wp.array(dtype=float)):
    """A lane of the only warp of a block."""
    own = Lane()
    own.lane = lane
    own.warp = 0
    own.warps = 1
    own.exchanged = exchanged
    return own


def wrinkled_sheet(cells, material, *, doubles=False):
    """Return a sheet with a rough shape and differing masses: its state, elements, and (3, n) where its vertices are.

    Args:
        cells: Cells along either side, of 2 cm by 3 cm.
        material: A `nuno.Cloth`.
        doubles: Whether coordinates are doubles.
    """
    sheet = ClothTopology.sheet(cells, (0.02 * cells[0], 0.03 * cells[1]))
    random, n = np.random.default_rng(3), sheet.vertex_count
    state, table = (StateDouble if doubles else StateFloat)(), Topology()
    for name, value in upload(sheet, "cpu").items():
        setattr(table, name, value)
    table.particles, table.columns = n, sheet.leaves.columns
    found = compliances(sheet, material.resolved(1, sheet.element_count))
    for kind in ("edge", "cell", "line", "twist"):
        setattr(table, f"{kind}_compliance", wp.array(found.place[kind], dtype=int, device="cpu"))
    for kind in ("stretch", "shear", "bend"):
        setattr(state, f"{kind}_compliance", wp.array(getattr(found, kind)[0], dtype=float, device="cpu"))
    # off the axes, so that no coordinate is zero
    start = sheet.rest.T + random.normal(scale=0.002, size=(3, n)) + [[0.61], [0.47], [0.53]]
    start = start.astype(float if doubles else np.float32)
    for name, row in zip("xyz", start, strict=True):
        setattr(state, name, wp.array(row, dtype=float64 if doubles else float, device="cpu"))
    state.w = wp.array(random.uniform(500.0, 4000.0, n), dtype=float, device="cpu")
    for name in ("gain", "pull", "inverse"):
        setattr(state, f"grid_line_{name}", wp.zeros(len(sheet.edges), dtype=float, device="cpu"))
    return state, table, start


def launch(kernel, state, table, start, *numbers):
    """Run a kernel on copies of the coordinates; return (3, n) where the vertices are then."""
    kind = state.x.dtype
    before = wp.array(start.ravel(), dtype=kind, device="cpu")
    out = wp.array(start.ravel(), dtype=kind, device="cpu")
    exchanged = wp.zeros(1 << 20, dtype=float, device="cpu")
    wp.launch(kernel, dim=1, inputs=[state, table, before, out, exchanged, *numbers], device="cpu")
    return out.numpy().reshape(start.shape)
