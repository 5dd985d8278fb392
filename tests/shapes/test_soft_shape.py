"""Soft shapes and their bodies, before anything makes them move."""

import json
import sys

import numpy as np
import pytest
import trimesh

import nuno
from matching import inner_faces_match
from nuno import InvalidInputError, MeshError, MissingPackageError
from nuno.mesh.tetrahedra import boundary_faces, volumes

CUBE = trimesh.creation.box((0.2, 0.2, 0.2))
ROUND = {
    "sphere": (lambda: nuno.soft_sphere(0.1, 0.025), 4 / 3 * np.pi * 0.1**3),
    "cylinder": (lambda: nuno.soft_cylinder(0.1, 0.3, 0.04), np.pi * 0.1**2 * 0.3),
    "capsule": (lambda: nuno.soft_capsule(0.05, 0.2, 0.025), np.pi * 0.05**2 * 0.2 + 4 / 3 * np.pi * 0.05**3),
}


def every_kind():
    """One body of each kind."""
    points, tets = tetrahedron()
    return [
        nuno.soft_box((0.1, 0.2, 0.3), (2, 3, 4)), nuno.soft_mesh(CUBE, 0.1), nuno.soft_tetrahedra(points, tets),
        *(make() for make, _ in ROUND.values()),
    ]  # fmt: skip


def tetrahedron():
    """The tetrahedron of the axes, away from the origin."""
    return np.array([[1, 0, 0], [2, 0, 0], [1, 1, 0], [1, 0, 1]], dtype=float), np.array([[0, 1, 2, 3]])


@pytest.mark.long
def test_vertices_are_those_of_the_tetrahedra():
    """``vertices`` are all that move, ``faces`` their boundary; the position is their mean."""
    for body in every_kind():
        made = body.shape.tetrahedra()
        assert body.shape.is_soft and not body.shape.is_cloth and body.is_solid
        np.testing.assert_allclose(body.vertices, made.vertices + body.position, atol=1e-15)
        np.testing.assert_array_equal(body.faces, boundary_faces(made.tets))
        np.testing.assert_allclose(body.vertices.mean(axis=0), body.position, atol=1e-15)
        assert body.name == body.shape.kind == f"soft_{body.shape.kind.removeprefix('soft_')}"
        assert volumes(made.vertices, made.tets).min() > 0.0


def test_box_is_exact():
    """A box of 10x10x10 cells has 1,331 vertices, 5,000 elements, all full, and its volume."""
    body = nuno.soft_box((0.2, 0.2, 0.2), cells=(10, 10, 10), position=(1, 2, 3))
    made = body.shape.tetrahedra()
    assert (len(made.vertices), len(made.tets), len(made.faces)) == (1331, 5000, 1200)
    assert (made.fraction == 1.0).all() and made.skin_tets is None
    assert volumes(made.vertices, made.tets).sum() == pytest.approx(0.008, rel=1e-12)
    np.testing.assert_allclose(body.vertices.min(axis=0), (0.9, 1.9, 2.9), atol=1e-12)


@pytest.mark.parametrize("name", ROUND)
def test_round_shapes_have_their_volume(name):
    """What fills the lattice is within 0.15 % of the shape's volume: it comes from 128 segments around."""
    make, volume = ROUND[name]
    made = make().shape.tetrahedra()
    assert volumes(made.vertices, made.tets) @ made.fraction == pytest.approx(volume, rel=1.5e-3)
    assert inner_faces_match(made.tets)


@pytest.mark.parametrize("name", ROUND)
def test_round_shapes_are_drawn_round(name):
    """The skin is that of the rigid shape, in place, and moves along with the body."""
    body = ROUND[name][0]()
    sizes = {k: v for k, v in vars(body.shape).items() if k in ("radius", "height")}
    rigid = getattr(nuno, name)(**sizes)
    body.locate((0.1, 0.2, 0.3)).rotate(0.4, "x")
    rigid.locate((0.1, 0.2, 0.3)).rotate(0.4, "x")
    vertices, faces = body.skin()
    np.testing.assert_allclose(vertices, rigid.vertices, atol=1e-12)
    np.testing.assert_array_equal(faces, rigid.faces)


def test_skin_of_other_bodies_is_their_mesh():
    """A box, a sheet and a soft box have no other surface than their faces."""
    for body in (nuno.box((1, 1, 1)), nuno.sheet((1, 1), (2, 2)), nuno.soft_box((1, 1, 1), (2, 2, 2))):
        vertices, faces = body.skin()
        np.testing.assert_array_equal(vertices, body.vertices)
        np.testing.assert_array_equal(faces, body.faces)


