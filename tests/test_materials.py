"""Materials: checks, values by world and by element, presets."""

import numpy as np
import pytest

from nuno import Cloth, InvalidInputError, Rigid, Soft, UnknownNameError


def test_resolved_broadcasts_to_worlds_and_elements():
    """Scalars become (worlds, 1), values by element (worlds, elements), pairs warp and weft."""
    cloth = Cloth(
        area_density=[0.1, 0.2],
        stretch_stiffness=(100.0, np.arange(1.0, 6.0)),
        bending_rigidity=np.full((2, 5), 1e-4),
    )
    got = cloth.resolved(2, 5)
    assert all(array.dtype == np.float32 for array in got.values())
    np.testing.assert_array_equal(got["area_density"], np.float32([[0.1], [0.2]]))
    assert got["stretch_stiffness_warp"].shape == (2, 1)
    np.testing.assert_array_equal(got["stretch_stiffness_weft"], [[1, 2, 3, 4, 5]] * 2)
    assert got["bending_rigidity_warp"].shape == got["bending_rigidity_weft"].shape == (2, 5)
    assert got["thickness"].shape == (2, 1)


def test_resolved_names_what_fits():
    """An array that fits neither worlds nor elements is refused with the shapes that do."""
    with pytest.raises(InvalidInputError, match=r"shear_stiffness.*\(2,\).*\(5,\).*got an array of shape \(3,\)"):
        Cloth(shear_stiffness=[1.0, 2.0, 3.0]).resolved(2, 5)
    with pytest.raises(InvalidInputError, match="thickness"):
        Cloth(thickness=np.full(5, 1e-3)).resolved(2, 5)


def test_one_world_of_a_batch():
    """Picking a world keeps its own values only."""
    cloth = Cloth(area_density=[0.1, 0.2], bending_rigidity=(np.full((2, 5), 1e-4), 3e-5)).of_world(1, 2)
    assert cloth.area_density == 0.2
    assert cloth.bending_rigidity[0].shape == (5,) and cloth.bending_rigidity[1] == 3e-5


@pytest.mark.parametrize(
    "values",
    [
        {"area_density": 0.0},
        {"thickness": -0.001},
        {"stretch_stiffness": np.nan},
        {"stretch_stiffness": (100.0, 0.0)},
        {"bending_rigidity": (1e-5, 1e-5, 1e-5)},
        {"friction": -0.1},
        {"damping": np.inf},
        {"shear_stiffness": "soft"},
        {"air_drag": [[1.0]]},
    ],
)
def test_bad_values(values):
    """Every bad value is named."""
    with pytest.raises(InvalidInputError, match=next(iter(values))):
        Cloth(**values)


@pytest.mark.parametrize(
    ("name", "density", "warp", "weft"),
    [
        ("denim", 0.324, 64e-6, 97e-6),
        ("interlock", 0.187, 23e-6, 14e-6),
        ("tablecloth", 0.128, 52e-6, 31e-6),
        ("blanket", 0.228, 117e-6, 60e-6),
        ("trousers", 0.220, 125e-6, 125e-6),
    ],
)
def test_measured_fabrics(name, density, warp, weft):
    """As Wang, Ramamoorthi and O'Brien (2011) measured them: area density, and the first and last of three angles."""
    fabric = Cloth.preset(name)
    assert fabric.area_density == density
    np.testing.assert_allclose(fabric.bending_rigidity, (warp, weft), rtol=1e-12)


def test_presets():
    """The towel is the default; an unknown name lists the valid ones."""
    assert Cloth.preset("towel").same_as(Cloth())
    with pytest.raises(UnknownNameError, match="tablecloth"):
        Cloth.preset("silk")


@pytest.mark.parametrize(
    "kind, values",
    [
        (Soft, {"density": 0.0}),
        (Soft, {"poisson_ratio": 0.5}),
        (Soft, {"poisson_ratio": [0.3, 0.6]}),
        (Soft, {"youngs_modulus": -1.0}),
        (Rigid, {"mass": 0.0}),
        (Rigid, {"restitution": 1.5}),
        (Rigid, {"inertia": np.diag([1.0, 1.0, 3.0])}),
        (Rigid, {"inertia": [1.0, 1.0, 1.0]}),
        (Rigid, {"density": [[1.0]]}),
        (Rigid, {"mass": 1.0, "density": 2.0}),
        (Rigid, {"mass": [1.0, 2.0], "density": [1000.0, 2.0]}),
    ],
)
def test_bad_values_of_solids(kind, values):
    """Every bad value of a soft or rigid material is named; an inertia that no mass has, a mass and a density, too."""
    with pytest.raises(InvalidInputError, match=next(iter(values))):
        kind(**values)


def test_soft_and_rigid_resolve():
    """Soft solids take values by tetrahedron, rigid ones by world only."""
    soft = Soft(youngs_modulus=np.arange(1.0, 6.0), damping=[0.1, 0.2]).resolved(2, 5)
    assert soft["youngs_modulus"].shape == (2, 5) and soft["damping"].shape == (2, 1)
    assert Soft.preset("sponge").density == 30.0
    rigid = Rigid(mass=[1.0, 2.0])
    assert rigid.resolved(2)["restitution"].shape == rigid.resolved(2)["air_drag"].shape == (2, 1)
    assert rigid.of_world(1, 2).mass == 2.0 and rigid.inertia is None
    tensor, centre = np.diag([1.0, 1.0, 2.0]), (0.1, 0.0, 0.2)
    one = Rigid(mass=[1.0, 2.0, 3.0], inertia=tensor, centre_of_mass=centre).of_world(1, 3)
    np.testing.assert_array_equal(one.inertia, tensor)
    np.testing.assert_array_equal(one.centre_of_mass, centre)
    assert Rigid(inertia=np.diag([1.0, 1.0, 2.0])).same_as(Rigid(inertia=np.diag([1.0, 1.0, 2.0])))
    assert not Rigid().same_as(Soft())
