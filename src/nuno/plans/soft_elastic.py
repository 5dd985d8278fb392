"""A soft body's tetrahedra, colour by colour: their elasticity and their viscosity.

A table of elements is `Tetrahedra`, or `SimdClusters` where sixteen clusters are in the lanes of a vector. The threads
of CUDA's blocks read a cluster while they work on the one before: `nuno.plans.soft_prefetch`.
"""

from typing import Any

import warp as wp

from nuno.constraints.cluster_elements import damp_cluster, shape_of, solve_cluster, stiffness
from nuno.numbers.block_group import BlockGroup, wait_for
from nuno.numbers.crew import Crew, shares_work
from nuno.numbers.element_access import corner
from nuno.numbers.lanes import add, full_like, mul, sub  # noqa: F401
from nuno.plans.soft_prefetch import elastic_ahead, viscous_ahead
from nuno.state.cloth_state import DAMPING, Settings
from nuno.state.soft_state import INVERTED, SEEN, SoftDouble, SoftFloat, Tetrahedra


@wp.func
def advance_notes(t: Any, rank: int):
    """Carry what was seen in the last substep over to this one; one thread does it."""
    if rank == 0:
        t.notes[INVERTED] = t.notes[SEEN]
        t.notes[SEEN] = full_like(t.x[0], 0.0)


@wp.func
def solve_clusters(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The elasticity of the tetrahedra of one colour's clusters."""
    square = run.dt * run.dt
    limit = wp.min(table.speed * run.dt, 0.5 * table.height)
    mu, bulk = stiffness(t, square)
    for k in range(first + rank, last, size):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        solve_cluster(t, table, k, row, count, a, b, c, d, e, f, g, h, square, mu, bulk, limit)


@wp.func
def damp_clusters(t: Any, table: Any, run: Settings, first: int, last: int, rank: int, size: int):
    """The viscosity of the tetrahedra of one colour's clusters, over ``run.damped`` substeps."""
    time = t.scalars[DAMPING] * (2.0 * run.dt * float(run.damped))
    eta = t.mu[0] * time
    for k in range(first + rank, last, size):
        a = corner(table.inner, k, 0, 4)
        b = corner(table.inner, k, 1, 4)
        c = corner(table.inner, k, 2, 4)
        d = corner(table.inner, k, 3, 4)
        e = corner(table.outer, k, 0, 4)
        f = corner(table.outer, k, 1, 4)
        g = corner(table.outer, k, 2, 4)
        h = corner(table.outer, k, 3, 4)
        row, count = shape_of(table, k)
        damp_cluster(t, table, k, row, count, a, b, c, d, e, f, g, h, time, eta)


@wp.func
def damp_colours(t: Any, table: Any, run: Settings, crew: Any):
    """The viscosity of all clusters, colour by colour."""
    for c in range(table.colour.shape[0] - 1):
        damp_clusters(t, table, run, table.colour[c], table.colour[c + 1], crew.rank, crew.size)
        wait_for(crew)


@wp.func
def solve_colours(t: Any, table: Any, run: Settings, crew: Any):
    """The elasticity of all clusters, colour by colour, always in this order: at rest nothing moves."""
    for c in range(table.colour.shape[0] - 1):
        solve_clusters(t, table, run, table.colour[c], table.colour[c + 1], crew.rank, crew.size)
        wait_for(crew)


@wp.func
def damp_soft(t: Any, table: Any, run: Settings, crew: Any):
    """One pass over the tetrahedra's viscosity, in the crew's quickest way."""
    damp_colours(t, table, run, crew)


@wp.func
def solve_soft(t: Any, table: Any, run: Settings, crew: Any):
    """One pass over the tetrahedra's elasticity, in the crew's quickest way."""
    solve_colours(t, table, run, crew)


# One world, not lanes of them: crews of CUDA read ahead.
@wp.func
def damp_soft(t: SoftFloat, table: Tetrahedra, run: Settings, crew: Crew):
    if shares_work(crew.size):
        viscous_ahead(t, table, run, crew)
    else:
        damp_colours(t, table, run, crew)


@wp.func
def damp_soft(t: SoftDouble, table: Tetrahedra, run: Settings, crew: Crew):
    if shares_work(crew.size):
        viscous_ahead(t, table, run, crew)
    else:
        damp_colours(t, table, run, crew)


@wp.func
def damp_soft(t: SoftFloat, table: Tetrahedra, run: Settings, crew: BlockGroup):
    viscous_ahead(t, table, run, crew)


@wp.func
def damp_soft(t: SoftDouble, table: Tetrahedra, run: Settings, crew: BlockGroup):
    viscous_ahead(t, table, run, crew)


@wp.func
def solve_soft(t: SoftFloat, table: Tetrahedra, run: Settings, crew: Crew):
    if shares_work(crew.size):
        elastic_ahead(t, table, run, crew)
    else:
        solve_colours(t, table, run, crew)


@wp.func
def solve_soft(t: SoftDouble, table: Tetrahedra, run: Settings, crew: Crew):
    if shares_work(crew.size):
        elastic_ahead(t, table, run, crew)
    else:
        solve_colours(t, table, run, crew)


@wp.func
def solve_soft(t: SoftFloat, table: Tetrahedra, run: Settings, crew: BlockGroup):
    elastic_ahead(t, table, run, crew)


@wp.func
def solve_soft(t: SoftDouble, table: Tetrahedra, run: Settings, crew: BlockGroup):
    elastic_ahead(t, table, run, crew)
