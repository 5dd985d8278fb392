"""The capacity of a cloth's neighbour lists, and how it grows where a list did not fit.

What does not fit a list is counted but not kept, and contacts that are not listed are not seen. So counts are looked at
whenever the state is asked to be finite, and a run in which some list was too short is gone through again with longer
ones (`nuno.world.simulation`). What is listed beside what touches changes no bit, and so neither does the length of a
list.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.numbers.warps import WARP
from nuno.plans.block_plan import FEW_THREADS
from nuno.state.cloth_state import MAX_NEIGHBOURS, MISSED_ELEMENTS, MISSED_LEAVES

SUSPECTS = 512
"""Pairs of elements that a warp that lists pairs can note at least: more than any two blocks of neighbouring vertices
have."""
PAIRS = 6, 16
"""Room for candidates, vertex-triangle and edge-edge ones, for each vertex, at first. Wrinkled cloths have under 3 and
8, two layers that lie on each other up to 7 and 14."""
MORE = 4.0
"""Times that room where memory allows: four layers have 15 and 43 candidates a vertex, many 20 and 56."""
PAIR_BYTES = 32
"""[B] A candidate's four vertices, among all and among those that are picked. (The CPU has a third list, of a substep's
pairs, but takes memory for what is written only.)"""
LISTS = 4.0e9
"""[B] That the lists of all worlds may take together for this."""
MAX_LIST_BYTES = 16.0e9
"""[B] That they may grow to where they turn out to be too short."""
SPARE = 1.5
"""Times what they would have needed that lists are made to hold."""
MAX_NUMBERS = 2**31 - 1
"""Elements of an array whose places are 32-bit numbers."""


def size_lists(size: Any, particles: int, worlds: int) -> None:
    """Set how long the lists are at first; ``leaf_pairs`` is set."""
    smallest = worlds * particles * sum(PAIRS) * PAIR_BYTES
    room = int(min(max(LISTS / smallest, 1.0), MORE) * particles)
    size.vertex_triangle, size.edge_edge = PAIRS[0] * room + 64, PAIRS[1] * room + 128
    if size.leaf_pairs > 1:
        # the room in which a list is made: a queue of pairs of blocks, and each warp's suspects
        size.vertex_triangle = max(size.vertex_triangle, -(-size.leaf_pairs // 4))
        size.edge_edge = max(size.edge_edge, SUSPECTS * FEW_THREADS // WARP // 2)


def find_missed(size: Any, counts: np.ndarray) -> np.ndarray:
    """Return (worlds,) bool, in which of them some pairs were passed over; counts are (worlds, `COUNTS`) int."""
    counted = np.maximum(counts[:, :2], counts[:, MAX_NEIGHBOURS : MAX_NEIGHBOURS + 2])
    missed = (counted > (size.vertex_triangle, size.edge_edge)).any(axis=1) | (counts[:, MISSED_ELEMENTS:] > 0).any(
        axis=1
    )
    return np.asarray(missed)


def lengthen_lists(size: Any, counts: np.ndarray, worlds: int, rows: int, device: str) -> bool:
    """Make lists longer that would have needed it; return whether there is memory for that.

    Args:
        size: The solver's sizes, which are changed.
        counts: (worlds, `COUNTS`) int.
        worlds: Worlds that there is room for, those that fill up a vector included.
        rows: Lists in one array at most: a world's or a vector's each, or a helping block's.
        device: "cpu" or "cuda:0" ...
    """
    counted = np.maximum(counts[:, :2], counts[:, MAX_NEIGHBOURS : MAX_NEIGHBOURS + 2]).max(axis=0)
    suspects, blocks = counts[:, MISSED_ELEMENTS].max(), counts[:, MISSED_LEAVES].max()
    bytes_each = PAIR_BYTES * worlds
    memory = MAX_LIST_BYTES
    if device.startswith("cuda"):
        # the old lists go only once the new ones are there
        memory = min(memory, 0.5 * float(wp.get_device(device).free_memory))
    for spare in (SPARE, 1.0):
        leaf_pairs = 1 + int(spare * blocks) if blocks else size.leaf_pairs
        triangles, edges = (
            int(spare * found) if found > room else room
            for found, room in zip(counted, (size.vertex_triangle, size.edge_edge), strict=True)
        )
        triangles = max(triangles, -(-leaf_pairs // 4) if leaf_pairs > 1 else 0)
        # half of a warp's room is for each kind, and a suspect takes two numbers of the four that a pair has
        edges = max(edges, int(spare * suspects) * (FEW_THREADS // WARP))
        longest = 4 * max(triangles, edges) * rows
        if bytes_each * (triangles + edges) <= memory and longest <= MAX_NUMBERS:
            size.vertex_triangle, size.edge_edge, size.leaf_pairs = triangles, edges, leaf_pairs
            return True
    return False
