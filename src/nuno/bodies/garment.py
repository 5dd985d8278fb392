"""Garments: cloth of two panels that are sewn to each other, or of one, made from patterns with measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body, BodyOptions
from nuno.errors import InvalidInputError, MeshError, UnknownNameError
from nuno.mesh.garment_patterns import PATTERNS
from nuno.mesh.sewn import BACK, BOTH, FRONT, Sewn, sew
from nuno.mesh.triangulated import quality
from nuno.shapes.shape import ClothMesh, length
from nuno.validation import checked, finite_array, number

LAYER_NAMES = ("front", "back", "both")
"""Names of layers: the front, the back, and seams, which are on both."""
CELL = 0.02
"""[m] About how long a triangle's side is."""
GAP = 0.005
"""[m] Between the layers of a garment that lies flat: more than the thickness of most cloths."""
MAX_VERTICES = 200_000
"""Of a garment: more would take minutes to make."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment that lies flat, its front up, around the origin.

    Attributes:
        name: What it is, such as "t-shirt".
        measures: By name, what it was made with [m], an angle ``slope`` [rad] among them.
        cell: About how long a triangle's side is [m].
        vertices: (n, 3) float [m], the layers a small gap apart.
        rest: (n, 3) float [m], the shape in which nothing is stretched: both layers in one plane.
        faces: (m, 3) int.
        layer: (n,) int, 0 of the front, 1 of the back, 2 of a seam, which is on both.
        face_layer: (m,) int, 0 or 1.
        mirror: (n,) int, the vertex on the other side of the garment's middle line, or None where it has none.
        swap: (n,) int, the vertex at the same place in the other layer, or None where the layers differ in shape.
    """

    name: str
    measures: dict[str, float]
    cell: float
    vertices: np.ndarray
    rest: np.ndarray
    faces: np.ndarray
    layer: np.ndarray
    face_layer: np.ndarray
    mirror: np.ndarray | None
    swap: np.ndarray | None

    def __repr__(self) -> str:
        kind = "two layers" if self.layers == 2 else "one layer"
        return f"<Garment: {self.name}, {kind}, {len(self.vertices)} vertices, {self.area:.2f} m2>"

    @property
    def layers(self) -> int:
        """1 or 2."""
        return 1 + int((self.face_layer == BACK).any())

    @cached_property
    def area(self) -> float:
        """Of the cloth, of both layers together [m2]."""
        a, b, c = (self.rest[self.faces[:, k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @cached_property
    def quality(self) -> np.ndarray:
        """(m,) float, the mean ratio of each triangle, 1 where it is equilateral."""
        return quality(self.rest[:, :2], self.faces)

    @property
    def symmetries(self) -> list[np.ndarray]:
        """Return permutations (n,) int of the vertices that map the garment onto itself, the identity first.

        These are its reflection about its middle line, its front on its back where both are cut alike, and both.
        """
        same = np.arange(len(self.vertices))
        found = [same]
        if self.mirror is not None:
            found.append(self.mirror)
        if self.swap is not None:
            found += [self.swap[one] for one in list(found)]
        return found

    def distances(self, vertex: int | ArrayLike) -> np.ndarray:
        """Return how far vertices are on the cloth, along edges: (n,), or (k, n) from k vertices [m].

        Along edges a way is up to 15 % longer than straight on the cloth. From one layer to the other it leads over a
        seam.

        Args:
            vertex: The number of a vertex, or (k,) int.
        """
        from scipy.sparse.csgraph import dijkstra

        try:
            of = np.asarray(vertex)
        except ValueError:  # lists of different lengths
            raise InvalidInputError("vertex must be numbers of vertices, got lists of different lengths") from None
        if of.dtype.kind not in "iu" or of.ndim > 1 or of.size == 0 or of.min() < 0 or of.max() >= len(self.vertices):
            raise InvalidInputError(f"vertex must be numbers from 0 to {len(self.vertices) - 1}, got {vertex!r}")
        return np.asarray(dijkstra(self._graph, directed=False, indices=of))

    @cached_property
    def _graph(self) -> object:
        from scipy.sparse import coo_matrix

        f = self.faces
        pairs = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        pairs = np.unique(pairs, axis=0)
        lengths = np.linalg.norm(self.rest[pairs[:, 0]] - self.rest[pairs[:, 1]], axis=1)
        count = len(self.vertices)
        return coo_matrix((lengths, (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()

    def nearest(self, place: ArrayLike, layer: str | int = 0) -> int:
        """Return the number of the vertex that is nearest to a place in a layer.

        Args:
            place: (2,) x to the wearer's left and y up in the flat garment, from its middle [m].
            layer: "front", "back" or "both" (a seam), or its number.

        Raises:
            InvalidInputError: the garment has no such layer.
        """
        x = finite_array("place", place, (2,))
        which = LAYER_NAMES.index(layer) if isinstance(layer, str) and layer in LAYER_NAMES else layer
        if not isinstance(which, int | np.integer) or isinstance(which, bool) or which not in (FRONT, BACK, BOTH):
            raise InvalidInputError(f"layer must be one of {', '.join(LAYER_NAMES)} or 0, 1 or 2, got {layer!r}")
        own = self.layer == BOTH if which == BOTH else (self.layer == which) | (self.layer == BOTH)
        if which != FRONT and self.layers == 1:
            raise InvalidInputError(f"a {self.name} has one layer, 0, the front, got {layer!r}")
        away = np.where(own, np.linalg.norm(self.rest[:, :2] - x, axis=1), np.inf)
        return int(away.argmin())

    def body(self, **options: Unpack[BodyOptions]) -> Body:
        """Return it as a cloth that lies flat at the origin, its front up.

        Args:
            options: Those of ``Body``.

        Raises:
            InvalidInputError: an option of a wrong shape.
        """
        return Body(ClothMesh(self.vertices, self.faces, self.rest), **({"name": self.name} | options))  # type: ignore[arg-type]


@checked
def garment(name: str, *, cell: float = CELL, gap: float = GAP, **measures: float) -> Garment:
    """Make a garment from its pattern.

    There are "t-shirt", "pullover", "trousers", "skirt" and "sock", of two panels that are sewn along their seams and
    open at hems, cuffs, necks and waists; and "apron" and "towel" (with round corners), of one.

    Args:
        name: Which garment.
        cell: About how long a triangle's side is [m].
        gap: Between the two layers where it lies flat [m]; more than the cloth's thickness, so that they do not touch.
        measures: By name [m]: ``length`` and ``width`` of most; docs/garments.md lists all of them. One that is not
            given has its usual size.

    Raises:
        UnknownNameError: no such garment or measure; the message has those that there are.
        InvalidInputError: a measure that is not positive, or measures that make no outline.
    """
    if name not in PATTERNS:
        raise UnknownNameError("garment", name, list(PATTERNS))
    draw, usual = PATTERNS[name]
    for key, value in measures.items():
        if key not in usual:
            raise UnknownNameError(f"measure of a {name}", key, list(usual))
        length(key, value)
    edge, apart = length("cell", cell), number("gap", gap, low=0.0, high=1.0)
    sizes = usual | {key: float(value) for key, value in measures.items()}
    if sum(sizes.values()) ** 2 / edge**2 > MAX_VERTICES:
        raise InvalidInputError(f"cell is {edge:g} m: a {name} of this size would have too many triangles")
    try:
        sewn = sew(draw(sizes), edge)
    except (MeshError, ValueError, FloatingPointError) as error:
        described = ", ".join(f"{key}={value:g}" for key, value in sizes.items())
        raise InvalidInputError(f"{described} make no {name} with cells of {edge:g} m: {error}") from error
    middle = 0.5 * (sewn.points.min(axis=0) + sewn.points.max(axis=0))
    middle[0] = 0.0 if sewn.mirror is not None else middle[0]
    rest = np.pad(sewn.points - middle, ((0, 0), (0, 1)))
    vertices = rest.copy()
    if (sewn.face_layer == BACK).any():
        vertices[:, 2] = 0.5 * apart * np.array([1.0, -1.0, 0.0])[sewn.layer]
    return _made(name, sizes, edge, vertices, rest, sewn)


def _made(
    name: str, sizes: dict[str, float], edge: float, vertices: np.ndarray, rest: np.ndarray, sewn: Sewn
) -> Garment:
    for array in (vertices, rest, sewn.faces, sewn.layer, sewn.face_layer):
        array.setflags(write=False)
    return Garment(
        name, sizes, edge, vertices, rest, sewn.faces, sewn.layer, sewn.face_layer, sewn.mirror, sewn.swap
    )  # fmt: skip
