"""Bodies: shapes, meshes, poses, points on surfaces."""

import copy

import numpy as np
import pytest
import trimesh

import nuno
from nuno import InvalidInputError, MeshError, SurfacePoints
from nuno.shapes.color import rgb

EXACT = 1e-12  # a few roundings of float64 at lengths of about 1
TRIANGLE = ([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


@pytest.mark.parametrize(
    ("body", "volume", "within"),
    [
        (nuno.box((1, 2, 3)), 6.0, 1e-12),
        # 32 segments around: a regular 32-gon has 0.6 % less area than its circle, a sphere of them 1.5 %
        (nuno.cylinder(0.5, 2.0), np.pi / 2, 0.01),
        (nuno.sphere(1.0), 4 * np.pi / 3, 0.02),
        (nuno.capsule(1.0, 2.0), 4 * np.pi / 3 + 2 * np.pi, 0.02),
    ],
)
def test_primitive_meshes_are_closed_and_point_outwards(body, volume, within):
    """Closed, of the shape's volume, and positive: faces counter-clockwise from outside."""
    solid = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert solid.is_watertight and solid.is_winding_consistent
    assert solid.volume == pytest.approx(volume, rel=within)
    np.testing.assert_allclose(body.vertices.mean(axis=0), 0.0, atol=EXACT)


def test_sheet_order():
    """Vertex (i, j) is j (nx + 1) + i; two faces a cell, (a, b, d) and (a, d, c), normal +z."""
    body = nuno.sheet((0.6, 0.4), cells=(3, 2), position=(1, 2, 3))
    assert body.vertices.shape == (12, 3) and body.faces.shape == (12, 3) and body.faces.dtype == np.int32
    np.testing.assert_allclose(body.vertices[1 * 4 + 3], (1.3, 2.0, 3.0), atol=EXACT)
    np.testing.assert_array_equal(body.faces[2 * (1 * 3 + 2) :], [(6, 7, 11), (6, 11, 10)])
    np.testing.assert_array_equal(body.position, (1, 2, 3))


def test_vertices_follow_the_pose_and_are_a_copy():
    """Vertices are in the world frame; writing to them changes nothing."""
    body = nuno.box((1, 1, 1)).locate((0, 0, 5)).rotate(np.pi / 2, "x")
    body.vertices[:] = 7.0
    assert body.vertices[:, 2].min() == pytest.approx(4.5, abs=EXACT)


def test_a_mesh_stays_where_its_vertices_are_unless_placed(tmp_path):
    """Its position is the mean of its vertices; files and trimesh objects are read."""
    body = nuno.mesh(TRIANGLE)
    np.testing.assert_allclose(body.vertices, TRIANGLE[0], atol=EXACT)
    np.testing.assert_allclose(body.position, (1 / 3, 1 / 3, 0), atol=EXACT)
    np.testing.assert_allclose(nuno.mesh(TRIANGLE, position=(0, 0, 1)).vertices.mean(axis=0), (0, 0, 1), atol=EXACT)
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    assert nuno.mesh(ball).vertices.shape == ball.vertices.shape
    ball.export(tmp_path / "ball.stl")
    assert len(nuno.mesh(tmp_path / "ball.stl").faces) == len(ball.faces)


def test_a_cloth_of_what_a_mesh_is_made_of(tmp_path):
    """A path, a trimesh, a pair and arrays are the same cloth, with a pattern or without."""
    flat = trimesh.Trimesh(*TRIANGLE, process=False)
    flat.export(tmp_path / "rag.ply")
    pattern = [(0, 0), (2, 0), (0, 2)]
    for source in ((TRIANGLE,), TRIANGLE, (flat,), (tmp_path / "rag.ply",), (str(tmp_path / "rag.ply"),)):
        for rest in (None, pattern):
            cloth = nuno.cloth_mesh(*source, rest=rest, name="rag")
            np.testing.assert_allclose(cloth.vertices, TRIANGLE[0], atol=EXACT)
            np.testing.assert_array_equal(cloth.faces, TRIANGLE[1])
            np.testing.assert_array_equal(cloth.shape.rest, TRIANGLE[0] if rest is None else rest)
            assert cloth.shape.kind == "cloth_mesh" and cloth.name == "rag"


def test_what_is_solid():
    """Closed meshes that look outwards are solid; open ones, ones inside out, and cloths are not."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    assert nuno.mesh(ball).is_solid and nuno.box((1, 1, 1)).is_solid
    assert not nuno.mesh((ball.vertices, ball.faces[:, ::-1])).is_solid
    assert not nuno.mesh((ball.vertices, ball.faces[1:])).is_solid
    assert not nuno.cloth_mesh(ball.vertices, ball.faces).is_solid and not nuno.sheet((1, 1), (1, 1)).is_solid


def test_points_of_a_sheet():
    """at(u, v) is u along x and v along y, on both triangles of a cell and on the borders."""
    body = nuno.sheet((2.0, 1.0), cells=(4, 2), position=(1.0, 0.5, 0.0))
    u, v = np.random.default_rng(0).uniform(size=(2, 50))
    u[:4], v[:4] = (0, 1, 0, 1), (0, 0, 1, 1)
    points = body.at(u, v)
    on = points.positions(body.vertices, body.faces)
    np.testing.assert_allclose(on, np.stack([2 * u, v, 0 * u], axis=1), atol=EXACT)
    assert points.per_world().faces.shape == (50, 1)
    assert len(body.at(0.5, 0.5)) == 1


def test_closest_points_agree_with_trimesh():
    """Closest points on a box, from around it, are as far away as trimesh's."""
    body = nuno.box((1, 2, 3), position=(0.1, 0.2, 0.3)).rotate(0.4, (1, 1, 0))
    points = np.random.default_rng(1).normal(size=(200, 3)) * 2
    on = body.closest(points).positions(body.vertices, body.faces)
    solid = trimesh.Trimesh(body.vertices, body.faces, process=False)
    wanted = trimesh.triangles.closest_point(
        np.repeat(solid.triangles, len(points), axis=0), np.tile(points, (len(solid.faces), 1))
    ).reshape(len(solid.faces), len(points), 3)
    distance = np.linalg.norm(wanted - points, axis=2).min(axis=0)
    np.testing.assert_allclose(np.linalg.norm(on - points, axis=1), distance, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: nuno.box((1, 1)), InvalidInputError),
        (lambda: nuno.box((1, 1, 0)), InvalidInputError),
        (lambda: nuno.sphere(-1.0), InvalidInputError),
        (lambda: nuno.cylinder(1.0, np.nan), InvalidInputError),
        (lambda: nuno.sheet((1, 1), cells=(0, 3)), InvalidInputError),
        (lambda: nuno.sheet((1, 1), cells=5), MeshError),
        (lambda: nuno.sheet((1, 1), cells=(2.5, 3)), InvalidInputError),
        (lambda: nuno.mesh(([(0, 0, np.nan), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])), MeshError),
        (lambda: nuno.mesh((TRIANGLE[0], [(0, 1, 3)])), MeshError),
        (lambda: nuno.mesh((TRIANGLE[0], [(0, 1, 1)])), MeshError),
        (lambda: nuno.mesh((TRIANGLE[0], np.zeros((0, 3), int))), MeshError),
        (lambda: nuno.mesh("no such file.stl"), MeshError),
        (lambda: nuno.mesh(3), MeshError),
        (lambda: nuno.cloth_mesh(*TRIANGLE, rest=[(0, 0), (1, 0)]), MeshError),
        (lambda: nuno.cloth_mesh("no such file.stl"), MeshError),
        (lambda: nuno.cloth_mesh(3), MeshError),
        (lambda: nuno.cloth_mesh(TRIANGLE[0]), MeshError),
        (lambda: nuno.cloth_mesh(TRIANGLE, TRIANGLE[1]), MeshError),
        (lambda: nuno.cloth_mesh("rag.ply", TRIANGLE[1]), MeshError),
        (lambda: nuno.cloth_mesh(trimesh.creation.box(), TRIANGLE[1]), MeshError),
        (lambda: nuno.cloth_mesh("text", [(0, 1, 2)]), MeshError),
        (lambda: nuno.cloth_mesh([(0, 0, 0), (1, 0, 0)], [(0, 1, 2)]), MeshError),
        (lambda: nuno.cloth_mesh(*TRIANGLE, rest=[(0, 0), (1, 0), (2, 0)]), MeshError),
        (lambda: nuno.box((1, 1, 1), friction=-1.0), InvalidInputError),
        (lambda: nuno.box((1, 1, 1), position=(0, 0, np.inf)), InvalidInputError),
        (lambda: nuno.box((1, 1, 1), group=-1), InvalidInputError),
        (lambda: nuno.box((1, 1, 1), name=""), InvalidInputError),
        (lambda: nuno.box((1, 1, 1)).at(0.5, 0.5), InvalidInputError),
        (lambda: nuno.sheet((1, 1), cells=(1, 1)).at(0.5, 1.5), InvalidInputError),
        (lambda: nuno.box((1, 1, 1)).closest((np.nan, 0, 0)), InvalidInputError),
        (lambda: SurfacePoints([0], [(0.5, 0.5, 0.5)]), InvalidInputError),
        (lambda: SurfacePoints([0], [(1.5, -0.5, 0.0)]), InvalidInputError),
        (lambda: SurfacePoints([0.5], [(1.0, 0.0, 0.0)]), InvalidInputError),
    ],
)
def test_bad_bodies(make, error):
    """What cannot be used is refused with a named error."""
    with pytest.raises(error):
        make()


