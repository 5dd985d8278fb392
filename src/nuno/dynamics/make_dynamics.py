"""Making dynamics of a body: by its material, from a saved state or at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import Dynamics, ParticleDynamics, State
from nuno.materials import Material, Rigid
from nuno.mesh.memory_limit import CLOTH_BYTES, check_host_memory
from nuno.shapes.shape import LARGE

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.dynamics.rigid_dynamics import RigidWorld


def make_dynamics(body: Body, material: Material, state: State, friction: Any, world: RigidWorld) -> Dynamics:
    """Return dynamics for a body, to be loaded with a state that dynamics of its kind gave.

    Raises:
        InvalidInputError: the shape has no such dynamics, or the material does not fit the shape or the batch.
    """
    if isinstance(material, Rigid):
        from nuno.dynamics.rigid_dynamics import RigidDynamics

        return RigidDynamics(body, material, friction, world, state)
    return ParticleDynamics(body.shape, material, state["local"], None, friction, world)


def start_dynamics(body: Body, material: Any, world: RigidWorld) -> Dynamics:
    """Return dynamics for a static body in the shape that it has now, at rest.

    Raises:
        InvalidInputError: the shape has no such dynamics, or the material does not fit the shape or the batch.
    """
    if isinstance(material, Rigid):
        from nuno.dynamics.rigid_dynamics import RigidDynamics

        return RigidDynamics(body, material, material.friction, world)
    n = len(body.shape.mesh()[0])
    if body.shape.is_cloth and n > LARGE:
        check_host_memory(f"a cloth of {n} vertices", CLOTH_BYTES * n)
    vertices = body._vertices()
    positions = np.broadcast_to(vertices, (world.world_count, *vertices.shape[-2:]))
    still = np.broadcast_to(np.zeros(3), positions.shape)
    return ParticleDynamics(body.shape, material, positions, still, material.friction, world)
