"""Crossed faces: the worlds in which a cloth passes through itself, by pairs of faces whose boxes meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.state.pack import pack_positions


@wp.kernel(enable_backward=False, module="nuno.contact.self.crossed_faces")
def box_faces(
    point: wp.array2d(dtype=wp.vec3), face: wp.array(dtype=wp.vec3i), start: wp.array(dtype=int),
    lower: wp.array2d(dtype=wp.vec3), upper: wp.array2d(dtype=wp.vec3),
):  # fmt: skip
    """The boxes of a leaf's faces, and behind all faces' that of the leaf."""
    world, leaf = wp.tid()
    low = wp.vec3(1.0e30, 1.0e30, 1.0e30)
    high = -low
    for k in range(start[leaf], start[leaf + 1]):
        f = face[k]
        a = point[world, f[0]]
        b = point[world, f[1]]
        c = point[world, f[2]]
        lo = wp.min(a, wp.min(b, c))
        hi = wp.max(a, wp.max(b, c))
        lower[world, k] = lo
        upper[world, k] = hi
        low = wp.min(low, lo)
        high = wp.max(high, hi)
    lower[world, face.shape[0] + leaf] = low
    upper[world, face.shape[0] + leaf] = high


@wp.func
def boxes_overlap(lower: wp.array2d(dtype=wp.vec3), upper: wp.array2d(dtype=wp.vec3), world: int, i: int, j: int):
    """Return True if two boxes overlap."""
    a = lower[world, i]
    b = upper[world, i]
    c = lower[world, j]
    d = upper[world, j]
    return a[0] <= d[0] and c[0] <= b[0] and a[1] <= d[1] and c[1] <= b[1] and a[2] <= d[2] and c[2] <= b[2]


@wp.func
def pierces(point: wp.array2d(dtype=wp.vec3), world: int, i: int, j: int, f: wp.vec3i):
    """Return True if an edge passes through a face that has none of its ends."""
    if i == f[0] or i == f[1] or i == f[2] or j == f[0] or j == f[1] or j == f[2]:
        return False
    p = point[world, i]
    a = point[world, f[0]] - p
    b = point[world, f[1]] - p
    c = point[world, f[2]] - p
    normal = wp.cross(b - a, c - a)
    along = point[world, j] - p
    near = -wp.dot(a, normal)
    far = near + wp.dot(along, normal)
    if near * far >= 0.0:
        return False
    u = wp.dot(wp.cross(a, b), along)
    v = wp.dot(wp.cross(b, c), along)
    w = wp.dot(wp.cross(c, a), along)
    return (u > 0.0 and v > 0.0 and w > 0.0) or (u < 0.0 and v < 0.0 and w < 0.0)


@wp.func
def cross(point: wp.array2d(dtype=wp.vec3), world: int, f: wp.vec3i, g: wp.vec3i):
    """Return True if an edge of one face passes through the other."""
    for k in range(3):
        n = (k + 1) % 3
        if pierces(point, world, f[k], f[n], g) or pierces(point, world, g[k], g[n], f):
            return True
    return False


@wp.kernel(enable_backward=False, module="nuno.contact.self.crossed_faces")
def find_crossed(
    point: wp.array2d(dtype=wp.vec3), face: wp.array(dtype=wp.vec3i), start: wp.array(dtype=int),
    lower: wp.array2d(dtype=wp.vec3), upper: wp.array2d(dtype=wp.vec3), crossed: wp.array(dtype=int),
):  # fmt: skip
    """Note the worlds in which a face of a leaf passes through one of it or of a later leaf."""
    world, leaf = wp.tid()
    faces = face.shape[0]
    for other in range(leaf, start.shape[0] - 1):
        if crossed[world] == 0 and boxes_overlap(lower, upper, world, faces + leaf, faces + other):
            for i in range(start[leaf], start[leaf + 1]):
                if boxes_overlap(lower, upper, world, i, faces + other):
                    for j in range(wp.max(i + 1, start[other]), start[other + 1]):
                        if boxes_overlap(lower, upper, world, i, j) and cross(point, world, face[i], face[j]):
                            crossed[world] = 1


def crossed_worlds(solver: Any) -> np.ndarray:
    """Return (worlds,) bool, where a cloth passes through itself, but for the rounding of floats."""
    worlds, n, device, topology = solver.world_count, solver.particle_count, solver.device, solver.device_topology
    point = pack_positions(solver.state, worlds, n, solver.lanes, device)
    face, start = topology.leaf_face, topology.leaf_face_start
    leaves = start.shape[0] - 1
    lower = wp.empty((worlds, face.shape[0] + leaves), dtype=wp.vec3, device=device)
    upper = wp.empty_like(lower)
    crossed = wp.zeros(worlds, dtype=int, device=device)
    wp.launch(box_faces, dim=(worlds, leaves), inputs=[point, face, start, lower, upper], device=device)
    wp.launch(find_crossed, dim=(worlds, leaves), inputs=[point, face, start, lower, upper, crossed], device=device)
    return np.asarray(crossed.numpy() != 0)
