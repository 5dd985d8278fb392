"""When a CUDA block lists its world's self-contact pairs anew."""

import warp as wp

from nuno.contact.batches import find_in_batches
from nuno.contact.block_lists import GONE, WIDTH, closed_in, list_blocks, measure_blocks
from nuno.contact.flat_blocks import forget_flat, mark_flat, mark_uncreased
from nuno.contact.helping import find_with_help
from nuno.contact.nearness import bound_blocks, middles
from nuno.contact.pair_lists import FORGET, begin_list, find_creases, pick_touching, swept
from nuno.solver.lanes import barrier
from nuno.solver.state import LISTINGS, THICKNESS, TRAVEL, Settings, StateFloat, Topology
from nuno.solver.warps import anyone, leads_warp, most_of_warp


@wp.func
def find_together(t: StateFloat, topo: Topology, run: Settings, thread: int, threads: int):
    """List anew what may have come too close for the list, and pick the pairs that may touch: by whole warps.

    Twice the sum of the largest speeds is a bound on that; where it is used up, the displacements are measured.
    """
    n = topo.particles
    fresh = int(0)
    left = run.margin - swept(t, run)
    if t.notes[TRAVEL] * 2.0 > left:
        barrier(threads)
        if thread == 0:
            for k in range(6):
                t.listed[3 * n + k] = -1.0e30
        barrier(threads)
        measure_blocks(t, topo, thread, threads)
        barrier(threads)
        lost = t.notes[TRAVEL] > FORGET
        dx = t.listed[3 * n] + t.listed[3 * n + 3]
        dy = t.listed[3 * n + 1] + t.listed[3 * n + 4]
        dz = t.listed[3 * n + 2] + t.listed[3 * n + 5]
        gone = t.listed[3 * n + GONE] + wp.sqrt(dx * dx + dy * dy + dz * dz)
        # before the next measure, points of blocks that are not listed may close in by the margin once more
        again = lost or gone + run.margin > t.listed[3 * n + WIDTH] - run.margin
        most = float(0.0)
        if not again:
            most = closed_in(t, topo, run.margin, thread, threads)
        if anyone(again or most > left):
            fresh = 1
            if thread == 0:
                begin_list(t)
                t.notes[TRAVEL] = 0.0
                t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
                t.listed[3 * n + GONE] = gone
            # the last percent is for rounding, in here and in the displacements
            far = t.scalars[THICKNESS] + 1.01 * run.margin
            for i in range(thread, n, threads):
                t.listed[i] = t.x[i]
                t.listed[n + i] = t.y[i]
                t.listed[2 * n + i] = t.z[i]
            mark_uncreased(t, topo, far, thread, threads)
            middles(t, topo, thread, threads)
            bound_blocks(t, topo, thread, threads)
            barrier(threads)
            mark_flat(t, topo, far, thread, threads)
            barrier(threads)
            if again:
                list_blocks(t, topo, run.margin, thread, threads)
            find_creases(t, topo, far * far, thread, threads)
            if t.helpers > 0:
                find_with_help(t, topo, far, thread, threads)
            else:
                find_in_batches(t, topo, far, thread, threads)
            barrier(threads)
            forget_flat(t, topo, thread, threads)
        else:
            if thread == 0:
                t.notes[TRAVEL] = 0.0
            high = most_of_warp(0.5 * most, threads)
            barrier(threads)
            if leads_warp(thread, threads):
                wp.atomic_max(t.notes, TRAVEL, high)
        barrier(threads)
    pick_touching(t, run, fresh, thread, threads)
