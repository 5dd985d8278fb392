"""Body-fitted lattices: voxels of five tetrahedra whose boundary is moved onto a closed mesh."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from nuno.errors import MeshError
from nuno.mesh.closed import enclosed_volume
from nuno.mesh.lattice import CLOSE, divided_box, triangles_of, whole_fraction
from nuno.mesh.nearest import NearestOn
from nuno.mesh.relaxed import relaxed
from nuno.mesh.surface_targets import surface_targets
from nuno.mesh.tetrahedra import FACES, Tetrahedra, boundary_faces, volumes, voxel_tetrahedra
from nuno.mesh.voxel_occupancy import inside_nodes
from nuno.validation import checked

FLAT = 0.35
"""Of its volume in the lattice: what a tetrahedron must keep that has all its corners on the surface."""
MAX_MISSING = 0.3
"""Of the mesh's volume, by which the tetrahedra's may differ: a sphere of 4 cells across loses 0.15, of 2 0.297."""
FARTHEST = 1.0
"""In cells: how far the mesh may be from the tetrahedra's boundary."""
LOOSE_PART = 0.01
"""Of the whole volume: what hangs on the rest by an edge or a vertex alone is left out below it."""
CANDIDATES = 24
"""Tetrahedra about a point that are looked at to embed it."""
AT_ONCE = 50_000
"""Points that are embedded at once, so that a drawn surface of millions fits the memory."""


class UnresolvedMeshError(MeshError):
    """The lattice is too coarse to be fitted to a mesh."""


