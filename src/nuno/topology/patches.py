"""Patches: a triangle with its neighbours, and the weights that read its curvature off their vertices.

Where two flat triangles meet, the slope jumps. The jumps at a triangle's three edges, one linear function each of the
edge's and both opposite vertices (the hinges of Bergou et al. 2006), say how the surface curves there in all three
components, in two ways:

- The jumps are the integral of the curvature. With half of each given to either side, a triangle's curvature is
  sum of (length x jump / 2) n n^T over its area, n the edges' normals in the plane: the curvature of the mid-edge
  normals (Grinspun et al. 2006). A constant moment then is in balance on any mesh, but curvature that varies from
  triangle to triangle, though the surface does not, costs too much energy: it is too stiff.
- The jumps of any quadratic surface are known: solved for its curvature (the six-point patch of rotation-free
  shells, Onate and Zarate 2000), it is exact for quadratics, but a moment is not in balance. It is too soft.

Both are exact on meshes of right-angled triangles cut one way, and nearly so on equilateral ones; on others the one is
as much too stiff as the other is too soft, and their geometric mean, as matrices over the jumps, is right to a few
percent (docs/physics.md). With the lumped masses, the mean is brought to three functions that do not act on each other,
which the solver projects one after the other (`nuno.constraints.bending.bend_patch`).
"""

from __future__ import annotations

import numpy as np

from nuno.errors import MeshError

MIN_RATIO = 0.05
"""The soft compliance counts as no less than this times the stiff one: six vertices on a conic tell nothing of a
quadratic surface, and would be rigid. Regular meshes reach 0.3; 0.2 instead changes no strip by 0.1 %."""


