"""The plan for scenes too large for a block: a launch per stage over the whole device.

A launch's end is the wait between stages (`nuno.scene.stages`). On CUDA a substep's launches are captured once as a
graph and replayed; everything that changes from run to run (the clock, what was listed, the grips' times) lives in
arrays that keep their place. The phases are those of `nuno.solver.frame`, so that colours come in the same order and
give the same bits; only self-contact is summed in fixed point, as in a block. Where all blocks fit a device at once,
`nuno.solver.grid` goes through the same phases in one launch a frame.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import warp as wp

from nuno.contact.distances import PLANE
from nuno.contact.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.contact.shapes import measure_box, reset_box, select_shapes, sort_shapes
from nuno.contact.sharp_shapes import forget_sharp, list_sharp, mark_sharp
from nuno.contact.sharp_turns import touch_sharp
from nuno.solver.broad import PairFinder
from nuno.solver.damping import damp_bends
from nuno.solver.frame import meet_shapes
from nuno.solver.grips import forget_loads, pull_points, read_loads
from nuno.solver.integrate import read_velocities, reset_speed, round_places, tick
from nuno.solver.lanes import barrier
from nuno.solver.stages import Work, go_through, steps_of
from nuno.solver.state import (
    LAYERS,
    MOTION,
    PULLS,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateFine,
    StateFloat,
    Topology,
    view,
)
from nuno.solver.team import team_of
from nuno.solver.warps import WARP

RESET, MEASURE, SELECT, SORT, MARK, LIST = range(6)

FEW = 1024
"""Threads a world where each ends in an atomic on one number."""
MANY = 1 << 16
"""Threads a world that look through the listed pairs."""
THREADS = 512
"""Threads of a block that has its share of the steps of all stages."""
CPU_THREADS = 64
"""Shares of a phase on the CPU, where they run one after the other: enough to test what many threads do."""


@wp.kernel(enable_backward=False)
def survey(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, phase: int, threads: int):
    """Choose the shapes that matter for the next frame, and what sharp ones may touch, in six phases."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    thread = tid % threads
    if phase == RESET:
        reset_box(t, thread)
        forget_sharp(t, topo, thread)
    elif phase == MEASURE:
        measure_box(t, topo.particles, thread, threads)
    elif phase == SELECT:
        select_shapes(t, shapes, float(run.frame) * run.dt, thread, threads)
    elif phase == SORT:
        sort_shapes(t, thread)
    elif phase == MARK:
        mark_sharp(t, topo, run, shapes, thread, threads)
    else:
        list_sharp(t, topo, thread, threads)


@wp.kernel(enable_backward=False)
def start(s: StateFloat, topo: Topology, size: Sizes, run: Settings):
    """The clock, and how far anything went, one thread a world."""
    t = view(s, wp.tid(), topo.particles, size)
    tick(t, run, 0)


