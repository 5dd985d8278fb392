"""Clusters: a tetrahedron and those across its faces, solved one after the other by whoever has their vertices.

A colour of single tetrahedra is little work for many threads, between two waits for all of them: a lattice has 32
elements about every other vertex, and so at least 32 colours. A cluster has up to five elements on eight vertices, and
the voxels of a lattice are clusters: they take 8 colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.mesh.tetrahedra import FACES
from nuno.topology.colouring import by_colour, colour_first_fit

MAX_OUTER = 4
"""Tetrahedra about the inner one: as many as it has faces."""
ELEMENTS = MAX_OUTER + 1
"""Places for elements in a cluster: the inner one, and those outside."""
BANKS = 32
"""Of a CUDA block's own memory: threads that read different numbers of one bank wait for each other."""
# Even permutations that bring the corners across from the faces that have an outer element to the front: an element
# stays of positive volume under them.
EVEN = np.array(
    [
        [0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 0, 3, 2], [1, 2, 0, 3], [1, 3, 2, 0],
        [2, 0, 1, 3], [2, 1, 3, 0], [2, 3, 0, 1], [3, 0, 2, 1], [3, 1, 0, 2], [3, 2, 1, 0],
    ]
)  # fmt: skip
OUTER_CORNERS = np.array([[4, 1, 3, 2], [5, 0, 2, 3], [6, 3, 1, 0], [7, 2, 0, 1]])
"""(4, 4): the corners of each outer element among the cluster's eight vertices, its own vertex first; of positive
volume where the inner one (0, 1, 2, 3) is, outer element k standing on the face across from corner k."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """Every tetrahedron of a body in one cluster, sorted by colour and within a colour by size.

    Attributes:
        vertices: (s, 8) int32, the corners of the inner element and the outer ones' own vertices; where there is none,
            the inner corner across from its face.
        elements: (s, 5) int32, the inner element and the outer ones, -1 where there is none; those that are there come
            first.
        offsets: (colours + 1,) int32, where each colour starts.
    """

    vertices: np.ndarray
    elements: np.ndarray
    offsets: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """(s, 5, 4) int32, the vertices of each element in the order in which a cluster has them."""
        return self.vertices[:, np.concatenate([[[0, 1, 2, 3]], OUTER_CORNERS])]


def clusters(tets: np.ndarray, volume: np.ndarray, place: np.ndarray, vertex_count: int) -> Clusters:
    """Group tetrahedra into clusters, the larger elements inside, and colour these.

    Clusters of a colour and size stand in an order in which any 32 of them have their first vertices, and in a lattice
    all their vertices, in as many banks as they can.

    Args:
        tets: (m, 4) int, of positive volume.
        volume: (m,) float [m3].
        place: (m,) int, the elements in an order in which neighbours are close to each other.
        vertex_count: Number of vertices.
    """
    inner, outer = _grouped(tets, across_faces(tets), _by_size(volume, place))
    vertices, elements = _arranged(tets, inner, outer)
    rank = np.empty(len(tets), dtype=np.int64)
    rank[place] = np.arange(len(tets))
    along = np.argsort(rank[elements[:, 0]])
    vertices, elements = vertices[along], elements[along]
    colours = colour_first_fit(vertices, vertex_count)
    fewer = ELEMENTS - (elements >= 0).sum(axis=1)
    offsets = by_colour(colours)[1]
    bank = vertices[:, 0] % BANKS
    order = np.lexsort((bank, _turn(np.stack([colours, fewer, bank], axis=1)), fewer, colours))
    return Clusters(vertices[order].astype(np.int32), elements[order].astype(np.int32), offsets)


def across_faces(tets: np.ndarray) -> np.ndarray:
    """Return (m, 4) int: the element on the other side of the face across from each corner, or -1."""
    # FACES[f] is the face without corner 3 - f
    faces = np.sort(tets[:, FACES[::-1]].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = (faces[order][1:] == faces[order][:-1]).all(axis=1)
    one, other = order[:-1][same], order[1:][same]
    across = np.full(len(faces), -1, dtype=np.int64)
    across[one], across[other] = other // 4, one // 4
    return across.reshape(-1, 4)


def _turn(rows: np.ndarray) -> np.ndarray:
    """Return which of its equals each row of integers is, from 0."""
    _, same = np.unique(rows, axis=0, return_inverse=True)
    same = same.reshape(-1)
    order = np.argsort(same, kind="stable")
    turn = np.empty(len(rows), dtype=np.int64)
    turn[order] = np.arange(len(rows)) - np.searchsorted(same[order], same[order])
    return turn


def _by_size(volume: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The elements from large to small, those of about the same size in their order."""
    classes = np.round(2.0 * np.log2(volume / volume.max()))
    return place[np.argsort(-classes[place], kind="stable")]


def _grouped(tets: np.ndarray, across: np.ndarray, order: np.ndarray) -> tuple[list[int], list[list[tuple[int, int]]]]:
    """Inner elements, and of each the outer ones as (corner across from them, element): full clusters first."""
    free = [True] * len(tets)
    corners, neighbours = tets.tolist(), across.tolist()
    inner, outer = [], []
    left = order.tolist()
    for wanted in range(MAX_OUTER, -1, -1):
        for k in left:
            if not free[k]:
                continue
            found = _outer_elements(k, corners, neighbours[k], free)
            if len(found) >= wanted:
                inner.append(k)
                outer.append(found)
                for element in (k, *(other for _, other in found)):
                    free[element] = False
        left = [k for k in left if free[k]]
    return inner, outer


def _outer_elements(k: int, corners: list[list[int]], neighbours: list[int], free: list[bool]) -> list[tuple[int, int]]:
    """Return the free neighbours that element k may take into its cluster, as (corner across from them, element)."""
    found, own = [], set(corners[k])
    for corner, other in enumerate(neighbours):
        if other >= 0 and free[other]:
            (tip,) = set(corners[other]) - set(corners[k])
            # two outer elements of one tip would each have their own idea of where it is
            if tip not in own:
                own.add(tip)
                found.append((corner, other))
    return found


def _arranged(tets: np.ndarray, inner: list[int], outer: list[list[tuple[int, int]]]) -> tuple[np.ndarray, np.ndarray]:
    """The clusters' vertices (s, 8) and elements (s, 5), outer elements on the faces across from the first corners."""
    vertices = np.empty((len(inner), 8), dtype=np.int64)
    elements = np.full((len(inner), ELEMENTS), -1, dtype=np.int64)
    elements[:, 0] = inner
    for s, (k, found) in enumerate(zip(inner, outer, strict=True)):
        faced = [corner for corner, _ in found]
        turn = next(p for p in EVEN.tolist() if set(p[: len(faced)]) == set(faced))
        core = tets[k][turn].tolist()
        vertices[s] = core + core
        for corner, other in found:
            slot = turn.index(corner)
            (tip,) = set(tets[other].tolist()) - set(core)
            vertices[s, 4 + slot], elements[s, 1 + slot] = tip, other
    return vertices, elements
