"""Worlds into scenes: everything of a world that a description holds, and what it does not by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import InvalidInputError
from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.joint_drives import DRIVES, Motor, Spring
from nuno.joints.tie import HoldSpec
from nuno.materials import Rigid
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneGrip, SceneJoint
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, apply, compose, invert
from nuno.shapes.mass_properties import mass_properties
from nuno.shapes.shape import Shape, TriangleMesh
from nuno.world.snapshot import Snapshot
from nuno.world.snapshot_records import BodyRecord, GripRecord
from nuno.world.world import World

ORIGIN: Pose = (np.zeros(3), quat.IDENTITY)


def describe_world(
    world: World, index: int | None = None, joint_names: Mapping[str, str] | None = None
) -> SceneDescription:  # fmt: skip
    """Return a world as a description.

    Args:
        world: The world.
        index: Which world of a batch; None for a single one.
        joint_names: What joints are called, by their keys.

    Raises:
        InvalidInputError: a batch without ``index``, or out of range.
    """
    with world.lock:
        count = world.world_count
        if index is None and count > 1:
            raise InvalidInputError(f"the world is a batch of {count}; say which one, from 0 to {count - 1}")
        k = 0 if index is None else index
        if not 0 <= k < count:
            raise InvalidInputError(f"index must be a whole number from 0 to {count - 1}, got {index!r}")
        snapshot = world.save()
        snapshot = snapshot.pick(k) if count > 1 else snapshot
        live = {body.key: body for body in world.bodies}
        scene = SceneDescription(snapshot.gravity, snapshot.frame_rate, snapshot.substeps)
        for record in snapshot.bodies:
            scene.bodies.append(_described(scene, record, live[record.key], k))
        names = {record.key: record.name for record in snapshot.bodies}
        poses = {record.key: _one(live[record.key].pose(), k) for record in snapshot.bodies}
        for grip in snapshot.grips:
            _add_grip(scene, grip, names, poses, snapshot)
            if isinstance(grip.spec, JointSpec) and grip.key in (joint_names or {}):
                scene.joints[-1].name = (joint_names or {})[grip.key]
        scene.ignored = [(names[a], names[b]) for a, b in snapshot.ignored if a in names and b in names]
        scene.pair_friction = [
            (names[a], names[b], float(np.ravel(mu)[0]))
            for a, b, mu in snapshot.pair_friction if a in names and b in names
        ]  # fmt: skip
        for driver, _ in snapshot.drivers:
            scene.note("robots are saved as bodies and joints, without what commands them", type(driver).__name__)
    return scene


def _one(pose: Any, k: int) -> Pose:
    """Return the pose in one world; the quaternion as long as 1, which a solver's is to a float's digits."""
    position, turn = (np.array(part if part.ndim == 1 else part[k if len(part) > 1 else 0]) for part in pose)
    return position, turn / np.linalg.norm(turn)


def _row(values: np.ndarray, k: int) -> np.ndarray:
    return np.array(values[k] if values.ndim == 3 else values)


def _described(scene: SceneDescription, record: BodyRecord, body: Body, k: int) -> SceneBody:
    if record.path is not None:
        scene.note("follows a path, and is saved where it is now", record.name)
    if record.parent is not None or record.relative is not None:
        scene.note("follows another frame, and is saved where it is now", record.name)
    position, turn = _one(body.pose(), k)
    material = None if record.dynamics is None else record.dynamics.material
    if record.dynamics is not None and record.dynamics.pushes:
        scene.note("is pushed, which is not saved", record.name)
    shape, thickness = body.shape, float(np.ravel(record.thickness)[0])
    made = SceneBody(
        record.name, shape, position, turn, material, record.color, float(np.ravel(record.friction)[0]), thickness,
        record.group, record.collides_with,
    )  # fmt: skip
    if isinstance(material, Rigid):
        if made.deforms or record.deformed is not None:
            made.shape, made.position = _stiff(body, made, k)
        offset = quat.rotate(quat.inverse(turn), made.position - position)
        made.material = _whole(material, made.shape, thickness, offset)
        made.velocity, made.angular_velocity = _vector(body.velocity, k), _vector(body.angular_velocity, k)
    elif made.deforms:
        made.vertices = _row(body.vertices, k)
        if material is not None:
            velocities = _row(body.velocities, k)
            made.velocities = velocities if velocities.any() else None
    return made


def _stiff(body: Body, made: SceneBody, k: int) -> tuple[Shape, np.ndarray]:
    """Return the mesh that a cloth or soft body is which moves as a rigid one, and where its centre is."""
    local = apply(invert((made.position, made.quaternion)), _row(body.vertices, k))
    shape = TriangleMesh(local, body.faces)
    return shape, made.position + quat.rotate(made.quaternion, shape.centre)


def _vector(values: np.ndarray, k: int) -> np.ndarray | None:
    vector = np.array(values if np.ndim(values) == 1 else values[k])
    return vector if vector.any() else None


def _whole(material: Rigid, shape: Shape, thickness: float, offset: np.ndarray) -> Rigid:
    """Return the material with mass, inertia and centre of mass, which a file holds in full.

    Args:
        material: The material.
        shape: The body's.
        thickness: Of what is open [m].
        offset: (3,) [m], where the shape's own frame is in that which the material's centre of mass is given in.
    """
    unit = mass_properties(shape, thickness=thickness)
    density = float(np.ravel(material.density)[0])
    mass = density * unit.volume if material.mass is None else float(np.ravel(material.mass)[0])
    inertia = unit.inertia * (mass / unit.volume) if material.inertia is None else np.asarray(material.inertia)
    centre = unit.centre if material.centre_of_mass is None else np.asarray(material.centre_of_mass) - offset
    friction, restitution, air_drag = (
        float(np.ravel(value)[0]) for value in (material.friction, material.restitution, material.air_drag)
    )
    return Rigid(
        mass=mass, inertia=inertia, friction=friction, restitution=restitution, air_drag=air_drag,
        centre_of_mass=centre,
    )  # fmt: skip


def _add_grip(
    scene: SceneDescription, grip: GripRecord, names: dict[str, str], poses: dict[str, Pose], snapshot: Snapshot
) -> None:
    spec, body = grip.spec, names[grip.body]
    target = None if grip.target is None else names[grip.target]
    if isinstance(spec, JointSpec):
        scene.joints.append(_joint(scene, grip, spec, body, target, poses))
        return
    if isinstance(spec, HoldSpec):
        if spec.free is not None or (len(spec.times) > 1 and spec.times[-1] > snapshot.time):
            scene.note("a grip that leads a rigid body or lets it slide is left out", body)
            return
        scene.note("a grip or weld of a rigid body is saved as a fixed joint", body)
        position = poses[grip.body][0]
        most = float(np.ravel(spec.max_force)[0])
        name, z = _free_name(scene, "fixed", body, target), np.array([0.0, 0.0, 1.0])
        scene.joints.append(SceneJoint(name, "fixed", body, target, position, z, max_force=most))
        return
    if isinstance(spec, GripSpec):
        limit: float | None
        held, moving = spec.vertices, len(spec.times) > 1 and spec.times[-1] > snapshot.time
        limit = None if spec.max_force is None else float(np.ravel(spec.max_force)[0])
    else:
        single = spec.weights.max(axis=-1) > 1.0 - 1e-9 if spec.places is not None else np.zeros(1, dtype=bool)
        held = np.take_along_axis(spec.corners, spec.weights.argmax(axis=-1)[..., None], -1)[..., 0]
        held, moving, limit = held if single.all() else None, False, float(np.ravel(spec.max_force)[0])
    if held is None:
        scene.note("a grip on points between vertices, or on another cloth, is left out", body)
        return
    if moving:
        scene.note("a grip that follows a path is saved where it is now", body)
    vertices = np.ravel(held)
    scene.grips.append(SceneGrip(body, vertices[vertices >= 0], target, spec.compliance, limit))


def _free_name(scene: SceneDescription, kind: str, body: str, target: str | None) -> str:
    name = base = f"{kind} of {body}" + ("" if target is None else f" and {target}")
    number = 0
    while any(joint.name == name for joint in scene.joints):
        number += 1
        name = f"{base} {number}"
    return name


def _joint(
    scene: SceneDescription, grip: GripRecord, spec: JointSpec, body: str, target: str | None, poses: dict[str, Pose]
) -> SceneJoint:
    own = compose(poses[grip.body], (spec.place[0], spec.turn[0]))
    other = compose(ORIGIN if grip.target is None else poses[grip.target], (spec.other_place[0], spec.other_turn[0]))
    relative = quat.multiply(quat.inverse(other[1]), own[1])
    relative = -relative if relative[0] < 0.0 else relative
    position = 0.0
    if spec.kind == "hinge":
        position = 2.0 * float(np.arctan2(relative[3], relative[0]))
    elif spec.kind == "slider":
        position = float(quat.rotate(quat.inverse(other[1]), own[0] - other[0])[2])
    drives = dict(zip(DRIVES, spec.drives[0].tolist(), strict=True))
    limits = (drives["lower"], drives["upper"]) if np.isfinite(drives["upper"]) else None
    spring = motor = None
    if drives["spring"] or drives["spring_damping"]:
        spring = Spring(drives["spring"], drives["rest"], drives["spring_damping"])
    if drives["max_effort"]:
        stiffness, damping = drives["stiffness"], drives["damping"]
        motor = Motor(
            drives["velocity"], drives["position"] if stiffness > 0.0 else None, stiffness,
            damping if np.isfinite(damping) else None, drives["max_effort"],
        )  # fmt: skip
    if spec.kind == "ball" and (limits or spring) and np.linalg.norm(relative[1:]) > 1e-6:
        scene.note("the cone and spring of a ball joint are saved from where it is now", body)
    axis = quat.rotate(own[1] if spec.kind == "ball" else other[1], np.array([0.0, 0.0, 1.0]))
    return SceneJoint(
        _free_name(scene, spec.kind, body, target), spec.kind, body, target, own[0], axis, position, limits,
        drives["friction"], motor, spring, float(spec.max_force[0]), grip.target is None or not spec.ignored,
    )  # fmt: skip
