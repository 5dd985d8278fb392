"""Five tetrahedra per voxel: they fill the box, face to face."""

import numpy as np
import pytest

from matching import inner_faces_match
from nuno.mesh.tetrahedra import FACES, FIVE, boundary_faces, box_tetrahedra, volumes

CELLS = [(1, 1, 1), (2, 1, 1), (1, 3, 2), (3, 4, 5)]


@pytest.mark.parametrize("cells", CELLS)
def test_they_fill_the_box(cells):
    """All have a positive volume, a sixth or a third of their voxel; together they are the box."""
    size = (0.2, 0.3, 0.4)
    vertices, tets = box_tetrahedra(size, cells)
    volume = volumes(vertices, tets) / (np.prod(size) / np.prod(cells))
    # of float64, a few roundings
    np.testing.assert_allclose(
        np.sort(volume.reshape(-1, 5), axis=1)[0], [1 / 6, 1 / 6, 1 / 6, 1 / 6, 1 / 3], rtol=1e-12
    )
    assert volume.min() > 0.16
    np.testing.assert_allclose(volume.reshape(-1, 5).sum(axis=1), 1.0, rtol=1e-12)
    assert tets.dtype == np.int32 and vertices.dtype == np.float64


@pytest.mark.parametrize("cells", CELLS)
def test_inner_faces_belong_to_two(cells):
    """Every face is one of the boundary's, or two elements see it from its two sides."""
    vertices, tets = box_tetrahedra((1.0, 1.0, 1.0), cells)
    assert inner_faces_match(tets)
    faces = boundary_faces(tets)
    nx, ny, nz = cells
    assert len(faces) == 4 * (nx * ny + ny * nz + nz * nx)
    # all of them lie on the box
    on = np.abs(vertices[faces])
    assert (np.isclose(on, 0.5).all(axis=1).any(axis=1)).all()


def test_without_alternation_faces_would_not_match():
    """The check finds voxels that are all even: the diagonals of a common face cross."""
    corner = np.arange(8)
    offset = (corner & 1) + 3 * (corner >> 1 & 1) + 6 * (corner >> 2)
    tets = np.concatenate([offset[FIVE[0]], offset[FIVE[0]] + 1])
    assert len(boundary_faces(tets)) == 24  # of the 20 that a box of two voxels has, and the two crossed pairs


def test_boundary_looks_outwards():
    """The boundary encloses the box's volume, with the sign of faces seen counterclockwise from outside."""
    vertices, tets = box_tetrahedra((0.2, 0.3, 0.4), (2, 3, 4))
    a, b, c = (vertices[boundary_faces(tets)[:, k]] for k in range(3))
    assert np.einsum("fx,fx->", a, np.cross(b, c)) / 6.0 == pytest.approx(0.024, rel=1e-12)


def test_vertices_are_a_lattice_x_fastest():
    """Vertex (i, j, k) is at the documented index and place."""
    vertices, _ = box_tetrahedra((2.0, 4.0, 6.0), (2, 2, 3))
    np.testing.assert_allclose(vertices[(2 * 3 + 1) * 3 + 2], (1.0, 0.0, 1.0), atol=1e-15)
    np.testing.assert_allclose(vertices[1] - vertices[0], (1.0, 0.0, 0.0))


def test_faces_of_an_element_look_outwards():
    """The table of faces, on the tetrahedron of the axes: each face's normal points away from the fourth corner."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    for face in FACES:
        a, b, c = corners[face]
        fourth = corners[(set(range(4)) - set(face.tolist())).pop()]
        assert np.cross(b - a, c - a) @ (fourth - a) < 0.0


def test_inside_out_is_negative():
    """An element with two corners swapped has the opposite volume."""
    vertices, tets = box_tetrahedra((1.0, 1.0, 1.0), (1, 1, 1))
    np.testing.assert_allclose(volumes(vertices, tets[:, [0, 2, 1, 3]]), -volumes(vertices, tets))
    assert not inner_faces_match(np.concatenate([tets, tets[:1]]))
