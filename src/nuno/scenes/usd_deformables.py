"""Cloth and soft bodies of a USD stage: meshes and meshes of tetrahedra with AOUSD's proposed schemas."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import NunoError
from nuno.materials import Cloth, Soft
from nuno.scenes.cloth_elasticity import Plate, cloth_of
from nuno.scenes.scene_description import SceneBody, SceneDescription
from nuno.scenes.usd_bodies import UsdBodies
from nuno.scenes.usd_package import SURFACE, VOLUME
from nuno.scenes.usd_shapes import mesh_arrays
from nuno.scenes.usd_stage import UsdStage
from nuno.shapes import quaternion as quat
from nuno.shapes.shape import ClothMesh
from nuno.shapes.soft_shape import SoftTetrahedra

REST = "physics:restShapePoints"


def deforming_prims(stage: UsdStage) -> list[Any]:
    """Return the prims that are cloth or soft bodies, attached or static."""
    return [
        prim for prim in stage.prims
        if prim.IsA(stage.usd.UsdGeom.TetMesh) or stage.has(prim, SURFACE)
        or (prim.IsA(stage.usd.UsdGeom.Mesh) and stage.value(prim, REST) is not None)
    ]  # fmt: skip


def add_deformable(scene: SceneDescription, stage: UsdStage, bodies: UsdBodies, prim: Any) -> None:
    """Add one cloth or soft body."""
    owner = stage.body_of(prim) or prim
    name = bodies.name_for(owner)
    if stage.is_rigid(owner):
        scene.note("deforming geometry of a rigid body is left out", name)
        return
    try:
        body = _deformable(scene, stage, prim, owner, name)
    except NunoError as error:
        scene.note(f"a deforming body that cannot be used is left out ({error})", name)
        return
    scene.bodies.append(body)
    bodies.names[str(prim.GetPath())] = bodies.names[str(owner.GetPath())] = name


def _deformable(scene: SceneDescription, stage: UsdStage, prim: Any, owner: Any, name: str) -> SceneBody:
    matrix = stage.matrix(prim)
    is_cloth = not prim.IsA(stage.usd.UsdGeom.TetMesh)
    if is_cloth:
        points, elements = mesh_arrays(stage, prim)
        if np.linalg.det(matrix[:, :3]) < 0.0:
            elements = elements[:, ::-1]
    else:
        points = np.array(stage.value(prim, "points", []), dtype=float).reshape(-1, 3)
        elements = np.array(stage.value(prim, "tetVertexIndices", []), dtype=int).reshape(-1, 4)
    now = points @ matrix[:, :3].T + matrix[:, 3]
    given = stage.value(prim, REST)
    rest = now if given is None else np.array(given, dtype=float) @ matrix[:, :3].T
    if len(rest) != len(now):
        scene.note("a rest shape of other vertices is left out", name)
        rest = now
    shape: Any = ClothMesh(now, elements, rest) if is_cloth else SoftTetrahedra(rest, elements)
    body = SceneBody(
        name, shape, now.mean(axis=0), quat.IDENTITY.copy(), None, stage.color(prim), vertices=now
    )  # fmt: skip
    # tetrahedra that nobody calls a deformable body are one to Newton too
    if stage.has(prim, SURFACE) or stage.has(prim, VOLUME) or (not is_cloth and owner is prim):
        material = _material(scene, stage, prim, name, is_cloth)
        body.material, body.friction = material, float(material.friction)
    speeds = stage.value(prim, "velocities")
    if speeds is not None and len(speeds) == len(now):
        body.velocities = np.array(speeds, dtype=float) @ matrix[:, :3].T
    return body


def _material(scene: SceneDescription, stage: UsdStage, prim: Any, name: str, is_cloth: bool) -> Any:
    """Return the material that is bound: Young's modulus, Poisson's ratio, density and thickness in the stage's units.

    Where nothing is said of elasticity, it is Nuno's default, which is noted.
    """
    bound = stage.bound_material(prim, "physics")

    def said(what: str, default: float) -> float:
        return default if bound is None else float(stage.value(bound, f"physics:{what}", default))

    friction = said("dynamicFriction", 0.5)
    density = said("density", 0.0) * stage.mass_unit / stage.unit**3
    young = said("youngsModulus", 0.0) * stage.mass_unit / stage.unit  # a pressure: force / length^2
    ratio = float(np.clip(said("poissonsRatio", 0.3), 0.0, 0.49))
    if young <= 0.0:
        scene.note("a deforming body without elasticity has Nuno's default", name)
    if not is_cloth:
        material = Soft(friction=friction)
        return Soft(
            density=density or material.density, youngs_modulus=young or material.youngs_modulus,
            poisson_ratio=ratio, friction=friction,
        )  # fmt: skip
    own = np.ravel(stage.value(prim, "physics:thicknesses", []))
    thickness = (float(own.mean()) if len(own) else said("surfaceThickness", 0.0)) * stage.unit
    contact = said("contactThickness", 0.0) * stage.unit or thickness or float(Cloth.thickness)
    if young <= 0.0 or thickness <= 0.0:
        return Cloth(friction=friction, thickness=contact)
    area_density = density * thickness or float(Cloth.area_density)
    return cloth_of(
        Plate(young, ratio, thickness, True), area_density=area_density, friction=friction, thickness=contact
    )
