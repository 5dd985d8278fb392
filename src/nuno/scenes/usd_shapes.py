"""Geometry of a USD stage as shapes."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.scenes.scene_description import SceneDescription
from nuno.scenes.usd_stage import UsdStage
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, compose
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sphere, TriangleMesh

READABLE = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Capsule", "Capsule_1", "Cone", "Plane", "Mesh")
AXES = {
    "X": np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]), "Y": np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]),
    "Z": quat.IDENTITY,
}  # fmt: skip
"""Rotations that bring z to an axis."""
ORDER = {"X": (1, 2, 0), "Y": (0, 2, 1), "Z": (0, 1, 2)}
"""Two axes across and the one along."""


def usd_shape(scene: SceneDescription, stage: UsdStage, prim: Any, name: str, moves: bool) -> tuple[Shape, Pose] | None:
    """Return a prim's shape and where that is in the world; None, with a note, for what Nuno has no shape for.

    Raises:
        MeshError: a mesh that cannot be used.
        InvalidInputError: a size that is none.
    """
    kind = str(prim.GetTypeName())
    if kind not in READABLE:
        scene.note(f"geometry of type {kind} is left out", name)
        return None
    pose, scale, sheared = stage.frame(prim)
    if sheared:
        scene.note("sheared axes are taken as right angles", name)
    if kind == "Mesh":
        return _mesh(scene, stage, prim, name, pose, scale, moves)
    size = np.abs(scale)
    if kind == "Cube":
        return Box(tuple(float(stage.value(prim, "size", 2.0)) * size)), pose
    if kind == "Sphere":
        radius = float(stage.value(prim, "radius", 1.0))
        if np.ptp(size) <= 1e-6 * size.max():
            return Sphere(radius * float(size[0])), pose
        scene.note("an ellipsoid is a hull", name)
        return _stretched(Sphere(radius), scale, pose)
    axis = str(stage.value(prim, "axis", "Z"))
    across, other, along = ORDER[axis]
    turned = compose(pose, (np.zeros(3), AXES[axis]))
    if kind == "Plane":
        return Plane(), turned
    height = float(stage.value(prim, "height", 2.0 if kind in ("Cylinder", "Cylinder_1", "Cone") else 1.0))
    default = 0.5 if kind.startswith("Capsule") else 1.0
    radius = float(stage.value(prim, "radius" if not kind.endswith("_1") else "radiusTop", default))
    sizes = size[[across, other, along]]
    if kind == "Cone":
        scene.note("a cone is a hull", name)
        return _cone(radius, height, sizes, turned)
    if kind.endswith("_1") and float(stage.value(prim, "radiusBottom", default)) != radius:
        scene.note("a cylinder or capsule with two radii has that of its top", name)
    if np.ptp(sizes[:2]) > 1e-6 * sizes.max() or (kind.startswith("Capsule") and np.ptp(sizes) > 1e-6 * sizes.max()):
        scene.note("a cylinder or capsule that is stretched is a hull", name)
        shape = Capsule(radius, height) if kind.startswith("Capsule") else Cylinder(radius, height)
        return _stretched(shape, sizes, turned)
    make = Capsule if kind.startswith("Capsule") else Cylinder
    return make(radius * float(sizes[0]), height * float(sizes[2])), turned


def mesh_arrays(stage: UsdStage, prim: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh's vertices (n, 3), in its own units and axes, and triangles (m, 3) that look outwards."""
    points = np.array(stage.value(prim, "points", []), dtype=float).reshape(-1, 3)
    counts = np.array(stage.value(prim, "faceVertexCounts", []), dtype=int)
    indices = np.array(stage.value(prim, "faceVertexIndices", []), dtype=int)
    starts = np.cumsum(counts) - counts
    faces = [
        np.stack([indices[first], indices[first + k], indices[first + k + 1]], axis=1)
        for many in np.unique(counts[counts >= 3])
        for first in [starts[counts == many]]
        for k in range(1, many - 1)
    ]
    triangles = np.concatenate(faces) if faces else np.zeros((0, 3), dtype=int)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return points, triangles[:, ::-1] if str(stage.value(prim, "orientation", "")) == "leftHanded" else triangles


def _mesh(
    scene: SceneDescription, stage: UsdStage, prim: Any, name: str, pose: Pose, scale: np.ndarray, moves: bool
) -> tuple[Shape, Pose]:
    points, triangles = mesh_arrays(stage, prim)
    points = points * scale
    triangles = triangles if scale[0] > 0.0 else triangles[:, ::-1]
    how = str(stage.value(prim, "physics:approximation", "none"))
    shape: Shape
    if how == "boundingCube":
        low, high = points.min(axis=0), points.max(axis=0)
        return Box(tuple(high - low)), compose(pose, (0.5 * (low + high), quat.IDENTITY))
    if how == "boundingSphere":
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return Sphere(float(np.linalg.norm(points - middle, axis=1).max())), compose(pose, (middle, quat.IDENTITY))
    if how == "convexHull" and not moves:
        shape = Hull.of(points)
    else:
        if moves and how in ("none", "convexDecomposition", "meshSimplification", "sdf"):
            scene.note("a mesh that moves is touched as its convex hull", name)
        shape = TriangleMesh(points, triangles)
    return shape, compose(pose, (shape.centre, quat.IDENTITY))


def _stretched(shape: Shape, scale: np.ndarray, pose: Pose) -> tuple[Shape, Pose]:
    hull = Hull.of(np.asarray(shape.mesh()[0]) * scale)
    return hull, compose(pose, (hull.centre, quat.IDENTITY))


def _cone(radius: float, height: float, sizes: np.ndarray, pose: Pose) -> tuple[Shape, Pose]:
    angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(32, -0.5 * height)], axis=1)
    hull = Hull.of(np.vstack([rim, [[0.0, 0.0, 0.5 * height]]]) * sizes)
    return hull, compose(pose, (hull.centre, quat.IDENTITY))
