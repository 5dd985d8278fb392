"""Phases of a substep in which particles move: damping, prediction, elasticity, and at the end velocities.

Overloads are told by the table of elements, as `nuno.plans.substep` says.
"""

from typing import Any

import warp as wp

from nuno.constraints.damping import damp_bends
from nuno.constraints.grips import hold_vertices
from nuno.constraints.position_shifts import clear_shifts
from nuno.contact.self.group_search import rebuild_by_group
from nuno.contact.self.list_rebuild import rebuild_lists
from nuno.numbers.block_group import BlockGroup, grid_barrier, rank_in_block, wait_for, wait_for_block
from nuno.numbers.crew import Crew
from nuno.numbers.lanes import LANES, lane_max
from nuno.plans.cloth_elastic import solve_cloth
from nuno.plans.group_figures import share_speed, share_speed_and_inversion
from nuno.plans.simd_elements import SimdElements
from nuno.plans.soft_elastic import advance_notes, damp_soft, solve_soft
from nuno.plans.stage_kernels import BlockShare, go_through
from nuno.state.cloth_state import SPEED, Settings, Topology
from nuno.state.integrate import predict
from nuno.state.soft_state import SimdClusters, Tetrahedra


@wp.func
def share_of(table: BlockShare, crew: Any):
    """The particles that are the member's: the first, beyond the last, and the step from one to the next."""
    return table.first + crew.rank_in_block, table.last, crew.block_size


@wp.func
def share_of(table: SimdElements, crew: Crew):
    return crew.rank, (table.particles + LANES - 1) / LANES, crew.size


@wp.func
def share_of(table: SimdClusters, crew: Crew):
    return crew.rank, (table.particles + LANES - 1) / LANES, crew.size


@wp.func
def share_of(table: Any, crew: Any):
    return crew.rank, table.particles, crew.size


@wp.func
def rebuild(floats: Any, table: Any, surface: Topology, run: Settings, crew: Crew):
    """The neighbour lists of self-contact, made anew where something may have come too close for them."""
    rebuild_lists(floats, surface, run, crew.rank, crew.size)


@wp.func
def rebuild(floats: Any, table: BlockShare, surface: Topology, run: Settings, crew: BlockGroup):
    rebuild_by_group(floats, surface, run, table.lists, table.world, crew)


@wp.func
def begin_motion(t: Any, floats: Any, table: Tetrahedra, surface: Any, run: Settings, k: int, crew: Any):
    """Begin substep k: neighbour lists of a cloth, and damping, before anything is predicted."""
    begin_soft_motion(t, table, run, k, crew)


@wp.func
def begin_motion(t: Any, floats: Any, table: SimdClusters, surface: Any, run: Settings, k: int, crew: Any):
    begin_soft_motion(t, table, run, k, crew)


@wp.func
def begin_soft_motion(t: Any, table: Any, run: Settings, k: int, crew: Any):
    """`begin_motion` of a soft body."""
    advance_notes(t, rank_in_block(crew))
    wait_for_block(crew)
    if run.damped != 0 and (run.first + k) % run.frame % wp.max(run.damped, 1) == 0:
        damp_soft(t, table, run, crew)


@wp.func
def begin_motion(t: Any, floats: Any, table: BlockShare, surface: Topology, run: Settings, k: int, crew: Any):
    begin_cloth_motion(t, floats, table, surface, surface, run, crew)


@wp.func
def begin_motion(t: Any, floats: Any, table: Any, surface: Topology, run: Settings, k: int, crew: Any):
    begin_cloth_motion(t, floats, table, table, surface, run, crew)


@wp.func
def begin_cloth_motion(t: Any, floats: Any, table: Any, bends: Any, surface: Topology, run: Settings, crew: Any):
    """`begin_motion` of a cloth, whose bends are in a table of their own where it is shared out."""
    wait_for_block(crew)
    if run.touching != 0:
        rebuild(floats, table, surface, run, crew)
    if run.damped != 0:
        damp_bends(t, bends, run, crew)


@wp.func
def move(t: Any, p: Any, table: BlockShare, surface: Topology, run: Settings, crew: BlockGroup):
    """Predict the particles, set those that are held where their paths are, and solve the elastic constraints."""
    go_through(t, surface, table.work, table.steps, run, table.held_first, 0, table.work.steps, crew)
    grid_barrier(crew)


@wp.func
def move(t: Any, p: Any, table: Any, surface: Any, run: Settings, crew: Any):
    first, last, step = share_of(table, crew)
    predict(p, last, run, first, step)
    wait_for(crew)
    if run.grips > 0:
        hold_vertices(t, run, crew.rank, crew.size)
        wait_for(crew)
    solve_elastic(t, table, run, crew)


@wp.func
def solve_elastic(t: Any, table: Tetrahedra, run: Settings, crew: Any):
    """The elastic constraints of a body."""
    solve_soft(t, table, run, crew)


@wp.func
def solve_elastic(t: Any, table: SimdClusters, run: Settings, crew: Any):
    solve_soft(t, table, run, crew)


@wp.func
def solve_elastic(t: Any, table: Any, run: Settings, crew: Crew):
    solve_cloth(t, table, run, crew)


@wp.func
def drop_shifts(p: Any, table: Tetrahedra, n: int, rank: int, size: int):
    """Let what moved without speed not count as motion; only a soft body's inverted elements do so."""
    clear_shifts(p, n, rank, size)


@wp.func
def drop_shifts(p: Any, table: SimdClusters, n: int, rank: int, size: int):
    clear_shifts(p, n, rank, size)


@wp.func
def drop_shifts(p: Any, table: Any, n: int, rank: int, size: int):
    return


@wp.func
def share_notes(t: Any, p: Any, table: SimdElements, k: int, crew: Crew):
    """Bring what members noted for themselves together, and wait; the end of a substep."""
    t.notes[SPEED] = lane_max(p.notes[SPEED])


@wp.func
def share_notes(t: Any, p: Any, table: SimdClusters, k: int, crew: Crew):
    t.notes[SPEED] = lane_max(p.notes[SPEED])


@wp.func
def share_notes(t: Any, p: Any, table: BlockShare, k: int, crew: BlockGroup):
    share_speed(t, k, crew)


@wp.func
def share_notes(t: Any, p: Any, table: Tetrahedra, k: int, crew: BlockGroup):
    share_speed_and_inversion(t, k, crew)


@wp.func
def share_notes(t: Any, p: Any, table: Any, k: int, crew: Crew):
    wait_for(crew)