def test_mesh_stays_where_it_is():
    """A mesh that is given in place gets its skin there; vertices of no face are left out."""
    moved = CUBE.copy().apply_translation((1.0, 0.5, 0.25))
    points = np.concatenate([moved.vertices, [[9.0, 9.0, 9.0]]])
    body = nuno.soft_mesh((points, moved.faces), cell=0.07)
    np.testing.assert_allclose(body.skin()[0], moved.vertices, atol=1e-12)
    np.testing.assert_allclose(body.position, (1.0, 0.5, 0.25), atol=1e-12)
    assert len(body.shape.tetrahedra().tets) == 5 * 27


def test_skin_by_world():
    """In a batch every world's skin follows its own vertices."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.soft_sphere(0.1, 0.05))
    futures = world.imagine(3)
    own = futures.find(ball.name)
    own.locate(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    vertices, faces = own.skin()
    assert vertices.shape == (3, len(ball.skin()[0]), 3)
    np.testing.assert_allclose(
        vertices[2] - vertices[0], np.broadcast_to((2.0, 0.0, 0.0), vertices[0].shape), atol=1e-12
    )
    np.testing.assert_array_equal(faces, ball.skin()[1])


def test_given_tetrahedra():
    """One that is inside out is turned; flat ones and vertices of none are named."""
    points, tets = tetrahedron()
    body = nuno.soft_tetrahedra(points, tets[:, [0, 2, 1, 3]])
    assert volumes(body.vertices, body.shape.tetrahedra().tets) == pytest.approx(1 / 6)
    np.testing.assert_array_equal(body.vertices, points)
    with pytest.raises(MeshError, match="1 of 5 vertices belong to no tetrahedron"):
        nuno.soft_tetrahedra(np.concatenate([points, points[:1]]), tets)
    with pytest.raises(MeshError, match="1 tetrahedra are flat"):
        nuno.soft_tetrahedra(points * (1, 1, 0), tets)
    with pytest.raises(MeshError, match="must lie in"):
        nuno.soft_tetrahedra(points, tets + 1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nuno.soft_box((1, 1), (1, 1, 1)), "size"),
        (lambda: nuno.soft_box((1, 1, 0), (1, 1, 1)), r"size\[2\] must be >= 1e-06"),
        (lambda: nuno.soft_box((1, 1, 1), (1, 1)), "three whole numbers"),
        (lambda: nuno.soft_box((1, 1, 1), (1, 1, 0)), r"cells\[2\] must be a whole number of at least 1"),
        (lambda: nuno.soft_box((1, 1, 1), (1000, 1000, 1000)), "1000000000 voxels"),
        (lambda: nuno.soft_sphere(0.1, 0.0), "cell must be >= 1e-06"),
        (lambda: nuno.soft_sphere(float("nan"), 0.1), "radius must be >= 1e-06"),
        (lambda: nuno.soft_sphere(10.0, 0.01), "cell must be larger"),
        (lambda: nuno.soft_cylinder(0.1, -1.0, 0.1), "height must be >= 1e-06"),
        (lambda: nuno.soft_mesh(CUBE, 0.1, tetrahedraliser="tetgen"), '"fitted", "lattice" or "pytetwild"'),
        (lambda: nuno.soft_sphere(0.1, 0.05, tetrahedraliser="pytetwild"), '"fitted" or "lattice"'),
        (lambda: nuno.soft_mesh((CUBE.vertices, CUBE.faces[1:]), 0.1), "is open"),
        (lambda: nuno.soft_mesh((CUBE.vertices, CUBE.faces[1:]), 0.1, tetrahedraliser="pytetwild"), "is open"),
    ],
)
def test_wrong_input(make, message):
    """What cannot be is named before a body is made."""
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_equal_shapes_share_their_tetrahedra():
    """Two boxes of the same size and cells are one shape, made once; arrays cannot be written to."""
    first, second = (nuno.soft_box((0.2, 0.2, 0.2), (4, 4, 4)).shape for _ in range(2))
    assert first == second and first.tetrahedra() is second.tetrahedra()
    with pytest.raises(ValueError):
        first.tetrahedra().vertices[0] = 0.0


def test_save_and_restore(tmp_path):
    """All kinds come back from a file as they were, in place."""
    world = nuno.World(device="cpu")
    for body in every_kind():
        world.add(body).translate((0.1, 0.2, 0.3))
    world.save(tmp_path / "room.npz")
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "room.npz")
    for before, after in zip(world.bodies, other.bodies, strict=True):
        assert type(before.shape) is type(after.shape)
        np.testing.assert_array_equal(before.vertices, after.vertices)
        np.testing.assert_array_equal(before.skin()[0], after.skin()[0])
    # into a world that has the same bodies already, which keep their identity
    kept = other.bodies
    other.restore(tmp_path / "room.npz")
    assert other.bodies == kept


@pytest.mark.parametrize("name", ROUND)
def test_round_shapes_are_in_place(name):
    """The mean of the vertices, which is the body's position, is the shape's centre."""
    for make in (ROUND[name][0], lambda: nuno.soft_sphere(0.1, 0.2 / 7)):
        vertices, _ = make().skin()
        np.testing.assert_allclose(vertices.min(axis=0) + vertices.max(axis=0), 0.0, atol=1e-12)


def test_fitted_or_lattice():
    """Fitted bodies keep to their surface; lattices have whole voxels about it, all of their corners off it."""
    fitted, lattice = (nuno.soft_sphere(0.1, 0.2 / 12, tetrahedraliser=kind) for kind in ("fitted", "lattice"))
    radius = [np.linalg.norm(body.vertices[np.unique(body.faces)], axis=1) for body in (fitted, lattice)]
    np.testing.assert_allclose(radius[0], 0.1, rtol=6.1e-4)  # of 128 segments around and 64 rings
    assert radius[1].max() > 0.11
    assert fitted.shape == nuno.soft_sphere(0.1, 0.2 / 12).shape != lattice.shape


def test_what_cannot_be_fitted_is_a_lattice_and_says_so(caplog):
    """A plate thinner than a cell, aligned with nothing, is filled as before; the warning names the cell."""
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    plate = trimesh.creation.box((0.2, 0.2, 0.01)).apply_transform(turn)
    with caplog.at_level("WARNING"):
        body = nuno.soft_mesh(plate, cell=0.05)
    assert "a cell of 0.05 m is too large" in caplog.text
    made, asked = body.shape.tetrahedra(), nuno.soft_mesh(plate, 0.05, tetrahedraliser="lattice").shape.tetrahedra()
    np.testing.assert_array_equal(made.vertices, asked.vertices)


def test_a_file_that_does_not_say_is_of_lattices(tmp_path):
    """Files of earlier versions have no tetrahedraliser; their bodies come back as the lattices that they were."""
    world = nuno.World(device="cpu")
    for kind in ("lattice", "fitted"):
        world.add(nuno.soft_sphere(0.1, 0.05, tetrahedraliser=kind, name=kind))
        world.add(nuno.soft_mesh(CUBE, 0.07, tetrahedraliser=kind, name=f"mesh {kind}"))
    world.save(tmp_path / "room.npz")
    with np.load(tmp_path / "room.npz") as file:
        arrays = {name: file[name] for name in file.files}
    header = json.loads(str(arrays["header"]))
    for record in header["world"]["fields"]["bodies"]:
        fields = record["fields"]["shape"]["fields"]
        if fields["tetrahedraliser"] == "lattice":
            del fields["tetrahedraliser"]
    arrays["header"] = np.array(json.dumps(header))
    np.savez(tmp_path / "old.npz", **arrays)
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "old.npz")
    for before, after in zip(world.bodies, other.bodies, strict=True):
        assert before.shape.tetrahedraliser == after.shape.tetrahedraliser
        np.testing.assert_array_equal(before.vertices, after.vertices)


def test_missing_tetrahedraliser(monkeypatch):
    """Without pytetwild the error names what to install."""
    monkeypatch.setitem(sys.modules, "pytetwild", None)
    with pytest.raises(MissingPackageError, match=r"pip install .* '\.\[tetrahedra\]'"):
        nuno.soft_mesh(CUBE, 0.1, tetrahedraliser="pytetwild")


@pytest.mark.long
def test_tetrahedraliser():
    """The elements of fTetWild follow the surface within its envelope, a thousandth of the diagonal."""
    pytest.importorskip("pytetwild")
    body = nuno.soft_mesh(CUBE, 0.1, tetrahedraliser="pytetwild")
    made = body.shape.tetrahedra()
    assert inner_faces_match(made.tets) and made.skin_tets is None
    # the envelope, 0.35 mm, over the cube's faces of 0.24 m2 is 1 % of its 8 litres
    assert volumes(made.vertices, made.tets).sum() == pytest.approx(0.008, rel=0.0105)
