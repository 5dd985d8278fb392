"""Cloth as other programs have it: a plate of an even, isotropic solid, in place of stretch, shear and bending apart.

A plate of thickness t, Young's modulus E and Poisson ratio nu has the stretch stiffness E t, the shear stiffness
E t / (2 (1 + nu)) and the bending rigidity E t^3 / (12 (1 - nu^2)) (Timoshenko and Woinowsky-Krieger, "Theory of Plates
and Shells", 1959). Three numbers make three: exactly so where nu comes to 0 to `MOST`, with the nearest one elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.materials import Cloth

MOST = 0.49
"""The largest Poisson ratio that is written: at 0.5 a solid keeps its volume, and stiffnesses become infinite."""
THINNEST = 1e-5
"""[m] A plate of less is taken for one that does not resist bending."""


@dataclass(frozen=True)
class Plate:
    """A plate that stretches and bends as a cloth does.

    Attributes:
        youngs_modulus: [Pa].
        poisson_ratio: Of its material.
        thickness: [m], of the plate; not the cloth's contact thickness.
        exact: Whether shear is the cloth's too.
    """

    youngs_modulus: float
    poisson_ratio: float
    thickness: float
    exact: bool


def plate_of(material: Cloth, stiffer: float = 1.0) -> Plate:
    """Return the plate of a cloth; of one with several values, that of their means.

    Args:
        material: The cloth.
        stiffer: By what its bending is multiplied, to make up for what a mesh of triangles lacks.
    """
    stretch, shear, bending = (
        mean_of(value) for value in (material.stretch_stiffness, material.shear_stiffness, material.bending_rigidity)
    )
    wanted = 0.5 * stretch / shear - 1.0
    ratio = float(np.clip(wanted, 0.0, MOST))
    same = all(
        np.ptp(np.ravel(value)) == 0.0
        for value in (material.stretch_stiffness, material.bending_rigidity, material.area_density)
    )
    thickness = max(float(np.sqrt(12.0 * (1.0 - ratio**2) * stiffer * bending / stretch)), THINNEST)
    return Plate(stretch / thickness, ratio, thickness, bool(same and abs(wanted - ratio) < 1e-9))


def cloth_of(plate: Plate, *, area_density: float, friction: float, thickness: float, damping: float = 0.0) -> Cloth:
    """Return the cloth that stretches and bends as a plate does.

    Args:
        plate: The plate.
        area_density: [kg/m2].
        friction: Coulomb's coefficient.
        thickness: Contact thickness [m].
        damping: Time constant of the internal damping [s].
    """
    modulus, ratio, deep = plate.youngs_modulus, plate.poisson_ratio, plate.thickness
    return Cloth(
        area_density=area_density, stretch_stiffness=modulus * deep,
        shear_stiffness=modulus * deep / (2.0 * (1.0 + ratio)),
        bending_rigidity=modulus * deep**3 / (12.0 * (1.0 - ratio**2)), thickness=thickness, friction=friction,
        damping=damping,
    )  # fmt: skip


def mean_of(value: Any) -> float:
    """Return the mean of a material's value, over elements and directions."""
    return float(np.mean(np.ravel(value)))
