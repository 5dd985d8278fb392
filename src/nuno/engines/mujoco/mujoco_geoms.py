"""Geoms: the shapes of rigid and static bodies in MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.rigid.convex import BOX_PART, CAPSULE_PART, CYLINDER_PART, FLAT, HULL, SPHERE_PART

if TYPE_CHECKING:
    from nuno.rigid.convex_parts import RigidPart

RIM = 5e-4
"""[m] Radius around the faces of a static surface that is not convex."""


def add_parts(spec: Any, body: Any, name: str, parts: tuple[RigidPart, ...]) -> tuple[list[Any], list[Any], list[Any]]:
    """Add a body's parts to a spec; return its geoms, the meshes that they need, and rigid flexes.

    What is not convex is a flex of which all vertices are the body's: MuJoCo takes a mesh geom for its convex hull.
    """
    kinds = mujoco_package().mjtGeom
    geoms, assets, flexes = [], [], []
    for k, part in enumerate(parts):
        own = f"{name}.{k}"
        place = np.zeros(3) if part.position is None else np.asarray(part.position)
        turn = np.array([1.0, 0.0, 0.0, 0.0]) if part.quaternion is None else np.asarray(part.quaternion)
        plain: dict[int, tuple[Any, list[float]]] = {
            BOX_PART: (kinds.mjGEOM_BOX, part.half.tolist()),
            SPHERE_PART: (kinds.mjGEOM_SPHERE, [float(part.half[0]), 0.0, 0.0]),
            CAPSULE_PART: (kinds.mjGEOM_CAPSULE, [float(part.half[0]), float(part.half[1]), 0.0]),
            CYLINDER_PART: (kinds.mjGEOM_CYLINDER, [float(part.half[0]), float(part.half[1]), 0.0]),
            FLAT: (kinds.mjGEOM_PLANE, [0.0, 0.0, 1.0]),
        }
        if part.kind in plain:
            kind, size = plain[part.kind]
            geoms.append(body.add_geom(name=own, type=kind, size=size, pos=place, quat=turn))
        elif part.kind == HULL or _is_convex(part):
            points = part.corners if part.kind == HULL else part.vertices
            assert points is not None
            mesh = spec.add_mesh(name=own)
            mesh.uservert = np.asarray(points, dtype=float).reshape(-1, 3).ravel().tolist()
            assets.append(mesh)
            geoms.append(body.add_geom(name=own, type=kinds.mjGEOM_MESH, meshname=own, pos=place, quat=turn))
        else:
            assert part.vertices is not None and part.faces is not None
            vertices = part.vertices if part.vertices.ndim == 2 else part.vertices[0]
            flex = spec.add_flex(name=own, dim=2, radius=max(part.rim, RIM))
            flex.vertbody = [body.name] * len(vertices)
            flex.vert = np.asarray(vertices, dtype=float).ravel().tolist()
            flex.elem = part.faces.ravel().tolist()
            flex.selfcollide = 0
            flexes.append(flex)
    return geoms, assets, flexes


def _is_convex(part: RigidPart) -> bool:
    """Return True if a closed surface is its own convex hull, to a thousandth of its volume."""
    from scipy.spatial import ConvexHull, QhullError

    from nuno.mesh.closed import enclosed_volume

    if part.vertices is None or part.faces is None or part.vertices.ndim == 3 or part.rim > 0.0:
        return False
    try:
        whole = float(ConvexHull(part.vertices).volume)
    except (QhullError, ValueError):
        return False
    return abs(float(enclosed_volume(part.vertices, part.faces)) - whole) < 1e-3 * whole
