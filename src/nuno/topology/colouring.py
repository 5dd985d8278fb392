"""Colours: sets of elements that share no vertex, so that a set can be projected at once."""

from __future__ import annotations

import numpy as np


def colour(elements: np.ndarray, vertex_count: int) -> np.ndarray:
    """Colour elements so that no two of one colour share a vertex.

    Repeated maximal independent sets by local minima of a fixed hash: vectorised, and the same every time.

    Args:
        elements: (m, k) int, vertex indices.
        vertex_count: Number of vertices.

    Returns:
        (m,) int, the colour of each element, from 0.
    """
    elements = np.asarray(elements, dtype=np.int64)
    count = len(elements)
    colours = np.full(count, -1, dtype=np.int64)
    # Knuth's multiplicative hash scatters the priorities, so that a few rounds find a maximal set
    priority = ((np.arange(count, dtype=np.uint64) * np.uint64(2654435761)) % np.uint64(2**32)).astype(np.int64)
    priority = np.argsort(np.argsort(priority, kind="stable"), kind="stable")
    left = np.arange(count)
    current = 0
    while len(left):
        open_ = left
        taken = np.zeros(vertex_count, dtype=bool)
        while len(open_):
            lowest = np.full(vertex_count, count, dtype=np.int64)
            np.minimum.at(lowest, elements[open_].ravel(), np.repeat(priority[open_], elements.shape[1]))
            wins = (lowest[elements[open_]] == priority[open_][:, None]).all(axis=1)
            chosen = open_[wins]
            colours[chosen] = current
            taken[elements[chosen].ravel()] = True
            open_ = open_[~wins]
            open_ = open_[~taken[elements[open_]].any(axis=1)]
        left = left[colours[left] < 0]
        current += 1
    return colours


def by_colour(colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The order that sorts elements by colour, and where each colour starts.

    Returns:
        order (m,) int, and offsets (colours + 1,) int32.
    """
    order = np.argsort(colours, kind="stable")
    count = int(colours.max()) + 1 if len(colours) else 0
    return order, np.searchsorted(colours[order], np.arange(count + 1)).astype(np.int32)


def colour_first_fit(elements: np.ndarray, vertex_count: int) -> np.ndarray:
    """Colour elements one after the other, each by the first colour that none of its vertices has.

    Slower than `colour`, with fewer colours: for elements of which many share a vertex.

    Args:
        elements: (m, k) int, vertex indices.
        vertex_count: Number of vertices.

    Returns:
        (m,) int, the colour of each element, from 0.
    """
    used = [0] * vertex_count
    colours = np.zeros(len(elements), dtype=np.int64)
    for k, corners in enumerate(np.asarray(elements).tolist()):
        taken = 0
        for vertex in corners:
            taken |= used[vertex]
        lowest = ~taken & (taken + 1)
        for vertex in corners:
            used[vertex] |= lowest
        colours[k] = lowest.bit_length() - 1
    return colours
