"""Bodies that several shapes make, and stand-ins for those that have none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nuno.materials import Rigid
from nuno.scenes.scene_description import SceneBody
from nuno.shapes import quaternion as quat
from nuno.shapes.compound import Compound
from nuno.shapes.coordinates import compose
from nuno.shapes.mass_properties import MassProperties
from nuno.shapes.shape import Shape, Sphere

BARE = 0.01
"""[m] Radius of what stands for a body without a shape; it touches nothing."""
MIN_MOMENT = 1e-9
"""[kg m2] Moments of inertia below this are those of a point, which no solver turns."""


def whole_body(
    body: SceneBody, shapes: list[tuple[Shape, np.ndarray, np.ndarray]], mass: MassProperties | None
) -> SceneBody:
    """Give a body its shapes and its mass: one shape takes the body's frame along, several make a compound.

    Args:
        body: With its pose, and a material where it moves.
        shapes: Each with its place and turn in the body's frame.
        mass: In the body's frame, the mass in the place of the volume; None of what is static.
    """
    frame = (np.zeros(3), quat.IDENTITY)
    if len(shapes) == 1:
        body.shape, *frame_parts = shapes[0]
        frame = (frame_parts[0], frame_parts[1])
        body.position, body.quaternion = compose((body.position, body.quaternion), frame)
    else:
        body.shape = Compound(tuple((shape, tuple(place), tuple(turn)) for shape, place, turn in shapes))
    if mass is not None:
        back = quat.inverse(frame[1])
        moved = mass.turned(back, quat.rotate(back, -frame[0]))
        material: Any = body.material
        body.material = replace(
            material, mass=moved.volume, inertia=possible(moved.inertia, moved.volume), centre_of_mass=moved.centre
        )
    return body


def possible(inertia: np.ndarray, mass: float) -> np.ndarray:
    """Return the inertia (3, 3) [kg m2] nearest to a given one that a mass [kg] can have."""
    symmetric = 0.5 * (inertia + inertia.T)
    moments, axes = np.linalg.eigh(symmetric)
    raised = np.maximum(moments, max(MIN_MOMENT, 1e-8 * mass))
    raised[2] = min(raised[2], raised[0] + raised[1])
    return symmetric if np.array_equal(raised, moments) else axes @ np.diag(raised) @ axes.T


SHARE = 0.01
"""Of a body's mass and inertia, what a body between two of its joints takes."""


def split_off(body: SceneBody, name: str, position: np.ndarray) -> SceneBody:
    """Return a small body that stands between two joints of a body, whose mass it takes a share of."""
    material: Any = body.material
    mass, inertia = float(material.mass), np.asarray(material.inertia)
    greatest = float(np.linalg.eigvalsh(inertia)[2])
    body.material = replace(material, mass=(1.0 - SHARE) * mass, inertia=(1.0 - SHARE) * inertia)
    return bare_body(name, position, SHARE * mass, SHARE * greatest)


def bare_body(name: str, position: np.ndarray, mass: float, moment: float) -> SceneBody:
    """Return a small ball without contact, which stands between two joints of one body.

    Args:
        name: Its name.
        position: (3,) [m].
        mass: [kg].
        moment: Of inertia, about every axis [kg m2].
    """
    material = Rigid(mass=mass, inertia=max(moment, MIN_MOMENT) * np.eye(3), centre_of_mass=np.zeros(3))
    return SceneBody(name, Sphere(BARE), position, quat.IDENTITY.copy(), material, group=0, collides_with=0)
