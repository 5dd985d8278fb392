"""Phases of a substep in which particles meet: a cloth itself, and particles shapes and grips.

Overloads are told by the table of elements, as `nuno.plans.substep` says.
"""

from typing import Any

import warp as wp

from nuno.constraints.grips import read_loads
from nuno.contact.particle.shape_contact import touch_shapes
from nuno.contact.particle.static_shape_contact import touch_shapes_together
from nuno.contact.self.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.numbers.block_group import BlockGroup, grid_barrier, wait_for, wait_for_block
from nuno.numbers.crew import Crew, shares_work
from nuno.numbers.lanes import full_like
from nuno.plans.motion_phases import share_of
from nuno.plans.simd_elements import SimdElements
from nuno.plans.stage_kernels import BlockShare
from nuno.state.cloth_state import CLOCK, SELF_CONTACT, Settings, Shapes, StateDouble, StateFloat
from nuno.state.soft_state import SimdClusters, Tetrahedra


@wp.func
def take_own_moves(t: Any, table: BlockShare, crew: BlockGroup):
    """Take the sums of what contacts move a block's own particles by."""
    first, last, step = share_of(table, crew)
    for i in range(first, last, step):
        take_moves(t, table.particles, i, table.particles)


@wp.func
def resolve_self_contact(t: Any, table: BlockShare, run: Settings, crew: BlockGroup):
    """A cloth's contacts with itself, in ``run.passes`` passes; a group leaves the last sums to `begin_rest`."""
    for again in range(run.passes):
        if again > 0:
            take_own_moves(t, table, crew)
            grid_barrier(crew)
        touch_edge_edge(t, table.particles, run, crew.rank, crew.size)
        touch_vertex_triangle(t, table.particles, run, crew.rank, crew.size)
        grid_barrier(crew)


@wp.func
def resolve_self_contact(t: Any, table: Tetrahedra, run: Settings, crew: Any):
    return


@wp.func
def resolve_self_contact(t: Any, table: SimdClusters, run: Settings, crew: Any):
    return


@wp.func
def resolve_self_contact(t: Any, table: Any, run: Settings, crew: Crew):
    for _again in range(run.passes):
        touch_edge_edge(t, table.particles, run, crew.rank, crew.size)
        touch_vertex_triangle(t, table.particles, run, crew.rank, crew.size)
        wait_for(crew)
        take_moves(t, table.particles, crew.rank, crew.size)
        wait_for(crew)


@wp.func
def begin_rest(t: Any, table: BlockShare, run: Settings, crew: BlockGroup):
    """Take the sums of contacts that are still to be taken, before shapes are met."""
    if run.touching != 0 and run.parts & SELF_CONTACT != 0:
        take_own_moves(t, table, crew)


@wp.func
def begin_rest(t: Any, table: Any, run: Settings, crew: Any):
    return


@wp.func
def read_grips(t: Any, table: BlockShare, run: Settings, crew: BlockGroup):
    """Loads of stiff grips, and their vertices' own masses again; of a block's own particles where they are shared."""
    if table.held > 0:
        wait_for_block(crew)
        for g in range(crew.rank_in_block, table.held, crew.block_size):
            i = t.grip_corner[3 * g]
            if i >= table.first and i < table.last:
                read_loads(t, run, g, table.held)
        wait_for_block(crew)


@wp.func
def read_grips(t: Any, table: Any, run: Settings, crew: Any):
    if run.grips > 0:
        read_loads(t, run, crew.rank, crew.size)
        wait_for(crew)


@wp.func
def share_clock(t: Any, p: Any, table: SimdElements):
    """Let moving shapes be where the clock says: sixteen particles have notes of their own."""
    p.notes[CLOCK] = full_like(p.x[0], t.notes[CLOCK])


@wp.func
def share_clock(t: Any, p: Any, table: SimdClusters):
    p.notes[CLOCK] = full_like(p.x[0], t.notes[CLOCK])


@wp.func
def share_clock(t: Any, p: Any, table: Any):
    return


@wp.func
def resolve_shapes(t: Any, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    """Particles against the shapes nearby."""
    touch_shapes(t, n, shapes, dt, rank, size)


@wp.func
def resolve_shapes(t: StateFloat, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    if shares_work(size):
        touch_shapes_together(t, n, shapes, dt, rank, size)
    else:
        touch_shapes(t, n, shapes, dt, rank, size)


@wp.func
def resolve_shapes(t: StateDouble, n: int, shapes: Shapes, dt: float, rank: int, size: int):
    if shares_work(size):
        touch_shapes_together(t, n, shapes, dt, rank, size)
    else:
        touch_shapes(t, n, shapes, dt, rank, size)
