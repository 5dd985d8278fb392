"""A soft body's frame by a team of blocks, for `nuno.solver.grid_plan.GridPlan`.

The phases are those of `nuno.solver.soft_frame`, with the same bits: what one colour's stars, or particles, do does not
hang on who does it. Every block keeps the figures that all threads read in shared memory, its own copy.
"""

from typing import Any

import warp as wp

from nuno.contact.shapes import touch_shapes
from nuno.contact.sharp_turns import touch_sharp
from nuno.solver.grid import near_shapes
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.idle import forget_idle
from nuno.solver.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import barrier
from nuno.solver.shared_memory import figures
from nuno.solver.soft_ahead import elastic_ahead, viscous_ahead
from nuno.solver.soft_frame import turn_notes
from nuno.solver.soft_state import SEEN, Sides, SoftFine, SoftFloat, SoftSizes, Tetrahedra, view
from nuno.solver.state import NOTES, SPEED, Settings, Shapes
from nuno.solver.team import Team, begin_to_meet, call_roll, meet, team_of
from nuno.solver.warps import in_warps

THREADS = 256
"""Of a block: stars take all registers that so many have."""
TOLD = 4
"""What blocks tell each other of a world: its speed and what is inside out, by turns for two substeps."""

for _name in ("run_soft_grid", "run_soft_fine_grid"):
    wp.get_module(f"nuno.solver.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def tell(t: Any, told: wp.array(dtype=float), own: int, other: int, team: Team):
    """Raise the notes of all blocks to the block's, wait, and take them; those of the substep before have served."""
    barrier(team.threads)
    if team.thread == 0:
        wp.atomic_max(told, own, t.notes[SPEED])
        wp.atomic_max(told, own + 1, t.notes[SEEN])
    if team.turn == 0:
        told[other] = 0.0
        told[other + 1] = 0.0
    meet(team)
    if team.thread == 0:
        t.notes[SPEED] = told[own]
        t.notes[SEEN] = told[own + 1]
    barrier(team.threads)


@wp.func
def advance_by_team(
    t: Any, near: Any, topo: Tetrahedra, sides: Sides, run: Settings, shapes: Shapes, told: wp.array(dtype=float),
    world: int, substeps: int, team: Team,
):  # fmt: skip
    """The phases of ``substeps`` substeps, the first of which begins a frame.

    ``near`` is as `nuno.solver.frame.advance` has it.
    """
    n = topo.particles
    forget_loads(t, run, team.turn, team.turns)
    if team.turn == 0:
        told[TOLD * world] = 0.0
        told[TOLD * world + 1] = 0.0
    near_shapes(near, sides, run, shapes, team)
    for k in range(substeps):
        tick(t, run, team.thread)
        turn_notes(t, team.thread)
        barrier(team.threads)
        if run.damped != 0 and k % wp.max(run.damped, 1) == 0:
            viscous_ahead(t, topo, run, team.turn, team.turns, team)
        predict(t, n, run, team.turn, team.turns)
        meet(team)
        if run.grips > 0:
            hold_vertices(t, run, team.turn, team.turns)
            meet(team)
        elastic_ahead(t, topo, run, team.turn, team.turns, team)
        if run.pulled != 0:
            pull_points(t, run, team.turn, team.turns)
            meet(team)
        if t.sharp[0] > 0:
            # few elements in many colours, between which a block waits for itself alone
            if team.block == 0:
                touch_sharp(t, sides, run, shapes, team.thread, team.threads)
            meet(team)
        if run.grips > 0:
            read_loads(t, run, team.turn, team.turns)
            meet(team)
        touch_shapes(t, n, shapes, run.dt, team.turn, team.turns)
        reset_speed(t, team.thread)
        barrier(team.threads)
        forget_idle(t, n, team.turn, team.turns)
        read_velocities(t, n, run, team.turn, team.turns)
        round_places(near, t, n, team.turn, team.turns)
        tell(t, told, TOLD * world + 2 * (k % 2), TOLD * world + 2 * ((k + 1) % 2), team)


@wp.func
def near_of(t: SoftFloat, floats: SoftFloat, world: int, n: int, size: SoftSizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def near_of(t: SoftFine, floats: SoftFloat, world: int, n: int, size: SoftSizes):
    near = view(floats, world, n, size)
    near.scalars = t.scalars
    near.notes = t.notes
    return near


@wp.func
def run_teams(
    s: Any, floats: SoftFloat, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    told: wp.array(dtype=float), first: int, substeps: int, teams: int, team: Team,
):  # fmt: skip
    """What a team does of the worlds that it goes through, from ``first`` on."""
    threads = team.threads
    for world in range(first, s.worlds, teams):
        t = view(s, world, topo.particles, size)
        notes = t.notes
        if in_warps(threads):
            scalars = t.scalars
            t.scalars = figures(0)
            t.notes = figures(8)
            if team.thread == 0:
                for k in range(7):
                    t.scalars[k] = scalars[k]
                for k in range(NOTES):
                    t.notes[k] = notes[k]
        barrier(threads)
        near = near_of(t, floats, world, topo.particles, size)
        advance_by_team(t, near, topo, sides, run, shapes, told, world, substeps, team)
        if team.turn == 0:
            for k in range(NOTES):
                notes[k] = t.notes[k]
        barrier(threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.run_soft_grid")
def run_soft_grid(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    told: wp.array(dtype=float), gate: wp.array(dtype=int), call: int, substeps: int, teams: int, blocks: int,
    threads: int,
):  # fmt: skip
    """A frame, or the beginning of one, of every world by a team of blocks; nothing where not all are there."""
    first, team = team_of(wp.tid(), gate, call, teams, blocks, threads)
    if blocks == 1 or call_roll(gate, call, teams, teams * blocks):
        begin_to_meet(team)
        run_teams(s, s, topo, sides, size, run, shapes, told, first, substeps, teams, team)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.run_soft_fine_grid")
def run_soft_fine_grid(
    s: SoftFine, floats: SoftFloat, topo: Tetrahedra, sides: Sides, size: SoftSizes, run: Settings, shapes: Shapes,
    told: wp.array(dtype=float), gate: wp.array(dtype=int), call: int, substeps: int, teams: int, blocks: int,
    threads: int,
):  # fmt: skip
    """`run_soft_grid` where coordinates are doubles."""
    first, team = team_of(wp.tid(), gate, call, teams, blocks, threads)
    if blocks == 1 or call_roll(gate, call, teams, teams * blocks):
        begin_to_meet(team)
        run_teams(s, floats, topo, sides, size, run, shapes, told, first, substeps, teams, team)
