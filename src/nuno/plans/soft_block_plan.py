"""The kernels that walk through a soft body's substeps on CUDA: a world a block, as much of it at hand as fits.

Each is there twice, with and without what meets sharp shapes: beside that the elastic clusters, which take all
registers that a thread may have, would lose some of theirs whether anything sharp is near or not. Those without go on
until something sharp is near at the start of a frame; those with it, launched behind them, do the rest. Which one does
a substep of a world depends on that world alone.
"""

from typing import Any

import warp as wp

from nuno.numbers.crew import barrier, crew_of
from nuno.plans.block_plan import BLOCKS_AT_ONCE
from nuno.plans.shared_memory import (
    DOUBLE_PARTICLES,
    ROOMY_PARTICLES,
    SHARED_PARTICLES,
    bring_figures,
    bring_masses,
    bring_notes,
    bring_places,
    bring_speeds,
    column,
    double_column,
    figures,
)
from nuno.plans.substep import advance
from nuno.state.cloth_state import Settings, Shapes
from nuno.state.soft_state import FarSides, Sides, SoftDouble, SoftFloat, SoftSizes, Tetrahedra, view

FEW_THREADS, MANY_THREADS, MANY_AT_ONCE = 256, 128, 4
"""Threads of a block, and of one where worlds queue up for multiprocessors and have all but the substep's start in
their memory, in which four worlds fit at once. A colour of such a body has about 128 clusters: more threads would only
wait for them. The bits are the same."""


@wp.func
def first_of(t: Any, sides: FarSides, substeps: int):
    """The substep with which a kernel begins, ``substeps`` where there is nothing left for it."""
    return 0


@wp.func
def first_of(t: Any, sides: Sides, substeps: int):
    # a single substep, or a part of one, is theirs alone: one launch instead of two
    return wp.where(substeps > 1, t.reached[0], 0)


@wp.func
def go(
    t: Any, floats: Any, topo: Tetrahedra, sides: Any, run: Settings, shapes: Shapes, substeps: int, rank: int,
    size: int,
):  # fmt: skip
    """`advance`, with a note of how far it went."""
    begin = first_of(t, sides, substeps)
    done = advance(t, t, floats, floats, topo, sides, run, shapes, begin, substeps, crew_of(rank, size))
    barrier(size)
    if rank == 0:
        t.reached[0] = done


@wp.func
def advance_block(
    t: Any, floats: Any, topo: Tetrahedra, sides: Any, run: Settings, shapes: Shapes, substeps: int, rank: int,
    size: int,
):  # fmt: skip
    """`go` with the world's scalars and notes in shared memory for as long as the launch takes."""
    scalars = t.scalars
    notes = t.notes
    t.scalars = figures(0)
    t.notes = figures(8)
    floats.scalars = figures(0)
    floats.notes = figures(8)
    bring_figures(t, scalars, notes, rank)
    barrier(size)
    go(t, floats, topo, sides, run, shapes, substeps, rank, size)
    barrier(size)
    if rank == 0:
        bring_notes(notes, t.notes)


@wp.func
def run_partly(
    s: SoftFloat, topo: Tetrahedra, sides: Any, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
    tid: int,
    size: int,
):  # fmt: skip
    """A world by a block with x, y, z and w in shared memory for as long as the launch takes."""
    n = topo.particles
    rank = tid % size
    t = view(s, tid / size, n, sizes)
    outside = view(s, tid / size, n, sizes)
    if first_of(t, sides, substeps) >= substeps:
        return
    t.x = column(0)
    t.y = column(SHARED_PARTICLES)
    t.z = column(2 * SHARED_PARTICLES)
    t.w = column(3 * SHARED_PARTICLES)
    bring_places(t, outside, n, rank, size)
    bring_masses(t, outside, n, rank, size)
    advance_block(t, t, topo, sides, run, shapes, substeps, rank, size)
    bring_places(outside, t, n, rank, size)


@wp.func
def run_shared(
    s: SoftFloat, topo: Tetrahedra, sides: Any, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
    tid: int,
    size: int,
):  # fmt: skip
    """A world by a block with x, y, z, w and v in shared memory."""
    n = topo.particles
    rank = tid % size
    t = view(s, tid / size, n, sizes)
    outside = view(s, tid / size, n, sizes)
    if first_of(t, sides, substeps) >= substeps:
        return
    t.x = column(0)
    t.y = column(ROOMY_PARTICLES)
    t.z = column(2 * ROOMY_PARTICLES)
    t.w = column(3 * ROOMY_PARTICLES)
    t.vx = column(4 * ROOMY_PARTICLES)
    t.vy = column(5 * ROOMY_PARTICLES)
    t.vz = column(6 * ROOMY_PARTICLES)
    bring_places(t, outside, n, rank, size)
    bring_masses(t, outside, n, rank, size)
    bring_speeds(t, outside, n, rank, size)
    advance_block(t, t, topo, sides, run, shapes, substeps, rank, size)
    bring_places(outside, t, n, rank, size)
    bring_speeds(outside, t, n, rank, size)


