"""The listing of self-contact pairs over the whole device, for the plan of large scenes.

What `nuno.contact.renewal` does, in phases, a launch each: whether to list is decided on the device, and a phase
does nothing in a world where it is not due. A thread looks at one block and the blocks of `REACH` groups of later ones,
which gives work to a whole device and passes over far groups at a comparison each.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.nearness import GROUP, append, bound_blocks, bound_groups, measure_span, middles, near_edges
from nuno.contact.pair_lists import FORGET, find_edge_edge, find_vertex_triangle, swept
from nuno.solver.state import LISTINGS, THICKNESS, TRAVEL, Settings, Sizes, StateFloat, Topology, view

REACH = 16
"""Groups of blocks that one thread looks through."""
NO, ASK, LIST = 0, 1, 2


@wp.kernel(enable_backward=False)
def ask(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int)):
    """Whether the bound on what moved is used up, so that the displacements must be measured; a thread a world."""
    world = wp.tid()
    t = view(s, world, topo.particles, size)
    due[world] = NO
    if t.notes[TRAVEL] * 2.0 > run.margin - swept(t, run):
        due[world] = ASK
        for k in range(6):
            t.listed[3 * topo.particles + k] = -1.0e30


@wp.kernel(enable_backward=False)
def measure(s: StateFloat, topo: Topology, size: Sizes, due: wp.array(dtype=int), threads: int):
    """The displacements since the list was made."""
    world, thread = wp.tid()
    if due[world] == ASK:
        t = view(s, world, topo.particles, size)
        measure_span(t, topo.particles, thread, threads)


@wp.kernel(enable_backward=False)
def decide(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int)):
    """Whether the list still holds by the measured displacements; a thread a world."""
    world = wp.tid()
    if due[world] == NO:
        return
    t = view(s, world, topo.particles, size)
    k = 3 * topo.particles
    high = wp.vec3(t.listed[k], t.listed[k + 1], t.listed[k + 2])
    span = wp.length(high + wp.vec3(t.listed[k + 3], t.listed[k + 4], t.listed[k + 5]))
    if wp.max(span, t.notes[TRAVEL] - FORGET) > run.margin - swept(t, run):
        due[world] = LIST
        t.pair_count[0] = 0
        t.pair_count[1] = 0
        t.notes[TRAVEL] = 0.0
        t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
    else:
        due[world] = NO
        t.notes[TRAVEL] = span * 0.5


@wp.kernel(enable_backward=False)
def bound(s: StateFloat, topo: Topology, size: Sizes, due: wp.array(dtype=int), threads: int):
    """Where everything is now: particles, centres of elements, boxes of blocks."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = view(s, world, topo.particles, size)
        n = topo.particles
        for i in range(thread, n, threads):
            t.listed[i] = t.x[i]
            t.listed[n + i] = t.y[i]
            t.listed[2 * n + i] = t.z[i]
        middles(t, topo, thread, threads)
        bound_blocks(t, topo, thread, threads)


@wp.kernel(enable_backward=False)
def gather_boxes(s: StateFloat, topo: Topology, size: Sizes, due: wp.array(dtype=int), threads: int):
    """Boxes of groups of blocks."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = view(s, world, topo.particles, size)
        bound_groups(t, topo, thread, threads)


@wp.func
def near(t: StateFloat, k: int, lo: wp.vec3, hi: wp.vec3):
    """Whether box k meets another one."""
    gap = wp.min(t.bounds[k + 3] - lo[0], hi[0] - t.bounds[k])
    gap = wp.min(gap, wp.min(t.bounds[k + 4] - lo[1], hi[1] - t.bounds[k + 1]))
    return wp.min(gap, wp.min(t.bounds[k + 5] - lo[2], hi[2] - t.bounds[k + 2])) > 0.0


@wp.kernel(enable_backward=False)
def find(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int)):
    """The pairs of block a with the blocks from a on in `REACH` groups."""
    world, part, a = wp.tid()
    m = topo.blocks
    last = wp.min((part + 1) * REACH, (m + GROUP - 1) / GROUP)
    if due[world] != LIST or last * GROUP <= a:
        return
    t = view(s, world, topo.particles, size)
    # the last percent is for rounding, in here and in the displacements
    far = t.scalars[THICKNESS] + 1.01 * run.margin
    grow = wp.vec3(far, far, far)
    lo = wp.vec3(t.bounds[6 * a], t.bounds[6 * a + 1], t.bounds[6 * a + 2]) - grow
    hi = wp.vec3(t.bounds[6 * a + 3], t.bounds[6 * a + 4], t.bounds[6 * a + 5]) + grow
    for g in range(wp.max(part * REACH, a / GROUP), last):
        if near(t, 6 * (m + g), lo, hi):
            for b in range(wp.max(a, GROUP * g), wp.min(GROUP * g + GROUP, m)):
                if near(t, 6 * b, lo, hi):
                    find_vertex_triangle(t, topo, a, b, far, far * far)
                    if a != b:
                        find_vertex_triangle(t, topo, b, a, far, far * far)
                    find_edge_edge(t, topo, a, b, far, far * far)


@wp.kernel(enable_backward=False)
def find_creases(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int)):
    """The pairs of edges that are looked at whatever their blocks."""
    world, k = wp.tid()
    if due[world] == LIST:
        t = view(s, world, topo.particles, size)
        far = t.scalars[THICKNESS] + 1.01 * run.margin
        q = topo.crease[k]
        hit = near_edges(t, q[0], q[1], q[2], q[3], far * far)
        append(hit, t.pair_count, 1, t.edge_edge, q[0], q[1], q[2], q[3])


class PairFinder:
    """Launches that list the pairs of all worlds whose list is used up.

    Args:
        topology: The cloth's elements.
        worlds: How many.
        device: "cpu" or "cuda:0" ...
        few: Threads a world where each ends in atomics on the same numbers.
        many: Threads a world elsewhere.
    """

    def __init__(self, topology: Any, worlds: int, device: str, few: int, many: int) -> None:
        self._topology, self._worlds, self._device = topology, worlds, device
        self._few, self._many = few, many
        self._due = wp.zeros(worlds, dtype=int, device=device)

    def load(self) -> None:
        """Load the kernels, which a graph's capture cannot."""
        wp.load_module(ask.module, device=self._device)

    def launch(self, state: Any, size: Any, run: Any) -> None:
        """Launch every phase; a world whose list still holds passes through."""
        topo, worlds, few, many = self._topology, self._worlds, self._few, self._many
        common = [state, topo, size]

        def go(kernel: Any, dim: Any, *inputs: Any) -> None:
            wp.launch(kernel, dim=dim, inputs=[*common, *inputs], device=self._device)

        groups = -(-topo.blocks // GROUP)
        go(ask, worlds, run, self._due)
        go(measure, (worlds, few), self._due, few)
        go(decide, worlds, run, self._due)
        go(bound, (worlds, many), self._due, many)
        go(gather_boxes, (worlds, many), self._due, many)
        go(find, (worlds, -(-groups // REACH), topo.blocks), run, self._due)
        if topo.crease.shape[0]:
            go(find_creases, (worlds, topo.crease.shape[0]), run, self._due)
