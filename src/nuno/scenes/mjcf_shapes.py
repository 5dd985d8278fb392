"""Bodies of a compiled MJCF model: their shapes, masses and velocities."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import MeshError
from nuno.materials import Rigid
from nuno.scenes.bare_body import BARE, whole_body
from nuno.scenes.compiled_mjcf import CompiledMjcf
from nuno.scenes.scene_description import SceneBody, SceneDescription
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, compose, invert
from nuno.shapes.mass_properties import MassProperties, joined
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sphere, TriangleMesh

Placed = tuple[int, Shape, np.ndarray, np.ndarray]
"""A geom, its shape, and where that is in the body that stands for it."""


def add_static(scene: SceneDescription, compiled: CompiledMjcf) -> None:
    """Add what does not move: one body for each geom of the world and for each other body."""
    for body in compiled.members[0]:
        placed = [geom for geom in _geoms(scene, compiled, body, 0) if body > 0 or _touches(compiled, geom[0])]
        if body == 0:
            for k in range(compiled.model.body_geomnum[0]):
                geom = compiled.model.body_geomadr[0] + k
                if not _touches(compiled, geom):
                    scene.note("geoms that are only seen are left out", _geom_name(compiled, geom))
        if compiled.model.body_mocapid[body] >= 0:
            scene.note("a mocap body is static: world.move leads it", compiled.body_name(body))
        pose = compiled.pose(body)
        alone = [[geom] for geom in placed] if body == 0 else _grouped(scene, compiled, body, placed)
        for k, parts in enumerate(alone):
            name = _geom_name(compiled, parts[0][0]) if body == 0 else compiled.body_name(body)
            name = _free_name(scene, name if k == 0 or body == 0 else f"{name} {k + 1}")
            scene.bodies.append(_body(scene, compiled, name, pose, parts, None))


def moving_body(scene: SceneDescription, compiled: CompiledMjcf, root: int) -> SceneBody:
    """Return a body that moves, with all that is fixed to it."""
    model = compiled.model
    placed = [geom for body in compiled.members[root] for geom in _geoms(scene, compiled, body, root)]
    name, pose = _free_name(scene, compiled.body_name(root)), compiled.pose(root)
    parts = _drawn_or_solid(scene, compiled, name, placed)
    mass = _mass(compiled, root)
    for body in compiled.members[root]:
        if model.body_gravcomp[body]:
            scene.note("gravity compensation is left out", compiled.body_name(body))
    made = _body(scene, compiled, name, pose, parts, mass)
    made.velocity, made.angular_velocity = _velocity(compiled, root, pose, mass)
    return made


def _grouped(scene: SceneDescription, compiled: CompiledMjcf, body: int, placed: list[Placed]) -> list[list[Placed]]:
    """Return the static bodies that a body is: planes are ones of their own."""
    planes = [[geom] for geom in placed if isinstance(geom[1], Plane)]
    others = [geom for geom in placed if not isinstance(geom[1], Plane)]
    if not others:
        return planes
    return [_drawn_or_solid(scene, compiled, compiled.body_name(body), others), *planes]


def _touches(compiled: CompiledMjcf, geom: int) -> bool:
    return bool(compiled.model.geom_contype[geom] or compiled.model.geom_conaffinity[geom])


def _drawn_or_solid(scene: SceneDescription, compiled: CompiledMjcf, name: str, placed: list[Placed]) -> list[Placed]:
    """Return the geoms that touch, or where none does those that are seen."""
    touching = [geom for geom in placed if _touches(compiled, geom[0])]
    if touching and len(touching) < len(placed):
        scene.note("geoms that are only seen are left out", name)
    elif placed and not touching:
        scene.note("bodies that touch nothing are there to be seen", name)
    elif not placed:
        scene.note("bodies without a shape are balls of 1 cm that touch nothing", name)
    return touching or placed


def _body(
    scene: SceneDescription, compiled: CompiledMjcf, name: str, pose: Pose, parts: list[Placed],
    mass: MassProperties | None,
) -> SceneBody:  # fmt: skip
    model = compiled.model
    geoms = [part[0] for part in parts]
    touching = [geom for geom in geoms if _touches(compiled, geom)]
    masks = {compiled.masks((int(model.geom_contype[g]), int(model.geom_conaffinity[g]))) for g in touching}
    group, others = 0, 0
    for own, other in masks:
        group, others = group | own, others | other
    frictions = {float(model.geom_friction[geom][0]) for geom in geoms}
    if len(masks) > 1 or len(frictions) > 1:
        scene.note("geoms of one body have one friction and touch the same others", name)
    friction = max(frictions) if frictions else 0.5
    color = tuple(float(np.clip(c, 0.0, 1.0)) for c in _rgba(compiled, geoms[0])[:3]) if geoms else None
    shapes = [(shape, place, turn) for _, shape, place, turn in parts] or [(Sphere(BARE), np.zeros(3), quat.IDENTITY)]
    material = None if mass is None else Rigid(mass=mass.volume, friction=friction)
    return whole_body(
        SceneBody(name, shapes[0][0], *pose, material, color, friction, 0.0, group, others), shapes, mass
    )  # fmt: skip


def _rgba(compiled: CompiledMjcf, geom: int) -> np.ndarray:
    material = compiled.model.geom_matid[geom]
    own = compiled.model.geom_rgba[geom]
    if material >= 0 and np.allclose(own, 0.5, atol=1e-6, rtol=0.0) | np.allclose(own, (0.5, 0.5, 0.5, 1.0)):
        return np.array(compiled.model.mat_rgba[material])
    return np.array(own)


def _geoms(scene: SceneDescription, compiled: CompiledMjcf, body: int, root: int) -> list[Placed]:
    """Return a body's geoms, in the frame of the one that stands for it; of what is static in the body's own."""
    model, data = compiled.model, compiled.data
    frame = compiled.pose(body if root == 0 else root)
    found: list[Placed] = []
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        turn = np.zeros(4)
        compiled.mujoco.mju_mat2Quat(turn, data.geom_xmat[geom])
        own = compose(invert(frame), (np.array(data.geom_xpos[geom]), turn))
        name = _geom_name(compiled, geom)
        try:
            shape, place = _shape(scene, compiled, geom, name, own)
        except MeshError as error:
            scene.note(f"a shape that cannot be used is left out ({error})", name)
            continue
        if shape is not None:
            found.append((geom, shape, *place))
    return found


def _shape(
    scene: SceneDescription, compiled: CompiledMjcf, geom: int, name: str, pose: Pose
) -> tuple[Shape | None, Pose]:
    model = compiled.model
    kind = compiled.mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    size = np.array(model.geom_size[geom])
    if kind == "box":
        return Box(tuple(2.0 * size)), pose
    if kind == "sphere":
        return Sphere(size[0]), pose
    if kind in ("cylinder", "capsule"):
        return (Cylinder if kind == "cylinder" else Capsule)(size[0], 2.0 * size[1]), pose
    if kind == "plane":
        return Plane(), pose
    if kind == "ellipsoid":
        scene.note("an ellipsoid is a hull", name)
        return _meshed(Hull.of(np.asarray(Sphere(1.0).mesh()[0]) * size), pose)
    if kind == "hfield":
        scene.note("a height field is a mesh", name)
        return _meshed(TriangleMesh(*_height_field(model, int(model.geom_dataid[geom]))), pose)
    if kind in ("mesh", "sdf"):
        mesh = int(model.geom_dataid[geom])
        first, many = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        points = np.array(model.mesh_vert[first : first + many], dtype=float)
        own = quat.rotate(pose[1], points) + pose[0]
        triangles = np.array(model.mesh_face[start : start + faces])
        a, b, c = triangles.T
        used, renumbered = np.unique(triangles[(a != b) & (b != c) & (c != a)], return_inverse=True)
        shape = TriangleMesh(own[used], renumbered.reshape(-1, 3))  # without points of no face
        return shape, (shape.centre, quat.IDENTITY)
    scene.note(f"a geom of type {kind} is left out", name)
    return None, pose


def _meshed(shape: TriangleMesh, pose: Pose) -> tuple[Shape, Pose]:
    return shape, compose(pose, (shape.centre, quat.IDENTITY))


def _height_field(model: Any, field: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the top of a height field as vertices (n, 3) [m] and faces (m, 3)."""
    rows, columns, start = model.hfield_nrow[field], model.hfield_ncol[field], model.hfield_adr[field]
    along, across, high, _ = model.hfield_size[field]
    heights = np.array(model.hfield_data[start : start + rows * columns], dtype=float) * high
    x, y = np.meshgrid(np.linspace(-along, along, columns), np.linspace(-across, across, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate([
        np.stack([corner, corner + 1, corner + columns + 1], axis=1),
        np.stack([corner, corner + columns + 1, corner + columns], axis=1),
    ])  # fmt: skip
    return np.stack([x.ravel(), y.ravel(), heights], axis=1), faces


def _mass(compiled: CompiledMjcf, root: int) -> MassProperties:
    """Return mass (as the volume), centre and inertia of all that is fixed to a body, in its frame."""
    model, frame = compiled.model, invert(compiled.pose(root))
    pieces = []
    for body in compiled.members[root]:
        if model.body_mass[body] > 0.0:
            own = MassProperties(float(model.body_mass[body]), np.zeros(3), np.diag(model.body_inertia[body]))
            at = compose(compiled.pose(body), (np.array(model.body_ipos[body]), np.array(model.body_iquat[body])))
            place, turn = compose(frame, at)
            pieces.append(own.turned(turn, place))
    return joined(pieces) if pieces else MassProperties(1e-3, np.zeros(3), 1e-6 * np.eye(3))


def _velocity(
    compiled: CompiledMjcf, root: int, pose: Pose, mass: MassProperties
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the velocity of a body's centre of mass and its angular velocity, None for none."""
    six = np.zeros(6)
    kind = compiled.mujoco.mjtObj.mjOBJ_XBODY
    compiled.mujoco.mj_objectVelocity(compiled.model, compiled.data, kind, root, six, 0)
    spin, velocity = six[:3].copy(), six[3:] + np.cross(six[:3], quat.rotate(pose[1], mass.centre))
    return velocity if velocity.any() else None, spin if spin.any() else None


def _geom_name(compiled: CompiledMjcf, geom: int) -> str:
    own = compiled.name("mjOBJ_GEOM", geom)
    if own:
        return own
    body = int(compiled.model.geom_bodyid[geom])
    return compiled.body_name(body) if body else f"geom {geom}"


def _free_name(scene: SceneDescription, name: str) -> str:
    taken, number, found = {body.name for body in scene.bodies}, 1, name
    while found in taken:
        number += 1
        found = f"{name} {number}"
    return found