def neighbours(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All edges (e, 2) int32, and (m, 3) int: the vertex across each edge (0, 1), (1, 2), (2, 0) of a face, or -1.

    Raises:
        MeshError: an edge belongs to more than two faces.
    """
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    opposite = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    edges, inverse, counts = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    if counts.max() > 2:
        worst = edges[counts.argmax()]
        raise MeshError(
            f"edge {worst[0]}-{worst[1]} belongs to {counts.max()} faces; a cloth's edges have one or two. Split "
            "the mesh there (trimesh.graph.connected_components over face_adjacency finds the sheets)"
        )
    order = np.argsort(inverse.ravel(), kind="stable")
    first = np.searchsorted(inverse.ravel()[order], np.nonzero(counts == 2)[0])
    across = np.full(len(half), -1, dtype=int)
    across[order[first]], across[order[first + 1]] = opposite[order[first + 1]], opposite[order[first]]
    return edges.astype(np.int32), across.reshape(3, -1).T


def curvature_weights(
    rest: np.ndarray, faces: np.ndarray, across: np.ndarray, areas: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a patch's bending weights: 1/2 B sum of |sum_i weight_ji x_i - rest_j|^2 over three functions j.

    Args:
        rest: (n, 3) float [m], rest shape.
        faces: (m, 3) int.
        across: (m, 3) int, the vertices of `neighbours`.
        areas: (n,) float [m2], of each vertex, to which masses are in proportion.

    Returns:
        vertices (m, 6) int, the face's and those across, vertex 0 in the place of one that is not there;
        weights (m, 3, 6) float [1/m];
        rest (m, 3, 3) float, the functions at rest by the sides from vertex 0 to 1 and to 2 and by the unit normal;
        curved (m,) bool, whether that is not zero.
    """
    count = len(faces)
    there = across >= 0
    vertices = np.concatenate([faces, np.where(there, across, faces[:, :1])], axis=1)
    x = rest[vertices]
    side, fold = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    normal = np.cross(side, fold)
    double = np.linalg.norm(normal, axis=1)
    normal /= double[:, None]
    frame = np.stack([side, np.cross(normal, side)], axis=1) / np.linalg.norm(side, axis=1)[:, None, None]
    flat = np.einsum("mkc,mdc->mkd", x[:, :3] - x[:, :1], frame)
    jumps = np.zeros((count, 3, 6))  # of the slope across each edge, times its length
    bends = np.zeros((count, 3, 3))  # those of surfaces with k_xx, k_yy or k_xy = 1
    turns = np.zeros((count, 3, 3))  # the edges' n n^T: xx, yy, xy
    for k in range(3):
        a, b, c, d = k, (k + 1) % 3, (k + 2) % 3, 3 + k
        along = flat[:, b] - flat[:, a]
        length = np.linalg.norm(along, axis=1)
        along /= length[:, None]
        out = np.stack([along[:, 1], -along[:, 0]], axis=1)
        # the vertex across, unfolded into the face's plane
        beam, leg = (x[:, b] - x[:, a]) / length[:, None], x[:, d] - x[:, a]
        place = (beam * leg).sum(axis=1)
        height = np.linalg.norm(leg - place[:, None] * beam, axis=1)
        far = flat[:, a] + place[:, None] * along + height[:, None] * out
        inner, depth = ((flat[:, c] - flat[:, a]) * along).sum(axis=1), double / length
        height = np.where(there[:, k], height, 1.0)
        # slope outside less slope inside, in terms of the heights over the edge
        jumps[:, k, c], jumps[:, k, d] = length / depth, length / height
        jumps[:, k, b] = -(inner / depth + place / height)
        jumps[:, k, a] = -(jumps[:, k, b] + jumps[:, k, c] + jumps[:, k, d])
        p = np.stack([flat[:, a], flat[:, b], flat[:, c], far], axis=1)
        quadratic = np.stack([p[..., 0] ** 2 / 2, p[..., 1] ** 2 / 2, p[..., 0] * p[..., 1]], axis=2)
        bends[:, k] = np.einsum("mv,mvq->mq", jumps[:, k][:, [a, b, c, d]], quadratic)
        turns[:, k] = np.stack([out[:, 0] ** 2, out[:, 1] ** 2, out[:, 0] * out[:, 1]], axis=1)
    held = there.astype(float)
    jumps *= held[:, :, None]
    both = held[:, :, None] * held[:, None, :]
    missing = np.einsum("mk,kl->mkl", 1.0 - held, np.eye(3))  # an edge at the rim never bends
    face = 0.5 * double[:, None, None]
    shared = np.einsum("mkq,q,mlq->mkl", turns, [1.0, 1.0, 2.0], turns) + 1e-10 * np.eye(3)  # for slivers' sake
    stiff = np.linalg.inv(shared / (4.0 * face) * both + missing)
    soft = np.einsum("mkq,q,mlq->mkl", bends, [1.0, 1.0, 0.5], bends) / face * both + missing
    # along their common axes the mean is that of numbers: where the stiff compliance is 1, the soft one is the ratio
    factor = np.linalg.cholesky(stiff)
    inverse = np.linalg.inv(factor)
    ratio, axes = np.linalg.eigh(np.einsum("mki,mij,mlj->mkl", inverse, soft, inverse))
    mean = np.maximum(ratio, MIN_RATIO) ** 0.25
    unit = np.einsum("mij,mik,mkl->mjl", axes, inverse, jumps) / mean[:, :, None]  # functions of unit stiffness
    light = unit / areas[vertices][:, None, :]
    _, turn = np.linalg.eigh(np.einsum("mki,mli->mkl", light, unit))
    weights = np.einsum("mkj,mki->mji", turn, unit)
    vector = np.einsum("mji,mic->mjc", weights, x)
    base = np.stack([side, fold, normal], axis=1)
    bent = np.einsum("mjc,mck->mjk", vector, np.linalg.inv(base))
    size = np.sqrt(face[:, 0, 0])
    curved = np.linalg.norm(vector, axis=2).max(axis=1) > 1e-5 * np.abs(weights).max(axis=(1, 2)) * size
    return vertices, weights, np.where(curved[:, None, None], bent, 0.0), curved


def bend_rate(vertices: np.ndarray, weights: np.ndarray, areas: np.ndarray, sizes: np.ndarray) -> float:
    """Return a mesh's bending rate [1/m4]: times rigidity over density, a patch's frequency squared [1/s2].

    Args:
        vertices: (m, 6) int, of `curvature_weights`.
        weights: (m, 3, 6) float [1/m], of `curvature_weights`.
        areas: (n,) float [m2], of each vertex.
        sizes: (m,) float, the faces' areas to any scale.

    Returns:
        The median by area, which a few small triangles do not change, of each patch's stiffest function.
    """
    fastest = (weights**2 / areas[vertices][:, None, :]).sum(axis=2).max(axis=1)
    order = np.argsort(fastest)
    share = np.cumsum(sizes[order]) / sizes.sum()
    return float(fastest[order][np.searchsorted(share, 0.5)])
