"""Flexes of a compiled MJCF model: cloth and soft bodies, and the vertices of them that are held."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import NunoError
from nuno.materials import Soft
from nuno.mesh.tetrahedra import volumes
from nuno.scenes.cloth_elasticity import Plate, cloth_of
from nuno.scenes.compiled_mjcf import CompiledMjcf
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneGrip
from nuno.shapes import quaternion as quat
from nuno.shapes.shape import ClothMesh
from nuno.shapes.soft_shape import SoftTetrahedra

SOFTEST = 1.0
"""[Pa] Young's modulus from which on a flex is elastic by it."""
TOWEL = Plate(1e6, 0.3, 1e-3, True)
"""Of a flex whose stiffness is left to its edges: about Nuno's default cloth."""


def add_flexes(scene: SceneDescription, compiled: CompiledMjcf) -> None:
    """Add cloth for each flex of triangles and a soft body for each of tetrahedra."""
    for k in range(compiled.model.nflex):
        name = compiled.name("mjOBJ_FLEX", k) or f"flex {k}"
        try:
            _add_flex(scene, compiled, k, name)
        except NunoError as error:
            scene.note(f"a flex that cannot be used is left out ({error})", name)


def _add_flex(scene: SceneDescription, compiled: CompiledMjcf, k: int, name: str) -> None:
    model = compiled.model
    dim = int(model.flex_dim[k])
    if dim == 1:
        scene.note("ropes (flexes of one dimension) are left out", name)
        return
    first, many = int(model.flex_vertadr[k]), int(model.flex_vertnum[k])
    start, count = int(model.flex_elemdataadr[k]), int(model.flex_elemnum[k])
    elements = np.array(model.flex_elem[start : start + (dim + 1) * count]).reshape(count, dim + 1)
    rest = np.array(compiled.initial.flexvert_xpos[first : first + many])
    now = np.array(compiled.data.flexvert_xpos[first : first + many])
    bodies = np.array(model.flex_vertbodyid[first : first + many])
    shape: Any = ClothMesh(now, elements, rest) if dim == 2 else SoftTetrahedra(rest, elements)
    body = SceneBody(
        name, shape, shape.centre if dim == 2 else now.mean(axis=0), quat.IDENTITY.copy(), None,
        tuple(float(c) for c in model.flex_rgba[k][:3]), float(model.flex_friction[k][0]), vertices=now,
    )  # fmt: skip
    body.group, body.collides_with = compiled.masks((int(model.flex_contype[k]), int(model.flex_conaffinity[k])))
    body.thickness = max(2.0 * float(model.flex_radius[k]), 1e-4)
    roots = {compiled.root(int(each)) for each in bodies if each >= 0}
    if not roots - {0}:
        scene.bodies.append(body)
        return
    if bool(model.flex_rigid[k]):
        scene.note("flexes that are fixed to a body that moves are left out", name)
        return
    if len(compiled.spec.flexes[k].node) or (bodies < 0).any():
        scene.note("a flex of few nodes is one of all its vertices", name)
    body.material = _material(scene, compiled, k, name, rest, elements, bodies)
    body.velocities = _velocities(compiled, bodies)
    scene.bodies.append(body)
    if dim == 2 and not model.flex_selfcollide[k]:
        scene.ignored.append((name, name))
    names = {compiled.body_name(each): each for each in compiled.roots}
    for root in sorted(roots - compiled.flex_bodies):
        held = np.flatnonzero([each >= 0 and compiled.root(int(each)) == root for each in bodies])
        to = None if root == 0 else compiled.body_name(root)
        if to is None or to in names:
            scene.grips.append(SceneGrip(name, held, to))


def _material(
    scene: SceneDescription, compiled: CompiledMjcf, k: int, name: str, rest: np.ndarray, elements: np.ndarray,
    bodies: np.ndarray,
) -> Any:  # fmt: skip
    model, spec = compiled.model, compiled.spec.flexes[k]
    own = [int(each) for each in bodies if int(each) in compiled.flex_bodies]
    # held vertices have the mass of the body that holds them: they count as the mean of the others
    mass = float(model.body_mass[own].sum()) * len(rest) / max(len(own), 1) if own else 0.0
    friction, damping = float(model.flex_friction[k][0]), float(spec.damping)
    young, ratio = float(spec.young), float(np.clip(spec.poisson, 0.0, 0.49))
    if elements.shape[1] == 4:
        density = mass / float(np.abs(volumes(rest, elements)).sum()) if mass else 200.0
        if young < SOFTEST:
            scene.note("a flex without elasticity has Nuno's default", name)
            return Soft(density=density, friction=friction)
        return Soft(density=density, youngs_modulus=young, poisson_ratio=ratio, friction=friction, damping=damping)
    corners = rest[elements]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    deep = float(spec.thickness)
    plate = Plate(young, ratio, deep, True)
    if young < SOFTEST or deep <= 0.0:
        scene.note("a flex that is elastic in its edges alone has Nuno's default elasticity", name)
        plate = TOWEL
    return cloth_of(
        plate, area_density=mass / area if mass else 0.2, friction=friction, damping=damping,
        thickness=max(2.0 * float(model.flex_radius[k]), 1e-4),
    )  # fmt: skip


def _velocities(compiled: CompiledMjcf, bodies: np.ndarray) -> np.ndarray | None:
    """Return the vertices' velocities (n, 3) [m/s], None where all rest."""
    found, kind = np.zeros((len(bodies), 3)), compiled.mujoco.mjtObj.mjOBJ_XBODY
    for k, body in enumerate(bodies):
        if int(body) in compiled.flex_bodies:
            six = np.zeros(6)
            compiled.mujoco.mj_objectVelocity(compiled.model, compiled.data, kind, int(body), six, 0)
            found[k] = six[3:]
    return found if found.any() else None
