"""Elements in stages: what the blocks of a device go through with few waits for each other.

Elements of one colour share no vertex, and all must be done before the next colour begins. If every colour ends with a
wait of the whole device, most of the time is waiting. But colours that follow one another may fall apart into strips
that share no vertex: on a sheet's grid two colours of cells make up pairs of rows, and bends or grid lines along the
rows stay in them too. A strip is one block's, whose threads wait for each other alone, and the device waits once for
all these colours: a stage. The order of the colours is the same, so the bits are.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

WAIT, ELEMENT = 1.5, 0.002
"""Costs of a stage's wait, and of an element of the block that has most of them in a step: microseconds on an H200, by
which stages are weighed against each other."""


@dataclass(frozen=True, eq=False)
class Colour:
    """Elements of one kind that share no vertex, one after the other in their table.

    Attributes:
        kind: Which table.
        first: The first of them there.
        count: How many.
        element: (k,) int, counted from ``first``, once for each of their vertices, in rising order.
        vertex: (k,) int, the vertices.
    """

    kind: int
    first: int
    count: int
    element: np.ndarray
    vertex: np.ndarray

    @cached_property
    def links(self) -> np.ndarray:
        """(2, k) int, vertices that an element joins."""
        same = self.element[1:] == self.element[:-1]
        return np.stack([self.vertex[:-1][same], self.vertex[1:][same]])

    @cached_property
    def some_vertex(self) -> np.ndarray:
        """(count,) int, a vertex of each element."""
        return self.vertex[np.searchsorted(self.element, np.arange(self.count))]


@dataclass(frozen=True, eq=False)
class Stages:
    """The work of each block in each step; a step is one colour.

    Attributes:
        kind: (steps,) int32, the kind of element.
        ends: (steps,) int32, 1 where a stage ends and all blocks wait for each other.
        share: (blocks, steps, 2) int32, the first and one past the last of a block's elements: in their table, or
            among the rows below for kinds that are sorted anew.
        row: (rows, 2) int64, kind and place in its table of each element of the kinds that are sorted anew.
    """

    kind: np.ndarray
    ends: np.ndarray
    share: np.ndarray
    row: np.ndarray

    @property
    def first(self) -> np.ndarray:
        """(stages + 1,) int, the step at which each stage begins, and the number of steps."""
        return np.concatenate([[0], np.nonzero(self.ends)[0] + 1])


def make_stages(colours: Sequence[Colour], vertices: int, blocks: int, sortable: Collection[int]) -> Stages:
    """Divide colours among blocks, those that fall apart into strips in one stage: the quickest division.

    Args:
        colours: In the order in which they are to be done; none is empty.
        vertices: How many vertices there are.
        blocks: How many blocks there are.
        sortable: Kinds whose elements may be sorted anew; of the others a block's must follow one another.
    """
    count = len(colours)
    # the quickest way from each colour on: its time, the colour after its first stage, and who does what in that
    best: list[tuple[float, int, list[np.ndarray]]] = [(0.0, count, [])]
    for first in reversed(range(count)):
        single = colours[first]
        owners = [np.arange(single.count) * blocks // single.count]
        found = [(_time(owners) + best[0][0], first + 1, owners)]
        for last in range(first + 2, count + 1):
            owners = _divide(colours[first:last], vertices, blocks)
            if max(np.bincount(owner).max() for owner in owners) * ELEMENT > 2.0 * WAIT:
                break
            if all(
                c.kind in sortable or (np.diff(o) >= 0).all() for c, o in zip(colours[first:last], owners, strict=True)
            ):
                found.append((_time(owners) + best[last - first - 1][0], last, owners))
        best.insert(0, min(found, key=lambda way: way[0]))
    ends, owned = np.zeros(count, dtype=np.int32), []
    k = 0
    while k < count:
        _, k, owners = best[k]
        ends[k - 1] = 1
        owned += owners
    rows: list[np.ndarray] = []
    shares = []
    for colour, owner in zip(colours, owned, strict=True):
        start = colour.first
        if colour.kind in sortable:
            start = sum(map(len, rows))
            place = colour.first + np.argsort(owner, kind="stable")
            rows.append(np.stack([np.full(colour.count, colour.kind), place], axis=1))
        shares.append(start + np.searchsorted(np.sort(owner), np.arange(blocks + 1)))
    share = np.array(shares).reshape(-1, blocks + 1)
    return Stages(
        np.array([c.kind for c in colours], dtype=np.int32),
        ends,
        np.stack([share[:, :-1].T, share[:, 1:].T], axis=-1).astype(np.int32),
        np.concatenate(rows) if rows else np.zeros((0, 2), dtype=np.int64),
    )


def _time(owners: Sequence[np.ndarray]) -> float:
    """Return what a stage costs."""
    return WAIT + ELEMENT * sum(int(np.bincount(owner).max()) for owner in owners)


def _divide(group: Sequence[Colour], vertices: int, blocks: int) -> list[np.ndarray]:
    """The block of each element of each colour: strips go to blocks whole."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    heads, tails = np.concatenate([colour.links for colour in group], axis=1)
    graph = coo_matrix((np.ones(len(heads), dtype=np.int8), (heads, tails)), (vertices, vertices))
    strips, label = connected_components(graph, directed=False)
    # strips by their lowest vertices, so that neighbours in memory come to the same block
    lowest = np.empty(strips, dtype=np.int64)
    lowest[label[::-1]] = np.arange(vertices)[::-1]
    rank = np.empty(strips, dtype=np.int64)
    rank[np.argsort(lowest)] = np.arange(strips)
    own = [rank[label[colour.some_vertex]] for colour in group]
    work = sum(np.bincount(strip, minlength=strips) for strip in own)
    # a block takes the strips whose middle, if all were in a row, is in its part of it
    block = ((2 * np.cumsum(work) - work) * blocks) // (2 * np.sum(work))
    return [block[strip] for strip in own]
