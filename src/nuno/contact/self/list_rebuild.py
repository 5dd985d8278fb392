"""Rebuilding neighbour lists when their skin is used up: on the CPU for each world by itself, on CUDA by a block.

A block's way is in `nuno.contact.self.block_rebuild`, that of several blocks in `nuno.contact.self.group_search`.
"""

from typing import Any

import warp as wp

from nuno.contact.self.block_rebuild import rebuild_by_block
from nuno.contact.self.cpu_inner_lists import make_inner_list_of_world, reach_world
from nuno.contact.self.cpu_search import list_world
from nuno.contact.self.neighbour_lists import FORGET, INNER_AHEAD, swept
from nuno.numbers.crew import shares_work
from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import LANES, add, anywhere, full_like, maximum, minimum, mul, sqrt, sub  # noqa: F401 (add, mul, sub: Warp takes them for the operators)
from nuno.state.cloth_state import (
    INNER_REACH,
    INNER_TRAVEL,
    LISTINGS,
    SPEED,
    THICKNESS,
    TRAVEL,
    Settings,
    StateFloat,
    StateLanes,
    Topology,
)

SLACK = wp.constant(1.1)
"""Times that reach by which the pairs of a substep are found: a hundredth of the thickness more, against rounding."""


@wp.func
def measure_moves(t: Any, topo: Topology):
    """The box of the displacements since the list was made, for each region: behind the regions' own boxes."""
    n = topo.particles
    regions = topo.region_start.shape[0] - 1
    for g in range(regions):
        i = topo.region_corner[topo.region_start[g]]
        lx = at(t.x, i) - at(t.reference, i)
        ly = at(t.y, i) - at(t.reference, n + i)
        lz = at(t.z, i) - at(t.reference, 2 * n + i)
        hx = lx
        hy = ly
        hz = lz
        for k in range(topo.region_start[g] + 1, topo.region_start[g + 1]):
            i = topo.region_corner[k]
            dx = at(t.x, i) - at(t.reference, i)
            dy = at(t.y, i) - at(t.reference, n + i)
            dz = at(t.z, i) - at(t.reference, 2 * n + i)
            lx = minimum(lx, dx)
            ly = minimum(ly, dy)
            lz = minimum(lz, dz)
            hx = maximum(hx, dx)
            hy = maximum(hy, dy)
            hz = maximum(hz, dz)
        k = 6 * (regions + g)
        put(t.bounds, k, lx)
        put(t.bounds, k + 1, ly)
        put(t.bounds, k + 2, lz)
        put(t.bounds, k + 3, hx)
        put(t.bounds, k + 4, hy)
        put(t.bounds, k + 5, hz)


@wp.func
def max_approach(t: Any, topo: Topology, far: Any):
    """Return how much of the margin is used up by two points that have come closer since the list was made [m].

    Points of two regions that were farther from each other than ``far`` have that much more before they matter.
    """
    regions = topo.region_start.shape[0] - 1
    zero = full_like(far, 0.0)
    worst = zero
    for g in range(regions):
        for h in range(g, regions):
            gap = zero
            square = zero
            for c in range(3):
                a = 6 * g + c
                b = 6 * h + c
                gap = maximum(
                    gap, maximum(at(t.bounds, a) - at(t.bounds, b + 3), at(t.bounds, b) - at(t.bounds, a + 3))
                )
                a = a + 6 * regions
                b = b + 6 * regions
                span = maximum(at(t.bounds, a + 3) - at(t.bounds, b), at(t.bounds, b + 3) - at(t.bounds, a))
                square = square + span * span
            worst = maximum(worst, sqrt(square) - maximum(gap - far, zero))
    return worst


@wp.func
def look_ahead(t: Any, run: Settings, approach: Any):
    """Return how far beyond its thickness a pair is in the inner list [m]: for a few substeps, at this speed."""
    return approach + sqrt(t.notes[SPEED]) * (2.0 * INNER_AHEAD * run.dt) + 0.1 * run.reach


@wp.func
def rebuild_lists(t: StateLanes, topo: Topology, run: Settings, rank: int, size: int):
    """List the self-contact pairs anew in those worlds whose list is used up, and pick those that may touch soon.

    Few of the listed pairs ever touch before the list is made anew, and solving looks at each in every substep.
    """
    lanes = int(LANES)  # variables, or Warp would unroll the loops
    # the lanes beyond the last world only repeat it, and nobody looks at them: they go without contact
    worlds = wp.min(lanes, t.worlds - lanes * t.group)
    approach = swept(t, run)
    left = run.margin - approach
    bound = t.notes[TRAVEL] * 2.0 - left
    if anywhere(bound):
        measure_moves(t, topo)
        worst = max_approach(t, topo, t.scalars[THICKNESS] + run.margin)
        worst = maximum(worst, t.notes[TRAVEL] - FORGET)
        late = worst - left
        for k in range(lanes):
            if bound[k] > 0.0:  # a world that would not measure alone does not here: its list is made when it would be
                t.notes[TRAVEL][k] = worst[k] * 0.5
            if bound[k] > 0.0 and late[k] > 0.0:
                t.notes[TRAVEL][k] = 0.0
                if k < worlds:
                    # what was picked of the old list is not to be trusted any more
                    t.notes[INNER_TRAVEL][k] = FORGET
                    t.notes[LISTINGS][k] = t.notes[LISTINGS][k] + 1.0
                    list_world(t, topo, t.scalars[THICKNESS][k] + 1.01 * run.margin, k, lanes)
    due = t.notes[INNER_TRAVEL] * 2.0 + approach - t.notes[INNER_REACH]
    if anywhere(due):
        ahead = look_ahead(t, run, approach)
        for k in range(worlds):
            if due[k] > 0.0:
                t.notes[INNER_TRAVEL][k] = 0.0
                t.notes[INNER_REACH][k] = ahead[k]
                make_inner_list_of_world(t, t.scalars[THICKNESS][k] + 1.01 * ahead[k], k, lanes)
    for k in range(worlds):
        reach_world(t, t.scalars[THICKNESS][k] + SLACK * approach[k], k, lanes)


@wp.func
def rebuild_lists(t: StateFloat, topo: Topology, run: Settings, rank: int, size: int):
    if shares_work(size):
        rebuild_by_block(t, topo, run, rank, size)
    else:
        approach = swept(t, run)
        left = run.margin - approach
        if t.notes[TRAVEL] * 2.0 > left:
            measure_moves(t, topo)
            worst = wp.max(max_approach(t, topo, t.scalars[THICKNESS] + run.margin), t.notes[TRAVEL] - FORGET)
            t.notes[TRAVEL] = 0.5 * worst
            if worst > left:
                t.notes[TRAVEL] = 0.0
                t.notes[INNER_TRAVEL] = FORGET
                t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
                list_world(t, topo, t.scalars[THICKNESS] + 1.01 * run.margin, 0, 1)
        if t.notes[INNER_TRAVEL] * 2.0 + approach > t.notes[INNER_REACH]:
            ahead = look_ahead(t, run, approach)
            t.notes[INNER_TRAVEL] = 0.0
            t.notes[INNER_REACH] = ahead
            make_inner_list_of_world(t, t.scalars[THICKNESS] + 1.01 * ahead, 0, 1)
        reach_world(t, t.scalars[THICKNESS] + SLACK * approach, 0, 1)
