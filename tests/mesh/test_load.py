"""Mesh files as other programs write them: with texture seams, and in millimetres."""

import logging

import numpy as np
import pytest
import trimesh
from PIL import Image

import nuno

CELLS = 4


def textured_square(folder, doubled):
    """Write an OBJ of a square of CELLS x CELLS cells, of which two halves have a texture each, and return its path."""
    side = np.linspace(-0.1, 0.1, CELLS + 1)
    lines = ["mtllib square.mtl", *[f"v {x} {y} 0.5" for y in side for x in side]]
    lines += [f"vt {(i / CELLS + half) / 2} {j / CELLS}" for half in (0, 1) for j in range(5) for i in range(5)]
    lines.append("usemtl print")
    for j in range(CELLS):
        for i in range(CELLS):
            corners = [j * 5 + i, j * 5 + i + 1, (j + 1) * 5 + i + 1, (j + 1) * 5 + i]
            shift = 25 if doubled and i >= CELLS // 2 else 0
            lines.append("f " + " ".join(f"{c + 1}/{c + 1 + shift}" for c in corners))
    (folder / "square.mtl").write_text("newmtl print\nKd 1 1 1\nmap_Kd print.png\n")
    Image.new("RGB", (4, 4), "white").save(folder / "print.png")
    (folder / "square.obj").write_text("\n".join(lines) + "\n")
    return folder / "square.obj"


@pytest.mark.parametrize("doubled", [False, True])
def test_cloth_holds_together_at_texture_seams(tmp_path, doubled):
    """A file repeats the vertices of a seam; the cloth has each once, and hangs whole by one corner."""
    cloth = nuno.cloth_mesh(textured_square(tmp_path, doubled))
    assert len(cloth.vertices) == (CELLS + 1) ** 2
    world = nuno.World(device="cpu")
    world.attach(world.add(cloth))
    corner = int(cloth.vertices[:, :2].sum(axis=1).argmin())
    held = cloth.vertices[corner]
    world.grip(cloth, [corner], to=held)
    world.run(0.5)
    diagonal = 0.2 * np.sqrt(2)
    assert np.linalg.norm(cloth.vertices - held, axis=1).max() < 1.1 * diagonal  # a half that fell would be 1.2 m away


def test_solid_of_a_file_with_a_normal_for_each_face_is_closed(tmp_path):
    """A GLB of a box with sharp edges has 24 vertices, and a soft body of it needs a closed surface."""
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    flat = trimesh.Trimesh(box.vertices[box.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    flat.vertex_normals = np.repeat(box.face_normals, 3, axis=0)
    flat.export(tmp_path / "box.glb", include_normals=True)
    solid = nuno.mesh(tmp_path / "box.glb")
    assert len(solid.vertices) == 8
    assert solid.is_solid


def test_file_in_millimetres_is_named_with_its_cure(tmp_path, caplog):
    """A mug of 80 mm is 80 m long; the mesh that the warning's cure makes is read without one."""
    path = tmp_path / "mug.stl"
    trimesh.creation.cylinder(40.0, 80.0).export(path)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        nuno.mesh(path)
    assert "mug.stl" in caplog.text
    assert "80 m long" in caplog.text
    assert "apply_scale(0.001)" in caplog.text
    caplog.clear()
    mug = trimesh.load(path, force="mesh")
    mug.apply_scale(0.001)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        body = nuno.mesh(mug)
    assert not caplog.records
    assert np.ptp(body.vertices[:, 2]) == pytest.approx(0.08)
