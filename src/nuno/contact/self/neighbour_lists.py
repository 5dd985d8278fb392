"""Neighbour lists of a cloth: vertices and triangles, and pairs of edges, that may touch, and how long a list is good.

A list holds all pairs nearer than the thickness and a margin, and stays valid until two points of the cloth may have
moved towards each other by the margin. Its order is that of the leaves, whatever else is in it: pairs that do not
touch change nothing, so results do not depend on when a list was made, with what margin, or together with which
other worlds.
"""

from typing import Any

import warp as wp

from nuno.contact.self.narrow_phase import append, near_edges, near_triangle
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import (  # noqa: F401 (add, mul, sub: Warp takes them for the operators)
    add,
    anywhere,
    choose,
    full_like,
    lane_max_int,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
    within,
)
from nuno.state.cloth_state import (
    INNER_REACH,
    INNER_TRAVEL,
    MAX_NEIGHBOURS,
    SPEED,
    THICKNESS,
    Settings,
    StateFloat,
    Topology,
)

INNER_AHEAD = wp.constant(1.5)
"""Substeps for which the pairs that may touch are picked, at the speed of the moment."""
FORGET = wp.constant(1.0e8)
"""[m] A travel beyond this says that there is no list."""


@wp.func
def begin_list(t: StateFloat):
    """Count anew, and keep what the last list came to: one thread's work."""
    for k in range(2):
        t.pair_count[MAX_NEIGHBOURS + k] = wp.max(t.pair_count[MAX_NEIGHBOURS + k], t.pair_count[k])
        t.pair_count[k] = 0


@wp.func
def find_creases(t: StateFloat, topo: Topology, far2: float, rank: int, size: int):
    """The further pairs of edges that are near each other, less those that the flags of flat regions rule out."""
    for k in range(rank, topo.crease.shape[0], size):
        tame = bool(False)
        if topo.columns > 0:
            tame = t.moved[topo.crease_corner[k]] != 0
        if not tame:
            q = topo.crease[k]
            hit = near_edges(t, q[0], q[1], q[2], q[3], far2)
            append(hit, t.pair_count, 1, t.edge_edge, q[0], q[1], q[2], q[3])


@wp.func
def swept(t: Any, run: Settings):
    """Return how far beyond its thickness a pair is looked at [m], when a substep begins.

    Little, for a pair that comes in from farther away is found one substep later, unless it is so fast that it
    could be on the other side by then.
    """
    thickness = t.scalars[THICKNESS]
    go = sqrt(t.notes[SPEED]) * (3.0 * run.dt) + 10.0 * run.dt * run.dt
    return minimum(maximum(go - thickness, thickness * 0.1), run.reach)


@wp.func
def make_inner_list(t: Any, far: Any, rank: int, size: int):
    """Add those of the listed pairs that are nearer than ``far`` to those that may touch."""
    far2 = far * far
    none = full_like(far, -1.0)
    for k in range(rank, wp.min(lane_max_int(t.pair_count[0]), t.vertex_triangle.shape[0] / 4), size):
        a = t.vertex_triangle[4 * k]
        b = t.vertex_triangle[4 * k + 1]
        c = t.vertex_triangle[4 * k + 2]
        d = t.vertex_triangle[4 * k + 3]
        hit = choose(within(far, k, t.pair_count[0]), near_triangle(t, a, b, c, d, far2), none)
        append(hit, t.active_count, 0, t.active_triangle, a, b, c, d)
    for k in range(rank, wp.min(lane_max_int(t.pair_count[1]), t.edge_edge.shape[0] / 4), size):
        a = t.edge_edge[4 * k]
        b = t.edge_edge[4 * k + 1]
        c = t.edge_edge[4 * k + 2]
        d = t.edge_edge[4 * k + 3]
        hit = choose(within(far, k, t.pair_count[1]), near_edges(t, a, b, c, d, far2), none)
        append(hit, t.active_count, 1, t.active_edge, a, b, c, d)


@wp.func
def find_active(t: Any, run: Settings, fresh: int, rank: int, size: int):
    """Pick the listed pairs that may touch within the next few substeps, each world as many as its speed asks for.

    Few of the listed pairs ever touch before the list is made anew, and solving looks at each in every substep.
    """
    like = t.x[0]
    approach = swept(t, run)
    if fresh != 0 or anywhere(t.notes[INNER_TRAVEL] * 2.0 + approach - t.notes[INNER_REACH]):
        ahead = approach + sqrt(t.notes[SPEED]) * (2.0 * INNER_AHEAD * run.dt) + 0.1 * run.reach
        barrier(size)
        if rank == 0:
            t.active_count[0] = t.active_count[0] * 0
            t.active_count[1] = t.active_count[1] * 0
            t.notes[INNER_TRAVEL] = full_like(like, 0.0)
            t.notes[INNER_REACH] = ahead
        barrier(size)
        make_inner_list(t, t.scalars[THICKNESS] + ahead * 1.01, rank, size)
        barrier(size)
