"""A cloth's elements: what stretches, shears and bends, and the blocks that self-contact looks through.

Everything here depends on the rest shape alone; materials come in as compliances when a solver is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, MeshError
from nuno.scene.colouring import by_colour, colour


@dataclass(frozen=True, eq=False)
class Elements:
    """One kind of constraint, sorted by colour.

    Attributes:
        vertices: (m, k) int32, vertex indices.
        scale: (m,) float32, the geometric part of the compliance: alpha = scale / stiffness.
        axis: (m,) int32, which stiffness applies: 0 warp, 1 weft, 2 the geometric mean of both.
        faces: (m, f) int32, the cells or faces whose stiffness is averaged where it is given per element.
        offsets: (colours + 1,) int32, where each colour starts.
        extra: Further columns by name.
    """

    vertices: np.ndarray
    scale: np.ndarray
    axis: np.ndarray
    faces: np.ndarray
    offsets: np.ndarray
    extra: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.vertices)


def _elements(vertices: np.ndarray, scale: Any, axis: Any, faces: np.ndarray, colours: np.ndarray, **extra: np.ndarray) -> Elements:
    count = len(vertices)
    order, offsets = by_colour(colours)
    return Elements(
        np.ascontiguousarray(vertices[order], dtype=np.int32),
        np.broadcast_to(np.asarray(scale, dtype=np.float32), (count,))[order],
        np.broadcast_to(np.asarray(axis, dtype=np.int32), (count,))[order],
        np.asarray(faces, dtype=np.int32)[order],
        offsets,
        {name: np.asarray(column)[order] for name, column in extra.items()},
    )


def _none(width: int, **extra: tuple[int, ...]) -> Elements:
    columns = {name: np.zeros((0, *shape)) for name, shape in extra.items()}
    return _elements(np.zeros((0, width), int), 0.0, 0, np.zeros((0, 1)), np.zeros(0, int), **columns)


@dataclass(frozen=True, eq=False)
class Blocks:
    """Elements grouped by small blocks of neighbouring vertices, for the broad phase of self-contact.

    Each face and edge belongs to the block of its lowest vertex in block order. Vertices nearer than ``ring`` [m] at
    rest are neighbours; elements with neighbouring vertices but none in common are listed beforehand, vertices with
    triangles (m, 4) and edges with edges (m, 4).
    """

    vertex: np.ndarray
    vertex_start: np.ndarray
    face: np.ndarray
    face_start: np.ndarray
    face_reach: np.ndarray
    edge: np.ndarray
    edge_start: np.ndarray
    edge_reach: np.ndarray
    ring: float
    ring_triangle: np.ndarray
    ring_edge: np.ndarray

    @property
    def contact_reach(self) -> float:
        """How far apart [m] the nearest vertices of two touching elements can be, both stretched by 10 %."""
        return max(2.0 * float(self.edge_reach.max()), float(self.face_reach.max()))

    @property
    def count(self) -> int:
        """Number of blocks."""
        return len(self.vertex_start) - 1


def make_blocks(rest: np.ndarray, faces: np.ndarray, edges: np.ndarray, size: int = 4) -> Blocks:
    """Halve the rest shape again and again along its axes until at most ``size`` vertices are left in a block."""
    count = len(rest)
    levels = max(0, int(np.ceil(np.log2(max(1.0, count / size)))))
    group = np.zeros(count, dtype=np.int64)
    extent = np.ptp(rest, axis=0)
    axes = np.argsort(-extent)[:2]
    span = extent[axes].astype(float)
    for _ in range(levels):
        k = int(np.argmax(span))
        order = np.lexsort((rest[:, axes[k]], group))
        start = np.searchsorted(group[order], np.arange(group.max() + 2))
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count) - start[group[order]]
        half = (np.diff(start) + 1) // 2
        group = 2 * group + (rank >= half[group])
        group = np.unique(group, return_inverse=True)[1]
        span[k] /= 2
    order = np.argsort(group, kind="stable")
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    blocks = int(group.max()) + 1

    def sort(elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        owner = group[elements[np.arange(len(elements)), np.argmin(place[elements], axis=1)]]
        by_owner = np.argsort(owner, kind="stable")
        return elements[by_owner], np.searchsorted(owner[by_owner], np.arange(blocks + 1))

    face, face_start = sort(faces)
    edge, edge_start = sort(edges)
    corners = rest[face]
    # 10 % more than at rest: what a stretched element may reach
    face_reach = 1.1 * np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    edge_reach = 0.55 * np.linalg.norm(rest[edge[:, 0]] - rest[edge[:, 1]], axis=1)
    vertex_start = np.searchsorted(group[order], np.arange(blocks + 1))
    ring = 1.2 * max(float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()), 1e-9)
    return Blocks(
        order, vertex_start, face, face_start, face_reach, edge, edge_start, edge_reach, ring,
        *_ring_pairs(rest, faces, edges, ring),
    )  # fmt: skip


def _ring_pairs(rest: np.ndarray, faces: np.ndarray, edges: np.ndarray, ring: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertex-triangle and edge-edge pairs that share no vertex but have vertices within ``ring`` of each other."""
    from scipy.spatial import cKDTree

    near = cKDTree(rest).query_pairs(ring * (1 - 1e-9), output_type="ndarray")
    near = np.concatenate([near, near[:, ::-1], np.repeat(np.arange(len(rest))[:, None], 2, axis=1)])
    near = near[np.argsort(near[:, 0], kind="stable")]
    start = np.searchsorted(near[:, 0], np.arange(len(rest) + 1))

    def incident(elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        order = np.argsort(elements.ravel(), kind="stable")
        return order // elements.shape[1], np.searchsorted(elements.ravel()[order], np.arange(len(rest) + 1))

    def expand(left: np.ndarray, right: np.ndarray, items: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Pairs (left[k], item) for every item of vertex right[k]."""
        counts = starts[right + 1] - starts[right]
        rows = np.repeat(np.arange(len(right)), counts)
        offset = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.stack([left[rows], items[starts[right[rows]] + offset]], axis=1)

    def unique(pairs: np.ndarray) -> np.ndarray:
        width = int(pairs.max(initial=0)) + 1
        key = np.unique(pairs[:, 0].astype(np.int64) * width + pairs[:, 1])
        return np.stack([key // width, key % width], axis=1)

    pairs = unique(expand(near[:, 0], near[:, 1], *incident(faces)))
    pairs = pairs[~(faces[pairs[:, 1]] == pairs[:, :1]).any(axis=1)]
    triangle = np.concatenate([pairs[:, :1], faces[pairs[:, 1]]], axis=1)
    items, starts = incident(edges)
    left = expand(np.arange(len(edges)).repeat(2), edges.ravel(), near[:, 1], start)
    pairs = unique(expand(left[:, 0], left[:, 1], items, starts))
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    shared = (edges[pairs[:, 0]][:, :, None] == edges[pairs[:, 1]][:, None]).any(axis=(1, 2))
    pairs = pairs[~shared]
    return triangle.astype(np.int32), np.concatenate([edges[pairs[:, 0]], edges[pairs[:, 1]]], axis=1).astype(np.int32)


@dataclass(frozen=True, eq=False)
class ClothTopology:
    """Everything about a cloth that does not depend on its material or state.

    Attributes:
        rest: (n, 3) float64, rest shape [m].
        faces: (m, 3) int32, triangles.
        area: (n,) float64, the rest area of each vertex [m2].
        element_count: Cells of a sheet, or faces of a mesh: what a material per element counts.
        cell_size: Smallest edge of the rest shape along warp or weft [m].
        extent: Longest straight line in the rest shape [m].
    """

    rest: np.ndarray
    faces: np.ndarray
    area: np.ndarray
    element_count: int
    cell_size: float
    extent: float
    edges: Elements
    cells: Elements
    triangles: Elements
    lines: Elements
    hinges: Elements
    blocks: Blocks
    device_arrays: dict[str, Any] = field(default_factory=dict, repr=False)

    @cached_property
    def altitude(self) -> float:
        """The smallest altitude of a triangle at rest [m]."""
        x = self.rest[self.faces]
        double = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
        longest = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        return float((double / longest).min())

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return len(self.rest)

    @classmethod
    def sheet(cls, cells: tuple[int, int], size: tuple[float, float]) -> ClothTopology:
        """A rectangle of ``cells`` (nx, ny) over ``size`` (x, y) [m]; vertex index j (nx + 1) + i.

        Stretch runs along grid lines (which is the constant-strain triangle for an orthotropic cloth without
        Poisson effect), shear per cell, bending along grid lines and as twist of cells.
        """
        nx, ny = (int(c) for c in cells)
        if nx < 1 or ny < 1 or min(size) <= 0:
            raise InvalidInputError(f"a sheet needs at least one cell a side and a size, got {cells} over {size}")
        dx, dy = size[0] / nx, size[1] / ny
        i, j = np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="xy")
        index = j * (nx + 1) + i
        rest = np.stack([i * dx - size[0] / 2, j * dy - size[1] / 2, 0.0 * i], axis=-1).reshape(-1, 3)
        a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
        corners = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
        faces = np.stack([corners[:, [0, 1, 3]], corners[:, [0, 3, 2]]], axis=1).reshape(-1, 3).astype(np.int32)
        rim_x = np.where((i == 0) | (i == nx), 0.5, 1.0)
        rim_y = np.where((j == 0) | (j == ny), 0.5, 1.0)
        area = (rim_x * rim_y * dx * dy).ravel()

        def cell(p: np.ndarray, q: np.ndarray) -> np.ndarray:
            return np.clip(q, 0, ny - 1) * nx + np.clip(p, 0, nx - 1)

        def flat(*parts: np.ndarray) -> np.ndarray:
            return np.stack([part.ravel() for part in parts], axis=1)

        iu, ju = i[:, :-1], j[:, :-1]
        iv, jv = i[:-1], j[:-1]
        edges = _elements(
            np.concatenate([flat(index[:, :-1], index[:, 1:]), flat(index[:-1], index[1:])]),
            np.concatenate([(dx / (dy * rim_y[:, :-1])).ravel(), (dy / (dx * rim_x[:-1])).ravel()]),
            np.repeat([0, 1], [iu.size, iv.size]),
            np.concatenate([flat(cell(iu, ju - 1), cell(iu, ju)), flat(cell(iv - 1, jv), cell(iv, jv))]),
            np.concatenate([(iu % 2).ravel(), (2 + jv % 2).ravel()]),
            rest=np.repeat([dx, dy], [iu.size, iv.size]),
        )
        ic, jc = i[:-1, :-1], j[:-1, :-1]
        own = cell(ic, jc).reshape(-1, 1)
        parity = (ic % 2 + 2 * (jc % 2)).ravel()
        cells_ = _elements(corners, 1.0 / (dx * dy), 0, own, parity, quarter=np.full(len(corners), 0.25 / (dx * dy)))
        il, jl = i[:, 1:-1], j[:, 1:-1]
        im, jm = i[1:-1], j[1:-1]
        around = [
            np.stack([cell(p - 1, q - 1), cell(p, q - 1), cell(p - 1, q), cell(p, q)], axis=-1).reshape(-1, 4)
            for p, q in ((il, jl), (im, jm))
        ]
        lines = _elements(
            np.concatenate(
                [flat(index[:, :-2], index[:, 1:-1], index[:, 2:]), flat(index[:-2], index[1:-1], index[2:])]
            ),
            np.concatenate([(dx**3 / (dy * rim_y[:, 1:-1])).ravel(), (dy**3 / (dx * rim_x[1:-1])).ravel()]),
            np.repeat([0, 1], [il.size, im.size]),
            np.concatenate(around),
            np.concatenate([(il % 3).ravel(), (3 + jm % 3).ravel()]),
        )
        twist = np.broadcast_to([1.0, -1.0, -1.0, 1.0], (len(corners), 4))
        hinges = _elements(
            corners, dx * dy / 2, 2, own, parity, weight=twist, rest=np.zeros(len(corners))
        )  # fmt: skip
        seams = edges.vertices
        return cls(
            rest, faces, area, nx * ny, min(dx, dy), float(np.hypot(*size)), edges, cells_,
            _none(3, u=(3,), v=(3,), area=()), lines, hinges, make_blocks(rest, faces, seams),
        )  # fmt: skip

    @classmethod
    def mesh(cls, rest: ArrayLike, faces: ArrayLike) -> ClothTopology:
        """A triangle mesh with a rest shape: an (n, 2) pattern (x is warp) or an (n, 3) surface.

        In an (n, 3) rest shape the warp of each triangle is the direction nearest to x.

        Raises:
            MeshError: a triangle without area, an edge of three faces, an unused vertex.
        """
        shape = np.asarray(rest, dtype=float)
        faces = np.ascontiguousarray(faces, dtype=np.int32)
        count = len(shape)
        rest3 = np.concatenate([shape, np.zeros((count, 3 - shape.shape[1]))], axis=1)
        x = rest3[faces]
        e1, e2 = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        normal = np.cross(e1, e2)
        double = np.linalg.norm(normal, axis=1)
        longest = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        bad = np.nonzero(double <= 1e-6 * longest**2)[0]
        if len(bad):
            raise MeshError(
                f"{len(bad)} triangles have no area (the first is face {bad[0]}); trimesh's "
                "mesh.update_faces(mesh.nondegenerate_faces()) takes them out"
            )
        unused = np.setdiff1d(np.arange(count), faces)
        if len(unused):
            raise MeshError(
                f"{len(unused)} vertices belong to no face (the first is {unused[0]}); trimesh's "
                "mesh.remove_unreferenced_vertices() takes them out"
            )
        normal /= double[:, None]
        warp = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        warp = warp - (warp * normal).sum(axis=1, keepdims=True) * normal
        warp /= np.linalg.norm(warp, axis=1, keepdims=True)
        weft = np.cross(normal, warp)
        flat = np.stack([np.stack([(e * d).sum(1) for e in (e1, e2)], -1) for d in (warp, weft)], axis=1)
        inverse = np.linalg.inv(flat)  # columns e1, e2 in (warp, weft); F k = [x1 - x0, x2 - x0] inverse[:, k]
        weights = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        area = np.zeros(count)
        np.add.at(area, faces.ravel(), np.repeat(double / 6, 3))
        own = np.arange(len(faces))[:, None]
        triangles = _elements(
            faces, 2.0 / double, 0, own, colour(faces, count), u=weights[:, :, 0], v=weights[:, :, 1], area=double / 2
        )
        edges, hinges = _mesh_hinges(rest3, faces, double / 2)
        lengths = np.linalg.norm(rest3[edges[:, 0]] - rest3[edges[:, 1]], axis=1)
        extent = float(np.linalg.norm(np.ptp(rest3, axis=0)))
        return cls(
            rest3, faces, area, len(faces), float(lengths.min()), extent, _none(2, rest=()), _none(4, quarter=()),
            triangles, _none(3), hinges, make_blocks(rest3, faces, edges),
        )  # fmt: skip


def _mesh_hinges(rest: np.ndarray, faces: np.ndarray, areas: np.ndarray) -> tuple[np.ndarray, Elements]:
    """All edges (e, 2), and a hinge (a, b, c, d) for each inner edge (a, b) between the corners c and d."""
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    opposite = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    face = np.tile(np.arange(len(faces)), 3)
    key = np.sort(half, axis=1)
    edges, inverse, counts = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    if counts.max() > 2:
        worst = edges[counts.argmax()]
        raise MeshError(
            f"edge {worst[0]}-{worst[1]} belongs to {counts.max()} faces; a cloth's edges have one or two. Split "
            "the mesh there (trimesh.graph.connected_components over face_adjacency finds the sheets)"
        )
    order = np.argsort(inverse.ravel(), kind="stable")
    first = np.searchsorted(inverse.ravel()[order], np.nonzero(counts == 2)[0])
    p, q = order[first], order[first + 1]
    hinge = np.stack([half[p, 0], half[p, 1], opposite[p], opposite[q]], axis=1)
    a, b, c, d = (rest[hinge[:, k]] for k in range(4))

    def cot(v: np.ndarray, w: np.ndarray) -> np.ndarray:
        return (v * w).sum(axis=1) / np.maximum(np.linalg.norm(np.cross(v, w), axis=1), 1e-12)

    cab, cba = cot(b - a, c - a), cot(a - b, c - b)
    dab, dba = cot(b - a, d - a), cot(a - b, d - b)
    weight = np.stack([cba + dba, cab + dab, -(cab + cba), -(dab + dba)], axis=1)
    total = areas[face[p]] + areas[face[q]]
    curve = np.einsum("hk,hkc->hc", weight, rest[hinge])
    # the kernel's normal is edge (a, b) x (d - c); the sign of the rest curvature follows it
    up = np.cross(b - a, d - c)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
    resting = (curve * up).sum(axis=1)
    resting[np.abs(resting) < 1e-6 * np.linalg.norm(b - a, axis=1)] = 0.0
    faces_of = np.stack([face[p], face[q]], axis=1)
    hinges = _elements(hinge, total, 2, faces_of, colour(hinge, len(rest)), weight=weight, rest=resting)
    return edges.astype(np.int32), hinges
