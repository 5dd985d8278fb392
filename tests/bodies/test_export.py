"""Bodies as trimesh objects and mesh files."""

import numpy as np
import pytest
import trimesh

import nuno
from nuno import InvalidInputError
from nuno.shapes.color import rgb


def test_to_trimesh():
    """The surface in place, with the body's colour at every vertex."""
    body = nuno.box((1, 2, 3), position=(1, 0, 0), color=(1.0, 0.5, 0.0))
    mesh = body.to_trimesh()
    np.testing.assert_array_equal(mesh.vertices, body.vertices)
    np.testing.assert_array_equal(mesh.faces, body.faces)
    assert mesh.is_watertight and mesh.volume == pytest.approx(6.0)
    assert (mesh.visual.vertex_colors == (255, 128, 0, 255)).all()


def test_a_soft_body_gives_its_skin():
    """A soft sphere comes out round."""
    mesh = nuno.soft_sphere(0.1, 0.05, color="#336699").to_trimesh()
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.1, atol=1e-12)
    assert tuple(mesh.visual.vertex_colors[0]) == (0x33, 0x66, 0x99, 255)


@pytest.mark.parametrize("extension", ["obj", "ply", "glb", "PLY"])
@pytest.mark.parametrize("make", [lambda: nuno.soft_sphere(0.1, 0.05), lambda: nuno.sheet((0.4, 0.3), (4, 3))])
def test_round_trip(tmp_path, extension, make):
    """Read back, every vertex is where it was, within the file's digits, and the surface is the same."""
    body = make().locate((1.0, 0.5, 0.25)).rotate(0.3, "y")
    path = tmp_path / f"body.{extension}"
    body.export(path)
    again = nuno.mesh(path)
    vertices, faces = body.skin()
    assert again.faces.shape == faces.shape
    # PLY and GLB hold float32: 2 m / 2^24; OBJ eight decimals
    nearest = np.linalg.norm(vertices[:, None] - again.vertices[None], axis=2)
    assert nearest.min(axis=1).max() < 1.2e-7 and nearest.min(axis=0).max() < 1.2e-7
    area = trimesh.Trimesh(vertices, faces).area
    assert trimesh.Trimesh(again.vertices, again.faces).area == pytest.approx(area, rel=1e-5)
    read = trimesh.load(path, force="mesh")
    assert (read.visual.vertex_colors[:, :3] == np.round(255.0 * rgb(body.color))).all()


def test_one_world_of_a_batch(tmp_path):
    """A batch needs to be told which; each world gives its own."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 1), name="box"))
    box = world.imagine(3).find("box")
    box.locate(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    np.testing.assert_array_equal(box.to_trimesh(world=2).vertices, box.vertices[2])
    with pytest.raises(InvalidInputError, match="batch of 3 worlds"):
        box.export(tmp_path / "box.ply")
    with pytest.raises(InvalidInputError, match=r"\[0, 2\], got 3"):
        box.to_trimesh(world=3)
    nuno.export_body(tmp_path / "box.ply", box, world=1)
    assert nuno.mesh(tmp_path / "box.ply").position[0] == pytest.approx(1.0)


def test_wrong_input(tmp_path):
    """An unknown extension or colour is named, and no file appears."""
    with pytest.raises(InvalidInputError, match=r"\.glb or \.obj or \.ply, got 'body\.step'"):
        nuno.box((1, 1, 1)).export(tmp_path / "body.step")
    with pytest.raises(InvalidInputError, match="got 'octarine'"):
        nuno.box((1, 1, 1), color="octarine").export(tmp_path / "body.ply")
    with pytest.raises(InvalidInputError, match=r"\[0, 1\]"):
        nuno.box((1, 1, 1), color=(255, 0, 0)).to_trimesh()
    assert not list(tmp_path.iterdir())