@wp.func
def run_double_partly(
    s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: Any, sizes: SoftSizes, run: Settings, shapes: Shapes,
    substeps: int, tid: int, size: int,
):  # fmt: skip
    """A world by a block, coordinates as doubles, x, y and z in shared memory for as long as the launch takes."""
    n = topo.particles
    rank = tid % size
    t = view(s, tid / size, n, sizes)
    outside = view(s, tid / size, n, sizes)
    if first_of(t, sides, substeps) >= substeps:
        return
    t.x = double_column(0)
    t.y = double_column(DOUBLE_PARTICLES)
    t.z = double_column(2 * DOUBLE_PARTICLES)
    bring_places(t, outside, n, rank, size)
    advance_block(t, view(rounded, tid / size, n, sizes), topo, sides, run, shapes, substeps, rank, size)
    bring_places(outside, t, n, rank, size)


def block_kernels(kind: Any, suffix: str) -> dict[str, Any]:
    """Return the kernels with ``kind`` for what they know of the surface, by name; a module each, with the suffix."""

    def module(name: str) -> str:
        """A module's name; quotients and roots are as the processor has them in it: see `nuno.plans.block_plan`."""
        whole = f"nuno.plans.run_soft_{name}{suffix}"
        wp.get_module(whole).options["fast_math"] = True
        return whole

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, BLOCKS_AT_ONCE), module=module("blocks"))
    def run_soft_blocks(
        s: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
        size: int,
    ):  # fmt: skip
        """Every world by a block of ``size`` threads."""
        tid = wp.tid()
        t = view(s, tid / size, topo.particles, sizes)
        go(t, t, topo, sides, run, shapes, substeps, tid % size, size)

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, BLOCKS_AT_ONCE), module=module("blocks_partly"))
    def run_soft_blocks_partly(
        s: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
        size: int,
    ):  # fmt: skip
        """Worlds that queue up for multiprocessors, and of which not all fits."""
        run_partly(s, topo, sides, sizes, run, shapes, substeps, wp.tid(), size)

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module=module("few_partly"))
    def run_soft_few_partly(
        s: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
        size: int,
    ):  # fmt: skip
        """Worlds that have a multiprocessor each, and so all of its registers, and of which not all fits."""
        run_partly(s, topo, sides, sizes, run, shapes, substeps, wp.tid(), size)

    @wp.kernel(enable_backward=False, launch_bounds=(MANY_THREADS, MANY_AT_ONCE), module=module("blocks_shared"))
    def run_soft_blocks_shared(
        s: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
        size: int,
    ):  # fmt: skip
        """Worlds that queue up for multiprocessors."""
        run_shared(s, topo, sides, sizes, run, shapes, substeps, wp.tid(), size)

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module=module("few_shared"))
    def run_soft_few_shared(
        s: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings, shapes: Shapes, substeps: int,
        size: int,
    ):  # fmt: skip
        """Worlds that have a multiprocessor each, and so all of its registers."""
        run_shared(s, topo, sides, sizes, run, shapes, substeps, wp.tid(), size)

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module=module("double_blocks"))
    def run_soft_double_blocks(
        s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings,
        shapes: Shapes,
        substeps: int, size: int,
    ):  # fmt: skip
        """Every world by a block, coordinates as doubles."""
        tid = wp.tid()
        n = topo.particles
        t = view(s, tid / size, n, sizes)
        floats = view(rounded, tid / size, n, sizes)
        advance_block(t, floats, topo, sides, run, shapes, substeps, tid % size, size)

    @wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module=module("double_blocks_partly"))
    def run_soft_double_blocks_partly(
        s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: kind, sizes: SoftSizes, run: Settings,
        shapes: Shapes,
        substeps: int, size: int,
    ):  # fmt: skip
        """The same with x, y and z in shared memory for as long as the launch takes."""
        run_double_partly(s, rounded, topo, sides, sizes, run, shapes, substeps, wp.tid(), size)

    kernels = (
        run_soft_blocks, run_soft_blocks_partly, run_soft_few_partly, run_soft_blocks_shared, run_soft_few_shared,
        run_soft_double_blocks, run_soft_double_blocks_partly,
    )  # fmt: skip
    return {kernel.key.rpartition("run_soft_")[2]: kernel for kernel in kernels}


FAR, FEATURES = block_kernels(FarSides, ""), block_kernels(Sides, "_sharp")
"""The kernels for as long as nothing sharp is near, and those for what is left then."""
