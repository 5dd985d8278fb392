"""The plan for scenes too large for a block: a launch per phase and colour over the whole device.

A launch's end is the barrier between phases. On CUDA a substep's launches are captured once as a graph and replayed;
everything that changes from run to run (the clock, what was listed, the grips' times) lives in arrays that keep
their place. The phases are those of `nuno.solver.frame`, so that colours come in the same order and give the same
bits; only self-contact is summed in fixed point, as in a block.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import warp as wp

from nuno.contact.self_contact import PASSES, take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.contact.shapes import measure_box, reset_box, select_shapes, sort_shapes
from nuno.solver.broad import PairFinder
from nuno.solver.frame import (
    bend_lines,
    bend_patches,
    bend_twists,
    meet_shapes,
    shear_cells,
    strain_triangles,
    stretch_yarns,
)
from nuno.solver.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.solver.integrate import predict, read_velocities, reset_speed, tick
from nuno.solver.state import (
    LAYERS,
    MOTION,
    PULLS,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateFloat,
    Topology,
    view,
)
from nuno.solver.warps import WARP

PATCHES, TWISTS, LINES, CELLS, TRIANGLES, YARNS = range(6)
RESET, MEASURE, SELECT, SORT = range(4)

FEW = 1024
"""Threads a world where each ends in an atomic on one number."""
MANY = 1 << 16
"""Threads a world that look through the listed pairs."""
CPU_THREADS = 64
"""Shares of a phase on the CPU, where they run one after the other: enough to test what many threads do."""


@wp.kernel(enable_backward=False)
def survey(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, phase: int, threads: int):
    """Choose the shapes that matter for the next frame, in four phases."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    thread = tid % threads
    if phase == RESET:
        reset_box(t, thread)
    elif phase == MEASURE:
        measure_box(t, topo.particles, thread, threads)
    elif phase == SELECT:
        select_shapes(t, shapes, float(run.frame) * run.dt, thread, threads)
    else:
        sort_shapes(t, thread)


@wp.kernel(enable_backward=False)
def start(s: StateFloat, topo: Topology, size: Sizes, run: Settings):
    """The clock, and how far anything went, one thread a world."""
    t = view(s, wp.tid(), topo.particles, size)
    tick(t, run, 0)