@checked
def fitted_tetrahedra(
    vertices: np.ndarray, faces: np.ndarray, cell: float, skin: tuple[np.ndarray, np.ndarray] | None = None,
    mean: tuple[float, float, float] | None = None,
) -> Tetrahedra:  # fmt: skip
    """Fill a closed mesh with tetrahedra whose boundary follows it.

    The bounding box is divided as by `nuno.mesh.lattice.lattice_tetrahedra`. Of every edge of a tetrahedron that the
    surface crosses, the end that is nearer to the surface is moved onto it; tetrahedra with an end left inside and none
    outside stay. (The surface is what is snapped to, as in Labelle and Shewchuk 2007, but nothing is cut, so that no
    element is smaller than what is moved.) Then all vertices are relaxed towards the shapes that the tetrahedra had,
    those of the boundary on the surface.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int, closed, counterclockwise from outside.
        cell: Longest edge of a voxel [m].
        skin: Vertices (k, 3) [m] and faces of the surface that is drawn, on or in the mesh; None is the mesh.
        mean: What the mean of the tetrahedra's vertices shall be [m]: a round shape's centre, from which it is off by
            1e-3 of a cell, as the nearest of two faces that are equally near is either. Inner vertices are moved.

    Returns:
        The tetrahedra. All have the fraction by which the mesh's volume is that of theirs, above 1 where flat faces
        cut a round surface's volume, so that the body has the mesh's volume.

    Raises:
        MeshError: too many voxels, or the mesh overlaps itself.
        UnresolvedMeshError: the mesh has parts that the lattice is too coarse for.
    """
    vertices, faces = triangles_of("vertices", vertices, faces)
    skin = None if skin is None else triangles_of("skin", *skin)
    low, edges, cells = divided_box(vertices, cell)
    points = (vertices - low) / edges
    fraction = whole_fraction(points, faces, cells)
    surface = NearestOn(vertices[faces], float(edges.min()))
    nodes, tets, on_surface = _classified(points, faces, cells, low, edges, surface)
    targets = surface_targets(vertices, faces, surface, nodes, on_surface, float(edges.max()))
    moved = targets.place(nodes)
    tets = _kept(tets, nodes, moved, on_surface, fraction, low, edges)
    used, tets = _renamed(tets)
    found = relaxed(nodes[used], moved[used], tets, targets.of(used), float(edges.min()))
    if found is None:
        raise UnresolvedMeshError("some tetrahedra would be flat")
    if not len(found[1]):
        raise UnresolvedMeshError("all tetrahedra would be flat")
    used, tets = _renamed(found[1])
    placed, tets = found[0][used], tets.astype(np.int32)
    inner = np.setdiff1d(np.arange(len(placed)), boundary_faces(tets))
    if mean is not None and len(inner):
        placed[inner] -= (placed.mean(axis=0) - mean) * len(placed) / len(inner)
    volume = enclosed_volume(vertices, faces)
    share = volume / float(volumes(placed, tets).sum())
    _check(placed, tets, share, surface, float(edges.max()), vertices, faces)
    drawn = (vertices, faces) if skin is None else skin
    parts = np.array_split(drawn[0], -(-len(drawn[0]) // AT_ONCE))
    home, weights = (np.concatenate(a) for a in zip(*(_embedding(part, placed, tets) for part in parts), strict=True))
    return Tetrahedra(placed, tets, np.full(len(tets), share), np.array(drawn[1], dtype=np.int32), home, weights)


def _classified(
    points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int], low: np.ndarray, edges: np.ndarray,
    surface: NearestOn,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Return nodes (n, 3) [m], tetrahedra (m, 4) with no corner outside, and (n,) which nodes go to the surface."""
    inside = inside_nodes(points, faces, cells)
    # Only where the sign changes, or at the lattice's ends, a node can be at an edge that the surface crosses.
    padded = np.pad(inside, 1)
    band = (maximum_filter(padded, 3) & ~minimum_filter(padded, 3))[1:-1, 1:-1, 1:-1]
    some = inside[:-1, :-1, :-1].copy()
    for shift in range(1, 8):
        some |= inside[tuple(slice(1, None) if shift >> axis & 1 else slice(None, -1) for axis in range(3))]
    tets = voxel_tetrahedra(np.argwhere(some), cells)
    index = np.stack(np.meshgrid(*[np.arange(count + 1) for count in cells], indexing="ij"), axis=-1)
    # x fastest, as the tetrahedra name them
    nodes = low + index.transpose(2, 1, 0, 3).reshape(-1, 3) * edges
    within, near = inside.transpose(2, 1, 0).ravel(), np.flatnonzero(band.transpose(2, 1, 0).ravel())
    away = np.full(len(nodes), np.inf)
    # in steps of a millionth of a cell: nodes that are equally near are, whatever the last digit
    away[near] = np.round(np.linalg.norm(surface.nearest(nodes[near]) - nodes[near], axis=1) / edges.min() / CLOSE)
    on_surface = away <= 1.0
    cut = within[tets].any(axis=1) & ~within[tets].all(axis=1)
    pairs = np.concatenate([tets[cut][:, [i, j]] for i in range(4) for j in range(i)])
    pairs = pairs[(within[pairs[:, 0]] != within[pairs[:, 1]]) & ~on_surface[pairs].any(axis=1)]
    pairs = np.where(within[pairs[:, :1]], pairs, pairs[:, ::-1])  # the inner end first, so that mirror images agree
    on_surface[np.where(away[pairs[:, 0]] < away[pairs[:, 1]], pairs[:, 0], pairs[:, 1])] = True
    return nodes, tets[(within | on_surface)[tets].all(axis=1)], on_surface


def _kept(
    tets: np.ndarray, nodes: np.ndarray, moved: np.ndarray, on_surface: np.ndarray, fraction: np.ndarray,
    low: np.ndarray, edges: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the tetrahedra that stay: those with a corner inside, and others where the mesh is sharp or thin."""
    whole = on_surface[tets].all(axis=1)
    last = np.array(fraction.shape) - 1
    voxel = np.clip(np.floor((nodes[tets].mean(axis=1) - low) / edges).astype(int), 0, last)
    solid = (volumes(moved, tets) > FLAT * volumes(nodes, tets)) & (fraction[tuple(voxel.T)] > 0.5)
    tets = tets[~whole | solid]
    if not len(tets):
        raise UnresolvedMeshError("no voxel is filled")
    part = _parts(tets)
    size = np.bincount(part, np.abs(volumes(nodes, tets)))
    return tets[size[part] > LOOSE_PART * size.sum()]


def _renamed(tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices that tetrahedra have (k,), and the tetrahedra (m, 4) in terms of these."""
    used, renamed = np.unique(tets, return_inverse=True)
    return used, renamed.reshape(-1, 4)


def _parts(tets: np.ndarray) -> np.ndarray:
    """Return (m,) int, which of the pieces that hang together by faces each tetrahedron belongs to."""
    _, face = np.unique(np.sort(tets[:, FACES].reshape(-1, 3), axis=1), axis=0, return_inverse=True)
    face = face.reshape(-1) + len(tets)
    ones = np.ones(len(face))
    graph = coo_matrix((ones, (np.repeat(np.arange(len(tets)), 4), face)), shape=(face.max() + 1,) * 2)
    return connected_components(graph, directed=False)[1][: len(tets)]


def _check(
    placed: np.ndarray, tets: np.ndarray, share: float, surface: NearestOn, edge: float, vertices: np.ndarray,
    faces: np.ndarray,
) -> None:  # fmt: skip
    """Raise where parts of the mesh are missing: by the volume, by distance, or torn off."""
    if not 1.0 - MAX_MISSING < 1.0 / share < 1.0 + MAX_MISSING:
        raise UnresolvedMeshError(f"the tetrahedra have {1.0 / share:.2f} of its volume")
    boundary = boundary_faces(tets)
    near = cKDTree(np.concatenate([placed[boundary].mean(axis=1), placed[np.unique(boundary)]]))
    samples = np.concatenate([surface.centres, vertices])
    away = near.query(samples)[0].max() / edge
    if away > FARTHEST:
        raise UnresolvedMeshError(f"a part of it is {away:.1f} cells away from the tetrahedra")
    joined = (faces[:, :2].T.ravel(), faces[:, 1:].T.ravel())
    graph = coo_matrix((np.ones(2 * len(faces)), joined), (len(vertices),) * 2)
    pieces, surfaces = _parts(tets).max() + 1, connected_components(graph, directed=False)[0]
    if pieces > surfaces:
        raise UnresolvedMeshError(f"its tetrahedra would be {pieces} pieces")


def _embedding(points: np.ndarray, placed: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the tetrahedron that holds each point or is the nearest, (k,) int32, and its corners' weights, (k, 4)."""
    count = min(CANDIDATES, len(tets))
    near = cKDTree(placed[tets].mean(axis=1)).query(points, count)[1].reshape(len(points), count)
    first = placed[tets[:, 0]]
    inverse = np.linalg.inv(np.swapaxes(placed[tets[:, 1:]] - first[:, None], 1, 2))
    rest = np.einsum("kcij,kcj->kci", inverse[near], points[:, None] - first[near])
    weights = np.concatenate([1.0 - rest.sum(axis=-1, keepdims=True), rest], axis=-1)
    best, each = np.argmax(weights.min(axis=-1), axis=1), np.arange(len(points))
    return near[each, best].astype(np.int32), weights[each, best]
