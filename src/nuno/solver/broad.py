"""The listing of self-contact pairs over the whole device, for the plan of large scenes.

What `nuno.contact.renewal` does, in phases, a launch each: whether to list is decided on the device, and a phase
does nothing in a world where it is not due. First pairs of blocks are noted: a thread looks at one block and the blocks
of `REACH` groups of later ones, which gives work to a whole device and passes over far groups at a comparison each.
Then a thread looks at one vertex or edge of one noted pair.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.flat_blocks import in_flat, mark_flat, mark_uncreased
from nuno.contact.nearness import GROUP, bound_blocks, bound_groups, measure_span, middles
from nuno.contact.pair_lists import FORGET, find_edge_edge, find_vertex_triangle, swept
from nuno.contact.pair_lists import find_creases as find_crease_pairs
from nuno.scene.blocks import BLOCK_VERTICES
from nuno.solver.lanes import window
from nuno.solver.state import LISTINGS, THICKNESS, TRAVEL, Settings, Sizes, StateFloat, Topology, view

REACH = 16
"""Groups of blocks that one thread looks through."""
ROOM = 24
"""Pairs of blocks, over the number of blocks, that there is room to note; a thread that finds no room looks through
the pair itself."""
ITEMS = 32
"""Threads that share a pair of blocks."""
FINDERS = 1 << 17
"""Threads of all worlds that look through noted pairs."""
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


@wp.func
def flagged(s: StateFloat, topo: Topology, size: Sizes, world: int, flat: wp.array(dtype=int)):
    """A world's state, with the flags of flat windows where `nuno.contact.flat_blocks` has them."""
    t = view(s, world, topo.particles, size)
    t.moved = window(flat, 2 * topo.particles * world, 2 * topo.particles)
    return t


@wp.kernel(enable_backward=False)
def bound(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), noted: wp.array(dtype=int),
    flat: wp.array(dtype=int), threads: int,
):  # fmt: skip
    """Where everything is now: particles, centres of elements, boxes of blocks, windows without a crease."""
    world, thread = wp.tid()
    if due[world] == LIST:
        n = topo.particles
        t = flagged(s, topo, size, world, flat)
        if thread == 0:
            noted[world] = 0
        mark_uncreased(t, topo, t.scalars[THICKNESS] + 1.01 * run.margin, thread, threads)
        for i in range(thread, n, threads):
            t.listed[i] = t.x[i]
            t.listed[n + i] = t.y[i]
            t.listed[2 * n + i] = t.z[i]
        middles(t, topo, thread, threads)
        bound_blocks(t, topo, thread, threads)


@wp.kernel(enable_backward=False)
def gather_boxes(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), flat: wp.array(dtype=int),
    threads: int,
):  # fmt: skip
    """Boxes of groups of blocks, and flat windows."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = flagged(s, topo, size, world, flat)
        bound_groups(t, topo, thread, threads)
        mark_flat(t, topo, t.scalars[THICKNESS] + 1.01 * run.margin, thread, threads)


@wp.func
def near(t: StateFloat, k: int, lo: wp.vec3, hi: wp.vec3):
    """Whether box k meets another one."""
    gap = wp.min(t.bounds[k + 3] - lo[0], hi[0] - t.bounds[k])
    gap = wp.min(gap, wp.min(t.bounds[k + 4] - lo[1], hi[1] - t.bounds[k + 1]))
    return wp.min(gap, wp.min(t.bounds[k + 5] - lo[2], hi[2] - t.bounds[k + 2])) > 0.0


@wp.func
def search(t: StateFloat, topo: Topology, a: int, b: int, far: float, item: int, items: int):
    """List what is near of two blocks; of ``items`` threads each has its share."""
    find_vertex_triangle(t, topo, a, b, far, far * far, item, items)
    if a != b:
        find_vertex_triangle(t, topo, b, a, far, far * far, item - BLOCK_VERTICES, items)
    find_edge_edge(t, topo, a, b, far, far * far, item - 2 * BLOCK_VERTICES, items)


@wp.func
def search_alone(t: StateFloat, topo: Topology, a: int, b: int, far: float):
    """`search` by one thread."""
    items = int(ITEMS)
    for item in range(items):
        search(t, topo, a, b, far, item, items)


@wp.kernel(enable_backward=False)
def meet(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), noted: wp.array(dtype=int),
    pairs: wp.array(dtype=wp.vec2i), flat: wp.array(dtype=int),
):  # fmt: skip
    """Note the pairs of block a with the blocks from a on in `REACH` groups, where they are near and not flat."""
    world, part, a = wp.tid()
    m = topo.blocks
    last = wp.min((part + 1) * REACH, (m + GROUP - 1) / GROUP)
    if due[world] != LIST or last * GROUP <= a:
        return
    t = flagged(s, topo, size, world, flat)
    # the last percent is for rounding, in here and in the displacements
    far = t.scalars[THICKNESS] + 1.01 * run.margin
    grow = wp.vec3(far, far, far)
    lo = wp.vec3(t.bounds[6 * a], t.bounds[6 * a + 1], t.bounds[6 * a + 2]) - grow
    hi = wp.vec3(t.bounds[6 * a + 3], t.bounds[6 * a + 4], t.bounds[6 * a + 5]) + grow
    for g in range(wp.max(part * REACH, a / GROUP), last):
        if near(t, 6 * (m + g), lo, hi):
            for b in range(wp.max(a, GROUP * g), wp.min(GROUP * g + GROUP, m)):
                if near(t, 6 * b, lo, hi) and not in_flat(t, topo, a, b):
                    k = wp.atomic_add(noted, world, 1)
                    if k < ROOM * m:
                        pairs[world * ROOM * m + k] = wp.vec2i(a, b)
                    else:
                        search_alone(t, topo, a, b, far)


@wp.kernel(enable_backward=False)
def find(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), noted: wp.array(dtype=int),
    pairs: wp.array(dtype=wp.vec2i), threads: int,
):  # fmt: skip
    """Look through the noted pairs, a vertex or an edge a thread."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = view(s, world, topo.particles, size)
        far = t.scalars[THICKNESS] + 1.01 * run.margin
        m = ROOM * topo.blocks
        for k in range(thread, wp.min(noted[world], m) * ITEMS, threads):
            pair = pairs[world * m + k / ITEMS]
            search(t, topo, pair[0], pair[1], far, k % ITEMS, ITEMS)


@wp.kernel(enable_backward=False)
def find_creases(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), flat: wp.array(dtype=int),
    threads: int,
):  # fmt: skip
    """The pairs of edges that are looked at whatever their blocks."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = flagged(s, topo, size, world, flat)
        far = t.scalars[THICKNESS] + 1.01 * run.margin
        find_crease_pairs(t, topo, far * far, thread, threads)


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
        self._due, self._noted = (wp.zeros(worlds, dtype=int, device=device) for _ in range(2))
        self._pairs = wp.zeros(worlds * ROOM * topology.blocks, dtype=wp.vec2i, device=device)
        self._flat = wp.zeros(2 * worlds * topology.particles, dtype=int, device=device)
        self._finders = max(many, FINDERS // worlds) if device.startswith("cuda") else many

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
        go(bound, (worlds, many), run, self._due, self._noted, self._flat, many)
        go(gather_boxes, (worlds, many), run, self._due, self._flat, many)
        go(meet, (worlds, -(-groups // REACH), topo.blocks), run, self._due, self._noted, self._pairs, self._flat)
        go(find, (worlds, self._finders), run, self._due, self._noted, self._pairs, self._finders)
        if topo.crease.shape[0]:
            go(find_creases, (worlds, many), run, self._due, self._flat, many)
