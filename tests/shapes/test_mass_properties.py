"""Volume, centre of mass and inertia: closed forms, and trimesh's integrals."""

import numpy as np
import pytest
import trimesh

from nuno.errors import MeshError
from nuno.shapes.compound import Compound
from nuno.shapes.mass_properties import mass_properties
from nuno.shapes.shape import Box, Capsule, Cylinder, Plane, Sheet, Sphere, TriangleMesh


@pytest.mark.parametrize(
    ("shape", "mesh", "off"),
    [
        (Box((0.1, 0.2, 0.3)), trimesh.creation.box((0.1, 0.2, 0.3)), 1e-12),
        # polygons of 128 and 256 sides lose (2 pi / n)^2 / 6 of the area
        (Cylinder(0.1, 0.3), trimesh.creation.cylinder(0.1, 0.3, sections=256), 5e-4),
        (Capsule(0.1, 0.3), trimesh.creation.capsule(0.3, 0.1, count=(128, 128)), 2e-3),
        (Sphere(0.1), trimesh.creation.icosphere(5, 0.1), 2e-3),
    ],
    ids=["box", "cylinder", "capsule", "sphere"],
)
def test_primitives_weigh_what_their_triangles_enclose(shape, mesh, off):
    """Trimesh's surface integrals of a fine mesh of the same shape."""
    found = mass_properties(shape)
    assert found.volume == pytest.approx(mesh.volume, rel=off)
    np.testing.assert_allclose(found.centre, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diag(found.inertia), np.diag(mesh.moment_inertia), rtol=off)


def test_a_mesh_has_its_centre_where_its_volume_has():
    """Closed form: a tetrahedron's is the mean of its corners, a sixth of the box its volume."""
    corners = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    shape = TriangleMesh(corners, faces)
    found = mass_properties(shape)
    assert found.volume == pytest.approx(0.3 * 0.2 * 0.1 / 6)
    np.testing.assert_allclose(found.centre, 0.0, atol=1e-12)  # in the shape's frame, which starts at that mean


def test_a_compound_is_the_sum_of_its_parts():
    """Closed form: two halves of a box, one of them turned by a quarter, are the box."""
    quarter = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    halves = Compound(((Box((0.1, 0.2, 0.3)), (-0.05, 0, 0)), (Box((0.2, 0.1, 0.3)), (0.05, 0, 0), quarter)))
    whole = mass_properties(Box((0.2, 0.2, 0.3)))
    found = mass_properties(halves)
    assert found.volume == pytest.approx(whole.volume)
    np.testing.assert_allclose(found.centre, 0.0, atol=1e-15)
    np.testing.assert_allclose(found.inertia, whole.inertia, atol=1e-15)


def test_a_sheet_is_a_thin_box():
    """Closed form: a flat sheet with a thickness weighs and turns as the box that it fills."""
    found = mass_properties(Sheet((0.4, 0.2), (8, 4)), thickness=0.01)
    box = mass_properties(Box((0.4, 0.2, 0.01)))
    assert found.volume == pytest.approx(box.volume)
    np.testing.assert_allclose(found.inertia, box.inertia, atol=1e-15)


def test_what_has_no_mass_is_refused():
    """A plane, and a sheet without thickness."""
    with pytest.raises(MeshError, match="endless"):
        mass_properties(Plane())
    with pytest.raises(MeshError, match="thickness"):
        mass_properties(Sheet((0.4, 0.2), (8, 4)))