@wp.kernel(enable_backward=False)
def begin(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """The predicted positions."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    predict(t, topo.particles, run, tid % threads, threads)


@wp.kernel(enable_backward=False)
def hold(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """Stiff grips on vertices."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    hold_vertices(t, run, tid % threads, threads)


@wp.kernel(enable_backward=False)
def project(s: StateFloat, topo: Topology, size: Sizes, run: Settings, kind: int, first: int, last: int, threads: int):
    """The elements first to last of one kind, which share no vertex."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    thread = tid % threads
    if kind == PATCHES:
        bend_patches(t, topo, run, first, last, thread, threads)
    elif kind == TWISTS:
        bend_twists(t, topo, run, first, last, thread, threads)
    elif kind == LINES:
        bend_lines(t, topo, run, first, last, thread, threads)
    elif kind == CELLS:
        shear_cells(t, topo, run, first, last, thread, threads)
    elif kind == TRIANGLES:
        strain_triangles(t, topo, run, first, last, thread, threads)
    else:
        stretch_yarns(t, topo, run, first, last, thread, threads)


@wp.kernel(enable_backward=False)
def unload(s: StateFloat, topo: Topology, size: Sizes, run: Settings, start: int, threads: int):
    """The loads of stiff grips: what this substep's were, or the sums set to zero."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    if start != 0:
        forget_loads(t, run, tid % threads, threads)
    else:
        read_loads(t, run, tid % threads, threads)


@wp.kernel(enable_backward=False)
def pull(s: StateFloat, topo: Topology, size: Sizes, run: Settings):
    """Grips on surface points, one thread a world."""
    t = view(s, wp.tid(), topo.particles, size)
    pull_points(t, run, 0, 1)


@wp.kernel(enable_backward=False)
def touch(s: StateFloat, topo: Topology, size: Sizes, run: Settings, threads: int):
    """Self-contact: what each pair moves, summed."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    touch_edge_edge(t, topo.particles, run, tid % threads, threads)
    touch_vertex_triangle(t, topo.particles, run, tid % threads, threads)


@wp.kernel(enable_backward=False)
def settle(s: StateFloat, topo: Topology, size: Sizes, run: Settings, last: int, threads: int):
    """Apply the sums; in the end the old speed has served."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    take_moves(t, topo.particles, tid % threads, threads)
    if last != 0:
        reset_speed(t, tid % threads)


@wp.kernel(enable_backward=False)
def finish(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, threads: int):
    """Shapes and velocities, particle by particle."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    if run.parts & SHAPES != 0:
        meet_shapes(t, topo.particles, shapes, run.dt, tid % threads, threads)
    if run.parts & VELOCITIES != 0:
        read_velocities(t, topo.particles, run, tid % threads, threads)


class LargePlan:
    """The launches of a substep, and on CUDA the graph that repeats them.

    Args:
        state: `StateFloat` of all worlds.
        topology: The cloth's elements.
        size: Numbers a world in each array.
        shapes: Static shapes.
        device: "cpu" or "cuda:0" ...
        worlds: How many.
        colours: Where each colour starts, by kind (PATCHES ... YARNS).
    """

    def __init__(
        self, state: Any, topology: Any, size: Any, shapes: Any, device: str, worlds: int, colours: dict[int, Any]
    ) -> None:
        self._state, self._topology, self._size, self._shapes = state, topology, size, shapes
        self._device, self._worlds = device, worlds
        self._colours = [
            (kind, int(first), int(last))
            for kind in (PATCHES, TWISTS, LINES, CELLS, TRIANGLES, YARNS)
            for first, last in pairwise(colours[kind])
            if last > first
        ]
        self._cuda = device.startswith("cuda")
        few, many = (FEW, topology.particles) if self._cuda else (CPU_THREADS, CPU_THREADS)
        self._finder = PairFinder(topology, worlds, device, few, many)
        self._graphs: dict[tuple[Any, ...], Any] = {}

    def run(self, run: Any, substeps: int) -> None:
        """Advance by ``substeps`` substeps under the settings ``run``."""
        graph = self._captured(run) if self._cuda else None
        for k in range(substeps):
            if run.parts & MOTION and (run.first + k) % run.frame == 0:
                self._survey(run)
                if run.grips:
                    self._launch(unload, run.grips, run, 1)
            if graph is None:
                self._substep(run)
            else:
                wp.capture_launch(graph)

    def _captured(self, run: Any) -> Any:
        """The graph of a substep: made for its settings, with the grips' figures in arrays of its own."""
        key: tuple[Any, ...] = (run.dt, tuple(run.gravity), run.pushed, run.damped, run.touching, run.margin)
        key += (
            run.reach,
            run.frame,
            run.parts,
            run.grips,
            run.pulled,
            run.keys,
            run.grip_ease.ptr,
            run.grip_fixed.ptr,
        )
        found = self._graphs.get(key)
        if found is None:
            run.grip_start, run.grip_soft = wp.clone(run.grip_start), wp.clone(run.grip_soft)
            wp.load_module(survey.module, device=self._device)
            self._finder.load()
            with wp.ScopedCapture(device=self._device, force_module_load=False) as capture:
                self._substep(run)
            found = self._graphs[key] = (capture.graph, run)
            return found[0]
        kept = found[1]
        wp.copy(kept.grip_start, run.grip_start)
        wp.copy(kept.grip_soft, run.grip_soft)
        return found[0]

    def _launch(self, kernel: Any, count: int, *inputs: Any, most: int = 1 << 30) -> None:
        threads = max(1, min(count, most if self._cuda else CPU_THREADS))
        common = [self._state, self._topology, self._size]
        wp.launch(kernel, dim=self._worlds * threads, inputs=[*common, *inputs, threads], device=self._device)

    def _survey(self, run: Any) -> None:
        shapes, particles = self._shapes, self._topology.particles
        for phase, count in ((RESET, 1), (MEASURE, min(FEW, particles)), (SELECT, shapes.count), (SORT, 1)):
            self._launch(survey, count, run, shapes, phase)

    def _substep(self, run: Any) -> None:
        n = self._topology.particles
        common = [self._state, self._topology, self._size, run]
        if run.parts & MOTION:
            wp.launch(start, dim=self._worlds, inputs=common, device=self._device)
            if run.touching:
                self._finder.launch(self._state, self._size, run)
            self._launch(begin, n, run)
            if run.grips:
                self._launch(hold, run.grips, run)
            for kind, first, last in self._colours:
                # a yarn is a warp's work
                count = (last - first) * (WARP if kind == YARNS and self._cuda else 1)
                self._launch(project, count, run, kind, first, last)
        if run.parts & PULLS and run.pulled:
            wp.launch(pull, dim=self._worlds, inputs=common, device=self._device)
        if run.parts & LAYERS:
            if run.touching:
                for again in range(PASSES):
                    self._launch(touch, MANY, run)
                    self._launch(settle, n, run, int(again + 1 == PASSES))
            else:
                self._launch(settle, 1, run, 1)
        if run.parts & SHAPES and run.grips:
            self._launch(unload, run.grips, run, 0)
        if run.parts & (SHAPES | VELOCITIES):
            self._launch(finish, n, run, self._shapes)
