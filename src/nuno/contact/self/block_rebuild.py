"""Rebuilding a world's neighbour list by one CUDA block, once its skin is used up."""

import warp as wp

from nuno.contact.self.block_flat_regions import forget_flat, mark_flat, mark_uncreased
from nuno.contact.self.block_search import find_in_batches
from nuno.contact.self.leaf_pairs import TRAVELLED, WIDTH, closed_in, list_leaf_pairs, measure_leaves
from nuno.contact.self.narrow_phase import bound_leaves, middles
from nuno.contact.self.neighbour_lists import FORGET, begin_list, find_active, find_creases, swept
from nuno.contact.self.search_queue import search_with_spare_blocks
from nuno.numbers.crew import barrier
from nuno.numbers.warps import anyone, leads_warp, warp_max
from nuno.state.cloth_state import LISTINGS, THICKNESS, TRAVEL, Settings, StateFloat, Topology


@wp.func
def rebuild_by_block(t: StateFloat, topo: Topology, run: Settings, rank: int, size: int):
    """List anew what may have come too close for the list, and pick the pairs that may touch: by whole warps.

    Twice the sum of the largest speeds is a bound on that; where it is used up, the displacements are measured.
    """
    n = topo.particles
    fresh = int(0)
    left = run.margin - swept(t, run)
    if t.notes[TRAVEL] * 2.0 > left:
        barrier(size)
        if rank == 0:
            for k in range(6):
                t.reference[3 * n + k] = -1.0e30
        barrier(size)
        measure_leaves(t, topo, rank, size)
        barrier(size)
        lost = t.notes[TRAVEL] > FORGET
        dx = t.reference[3 * n] + t.reference[3 * n + 3]
        dy = t.reference[3 * n + 1] + t.reference[3 * n + 4]
        dz = t.reference[3 * n + 2] + t.reference[3 * n + 5]
        travelled = t.reference[3 * n + TRAVELLED] + wp.sqrt(dx * dx + dy * dy + dz * dz)
        # before the next measure, points of leaves that are not listed may close in by the margin once more
        again = lost or travelled + run.margin > t.reference[3 * n + WIDTH] - run.margin
        worst = float(0.0)
        if not again:
            worst = closed_in(t, topo, run.margin, rank, size)
        if anyone(again or worst > left):
            fresh = 1
            if rank == 0:
                begin_list(t)
                t.notes[TRAVEL] = 0.0
                t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
                t.reference[3 * n + TRAVELLED] = travelled
            # the last percent is for rounding, in here and in the displacements
            far = t.scalars[THICKNESS] + 1.01 * run.margin
            for i in range(rank, n, size):
                t.reference[i] = t.x[i]
                t.reference[n + i] = t.y[i]
                t.reference[2 * n + i] = t.z[i]
            mark_uncreased(t, topo, far, rank, size)
            middles(t, topo, rank, size)
            bound_leaves(t, topo, rank, size)
            barrier(size)
            mark_flat(t, topo, far, rank, size)
            barrier(size)
            if again:
                list_leaf_pairs(t, topo, run.margin, rank, size)
            find_creases(t, topo, far * far, rank, size)
            if t.spare_blocks > 0:
                search_with_spare_blocks(t, topo, far, rank, size)
            else:
                find_in_batches(t, topo, far, rank, size)
            barrier(size)
            forget_flat(t, topo, rank, size)
        else:
            if rank == 0:
                t.notes[TRAVEL] = 0.0
            high = warp_max(0.5 * worst, size)
            barrier(size)
            if leads_warp(rank, size):
                wp.atomic_max(t.notes, TRAVEL, high)
        barrier(size)
    find_active(t, run, fresh, rank, size)