@wp.kernel(enable_backward=False)
def unload(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """The sums of the loads of stiff grips set to zero."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    forget_loads(t, run, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1))
def damp(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """The damping of bends, a block a world; velocities are floats in any case."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    damp_bends(t, topo, run, tid % threads, threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1))
def project(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, work: Work, gate: wp.array(dtype=int), begin: int,
    end: int, blocks: int, threads: int,
):  # fmt: skip
    """The steps of one stage, a share a block."""
    world, team = team_of(wp.tid(), gate, 0, s.worlds, blocks, threads)
    t = view(s, world, topo.particles, size)
    go_through(t, topo, work, steps_of(work, team.block), run, run.grips, begin, end, team)


@wp.kernel(enable_backward=False)
def pull(s: StateFloat, topo: Topology, size: Sizes, run: Settings):
    """Grips on surface points, one thread a world."""
    t = view(s, wp.tid(), topo.particles, size)
    pull_points(t, run, 0, 1)


@wp.func
def touch_listed(t: Any, n: int, run: Settings, thread: int, threads: int):
    """What each listed pair moves, summed: all that are listed are solved, which a whole device looks at in no time."""
    t.touch_triangle = t.vertex_triangle
    t.touch_edge = t.edge_edge
    t.touch_count = t.pair_count
    touch_edge_edge(t, n, run, thread, threads)
    touch_vertex_triangle(t, n, run, thread, threads)


@wp.kernel(enable_backward=False)
def touch(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """Self-contact: what each pair moves, summed."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    touch_listed(t, topo.particles, run, tid % threads, threads)


@wp.kernel(enable_backward=False)
def settle(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """Apply the sums."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    take_moves(t, topo.particles, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1))
def meet_sharp(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, threads: int):
    """Edges and triangles against sharp shapes, a block a world."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    touch_sharp(t, topo, run, shapes, tid % threads, threads)


@wp.kernel(enable_backward=False)
def calm(s: StateFloat, topo: Topology, size: Sizes):
    """The old speed has served; one thread a world."""
    t = view(s, wp.tid(), topo.particles, size)
    reset_speed(t, 0)


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


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1))
def finish(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, gate: wp.array(dtype=int), blocks: int,
    threads: int,
):  # fmt: skip
    """What ends a substep, particle by particle."""
    n = topo.particles
    world, team = team_of(wp.tid(), gate, 0, s.worlds, blocks, threads)
    t = view(s, world, n, size)
    first = n * team.block / blocks
    last = n * (team.block + 1) / blocks
    come_to_rest(t, t, n, run, shapes, run.grips, first, last, team.thread, threads)


# The same where coordinates are doubles; what asks for none of them, or is content with floats, is as above.


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.fine_large")
def project_fine(
    s: StateFine, topo: Topology, size: Sizes, run: Settings, work: Work, gate: wp.array(dtype=int), begin: int,
    end: int, blocks: int, threads: int,
):  # fmt: skip
    """`project`."""
    world, team = team_of(wp.tid(), gate, 0, s.worlds, blocks, threads)
    t = view(s, world, topo.particles, size)
    go_through(t, topo, work, steps_of(work, team.block), run, run.grips, begin, end, team)


@wp.kernel(enable_backward=False, module="nuno.solver.fine_large")
def pull_fine(s: StateFine, topo: Topology, size: Sizes, run: Settings):
    """`pull`."""
    t = view(s, wp.tid(), topo.particles, size)
    pull_points(t, run, 0, 1)


@wp.kernel(enable_backward=False, module="nuno.solver.fine_large")
def touch_fine(s: StateFine, topo: Topology, size: Sizes, run: Settings, threads: int):
    """`touch`."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    touch_listed(t, topo.particles, run, tid % threads, threads)


@wp.kernel(enable_backward=False, module="nuno.solver.fine_large")
def settle_fine(s: StateFine, topo: Topology, size: Sizes, run: Settings, threads: int):
    """`settle`."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    take_moves(t, topo.particles, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.fine_large")
def meet_sharp_fine(s: StateFine, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, threads: int):
    """`meet_sharp`."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    touch_sharp(t, topo, run, shapes, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.solver.fine_large")
def finish_fine(
    s: StateFine, topo: Topology, size: Sizes, floats: StateFloat, run: Settings, shapes: Shapes,
    gate: wp.array(dtype=int), blocks: int, threads: int,
):  # fmt: skip
    """`finish`."""
    n = topo.particles
    world, team = team_of(wp.tid(), gate, 0, s.worlds, blocks, threads)
    t = view(s, world, n, size)
    near = view(floats, world, n, size)
    first = n * team.block / blocks
    last = n * (team.block + 1) / blocks
    come_to_rest(t, near, n, run, shapes, run.grips, first, last, team.thread, threads)


class LargePlan:
    """The launches of a substep, and on CUDA the graph that repeats them.

    Args:
        state: `StateFloat` of all worlds.
        topology: The cloth's elements.
        size: Numbers a world in each array.
        shapes: Static shapes.
        device: "cpu" or "cuda:0" ...
        worlds: How many.
        work: The elements' `Work`.
        stages: The step at which each stage begins, and the number of steps.
        lists: Room for listing pairs, from `nuno.contact.team_listing.make_lists`.
    """

    def __init__(
        self, state: Any, topology: Any, size: Any, shapes: Any, device: str, worlds: int, work: Any, stages: Any,
        lists: Any,
    ) -> None:  # fmt: skip
        self._state = state
        self._fine: Any = None
        self._topology, self._size, self._shapes = topology, size, shapes
        self._device, self._worlds, self._work = device, worlds, work
        self._stages = [(int(first), int(last)) for first, last in pairwise(stages)]
        self._cuda = device.startswith("cuda")
        self._blocks, self._threads = work.step.shape[0] // (4 * work.steps), THREADS if self._cuda else 1
        # whether there are shapes that may touch edges and triangles
        self._sharp = bool(shapes.count) and bool((shapes.kind.numpy()[: shapes.count] < PLANE).any())
        self._gate = wp.zeros(1, dtype=int, device=device)
        # whole warps, which look through the boxes together
        many = -(-topology.particles // WARP) * WARP if self._cuda else CPU_THREADS
        self._finder = PairFinder(topology, lists, worlds, device, many)
        self._graphs: dict[tuple[Any, ...], Any] = {}

    def run(self, run: Any, substeps: int, fine: Any = None) -> None:
        """Advance by ``substeps`` substeps under the settings ``run``, coordinates as doubles if there is ``fine``."""
        self._fine = fine
        graph = self._captured(run) if self._cuda else None
        for k in range(substeps):
            if run.parts & MOTION and (run.first + k) % run.frame == 0:
                self._survey(run)
                if run.grips:
                    self._launch(unload, run.grips, run)
            if graph is None:
                self._substep(run)
            else:
                wp.capture_launch(graph)

    def _captured(self, run: Any) -> Any:
        """The graph of a substep: made for its settings, with the grips' figures in arrays of its own."""
        key: tuple[Any, ...] = (run.dt, tuple(run.gravity), run.pushed, run.damped, run.touching, run.margin)
        key += (
            run.reach,
            run.passes,
            run.frame,
            run.parts,
            run.grips,
            run.pulled,
            run.keys,
            run.grip_ease.ptr,
            run.grip_fixed.ptr,
            self._fine is not None,
        )
        found = self._graphs.get(key)
        if found is None:
            run.grip_start, run.grip_soft = wp.clone(run.grip_start), wp.clone(run.grip_soft)
            for module in (survey.module, *([] if self._fine is None else [project_fine.module])):
                wp.load_module(module, device=self._device)
                wp.load_module(module, device=self._device, block_dim=THREADS)
            self._finder.load()
            with wp.ScopedCapture(device=self._device, force_module_load=False) as capture:
                self._substep(run)
            found = self._graphs[key] = (capture.graph, run)
            return found[0]
        kept = found[1]
        wp.copy(kept.grip_start, run.grip_start)
        wp.copy(kept.grip_soft, run.grip_soft)
        return found[0]

    def _launch(self, kernel: Any, count: int, *inputs: Any, state: Any = None) -> None:
        threads = max(1, min(count, MANY if self._cuda else CPU_THREADS))
        common = [state or self._state, self._topology, self._size]
        wp.launch(kernel, dim=self._worlds * threads, inputs=[*common, *inputs, threads], device=self._device)

    def _launch_blocks(self, kernel: Any, *inputs: Any) -> None:
        inputs = (self._fine or self._state, self._topology, self._size, *inputs, self._blocks, self._threads)
        dim = self._worlds * self._blocks * self._threads
        wp.launch(kernel, dim=dim, inputs=inputs, device=self._device, block_dim=THREADS)

    def _survey(self, run: Any) -> None:
        shapes, particles = self._shapes, self._topology.particles
        counts = {
            RESET: 1,
            MEASURE: min(FEW, particles),
            SELECT: shapes.count,
            SORT: 1,
            MARK: particles,
            LIST: particles,
        }
        for phase, count in counts.items():
            self._launch(survey, count, run, shapes, phase)

    def _substep(self, run: Any) -> None:
        common = [self._state, self._topology, self._size]
        coarse, floats = self._fine is None, [] if self._fine is None else [self._state]
        state = self._fine or self._state
        if run.parts & MOTION:
            wp.launch(start, dim=self._worlds, inputs=[*common, run], device=self._device)
            if run.touching:
                self._finder.launch(self._state, self._size, run)
            if run.damped:
                threads = self._threads
                wp.launch(
                    damp, dim=self._worlds * threads, inputs=[*common, run, threads], device=self._device,
                    block_dim=THREADS,
                )  # fmt: skip
            for first, last in self._stages:
                self._launch_blocks(project if coarse else project_fine, run, self._work, self._gate, first, last)
        if run.parts & PULLS and run.pulled:
            inputs = [state, self._topology, self._size, run]
            wp.launch(pull if coarse else pull_fine, dim=self._worlds, inputs=inputs, device=self._device)
        if run.parts & LAYERS and run.touching:
            for again in range(run.passes):
                if again:
                    kernel = settle if coarse else settle_fine
                    self._launch(kernel, self._topology.particles, run, state=state)
                self._launch(touch if coarse else touch_fine, MANY, run, state=state)
        if run.parts & SHAPES and self._sharp:
            if run.parts & LAYERS and run.touching:
                self._launch(settle if coarse else settle_fine, self._topology.particles, run, state=state)
            inputs = [state, self._topology, self._size, run, self._shapes, self._threads]
            wp.launch(
                meet_sharp if coarse else meet_sharp_fine, dim=self._worlds * self._threads, inputs=inputs,
                device=self._device, block_dim=THREADS,
            )  # fmt: skip
        if run.parts & VELOCITIES:
            wp.launch(calm, dim=self._worlds, inputs=common, device=self._device)
        if run.parts & (LAYERS | SHAPES | VELOCITIES):
            self._launch_blocks(finish if coarse else finish_fine, *floats, run, self._shapes, self._gate)
