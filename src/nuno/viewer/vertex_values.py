"""Values of vertices that bodies can be coloured by: strain, layers, contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nuno.bodies.shape_topology import topology_of
from nuno.bodies.soft_measures import strains
from nuno.errors import InvalidInputError

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

Quantity = Literal["strain", "layer", "contact"]
QUANTITIES: dict[str, tuple[str, float]] = {"strain": ("", 0.05), "layer": ("", 4.0), "contact": ("N", 0.5)}
"""The quantities with their units, and the values that the last colour stands for."""


def check_quantity(body: Body, quantity: str) -> None:
    """Check that a body can be coloured by a quantity.

    Raises:
        InvalidInputError: there is no such quantity, or the body has none.
    """
    if not isinstance(quantity, str) or quantity not in QUANTITIES:
        raise InvalidInputError(f'color_by must be "strain", "layer", "contact" or None, got {quantity!r}')
    if quantity == "layer" and not body.shape.is_cloth:
        raise InvalidInputError(f"only cloths have layers; {body.name!r} is a {body.shape.kind}")
    if quantity == "strain" and not (body.shape.is_cloth or body.shape.is_soft):
        raise InvalidInputError(f"only cloths and soft bodies have strains; {body.name!r} is a {body.shape.kind}")


def vertex_strains(body: Body, vertices: np.ndarray) -> np.ndarray:
    """Return the strain at each vertex, (n,).

    Of a cloth, it is the largest relative change of length of the mesh's edges that meet there; of a soft body, the
    largest principal strain (Green's), without its sign, of the tetrahedra that meet there.

    Args:
        body: A cloth or soft body.
        vertices: (n, 3) [m].
    """
    topology: Any = topology_of(body.shape)
    found = np.zeros(len(vertices))
    if body.shape.is_soft:
        principal = np.abs(np.linalg.eigvalsh(strains(topology, vertices))).max(axis=-1)
        np.maximum.at(found, topology.tets, principal[:, None])
        return found
    edges = np.unique(np.sort(topology.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    lengths, rest = (np.linalg.norm(p[edges[:, 0]] - p[edges[:, 1]], axis=1) for p in (vertices, topology.rest))
    np.maximum.at(found, edges, np.abs(lengths / rest - 1.0)[:, None])
    return found


def vertex_layers(faces: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return how many layers of a cloth lie below each of its vertices, (n,): the triangles right below it.

    Triangles that have the vertex as a corner do not count, nor those on edge.

    Args:
        faces: (m, 3).
        vertices: (n, 3) [m].
    """
    # over an edge, a vertex would lie over both of its triangles: all are looked at from a hair's breadth aside
    aside = 1e-6 * float(np.ptp(vertices, axis=0).max()) * np.array((0.77, 0.41, 0.0))
    corners = vertices[faces] - aside
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    # a grid of cells as large as the largest triangle: each lies in up to four of them
    size = max(float((high - low).max()), 1e-9) * (1.0 + 1e-9)
    origin = vertices[:, :2].min(axis=0)
    columns = int((vertices[:, 0].max() - origin[0]) / size) + 2

    def cell(points: np.ndarray) -> np.ndarray:
        x, y = ((points - origin) / size).astype(int).T
        return x + columns * y

    boxes = [cell(np.column_stack([x, y])) for x in (low[:, 0], high[:, 0]) for y in (low[:, 1], high[:, 1])]
    pairs = np.unique(np.column_stack([np.concatenate(boxes), np.tile(np.arange(len(faces)), 4)]), axis=0)
    own = cell(vertices[:, :2])
    first, last = np.searchsorted(pairs[:, 0], own), np.searchsorted(pairs[:, 0], own, side="right")
    counts = last - first
    vertex = np.repeat(np.arange(len(vertices)), counts)
    triangle = pairs[np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum()), 1]
    keep = (faces[triangle] != vertex[:, None]).all(axis=1)
    vertex, triangle = vertex[keep], triangle[keep]
    a, b, c = (corners[triangle, k] for k in range(3))
    p = vertices[vertex]
    area = _cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = _cross(p - a, c - a) / area, _cross(b - a, p - a) / area
        height = (1.0 - u - v) * a[:, 2] + u * b[:, 2] + v * c[:, 2]
        below = (u >= 0.0) & (v >= 0.0) & (u + v < 1.0) & (height < p[:, 2])
    return np.bincount(vertex[below], minlength=len(vertices)).astype(float)


def vertex_contacts(world: Simulation, body: Body) -> np.ndarray:
    """Return the contact forces at the vertices nearest to where they act, (worlds, n) [N]; the caller holds the lock.

    Static bodies have none.
    """
    from scipy.spatial import cKDTree

    from nuno.world.contact_points import contact_points

    vertices = body._vertices()
    found = np.zeros((world.world_count, vertices.shape[-2]))
    if not body.is_dynamic:
        return found
    contacts = contact_points(world, body)
    force = np.linalg.norm(contacts.forces, axis=1)
    for k in np.unique(contacts.worlds):
        here = contacts.worlds == k
        own = vertices[k if len(vertices) > 1 else 0] if vertices.ndim == 3 else vertices
        np.add.at(found[k], cKDTree(own).query(contacts.points[here])[1], force[here])
    return found


def colours_of(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the colours of values, (n, 3) uint8: matplotlib's viridis from ``low`` to ``high``."""
    from matplotlib import colormaps

    part = np.clip((values - low) / (high - low), 0.0, 1.0)
    return (np.asarray(colormaps["viridis"](part))[:, :3] * 255.0 + 0.5).astype(np.uint8)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
