"""A cloth's elements: what stretches, shears and bends.

Everything here depends on the rest shape alone; materials come in as compliances when a solver is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.topology.cloth_mesh_checks import check_areas
from nuno.topology.colouring import by_colour, colour
from nuno.topology.leaves import Leaves, make_leaves
from nuno.topology.patches import bend_rate, curvature_weights, neighbours


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

    def column(self, name: str) -> np.ndarray:
        """Return the column of a name: ``scale``, or one of ``extra``."""
        return self.scale if name == "scale" else self.extra[name]


@dataclass(frozen=True)
class ElementKind:
    """A kind of constraint, as the tables of kernels have it.

    They have its vertices under ``name``, its columns as ``name_column``, where each colour starts as ``name_colour``,
    and which compliance each element takes as ``name_compliance``.

    Attributes:
        name: As above.
        elements: The attribute of `ClothTopology` that has them.
        corners: Vertices of an element.
        columns: By name, the column of `Elements` and how many numbers it has for an element.
        compliance: The state's table of compliances: "shear" or "bend", which have room for more kinds; "stretch" is
            that of edges and triangles.
        stiffness: The material's numbers of which these are the inverse. Where there are two, along warp and weft,
            `Elements.axis` says which of them or of their geometric mean an element takes.
        value: The constraint's C in NumPy, of its elements and positions (worlds, n, 3) [m]: (worlds, elements, parts)
            of so many scalars or, with a last axis, vectors; their energies are C^2 / (2 scale compliance). None where
            `nuno.bodies.cloth_measures` has the energy itself.
        plain: Whether every plan solves it colour by colour by `nuno.plans.cloth_elastic.solve_plain`, and before the
            others, for which some have methods of their own.
    """

    name: str
    elements: str
    corners: int
    columns: dict[str, tuple[str, int]]
    compliance: str
    stiffness: tuple[str, ...]
    value: Callable[[Elements, np.ndarray], np.ndarray] | None = None
    plain: bool = True


def _cell_shear(cells: Elements, x: np.ndarray) -> np.ndarray:
    """C = F_u . F_v = (|d - a|^2 - |b - c|^2) / (4 area) of a cell of corners a, b, c, d."""
    a, b, c, d = (x[:, corner] for corner in cells.vertices.T)
    diagonals = ((d - a) ** 2).sum(axis=-1) - ((b - c) ** 2).sum(axis=-1)
    return (diagonals * cells.extra["quarter"])[..., None]


def _line_bend(lines: Elements, x: np.ndarray) -> np.ndarray:
    """C = x_0 - 2 x_1 + x_2."""
    return np.einsum("wmcx,c->wmx", x[:, lines.vertices], (1.0, -2.0, 1.0))[:, :, None]


def _cell_twist(twists: Elements, x: np.ndarray) -> np.ndarray:
    """C = x_0 - x_1 - x_2 + x_3."""
    return np.einsum("wmcx,c->wmx", x[:, twists.vertices], (1.0, -1.0, -1.0, 1.0))[:, :, None]


def _patch_bend(patches: Elements, x: np.ndarray) -> np.ndarray:
    """Three C = sum k_i x_i - rest; ``rest`` turns with the triangle, a sum of its two sides and its normal."""
    corners = x[:, patches.vertices]
    side, fold = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
    normal = np.cross(side, fold)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-10)
    at_rest = np.einsum("mjk,wmkx->wmjx", patches.extra["rest"], np.stack([side, fold, normal], axis=2))
    return np.einsum("mjc,wmcx->wmjx", patches.extra["weight"], corners) - at_rest


SHEAR, RIGIDITY = ("shear_stiffness",), ("bending_rigidity_warp", "bending_rigidity_weft")
STIFFNESS = ("stretch_stiffness_warp", "stretch_stiffness_weft")
ELEMENT_KINDS = (
    ElementKind("cell", "cells", 4, {"scale": ("quarter", 1)}, "shear", SHEAR, _cell_shear, plain=False),
    ElementKind(
        "triangle", "triangles", 3, {"u": ("u", 3), "v": ("v", 3), "area": ("area", 1)}, "stretch", STIFFNESS + SHEAR,
        plain=False,
    ),
    ElementKind("line", "lines", 3, {"scale": ("scale", 1)}, "bend", RIGIDITY, _line_bend, plain=False),
    ElementKind("twist", "twists", 4, {"scale": ("scale", 1)}, "bend", RIGIDITY, _cell_twist, plain=False),
    # three rows of six weights and three rest vectors of three numbers each
    ElementKind(
        "patch", "patches", 6, {"weight": ("weight", 18), "rest": ("rest", 9), "curved": ("curved", 1)}, "bend",
        RIGIDITY, _patch_bend,
    ),
)  # fmt: skip
"""All but the edges, which are solved by grid lines. docs/extending.md shows what a new kind needs: its elements and a
row here, a file in `nuno.constraints`, and its place in `nuno.plans.cloth_elastic`."""
PLAIN_KINDS = tuple(kind for kind in ELEMENT_KINDS if kind.plain)


def _elements(
    vertices: np.ndarray, scale: Any, axis: Any, faces: np.ndarray, colours: np.ndarray, **extra: np.ndarray
) -> Elements:
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
class ClothTopology:
    """Everything about a cloth that does not depend on its material or state.

    Attributes:
        rest: (n, 3) float64, rest shape [m].
        faces: (m, 3) int32, triangles.
        area: (n,) float64, the rest area of each vertex [m2].
        element_count: Cells of a sheet, or faces of a mesh: what a material per element counts.
        cell_size: Smallest edge of the rest shape along warp or weft [m].
        extent: Longest straight line in the rest shape [m].
        bend_rate: Of a mesh [1/m4]: times rigidity and dt^2 over density, how much of a patch's bending one substep
            could take away; the median by area of the stiffest way in which each bends.
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
    twists: Elements
    patches: Elements
    leaves: Leaves
    bend_rate: float = 0.0
    device_arrays: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return len(self.rest)

    @cached_property
    def guarded_leaves(self) -> Leaves:
        """`leaves` in which a sheet's diagonals collide with all edges: see `nuno.world.impacts`."""
        if not len(self.cells):
            return self.leaves
        edges = np.concatenate([self.edges.vertices, self.cells.vertices[:, [0, 3]]])
        return make_leaves(self.rest, self.faces, edges, np.zeros((0, 4), int), columns=self.leaves.columns)

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
        twists = _elements(corners, dx * dy / 2, 2, own, parity)
        return cls(
            rest, faces, area, nx * ny, min(dx, dy), float(np.hypot(*size)), edges, cells_,
            _none(3, u=(3,), v=(3,), area=()), lines, twists, _none(6, weight=(3, 6), rest=(3, 3), curved=()),
            make_leaves(rest, faces, edges.vertices, _creases(index), columns=nx + 1),
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
        check_areas(rest3, faces)
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
        edges, across = neighbours(faces)
        corners, weight, bent, curved = curvature_weights(rest3, faces, across, area)
        patches = _elements(
            corners, 1.0, 2, own, colour(corners, count), weight=weight, rest=bent, curved=curved.astype(float)
        )  # fmt: skip
        lengths = np.linalg.norm(rest3[edges[:, 0]] - rest3[edges[:, 1]], axis=1)
        extent = float(np.linalg.norm(np.ptp(rest3, axis=0)))
        return cls(
            rest3, faces, area, len(faces), float(lengths.min()), extent, _none(2, rest=()), _none(4, quarter=()),
            triangles, _none(3), _none(4), patches, make_leaves(rest3, faces, edges, np.zeros((0, 4), int)),
            bend_rate(corners, weight, area, double),
        )  # fmt: skip


def _creases(index: np.ndarray) -> np.ndarray:
    """Pairs of edges (c, 4) that only a crease through a cell brings together: diagonals with what is next to them.

    A sheet's diagonals are left out of the edges that collide, for layers meet along grid lines just as well. Where
    the cloth is creased sharply at one of the two corners off the diagonal, though, the diagonal can go through the
    cells around that corner while no vertex does.

    Args:
        index: (ny + 1, nx + 1) int, the vertices of the grid.
    """
    ny, nx = index.shape[0] - 1, index.shape[1] - 1
    padded = np.pad(index, 1, constant_values=-1)
    j, i = np.meshgrid(np.arange(ny), np.arange(nx), indexing="ij")
    at = lambda p, q: padded[q + 1, p + 1]  # noqa: E731
    diagonal = np.stack([at(i, j), at(i + 1, j + 1)], axis=-1)
    # the two seams that leave each off corner (p, q), and the diagonals of the other cells around it
    others = []
    for p, q, (a, b) in ((i + 1, j, (1, -1)), (i, j + 1, (-1, 1))):
        others.append((at(p, q), at(p + a, q)))
        others.append((at(p, q), at(p, q + b)))
        others.extend((at(p + c, q + d), at(p + c + 1, q + d + 1)) for c, d in ((0, 0), (-1, -1), (a // 2, b // 2)))
    first = np.tile(diagonal[None], (len(others), 1, 1, 1)).reshape(-1, 2)
    second = np.stack([np.stack(pair, axis=-1) for pair in others]).reshape(-1, 2)
    shared = (first[:, :, None] == second[:, None, :]).any(axis=(1, 2))
    keep = ~shared & (second >= 0).all(axis=1)
    pairs = np.sort(np.stack([first[keep], second[keep]], axis=1), axis=2)
    swap = pairs[:, 0, 0] > pairs[:, 1, 0]
    pairs[swap] = pairs[swap, ::-1]
    return np.unique(pairs.reshape(-1, 4), axis=0)
