"""Making dynamics of a body: by its material, from a saved state or at rest."""

from __future__ import annotations

import logging
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import Dynamics, ParticleDynamics, State
from nuno.materials import Material, Rigid
from nuno.mesh.memory_limit import CLOTH_BYTES, check_host_memory
from nuno.shapes.shape import LARGE, Shape, TriangleMesh

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.dynamics.rigid_dynamics import RigidWorld

HOLLOW = 1.25
"""Ratio of a hull's volume to its mesh's from which a moving mesh is said to be touched as its hull."""

_log = logging.getLogger(__name__)
_warned_of: weakref.WeakSet[Shape] = weakref.WeakSet()


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

        dynamics = RigidDynamics(body, material, material.friction, world)
        _warn_of_hull(body)
        return dynamics
    n = len(body.shape.mesh()[0])
    if body.shape.is_cloth and n > LARGE:
        check_host_memory(f"a cloth of {n} vertices", CLOTH_BYTES * n)
    vertices = body._vertices()
    positions = np.broadcast_to(vertices, (world.world_count, *vertices.shape[-2:]))
    still = np.broadcast_to(np.zeros(3), positions.shape)
    return ParticleDynamics(body.shape, material, positions, still, material.friction, world)


def _warn_of_hull(body: Body) -> None:
    """Tell once of a closed mesh that moves and whose hull fills much that the mesh leaves free, such as a bowl."""
    shape = body.shape
    if type(shape) is not TriangleMesh or shape in _warned_of or not shape.is_solid:
        return
    import trimesh

    _warned_of.add(shape)
    mesh = trimesh.Trimesh(*shape.mesh(), process=False)
    filled = mesh.convex_hull.volume / mesh.volume
    if filled >= HOLLOW:
        _log.warning(
            "%r is touched as its convex hull while it is rigid and dynamic, which has %.3g times its volume: what is "
            "in it or through it is pushed out. nuno.compound of convex parts, such as nuno.Box or nuno.Hull, leaves "
            "its hollows free", body.name, filled,
        )  # fmt: skip
