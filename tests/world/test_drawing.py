"""What is drawn of a body in each mode."""

import numpy as np
import pytest

import nuno
from nuno import InvalidInputError
from nuno.mesh.tetrahedra import volumes


def enclosed(vertices, triangles):
    """Return the volume inside triangles that look outwards."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.einsum("fx,fx->", a, np.cross(b, c)) / 6.0


def test_surface():
    """The skin, each of its edges once: a closed surface has three edges for two faces."""
    body = nuno.soft_sphere(0.1, 0.05, position=(1, 0, 0))
    drawn = nuno.draw(body)
    np.testing.assert_array_equal(drawn.vertices, body.skin()[0])
    np.testing.assert_array_equal(drawn.triangles, body.skin()[1])
    assert 2 * len(drawn.segments) == 3 * len(drawn.triangles)
    assert drawn.elements is None


def test_wireframe():
    """The edges of what moves: of a sheet of 3x2 cells its 27, of a soft box those of its boundary."""
    sheet = nuno.draw(nuno.sheet((0.3, 0.2), (3, 2)), "wireframe")
    assert len(sheet.segments) == 3 * 3 + 2 * 4 + 3 * 2 and len(sheet.triangles) == 0
    body = nuno.soft_box((1, 1, 1), (2, 2, 2))
    drawn = nuno.draw(body, "wireframe")
    assert len(drawn.segments) == 3 * len(body.faces) // 2
    ends = body.vertices[drawn.segments]
    assert (np.abs(ends).max(axis=2) == 0.5).all()  # nothing of the inside
    assert len(np.unique(np.sort(drawn.segments, axis=1), axis=0)) == len(drawn.segments)


def test_exploded():
    """Elements keep shape and size; their middles go apart from the body's by the factor."""
    body = nuno.soft_box((0.2, 0.2, 0.3), (2, 2, 3), position=(1, 2, 3))
    made = body.shape.tetrahedra()
    drawn = nuno.draw(body, "tetrahedra", explode=2.0)
    assert drawn.vertices.shape == (4 * 60, 3) and drawn.triangles.shape == (4 * 60, 3)
    own = np.arange(240).reshape(60, 4)
    np.testing.assert_allclose(volumes(drawn.vertices, own), volumes(made.vertices, made.tets), rtol=1e-9)
    before, after = body.vertices[made.tets].mean(axis=1), drawn.vertices[own].mean(axis=1)
    np.testing.assert_allclose(after - body.position, 2.0 * (before - body.position), atol=1e-12)
    # every element is a closed surface by itself, with its own number
    for element in (0, 17, 59):
        volume = enclosed(drawn.vertices, drawn.triangles[drawn.elements == element])
        assert volume == pytest.approx(volumes(made.vertices, made.tets)[element], rel=1e-9)
    assert len(drawn.segments) == 6 * 60


def test_a_factor_of_one_leaves_all_in_place():
    """Not exploded, the elements fill the box."""
    body = nuno.soft_box((1, 1, 1), (2, 2, 2))
    drawn = nuno.draw(body, "tetrahedra", explode=1.0)
    np.testing.assert_allclose(drawn.vertices.reshape(-1, 4, 3), body.vertices[body.shape.tetrahedra().tets])


def test_sliced():
    """Half of the box is left, closed, with the elements along the cut to be seen."""
    body = nuno.soft_box((1, 1, 1), (4, 4, 4), position=(3, 0, 0))
    made = body.shape.tetrahedra()
    drawn = nuno.draw(body, "tetrahedra", slice_at=((0, 0, 0), (2, 0, 0)))
    assert enclosed(drawn.vertices, drawn.triangles) == pytest.approx(0.5)  # the plane is one of the lattice's
    assert drawn.vertices[np.unique(drawn.triangles)][:, 0].max() == pytest.approx(3.0)
    # every triangle is a face of the element that it names
    for triangle, element in zip(drawn.triangles, drawn.elements, strict=True):
        assert set(triangle) <= set(made.tets[element])


def test_a_slice_moves_with_the_body():
    """The plane is the shape's own, at rest: turned and moved, the same elements are shown."""
    body = nuno.soft_sphere(0.1, 0.03)
    plane = ((0, 0, 0.01), (0, 0.5, 1.0))
    before = nuno.draw(body, "tetrahedra", slice_at=plane)
    body.locate((1, 2, 3)).rotate(1.0, "y")
    after = nuno.draw(body, "tetrahedra", slice_at=plane)
    np.testing.assert_array_equal(before.triangles, after.triangles)
    np.testing.assert_array_equal(before.elements, after.elements)


def test_batches():
    """In a batch every mode has the vertices of every world."""
    world = nuno.World(device="cpu")
    world.add(nuno.soft_box((1, 1, 1), (2, 2, 2), name="box"))
    box = world.imagine(3).find("box")
    box.locate(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    for options in ({}, {"mode": "wireframe"}, {"mode": "tetrahedra"}):
        vertices = nuno.draw(box, **options).vertices
        np.testing.assert_allclose(vertices[2], vertices[0] + (2, 0, 0), atol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "points"}, '"surface", "wireframe" or "tetrahedra"'),
        ({"mode": "tetrahedra", "explode": 0.5}, "explode must be >= 1"),
        ({"mode": "tetrahedra", "slice_at": ((0, 0, 0), (0, 0, 0))}, "not zero"),
        ({"mode": "tetrahedra", "slice_at": ((0, 0, -9), (0, 0, 1))}, "no tetrahedron lies behind"),
        ({"mode": "tetrahedra", "slice_at": ((0, 0), (0, 0, 1))}, r"slice_at\[0\] must have shape"),
    ],
)
def test_wrong_input(options, message):
    """Unknown modes and planes that are none are named."""
    with pytest.raises(InvalidInputError, match=message):
        nuno.draw(nuno.soft_box((1, 1, 1), (1, 1, 1)), **options)


def test_only_soft_bodies_have_tetrahedra():
    """A rigid box has none to draw."""
    with pytest.raises(InvalidInputError, match="'box' is a box"):
        nuno.draw(nuno.box((1, 1, 1)), "tetrahedra")
