"""The substep, written once: which phase comes after which, for cloth and soft bodies, on every device.

A crew goes through it together: a thread of the CPU, the threads of a CUDA block, or a group of blocks. Lanes of SIMD
are sixteen worlds, or sixteen elements and particles of one. Where a body or a crew does a phase otherwise, the phase
has an overload here, told by the table of elements: `Topology` and `SimdElements` for a cloth, `Tetrahedra` and
`SimdClusters` for a soft body, `BlockShare` for a cloth that is shared out among the blocks of a group.
"""

from typing import Any

import warp as wp

from nuno.constraints.grips import forget_loads, pull_points
from nuno.numbers.block_group import rank_in_block, wait_for, wait_for_block
from nuno.plans.contact_phases import begin_rest, read_grips, resolve_self_contact, resolve_shapes, share_clock
from nuno.plans.feature_phases import goes_on, keep_clock, read_clock, resolve_features, select_nearby
from nuno.plans.motion_phases import begin_motion, drop_shifts, move, share_notes, share_of
from nuno.state.cloth_state import (
    COMPLIANT_GRIPS,
    MOTION,
    SELF_CONTACT,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
)
from nuno.state.integrate import read_velocities, reset_speed, round_places, tick


@wp.func
def advance(
    t: Any, p: Any, floats: Any, float_p: Any, table: Any, surface: Any, run: Settings, shapes: Shapes, begin: int,
    substeps: int, crew: Any,
):  # fmt: skip
    """The phases of substeps ``begin`` to ``substeps``: all of them, or those of the parts that are asked for.

    Args:
        t: The state of one world, or of sixteen in lanes.
        p: The same for loops over particles: by sixteen where the elements are, else ``t``.
        floats: The state with coordinates as floats, for lists of what is near: ``t`` where they are.
        float_p: ``floats`` for loops over particles, as ``p`` is ``t``.
        table: The elements.
        surface: Its edges and triangles, for sharp shapes and self-contact: a cloth's `Topology`, or `Sides`.
        run: The run's settings.
        shapes: All shapes.
        begin: The first substep.
        substeps: Beyond the last.
        crew: Who goes through it.

    Returns:
        The substep before which it stopped: ``substeps``, or with `FarSides` the first that something sharp is near in.
    """
    clock = read_clock(t, shapes)
    done = int(begin)
    while done < substeps:
        k = int(done)
        begins_frame = run.parts & MOTION != 0 and (run.first + k) % run.frame == 0
        if begins_frame:
            select_nearby(floats, table.particles, surface, run, shapes, crew)
            clock = read_clock(t, shapes)
        if not goes_on(t, surface):
            break
        if run.parts & MOTION != 0:
            if begins_frame:
                forget_loads(t, run, crew.rank, crew.size)
            # before the lists, which ask how far anything went in the substep before
            tick(t, run, rank_in_block(crew))
            begin_motion(t, floats, table, surface, run, k, crew)
            move(t, p, table, surface, run, crew)
        if run.pulled != 0 and run.parts & COMPLIANT_GRIPS != 0:
            pull_points(t, run, crew.rank, crew.size)
            wait_for(crew)
        if run.touching != 0 and run.parts & SELF_CONTACT != 0:
            resolve_self_contact(t, table, run, crew)
        first, last, step = share_of(table, crew)
        if run.parts & SHAPES != 0:
            clock = resolve_features(t, table, surface, run, shapes, clock, crew)
        begin_rest(t, table, run, crew)
        if run.parts & SHAPES != 0:
            read_grips(t, table, run, crew)
            share_clock(t, p, table)
            resolve_shapes(p, last, shapes, run.dt, first, step)
            wait_for_block(crew)
        if run.parts & VELOCITIES != 0:
            reset_speed(p, rank_in_block(crew))
            wait_for_block(crew)
            drop_shifts(p, table, last, first, step)
            read_velocities(p, last, run, first, step)
            round_places(float_p, p, last, first, step)
            share_notes(t, p, table, k, crew)
        done = k + 1
    keep_clock(t, table, clock, crew)
    return done