def test_import_is_light():
    """Importing nuno loads none of the heavy libraries."""
    import subprocess
    import sys

    heavy = ("warp", "cv2", "trimesh", "matplotlib", "pinocchio")
    code = f"import sys, nuno; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    assert nuno.__all__ == sorted(nuno.__all__)


def test_default_colours_tell_kinds_apart():
    """A towel on a table, a cube on a floor and a cloth on a cube are seen; a given colour is taken as it is."""
    kinds = [
        nuno.plane(), nuno.box((1, 1, 1)), nuno.sheet((1, 1), cells=(2, 2)), nuno.soft_box((1, 1, 1), cells=(1, 1, 1))
    ]  # fmt: skip
    light = np.array([rgb(body.color) for body in kinds])
    apart = np.linalg.norm(light[:, None] - light, axis=-1) + 9.0 * np.eye(4)
    assert apart.min() > 0.25, "of 1.73 between black and white"
    assert nuno.sphere(1.0).color == nuno.box((1, 1, 1)).color == "gray"
    assert nuno.sheet((1, 1), cells=(2, 2), color="red").color == "red"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_is_another_body(copied):
    """It stands in the same world beside the first and moves by itself; bodies that are in a world are not copied."""
    world = nuno.World(device="cpu")
    cup = nuno.box((0.1, 0.1, 0.1), name="cup")
    other = copied(cup).locate((1.0, 0.0, 0.0))
    world.add(cup)
    assert world.add(other).name == "cup_1" and tuple(cup.position) == (0.0, 0.0, 0.0)
    assert world.find("cup") is cup and world.find("cup_1") is other
    with pytest.raises(nuno.BodyStateError, match="copy"):
        copied(cup)
