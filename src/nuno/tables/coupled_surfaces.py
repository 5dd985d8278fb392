"""The surfaces of bodies that move together, as the tables that their contacts are found with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from nuno.coupled.contact_candidates import Elements
from nuno.rigid.ridges import Ridges


@dataclass(frozen=True, eq=False)
class SurfaceOfParticles:
    """The surface of a cloth or a soft body.

    Attributes:
        particles: Particles of the body, inner ones included.
        faces: (m, 3) int, their corners among the particles.
        radius: (worlds,) float [m], half the thickness.
        compliance: (worlds,) float [m/N], how far a contact presses it together.
        solid: Whether the faces enclose the body, corners anticlockwise from outside.
        joined: (k, 2) int, where the body touches itself: pairs of its particles whose surroundings do not touch, each
            in both orders; else None.
    """

    particles: int
    faces: np.ndarray
    radius: np.ndarray
    compliance: np.ndarray
    solid: bool = False
    joined: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class RigidPart:
    """A convex part of a rigid body, or a closed mesh.

    Attributes:
        kind: BOX ... SOLID_MESH of `nuno.contact.particle.distances`.
        size: (3,) float [m], as in the tables of static shapes.
        place: (3,) float [m], in the frame of the centre of mass.
        turn: (4,) float, (w, x, y, z) in that frame.
        radius: Bounding radius [m] about ``place``.
        mesh: A `wp.Mesh` in the part's own frame, or None.
    """

    kind: int
    size: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    radius: float
    mesh: Any = None


@dataclass(frozen=True, eq=False)
class SurfaceOfRigid:
    """The surface of a rigid body.

    Attributes:
        slot: The body's number in the rigid solver.
        parts: What it is made of.
        points: (k, 3) float [m], its corners and the middles of what is round, in the frame of the centre of mass.
        radii: (k,) float [m], how far it reaches about each of these.
        ridges: Its sharp edges and the axes of what is round, in the same frame.
    """

    slot: int
    parts: tuple[RigidPart, ...]
    points: np.ndarray
    radii: np.ndarray
    ridges: Ridges


def make_elements(
    particles: Sequence[SurfaceOfParticles],
    rigid: Sequence[SurfaceOfRigid],
    touch: np.ndarray,
    friction: np.ndarray,
    device: str,
) -> Elements:
    """Return the tables.

    Args:
        particles: Cloths and soft bodies; their particles are numbered one body after the other.
        rigid: Rigid bodies.
        touch: (bodies, bodies) bool, whether two bodies touch; rigid ones come last.
        friction: (worlds, bodies, bodies) float.
        device: Where the tables live.
    """
    worlds, bodies = friction.shape[0], len(particles) + len(rigid)
    vertex, vertex_body, triangle, triangle_body, edge, edge_body, owner = [], [], [], [], [], [], []
    first, edges_before = 0, 0
    near: list[np.ndarray] = []
    for body, surface in enumerate(particles):
        used = np.unique(surface.faces)
        vertex.append(used + first)
        vertex_body.append(np.full(len(used), body))
        triangle.append(surface.faces + first)
        triangle_body.append(np.full(len(surface.faces), body))
        found, entry = _edges(surface.faces)
        edge.append(found + first)
        edge_body.append(np.full(len(found), body))
        owner.append(np.where(entry >= 0, entry + edges_before, -1))
        if surface.joined is not None:
            near.append(surface.joined + first)
        first += surface.particles
        edges_before += len(found)
    parts = [(surface.slot, len(particles) + k, part) for k, surface in enumerate(rigid) for part in surface.parts]
    points = [
        (surface.slot, len(particles) + k, surface.points) for k, surface in enumerate(rigid) if len(surface.points)
    ]

    def joined(arrays: list[np.ndarray], columns: int = 1) -> np.ndarray:
        empty = np.zeros((0, columns)) if columns > 1 else np.zeros(0)
        return np.concatenate(arrays) if arrays else empty

    def put(values: Any, dtype: Any) -> wp.array:
        kind = np.int32 if dtype in (int, wp.vec2i, wp.vec3i) else np.uint64 if dtype is wp.uint64 else np.float32
        return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)

    made = Elements()
    made.bodies = bodies
    made.vertex, made.vertex_body = put(joined(vertex), int), put(joined(vertex_body), int)
    made.triangle, made.triangle_body = put(joined(triangle, 3), wp.vec3i), put(joined(triangle_body), int)
    made.triangle_edges = put(joined(owner, 3), wp.vec3i)
    made.edge, made.edge_body = put(joined(edge, 2), wp.vec2i), put(joined(edge_body), int)
    made.part_slot, made.part_body = put([p[0] for p in parts], int), put([p[1] for p in parts], int)
    made.part_kind = put([p[2].kind for p in parts], int)
    made.part_size = put(np.reshape([p[2].size for p in parts], (-1, 3)), wp.vec3)
    made.part_place = put(np.reshape([p[2].place for p in parts], (-1, 3)), wp.vec3)
    turns = np.reshape([p[2].turn for p in parts], (-1, 4))[:, [1, 2, 3, 0]]
    made.part_rotation = put(turns, wp.quat)
    made.part_radius = put([p[2].radius for p in parts], float)
    made.part_mesh = put([0 if p[2].mesh is None else p[2].mesh.id for p in parts], wp.uint64)
    made.point = put(joined([p[2] for p in points], 3), wp.vec3)
    made.point_radius = put(joined([surface.radii for surface in rigid]), float)
    made.point_slot = put(joined([np.full(len(p[2]), p[0]) for p in points]), int)
    made.point_body = put(joined([np.full(len(p[2]), p[1]) for p in points]), int)
    _put_ridges(made, rigid, len(particles), put)
    made.vertices, made.triangles, made.edges = made.vertex.shape[0], made.triangle.shape[0], made.edge.shape[0]
    made.parts, made.points = made.part_slot.shape[0], made.point.shape[0]
    made.touch = put(touch.astype(int).ravel(), int)
    made.friction = put(friction.ravel(), float)
    radius, compliance = np.zeros((worlds, bodies)), np.zeros((worlds, bodies))
    for body, surface in enumerate(particles):
        radius[:, body], compliance[:, body] = surface.radius, surface.compliance
    made.radius, made.compliance = put(radius.ravel(), float), put(compliance.ravel(), float)
    pairs = joined(near, 2).astype(int)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    made.near_start = put(np.searchsorted(pairs[:, 0], np.arange(first + 1)), int)
    made.near = put(pairs[:, 1] if len(pairs) else [0], int)
    made.island = wp.zeros(worlds * bodies, dtype=int, device=device)
    made.reach = wp.zeros(worlds * bodies, dtype=float, device=device)
    made.far = wp.zeros(worlds * bodies, dtype=float, device=device)
    made.solid = put([*(surface.solid for surface in particles), *(False for _ in rigid)], int)
    made.low = wp.zeros(worlds * made.triangles, dtype=wp.vec3, device=device)
    made.high = wp.zeros(worlds * made.triangles, dtype=wp.vec3, device=device)
    return made


def _put_ridges(
    made: Elements, rigid: Sequence[SurfaceOfRigid], before: int, put: Callable[[Any, Any], wp.array]
) -> None:
    """Set the tables of sharp edges; ``before`` bodies are not rigid."""
    lines = Ridges.joined([surface.ridges for surface in rigid]) if rigid else None
    for name in ("start", "end", "left", "right"):
        setattr(made, f"ridge_{name}", put(np.zeros((0, 3)) if lines is None else getattr(lines, name), wp.vec3))
    for name in ("radius", "depth"):
        setattr(made, f"ridge_{name}", put(np.zeros(0) if lines is None else getattr(lines, name), float))
    counts = [len(surface.ridges.radius) for surface in rigid]
    made.ridges = sum(counts)
    made.ridge_slot = put(np.repeat([surface.slot for surface in rigid], counts), int)
    made.ridge_body = put(np.repeat(before + np.arange(len(rigid)), counts), int)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (e, 2), and which of them (m, 3) are listed with each face: those that no face before it has, else -1."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    edges, firsts = np.unique(sides, axis=0, return_index=True)
    entry = np.full(len(sides), -1)
    entry[firsts] = np.arange(len(edges))
    return edges, entry.reshape(-1, 3)


def joined_particles(tets: np.ndarray) -> np.ndarray:
    """Return (k, 2) int, particles of tetrahedra (m, 4) that at most two edges part, in both orders, and each itself.

    Between these a mesh does not fold: where they come near, the material between them is pressed together.
    """
    ends = np.array([[a, b] for a in range(4) for b in range(4) if a != b]).T
    edges = np.unique(np.stack([tets[:, ends[0]].ravel(), tets[:, ends[1]].ravel()], axis=1), axis=0)
    n = int(tets.max()) + 1
    starts = np.searchsorted(edges[:, 0], np.arange(n + 1))
    count = np.diff(starts)[edges[:, 1]]
    # the neighbours of each edge's second end
    rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    second = edges[np.repeat(starts[edges[:, 1]], count) + rank, 1]
    pairs = np.stack([np.repeat(edges[:, 0], count), second], axis=1)
    return np.unique(np.concatenate([edges, pairs]), axis=0)
