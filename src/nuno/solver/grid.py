"""A cloth's frame by a team of blocks, for `nuno.solver.grid_plan.GridPlan`.

The phases are those of `nuno.solver.frame`, so that colours come in the same order and give the same bits; blocks wait
for each other inside of the launch. Every block keeps the figures that all threads read in shared memory, its own copy.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.contact.shapes import measure_box, reset_box, select_shapes, sort_shapes
from nuno.contact.sharp_shapes import forget_sharp, list_sharp, mark_sharp
from nuno.contact.sharp_turns import touch_sharp
from nuno.contact.team_listing import Lists, renew_by_team
from nuno.solver.damping import damp_bends
from nuno.solver.frame import meet_shapes
from nuno.solver.grips import forget_loads, pull_points, read_loads
from nuno.solver.integrate import read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import barrier
from nuno.solver.shared_memory import MOST_STEPS, figures, program
from nuno.solver.stages import Work, go_through, grips_on, steps_of
from nuno.solver.state import (
    LAYERS,
    MOTION,
    NOTES,
    PULLS,
    SHAPES,
    SPEED,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateFine,
    StateFloat,
    Topology,
    view,
)
from nuno.solver.team import Team, begin_to_meet, call_roll, meet, team_of
from nuno.solver.warps import in_warps

THREADS = 512
"""Threads of a block."""

for _name in ("run_grid", "run_fine_grid"):
    wp.get_module(f"nuno.solver.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def near_shapes(t: Any, topo: Any, run: Settings, shapes: Shapes, team: Team):
    """Choose the shapes that matter for the next frame, and what sharp ones may touch between vertices."""
    n = topo.particles
    reset_box(t, team.turn)
    forget_sharp(t, topo, team.turn)
    meet(team)
    measure_box(t, n, team.turn, team.turns)
    meet(team)
    select_shapes(t, shapes, float(run.frame) * run.dt, team.turn, team.turns)
    meet(team)
    sort_shapes(t, team.turn)
    meet(team)
    mark_sharp(t, topo, run, shapes, team.turn, team.turns)
    meet(team)
    list_sharp(t, topo, team.turn, team.turns)
    meet(team)


@wp.func
def share_speed(t: Any, speeds: wp.array(dtype=float), own: int, other: int, team: Team):
    """Raise a speed of all blocks to the block's, wait, and take it; the one of the substep before has served."""
    barrier(team.threads)
    if team.thread == 0:
        wp.atomic_max(speeds, own, t.notes[SPEED])
    if team.turn == 0:
        speeds[other] = 0.0
    meet(team)
    if team.thread == 0:
        t.notes[SPEED] = speeds[own]
    barrier(team.threads)


@wp.func
def come_to_rest(
    t: Any, near: Any, n: int, run: Settings, shapes: Shapes, grips: int, first: int, last: int, thread: int,
    threads: int,
):  # fmt: skip
    """What ends a substep of the particles first to last: sums of contact, stiff grips, shapes, velocities.

    ``grips`` is none where no stiff grip is on one of these; ``near`` is as `nuno.solver.frame.advance` has it.
    """
    if run.parts & LAYERS != 0 and run.touching != 0:
        for i in range(first + thread, last, threads):
            take_moves(t, n, i, n)
    if run.parts & SHAPES != 0:
        if grips > 0:
            barrier(threads)
            for g in range(thread, grips, threads):
                i = t.grip_corner[3 * g]
                if i >= first and i < last:
                    read_loads(t, run, g, grips)
            barrier(threads)
        meet_shapes(t, last, shapes, run.dt, first + thread, threads)
    if run.parts & VELOCITIES != 0:
        read_velocities(t, last, run, first + thread, threads)
        round_places(near, t, last, first + thread, threads)


