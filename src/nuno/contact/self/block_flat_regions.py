"""Flat regions of a sheet, where nothing can be near itself, found by the threads of a CUDA block.

Most pairs of leaves that are near each other are neighbours on the sheet. Those that lie in one flat region of its grid
are passed over. The search's flags stand in `State.moved`, which is zero between the passes over contacts.
"""

import warp as wp

from nuno.state.cloth_state import StateFloat, Topology
from nuno.topology.leaves import FLAT_SIDE

SIDE = wp.constant(FLAT_SIDE)
"""Vertices along a side of a square."""
ROUNDING = wp.constant(1.001)
"""Factor by which the lines of a square must be farther apart than asked for."""


@wp.func
def along(t: StateFloat, k: int, d: wp.vec3):
    """Return how far vertex k is along a direction."""
    return t.x[k] * d[0] + t.y[k] * d[1] + t.z[k] * d[2]


@wp.func
def vertex(t: StateFloat, k: int):
    """Return where vertex k is."""
    return wp.vec3(t.x[k], t.y[k], t.z[k])


@wp.func
def uncreased(t: StateFloat, at: int, columns: int, far: float):
    """Return True if the diagonals of the square of 3 by 3 vertices from ``at`` on keep a distance."""
    d = vertex(t, at + 2) - vertex(t, at + 2 * columns)
    gap = float(1.0e30)
    before = float(-2.0e30)
    diagonals = int(5)  # a variable, or Warp would unroll the loop
    for k in range(diagonals):
        high = float(-1.0e30)
        low = float(1.0e30)
        for j in range(wp.max(2 - k, 0), wp.min(5 - k, 3)):
            s = along(t, at + j * columns + j + k - 2, d)
            high = wp.max(high, s)
            low = wp.min(low, s)
        gap = wp.min(gap, low - before)
        before = high
    return gap > wp.length(d) * far


@wp.func
def apart(t: StateFloat, at: int, step: int, other: int, far: float):
    """Return True if the lines of a square, ``step`` from one to the next, keep a distance."""
    side = int(SIDE)
    d = wp.vec3(0.0, 0.0, 0.0)
    for j in range(side):
        k = at + j * other
        d = d + (vertex(t, k + (side - 1) * step) - vertex(t, k))
    gap = float(1.0e30)
    before = float(-2.0e30)
    for i in range(side):
        high = float(-1.0e30)
        low = float(1.0e30)
        for j in range(side):
            s = along(t, at + i * step + j * other, d)
            high = wp.max(high, s)
            low = wp.min(low, s)
        gap = wp.min(gap, low - before)
        before = high
    return gap > wp.length(d) * far


@wp.func
def mark_uncreased(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """Flag the lowest vertices of squares of 3 by 3 vertices that have no crease."""
    columns = topo.columns
    if columns > 0:
        interior = columns - 2
        for k in range(rank, interior * (topo.particles / columns - 2), size):
            at = k / interior * columns + k % interior
            t.moved[at] = wp.where(uncreased(t, at, columns, far * ROUNDING), 1, 0)


@wp.func
def mark_flat(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """Flag the lowest vertices of flat regions, behind the flags of `mark_uncreased`."""
    columns = topo.columns
    if columns > 0:
        n = topo.particles
        enough = far * ROUNDING
        interior = columns - SIDE + 1
        for k in range(rank, interior * (n / columns - SIDE + 1), size):
            at = k / interior * columns + k % interior
            creased = int(0)
            for j in range(3):
                for i in range(3):
                    creased += 1 - t.moved[at + j * columns + i]
            flat = int(0)
            if creased == 0:
                if apart(t, at, 1, columns, enough) and apart(t, at, columns, 1, enough):
                    flat = 1
            t.moved[n + at] = flat


@wp.func
def forget_flat(t: StateFloat, topo: Topology, rank: int, size: int):
    """Take back all flags."""
    if topo.columns > 0:
        for k in range(rank, 2 * topo.particles, size):
            t.moved[k] = 0


@wp.func
def in_flat(t: StateFloat, topo: Topology, a: int, b: int):
    """Return True if two leaves lie in one flat region, so that no two of their elements are near."""
    columns = topo.columns
    flat = bool(False)
    if columns > 0:
        stride = topo.leaf_span.shape[0] / 4
        left = wp.min(topo.leaf_span[a], topo.leaf_span[b])
        right = wp.max(topo.leaf_span[stride + a], topo.leaf_span[stride + b])
        low = wp.min(topo.leaf_span[2 * stride + a], topo.leaf_span[2 * stride + b])
        high = wp.max(topo.leaf_span[3 * stride + a], topo.leaf_span[3 * stride + b])
        if right - left < SIDE and high - low < SIDE:
            rows = topo.particles / columns
            at = wp.min(low, rows - SIDE) * columns + wp.min(left, columns - SIDE)
            flat = t.moved[topo.particles + at] != 0
    return flat
