"""Cloth as an isotropic plate and back."""

import pytest

import nuno
from nuno.scenes.cloth_elasticity import MOST, cloth_of, plate_of


def test_a_plate_has_the_cloths_stretch_shear_and_bending():
    """Three numbers make three, where Poisson's ratio comes to what a solid can have."""
    cloth = nuno.Cloth(stretch_stiffness=800.0, shear_stiffness=320.0, bending_rigidity=2e-4, area_density=0.3)
    plate = plate_of(cloth)
    assert plate.exact and plate.poisson_ratio == pytest.approx(800.0 / 640.0 - 1.0)
    again = cloth_of(plate, area_density=0.3, friction=0.5, thickness=0.004)
    for name in ("stretch_stiffness", "shear_stiffness", "bending_rigidity", "area_density"):
        assert getattr(again, name) == pytest.approx(getattr(cloth, name), rel=1e-12)


def test_a_cloth_that_no_plate_is_keeps_stretch_and_bending():
    """A towel shears too easily for an isotropic solid, and denim has two directions: the nearest plate."""
    for cloth, stretch, bending in (
        (nuno.Cloth(), 1000.0, 5e-5), (nuno.Cloth.preset("denim"), 1000.0, 0.5 * (64e-6 + 97e-6)),
    ):  # fmt: skip
        plate = plate_of(cloth)
        assert not plate.exact and plate.poisson_ratio == MOST
        again = cloth_of(plate, area_density=0.3, friction=0.5, thickness=0.004)
        assert (again.stretch_stiffness, again.bending_rigidity) == pytest.approx((stretch, bending), rel=1e-12)
