"""A material's numbers in the form in which the solver takes them: compliances of elements, masses of vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.topology.cloth_topology import ClothTopology, Elements
from nuno.topology.grid_lines import find_grid_lines

SOFTEST = 1.0e-12
"""The least stiffness [N/m] and rigidity [N m], so that a cloth without any has a finite compliance."""
UNIFORM_BENDS = 9
"""Numbers in ``bend`` where all elements of a kind and direction have the same: three of each of three kinds."""


@dataclass(frozen=True)
class Compliances:
    """One over a cloth's stiffness, and which number each element takes.

    Attributes:
        stretch: (worlds, k) float [m/N].
        shear: (worlds, k) float [m/N].
        bend: (worlds, k) float [1/(N m)].
        edge: (edges,) int32, the place in ``stretch`` of each edge, in the order of the grid lines.
        triangle: (triangles, 3) int32, the places in ``stretch`` along warp and weft, and in ``shear``.
        cell: (cells,) int32, the place in ``shear``.
        line: (lines,) int32, the place in ``bend``.
        twist: (twists,) int32, the place in ``bend``.
        patch: (patches,) int32, the place in ``bend``.
    """

    stretch: np.ndarray
    shear: np.ndarray
    bend: np.ndarray
    edge: np.ndarray
    triangle: np.ndarray
    cell: np.ndarray
    line: np.ndarray
    twist: np.ndarray
    patch: np.ndarray


def compliances(topology: ClothTopology, values: dict[str, np.ndarray]) -> Compliances:
    """The compliances of a cloth's elements in all worlds.

    Args:
        topology: The cloth's elements.
        values: What `nuno.materials.Cloth.resolved` gives: (worlds, elements), or (worlds, 1) for one value of all.
    """

    def table(*which: str) -> list[np.ndarray]:
        return [np.maximum(np.asarray(values[name], dtype=np.float64), SOFTEST) for name in which]

    stretch = table("stretch_stiffness_warp", "stretch_stiffness_weft")
    shear = table("shear_stiffness")
    bend = table("bending_rigidity_warp", "bending_rigidity_weft")
    bend.append(np.sqrt(bend[0] * bend[1]))

    edges, triangles = topology.edges, topology.triangles
    if len(triangles):
        stretch_compliance, places = _of_triangles(triangles, stretch, _differ(shear))
        edge = np.zeros(0, dtype=int)
    else:
        stretch_compliance, edge = _of_elements(topology, edges, stretch)
        edge = edge[find_grid_lines(edges)[0]]
        places = np.zeros((0, 3), dtype=int)
    shear_compliance, cell = _of_elements(topology, topology.cells if len(topology.cells) else triangles, shear)
    lines, line = _of_elements(topology, topology.lines, bend)
    twists, twist = _of_elements(topology, topology.twists, bend)
    soft, patch = _of_elements(topology, topology.patches, bend)
    twist, patch = twist + lines.shape[1], patch + lines.shape[1] + twists.shape[1]
    bending = np.concatenate([lines, twists, soft], axis=1)
    if _differ(bend):
        # the strips on CUDA tell by the count that elements have their own numbers, however few there are
        bending = np.pad(bending, ((0, 0), (0, max(0, UNIFORM_BENDS + 1 - bending.shape[1]))), mode="edge")
    indices = (edge, places, cell[: len(topology.cells)], line, twist, patch)
    return Compliances(
        stretch_compliance,
        shear_compliance,
        bending,
        *(np.ascontiguousarray(index, dtype=np.int32) for index in indices),
    )


def vertex_masses(topology: ClothTopology, density: np.ndarray) -> np.ndarray:
    """Masses (worlds, n) [kg] of an area density (worlds, elements) or (worlds, 1) [kg/m2]."""
    density = np.asarray(density, dtype=float)
    if density.shape[1] == 1:
        return density * topology.area[None]
    per_face = len(topology.faces) // topology.element_count
    x = topology.rest[topology.faces]
    areas = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    shares = np.repeat(density, per_face, axis=1) * areas / 3
    mass = np.zeros((len(density), len(topology.rest)))
    for k in range(3):
        np.add.at(mass.T, topology.faces[:, k], shares.T)
    return mass


def _differ(columns: list[np.ndarray]) -> bool:
    """Return True if elements have their own values."""
    return any(column.shape[1] > 1 for column in columns)


def _of_elements(
    topology: ClothTopology, elements: Elements, columns: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Compliances (worlds, k) of a column of stiffness for each axis, and which one each element takes."""
    if not _differ(columns):
        return 1.0 / np.concatenate(columns, axis=1), elements.axis
    count = len(elements)
    full = np.stack([np.broadcast_to(c, (len(c), topology.element_count)) for c in columns], axis=1)
    mean = full[:, elements.axis[:, None], elements.faces].mean(axis=2)
    return 1.0 / mean.reshape(len(mean), count), np.arange(count)


def _of_triangles(triangles: Elements, stretch: list[np.ndarray], sheared: bool) -> tuple[np.ndarray, np.ndarray]:
    """Compliances (worlds, k) along warp and weft, and which ones, and which of the shear, each triangle takes."""
    count = len(triangles)
    each = np.arange(count)
    none = np.zeros(count, dtype=int)
    w = each if sheared else none
    if not _differ(stretch):
        return 1.0 / np.concatenate(stretch, axis=1), np.stack([none, none + 1, w], axis=1)
    face = triangles.faces[:, 0]
    # a side that all elements share is spread over them
    own = [c[:, face] if c.shape[1] > 1 else np.repeat(c, count, axis=1) for c in stretch]
    return 1.0 / np.concatenate(own, axis=1), np.stack([each, each + count, w], axis=1)
