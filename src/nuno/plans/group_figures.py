"""Figures of a world that the blocks of a group bring together at the end of a substep.

Each block has its own copy of a world's notes in shared memory. What all must know they raise in the device's memory,
by turns in one of two places, so that the one of the substep before can be cleared meanwhile.
"""

from typing import Any

import warp as wp

from nuno.numbers.block_group import BlockGroup, grid_barrier
from nuno.numbers.crew import barrier
from nuno.state.cloth_state import SPEED
from nuno.state.soft_state import SEEN

SHARED_FIGURES = 4
"""Of a world: its speed and whether an element is inside out, for two substeps alternately."""


@wp.func
def begin_sharing(crew: BlockGroup, shared: wp.array(dtype=float), world: int):
    """The crew with the figures of a world, none of them raised yet."""
    group = crew
    group.shared = shared
    group.first_shared = SHARED_FIGURES * world
    if group.rank == 0:
        shared[group.first_shared] = 0.0
        shared[group.first_shared + 1] = 0.0
    grid_barrier(group)
    return group


@wp.func
def share_speed(t: Any, k: int, crew: BlockGroup):
    """Raise a speed of all blocks to the block's in substep k, wait, and take it."""
    own = crew.first_shared + 2 * (k % 2)
    barrier(crew.block_size)
    if crew.rank_in_block == 0:
        wp.atomic_max(crew.shared, own, t.notes[SPEED])
    if crew.rank == 0:
        crew.shared[crew.first_shared + 2 * ((k + 1) % 2)] = 0.0
    grid_barrier(crew)
    if crew.rank_in_block == 0:
        t.notes[SPEED] = crew.shared[own]
    barrier(crew.block_size)


@wp.func
def share_speed_and_inversion(t: Any, k: int, crew: BlockGroup):
    """The same of a soft body, with whether an element was seen inside out."""
    own = crew.first_shared + 2 * (k % 2)
    barrier(crew.block_size)
    if crew.rank_in_block == 0:
        wp.atomic_max(crew.shared, own + 1, t.notes[SEEN])
    if crew.rank == 0:
        crew.shared[crew.first_shared + 2 * ((k + 1) % 2) + 1] = 0.0
    share_speed(t, k, crew)
    if crew.rank_in_block == 0:
        t.notes[SEEN] = crew.shared[own + 1]
    barrier(crew.block_size)
