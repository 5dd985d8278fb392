"""A material's numbers in the form in which the solver takes them: compliances of elements, masses of vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.topology.cloth_topology import ELEMENT_KINDS, RIGIDITY, SHEAR, STIFFNESS, ClothTopology, Elements
from nuno.topology.grid_lines import find_grid_lines

SOFTEST = 1.0e-12
"""The least stiffness [N/m] and rigidity [N m], so that a cloth without any has a finite compliance."""
UNIFORM_BENDS, UNIFORM_SHEARS = (
    sum(2 * len(kind.stiffness) - 1 for kind in ELEMENT_KINDS if kind.compliance == own) for own in ("bend", "shear")
)
"""Numbers in ``bend`` and ``shear`` where all elements of a kind and direction have the same: three of each kind that
has directions."""


@dataclass(frozen=True)
class Compliances:
    """One over a cloth's stiffness, and which number each element takes.

    Attributes:
        stretch: (worlds, k) float [m/N].
        shear: (worlds, k) float [m/N].
        bend: (worlds, k) float [1/(N m)].
        place: By the name of a kind of `nuno.topology.cloth_topology.ELEMENT_KINDS`, (elements,) int32, the places in
            its table; of triangles (triangles, 3), two in ``stretch``, along warp and weft, and one in ``shear``; of
            the "edge", in the order of the grid lines, in ``stretch``.
    """

    stretch: np.ndarray
    shear: np.ndarray
    bend: np.ndarray
    place: dict[str, np.ndarray]


def compliances(topology: ClothTopology, values: dict[str, np.ndarray]) -> Compliances:
    """The compliances of a cloth's elements in all worlds.

    Args:
        topology: The cloth's elements.
        values: What `nuno.materials.Cloth.resolved` gives: (worlds, elements), or (worlds, 1) for one value of all.
    """

    def columns(stiffness: tuple[str, ...]) -> list[np.ndarray]:
        found = [np.maximum(np.asarray(values[name], dtype=np.float64), SOFTEST) for name in stiffness]
        return [*found, np.sqrt(found[0] * found[1])] if len(found) == 2 else found

    edges, triangles = topology.edges, topology.triangles
    stretch, shear = columns(STIFFNESS)[:2], columns(SHEAR)
    tables: dict[str, list[np.ndarray]] = {"stretch": [], "shear": [], "bend": []}
    place: dict[str, np.ndarray] = {}
    if len(triangles):
        own, place["triangle"] = _of_triangles(triangles, stretch, _differ(shear))
        tables["shear"] = [_of_elements(topology, triangles, shear)[0]]
        place["edge"] = np.zeros(0)
    else:
        own, edge = _of_elements(topology, edges, stretch)
        place["edge"], place["triangle"] = edge[find_grid_lines(edges)[0]], np.zeros((0, 3))
    tables["stretch"] = [own]
    for kind in ELEMENT_KINDS:
        if kind.name in place:
            continue
        elements, table = getattr(topology, kind.elements), tables[kind.compliance]
        own, index = _of_elements(topology, elements, columns(kind.stiffness))
        place[kind.name] = index + sum(part.shape[1] for part in table)
        table.append(own)
    made = {name: np.concatenate(parts, axis=1) for name, parts in tables.items()}
    for name, stiffness, uniform in (("bend", RIGIDITY, UNIFORM_BENDS), ("shear", SHEAR, UNIFORM_SHEARS)):
        if _differ(columns(stiffness)) and made[name].shape[1] <= uniform:
            # the strips on CUDA tell by the count that elements have their own numbers, however few there are
            made[name] = np.pad(made[name], ((0, 0), (0, uniform + 1 - made[name].shape[1])), mode="edge")
    return Compliances(**made, place={k: np.ascontiguousarray(v, dtype=np.int32) for k, v in place.items()})


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
