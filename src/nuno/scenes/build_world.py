"""Scenes into worlds: a description's bodies, joints and grips are added to a world."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import NunoError
from nuno.joints.grip import Grip
from nuno.joints.joint import Joint
from nuno.materials import Cloth, Rigid, Soft
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneGrip, SceneJoint
from nuno.world.make_joints import ball_joint, fixed_joint, hinge, slider
from nuno.world.world import World

SAME = 1e-12
"""[m] Vertices this near to those of the undeformed shape are where it has them."""


def build_world(scene: SceneDescription, world: World) -> tuple[dict[str, Body], dict[str, Joint], list[Grip]]:
    """Add a scene to a world; where that fails, nothing of it stays there.

    Returns:
        Bodies and joints by their names in the scene, and grips.
    """
    bodies: dict[str, Body] = {}
    with world.lock:
        try:
            for described in scene.bodies:
                bodies[described.name] = world.add(_body(described))
                _start(world, bodies[described.name], described)
            for a, b in scene.ignored:
                world.ignore_contact(bodies[a], bodies[b])
            for a, b, mu in scene.pair_friction:
                world.set_friction(bodies[a], bodies[b], mu)
            joints = {joint.name: _join(joint, bodies) for joint in scene.joints}
            grips = [_grip(world, grip, bodies) for grip in scene.grips]
        except BaseException:
            for body in bodies.values():
                with suppress(NunoError):
                    world.remove(body)
            raise
    return bodies, joints, grips


def _body(described: SceneBody) -> Body:
    return Body(
        described.shape, name=described.name, position=described.position, quaternion=described.quaternion,
        color=described.color, friction=described.friction, group=described.group,
        collides_with=described.collides_with,
    )  # fmt: skip


def _start(world: World, body: Body, described: SceneBody) -> None:
    """Give a body the dynamics and the shape that it has now."""
    material = described.material
    if not described.deforms:
        if material is not None:
            world.attach(
                body, material, velocity=described.velocity, angular_velocity=described.angular_velocity
            )  # fmt: skip
        return
    vertices = described.vertices
    bent = vertices is not None and np.abs(body.vertices - vertices).max() > SAME
    passing: Any = material
    if material is None:
        if not bent and (body.shape.is_soft or described.thickness in (0.0, body.thickness)):
            return
        thin = described.thickness or float(Cloth.thickness)
        friction = described.friction
        passing = Cloth(thickness=thin, friction=friction) if body.shape.is_cloth else Soft(friction=friction)
    world.attach(body, passing)
    if vertices is not None and (bent or described.velocities is not None):
        world.set_vertices(body, vertices if bent else body.vertices, described.velocities)
    if material is None:
        world.detach(body)


def _join(joint: SceneJoint, bodies: dict[str, Body]) -> Joint:
    a, b = bodies[joint.body], None if joint.other is None else bodies[joint.other]
    given: dict[str, Any] = {"max_force": joint.max_force, "contact": joint.contact}
    if joint.kind == "fixed":
        return fixed_joint(a, b, **given)
    given |= {"friction": joint.friction, "spring": joint.spring, "point": joint.point, "axis": joint.axis}
    if joint.kind == "ball":
        return ball_joint(a, b, limit=None if joint.limits is None else joint.limits[1], **given)
    given |= {"limits": joint.limits, "motor": joint.motor}
    if joint.kind == "slider":
        return slider(a, b, position=joint.position, **given)
    return hinge(a, b, position=float(np.clip(joint.position, -np.pi, np.pi)), **given)


def _grip(world: World, grip: SceneGrip, bodies: dict[str, Body]) -> Grip:
    body, vertices = bodies[grip.body], np.asarray(grip.vertices)
    places = body.vertices[..., vertices, :]
    to: Any = places.mean(axis=-2) if grip.to is None else bodies[grip.to]
    return world.grip(body, vertices, to=to, compliance=grip.compliance, max_force=grip.max_force)


def is_rigid(body: SceneBody) -> bool:
    """Return True if a body moves as a rigid one."""
    return isinstance(body.material, Rigid)
