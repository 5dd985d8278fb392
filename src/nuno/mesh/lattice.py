"""Lattices: a closed mesh filled with voxels of five tetrahedra each, its surface embedded in them."""

from __future__ import annotations

import numpy as np

from nuno.errors import MeshError
from nuno.mesh.closed import enclosed_volume
from nuno.mesh.tetrahedra import Tetrahedra, volumes, voxel_tetrahedra
from nuno.mesh.voxel_occupancy import filled_fraction
from nuno.validation import checked, finite_array, index_array

FLOOR = 0.1  # least fraction: a softer and lighter voxel would ask for smaller steps than all others
MAX_VOXELS = 2_000_000  # ten million tetrahedra: more takes gigabytes, and the size was a slip
CLOSE = 1e-6  # in edges of a voxel: what is nearer to a voxel's face is on it


@checked
def lattice_tetrahedra(
    vertices: np.ndarray, faces: np.ndarray, cell: float, skin: tuple[np.ndarray, np.ndarray] | None = None
) -> Tetrahedra:
    """Fill a closed mesh with voxels of five tetrahedra each.

    The bounding box is divided into voxels of equal edges, ``cell`` at most along each axis; those stay that hold a
    part of the inside, as 192 lines through each of them tell, or of an edge of the mesh. Parts of the mesh that meet
    in one voxel move together, however thin the gap between them is.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int, closed, counterclockwise from outside.
        cell: Longest edge of a voxel [m].
        skin: Vertices (k, 3) [m] and faces of the surface that is drawn, on or in the mesh; None is the mesh.

    Returns:
        The tetrahedra, in the order of their voxels, x fastest. Each has its voxel's filled fraction, 0.1 at least;
        what that adds is taken from the fuller ones, so that the filled volume is the mesh's.

    Raises:
        MeshError: too many voxels, or the mesh overlaps itself.
    """
    vertices, faces = triangles_of("vertices", vertices, faces)
    skin = None if skin is None else triangles_of("skin", *skin)
    low, edges, cells = divided_box(vertices, cell)
    points = (vertices - low) / edges
    fraction = whole_fraction(points, faces, cells)
    drawn = (points, faces) if skin is None else ((skin[0] - low) / edges, skin[1])
    filled = fraction > CLOSE
    for used in _voxels_of_edges(points, faces, cells), _voxels_of_edges(*drawn, cells):
        filled[tuple(used.T)] = True
    voxels = np.argwhere(filled.transpose(2, 1, 0))[:, ::-1]
    volume = enclosed_volume(vertices, faces) / edges.prod()
    share = np.repeat(_floored(fraction[tuple(voxels.T)], volume), 5)
    named = voxel_tetrahedra(voxels, cells)
    nodes, tets = np.unique(named, return_inverse=True)
    k, rest = np.divmod(nodes, (cells[0] + 1) * (cells[1] + 1))
    j, i = np.divmod(rest, cells[0] + 1)
    lattice = np.stack([i, j, k], axis=1).astype(float)
    tets = tets.reshape(-1, 4).astype(np.int32)
    which = np.full(cells, -1)
    which[tuple(voxels.T)] = np.arange(len(voxels))
    home, weights = _embedding(drawn[0], which, voxels, lattice, tets)
    triangles = np.array(drawn[1], dtype=np.int32)
    return Tetrahedra(low + lattice * edges, tets, share, triangles, home, weights)