@wp.func
def advance_by_team(
    t: Any, near: Any, topo: Topology, work: Work, steps: wp.array(dtype=int), run: Settings, shapes: Shapes,
    lists: Lists, speeds: wp.array(dtype=float), world: int, substeps: int, team: Team,
):  # fmt: skip
    """The phases of ``substeps`` substeps: all of them, or those of the parts that are asked for.

    ``near`` is as `nuno.solver.frame.advance` has it.
    """
    n = topo.particles
    first = n * team.block / team.blocks
    last = n * (team.block + 1) / team.blocks
    # the first step is that of the particles
    led = grips_on(t, run, steps[2], steps[3])
    held = grips_on(t, run, first, last)
    if team.turn == 0:
        speeds[2 * world] = 0.0
    meet(team)
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                forget_loads(t, run, team.turn, team.turns)
                near_shapes(near, topo, run, shapes, team)
            tick(t, run, team.thread)
            barrier(team.threads)
            if run.touching != 0:
                renew_by_team(near, topo, run, lists, world, team)
            if run.damped != 0:
                damp_bends(t, topo, run, team.turn, team.turns, team)
            go_through(t, topo, work, steps, run, led, 0, work.steps, team)
            meet(team)
        if run.pulled != 0 and run.parts & PULLS != 0:
            pull_points(t, run, team.turn, 1)
            meet(team)
        if run.touching != 0 and run.parts & LAYERS != 0:
            for again in range(run.passes):
                if again > 0:
                    for i in range(first + team.thread, last, team.threads):
                        take_moves(t, n, i, n)
                    meet(team)
                touch_edge_edge(t, n, run, team.turn, team.turns)
                touch_vertex_triangle(t, n, run, team.turn, team.turns)
                meet(team)
        if t.sharp[0] > 0 and run.parts & SHAPES != 0:
            if run.touching != 0 and run.parts & LAYERS != 0:
                for i in range(first + team.thread, last, team.threads):
                    take_moves(t, n, i, n)
                meet(team)
            # few elements in many colours, between which a block waits for itself alone
            if team.block == 0:
                touch_sharp(t, topo, run, shapes, team.thread, team.threads)
            meet(team)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, team.thread)
            barrier(team.threads)
        come_to_rest(t, near, n, run, shapes, held, first, last, team.thread, team.threads)
        if run.parts & VELOCITIES != 0:
            share_speed(t, speeds, 2 * world + k % 2, 2 * world + (k + 1) % 2, team)


@wp.func
def near_of(t: StateFloat, floats: StateFloat, world: int, n: int, size: Sizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def near_of(t: StateFine, floats: StateFloat, world: int, n: int, size: Sizes):
    near = view(floats, world, n, size)
    near.scalars = t.scalars
    near.notes = t.notes
    return near


@wp.func
def run_teams(
    s: Any, floats: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    speeds: wp.array(dtype=float), first: int, substeps: int, teams: int, team: Team,
):  # fmt: skip
    """What a team does of the worlds that it goes through, from ``first`` on."""
    threads = team.threads
    steps = steps_of(work, team.block)
    if in_warps(threads) and work.steps <= MOST_STEPS:
        steps = program(0)
        listed = steps_of(work, team.block)
        for k in range(team.thread, 4 * work.steps, threads):
            steps[k] = listed[k]
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
        advance_by_team(t, near, topo, work, steps, run, shapes, lists, speeds, world, substeps, team)
        if team.turn == 0:
            for k in range(NOTES):
                notes[k] = t.notes[k]
        barrier(threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.run_grid")
def run_grid(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    speeds: wp.array(dtype=float), gate: wp.array(dtype=int), call: int, substeps: int, teams: int, blocks: int,
    threads: int,
):  # fmt: skip
    """A frame, or some of one, of every world by a team of blocks; nothing where not all are there."""
    first, team = team_of(wp.tid(), gate, call, teams, blocks, threads)
    if blocks == 1 or call_roll(gate, call, teams, teams * blocks):
        begin_to_meet(team)
        run_teams(s, s, topo, size, run, shapes, work, lists, speeds, first, substeps, teams, team)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.run_fine_grid")
def run_fine_grid(
    s: StateFine, floats: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, work: Work,
    lists: Lists, speeds: wp.array(dtype=float), gate: wp.array(dtype=int), call: int, substeps: int, teams: int,
    blocks: int, threads: int,
):  # fmt: skip
    """`run_grid` where coordinates are doubles."""
    first, team = team_of(wp.tid(), gate, call, teams, blocks, threads)
    if blocks == 1 or call_roll(gate, call, teams, teams * blocks):
        begin_to_meet(team)
        run_teams(s, floats, topo, size, run, shapes, work, lists, speeds, first, substeps, teams, team)
