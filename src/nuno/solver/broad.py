"""The launches that list self-contact pairs over the whole device, for the plan of large scenes.

The phases of `nuno.contact.team_listing`, a launch each: whether to list is decided on the device, and a phase does
nothing in a world where it is not due.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.closing import box_moves, boxes, join_boxes, moves_start
from nuno.contact.flat_blocks import mark_flat
from nuno.contact.pair_lists import FORGET, begin_list, find_creases
from nuno.contact.team_listing import (
    Lists,
    keep_places,
    list_reach,
    margin_left,
    measure_closing,
    note_pairs,
    search_noted,
)
from nuno.solver.lanes import window
from nuno.solver.state import LISTINGS, PICKED, TRAVEL, Settings, Sizes, StateFloat, Topology, view

FINDERS = 1 << 17
"""Threads of all worlds that look through noted pairs."""
NO, ASK, LIST = 0, 1, 2


def bounds_room(blocks: int) -> int:
    """Numbers of a world in `State.bounds`: see `nuno.contact.closing`."""
    return 2 * 6 * boxes(blocks)


@wp.kernel(enable_backward=False)
def ask(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int)):
    """Whether the bound on what moved is used up, so that the displacements must be measured; a thread a world."""
    world = wp.tid()
    t = view(s, world, topo.particles, size)
    due[world] = NO
    if t.notes[TRAVEL] * 2.0 > margin_left(t, run):
        due[world] = ASK
        t.listed[3 * topo.particles] = 0.0


@wp.kernel(enable_backward=False)
def measure(s: StateFloat, topo: Topology, size: Sizes, due: wp.array(dtype=int), threads: int):
    """The blocks' displacements since the list was made."""
    world, thread = wp.tid()
    if due[world] == ASK:
        t = view(s, world, topo.particles, size)
        box_moves(t, topo, thread, threads)


@wp.kernel(enable_backward=False)
def gather_moves(s: StateFloat, topo: Topology, size: Sizes, due: wp.array(dtype=int), threads: int):
    """The displacements of groups and regions."""
    world, thread = wp.tid()
    if due[world] == ASK:
        t = view(s, world, topo.particles, size)
        join_boxes(t, topo, moves_start(topo.blocks), thread, threads)


@wp.kernel(enable_backward=False)
def compare(s: StateFloat, topo: Topology, size: Sizes, run: Settings, due: wp.array(dtype=int), threads: int):
    """How much of the margin they used up."""
    world, thread = wp.tid()
    if due[world] == ASK:
        t = view(s, world, topo.particles, size)
        measure_closing(t, topo, run, thread, threads)


@wp.kernel(enable_backward=False)
def decide(s: StateFloat, topo: Topology, size: Sizes, run: Settings, lists: Lists, due: wp.array(dtype=int)):
    """Whether the list still holds by the measured displacements; a thread a world."""
    world = wp.tid()
    if due[world] == NO:
        return
    t = view(s, world, topo.particles, size)
    worst = wp.max(t.listed[3 * topo.particles], t.notes[TRAVEL] - FORGET)
    if worst > margin_left(t, run):
        due[world] = LIST
        lists.noted[world] = 0
        begin_list(t)
        t.notes[TRAVEL] = 0.0
        t.notes[PICKED] = FORGET
        t.notes[LISTINGS] = t.notes[LISTINGS] + 1.0
    else:
        due[world] = NO
        t.notes[TRAVEL] = worst * 0.5


@wp.func
def flagged(s: StateFloat, topo: Topology, size: Sizes, world: int, flat: wp.array(dtype=int)):
    """A world's state, with the flags of flat windows where `nuno.contact.flat_blocks` has them."""
    t = view(s, world, topo.particles, size)
    t.moved = window(flat, 2 * topo.particles * world, 2 * topo.particles)
    return t


@wp.kernel(enable_backward=False)
def bound(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, lists: Lists, due: wp.array(dtype=int), threads: int
):
    """Where everything is now."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = flagged(s, topo, size, world, lists.flat)
        keep_places(t, topo, run, thread, threads)


@wp.kernel(enable_backward=False)
def gather_boxes(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, lists: Lists, due: wp.array(dtype=int), threads: int
):
    """Boxes of groups and regions, and flat windows."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = flagged(s, topo, size, world, lists.flat)
        join_boxes(t, topo, 0, thread, threads)
        mark_flat(t, topo, list_reach(t, run), thread, threads)


@wp.kernel(enable_backward=False)
def note(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, lists: Lists, due: wp.array(dtype=int), threads: int
):
    """Note the pairs of blocks that are near each other, and list the pairs of edges that go by themselves."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = flagged(s, topo, size, world, lists.flat)
        note_pairs(t, topo, run, lists, world, thread, threads)
        find_creases(t, topo, list_reach(t, run) * list_reach(t, run), thread, threads)


@wp.kernel(enable_backward=False)
def find(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, lists: Lists, due: wp.array(dtype=int), threads: int
):
    """Look through the noted pairs, a vertex or an edge a thread."""
    world, thread = wp.tid()
    if due[world] == LIST:
        t = view(s, world, topo.particles, size)
        search_noted(t, topo, run, lists, world, thread, threads)


class PairFinder:
    """Launches that list the pairs of all worlds whose list is used up.

    Args:
        topology: The cloth's elements.
        lists: Room, from `make_lists`.
        worlds: How many.
        device: "cpu" or "cuda:0" ...
        many: Threads a world: on CUDA whole warps.
    """

    def __init__(self, topology: Any, lists: Any, worlds: int, device: str, many: int) -> None:
        self._topology, self._lists, self._worlds, self._device = topology, lists, worlds, device
        self._many = many
        self._due = wp.zeros(worlds, dtype=int, device=device)
        self._finders = max(many, FINDERS // worlds) if device.startswith("cuda") else many

    def load(self) -> None:
        """Load the kernels, which a graph's capture cannot."""
        wp.load_module(ask.module, device=self._device)

    def launch(self, state: Any, size: Any, run: Any) -> None:
        """Launch every phase; a world whose list still holds passes through."""
        topo, lists, due, many = self._topology, self._lists, self._due, self._many

        def go(kernel: Any, threads: int, *inputs: Any) -> None:
            dim, last = ((self._worlds, threads), [threads]) if threads else (self._worlds, [])
            wp.launch(kernel, dim=dim, inputs=[state, topo, size, *inputs, *last], device=self._device)

        go(ask, 0, run, due)
        go(measure, many, due)
        go(gather_moves, many, due)
        go(compare, many, run, due)
        go(decide, 0, run, lists, due)
        for kernel in (bound, gather_boxes, note):
            go(kernel, many, run, lists, due)
        go(find, self._finders, run, lists, due)