def triangles_of(name: str, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) float64 and faces (m, 3) int32.

    Raises:
        MeshError: of other shapes, not finite, or faces of vertices that there are not.
    """
    points = finite_array(name, vertices, ("n", 3), error=MeshError)
    return points, index_array(f"faces of {name}", faces, ("m", 3), low=0, high=len(points), error=MeshError)


def divided_box(vertices: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray, tuple[int, int, int]]:
    """Return the bounding box's lower corner (3,) [m], and its voxels' edges (3,) [m] and counts along x, y, z.

    Raises:
        MeshError: too many voxels.
    """
    low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
    counts = np.maximum(np.ceil(extent / cell * (1.0 - 1e-9)), 1.0)
    if counts.prod() > MAX_VOXELS:
        raise MeshError(
            f"cell {cell:g} m divides the mesh's bounding box of {_metres(extent)} into {counts.prod():.3g} voxels; "
            f"at most {MAX_VOXELS:.0e} are made, so cell must be larger (are the mesh's numbers metres?)"
        )
    return low, extent / counts, (int(counts[0]), int(counts[1]), int(counts[2]))


def whole_fraction(points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int]) -> np.ndarray:
    """Return (nx, ny, nz), the part of each voxel that is inside a mesh, as `filled_fraction` has it.

    Raises:
        MeshError: the mesh overlaps itself.
    """
    fraction, overlaps = filled_fraction(points, faces, cells)
    if overlaps:
        raise MeshError(
            f"the mesh overlaps itself: {overlaps} of the lines drawn through it are inside it more than once; unite "
            "its parts, e.g. trimesh.boolean.union(mesh.split()) (pip install 'trimesh[easy]')"
        )
    return fraction


def _floored(fraction: np.ndarray, volume: float) -> np.ndarray:
    """Return fractions of at least the floor, the others scaled so that all add up to ``volume`` where they can."""
    scale = [0.0, 2.0]
    floored = np.clip(fraction, FLOOR, 1.0)
    if abs(floored.sum() - volume) <= 1e-9 * volume:
        return floored
    for _ in range(60):  # halves the interval down to the last digit
        middle = 0.5 * (scale[0] + scale[1])
        floored = np.clip(fraction * middle, FLOOR, 1.0)
        scale[int(floored.sum() > volume)] = middle
    return floored


def _voxels_of_edges(points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int]) -> np.ndarray:
    """Return (v, 3), the voxels that the mesh's edges pass through: a needle's are a chain from face to face."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    a, b = points[pairs[:, 0]], points[pairs[:, 1]]
    each = np.arange(len(pairs))
    edges, along = [each, each], [np.zeros(len(pairs)), np.ones(len(pairs))]
    for axis in range(3):  # where each edge passes from one layer of voxels into the next
        first = np.floor(np.minimum(a[:, axis], b[:, axis])).astype(int) + 1
        count = np.maximum(np.ceil(np.maximum(a[:, axis], b[:, axis])).astype(int) - first, 0)
        edge = np.repeat(each, count)
        plane = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        edges.append(edge)
        along.append((plane - a[edge, axis]) / (b - a)[edge, axis])
    edge, passed = np.concatenate(edges), np.concatenate(along)
    order = np.lexsort((passed, edge))
    edge, passed = edge[order], passed[order]
    same = edge[1:] == edge[:-1]
    middle, edge = 0.5 * (passed[1:] + passed[:-1])[same], edge[1:][same]
    on = a[edge] + middle[:, None] * (b - a)[edge]
    voxel = np.floor(on)
    # On a face between two voxels, an edge says nothing about which of them is filled.
    inside = (on - voxel > CLOSE).all(axis=1) & (on - voxel < 1.0 - CLOSE).all(axis=1)
    return np.unique(np.clip(voxel[inside].astype(int), 0, np.array(cells) - 1), axis=0)


def _embedding(
    points: np.ndarray, which: np.ndarray, voxels: np.ndarray, lattice: np.ndarray, tets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tetrahedron that holds each point, (k,) int32, and the weights of its corners, (k, 4)."""
    last = np.array(which.shape) - 1
    shifts = np.stack(np.meshgrid(*[[0, -1, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    home = np.full(len(points), -1)
    for shift in shifts[np.argsort(np.abs(shifts).sum(axis=1), kind="stable")]:
        found = which[tuple(np.clip(np.floor(points + 2.0 * CLOSE * shift).astype(int), 0, last).T)]
        home = np.where(home < 0, found, home)
    for lost in np.flatnonzero(home < 0):  # by rounding alone; at most a few
        home[lost] = np.argmin(np.linalg.norm(voxels + 0.5 - points[lost], axis=1))
    own = home[:, None] * 5 + np.arange(5)
    corners = lattice[tets[own]]
    weights = np.stack(
        [volumes(_with_corner(corners, c, points), np.arange(4)[None])[..., 0] for c in range(4)], axis=-1
    )
    weights /= weights.sum(axis=-1, keepdims=True)
    best = np.argmax(weights.min(axis=-1), axis=1)
    each = np.arange(len(points))
    return own[each, best].astype(np.int32), weights[each, best]


def _with_corner(corners: np.ndarray, corner: int, points: np.ndarray) -> np.ndarray:
    changed = corners.copy()
    changed[..., corner, :] = points[:, None]
    return changed


def _metres(extent: np.ndarray) -> str:
    return " x ".join(f"{edge:.3g}" for edge in extent) + " m"
