"""Body parts: the convex parts of a body, and their mass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nuno.dynamics.static_place import one_shape
from nuno.materials import Rigid
from nuno.rigid.convex_parts import RigidPart, rigid_shape
from nuno.shapes.mass_properties import mass_properties

if TYPE_CHECKING:
    from nuno.bodies.body import Body


def parts_of(body: Body, *, moves: bool) -> tuple[RigidPart, ...]:
    """Return the parts of a body in its own frame, in the shape that it has now."""
    from nuno.shapes.compound import Compound

    plain = body.shape.formula is not None or isinstance(body.shape, Compound)
    # the same bits wherever the body is
    vertices = None if plain and body._deformed is None else body.local_vertices()
    if moves and body._deformed is not None:
        vertices = one_shape(body)
    return rigid_shape(body.shape, moves=moves, thickness=body.thickness, vertices=vertices, is_solid=body.is_solid)


def mass_of(body: Body, material: Rigid, density: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass (worlds,), inertia (worlds, 3, 3) about the centre of mass, and that (3,)."""
    if material.mass is not None and material.inertia is not None and material.centre_of_mass is not None:
        mass = np.broadcast_to(np.asarray(material.mass, dtype=float), density.shape)
        return mass, np.broadcast_to(material.inertia, (len(mass), 3, 3)), np.asarray(material.centre_of_mass)
    vertices = one_shape(body) if body._deformed is not None else None
    unit = mass_properties(body.shape, thickness=body.thickness, vertices=vertices)
    mass = density * unit.volume
    inertia = density[:, None, None] * unit.inertia
    if material.mass is not None:
        given = np.broadcast_to(np.asarray(material.mass, dtype=float), mass.shape)
        inertia, mass = inertia * (given / mass)[:, None, None], given
    if material.inertia is not None:
        inertia = np.broadcast_to(material.inertia, inertia.shape)
    centre = unit.centre if material.centre_of_mass is None else np.asarray(material.centre_of_mass)
    return mass, inertia, centre
