"""What MJCF needs said otherwise: names that MuJoCo gives itself, flat meshes, loops of joints."""

import numpy as np
import pytest

import nuno

TRIANGLES = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 3, 2]]))


def saved_and_loaded(world, tmp_path):
    """Return the scene that is read from what is written of a world, and the report of the writing."""
    pytest.importorskip("mujoco")
    report = nuno.save_scene(world, tmp_path / "room.xml")
    return nuno.load_scene(tmp_path / "room.xml", nuno.World(device="cpu")), report


def test_names_that_mujoco_gives_itself_are_changed(tmp_path):
    """The world's, and those of a flex's vertices: told, with their joints; odd letters stay."""
    world = nuno.World(device="cpu")
    for k, name in enumerate(("world", "towel_1", "a<\"&>'b/ü")):
        world.attach(world.add(nuno.box((0.1, 0.1, 0.1), name=name, position=(k + 1, 0, 1))))
    world.attach(world.add(nuno.sheet((0.2, 0.2), (2, 2), name="towel", position=(0, 0, 1))))
    nuno.hinge(world.find("towel_1"), world.find("world"), point=(1.5, 0, 1), axis=(0, 1, 0))
    scene, report = saved_and_loaded(world, tmp_path)
    assert set(scene.bodies) == {"world body", "towel_1 body", "a<\"&>'b/ü", "towel"}
    assert len(report.notes["a name that MuJoCo gives itself is changed"]) == 2
    (joint,) = scene.joints.values()
    assert {joint.body.name, joint.target.name} == {"world body", "towel_1 body"}


def test_flat_meshes_and_static_cloth_come_back(tmp_path):
    """MuJoCo makes no hull of points in a plane: one more point, which no face has, is not read back."""
    world = nuno.World(device="cpu")
    world.add(nuno.mesh(TRIANGLES, name="flat"))
    world.add(nuno.sheet((0.2, 0.2), (2, 2), name="cloth", position=(0, 0, 2)))
    stiff = world.add(nuno.sheet((0.2, 0.2), (2, 2), name="stiff", position=(0, 0, 1)))
    world.attach(stiff, nuno.Rigid(density=300.0))
    scene, report = saved_and_loaded(world, tmp_path)
    for body in world.bodies:
        np.testing.assert_allclose(scene.bodies[body.name].vertices, body.vertices, atol=1e-7, err_msg=body.name)
    assert set(report.notes["a flat mesh has a hull of some depth for MuJoCo"]) == {"flat", "stiff"}
    # 300 kg/m3 over 0.2 m x 0.2 m and a thickness of 4 mm
    assert scene.bodies["stiff"].mass == pytest.approx(300.0 * 0.2 * 0.2 * 0.004, rel=1e-6)


def test_a_ring_of_ball_joints_is_closed(tmp_path):
    """Three joints make the tree, the fourth is a constraint; a hinge that closes a loop is left out by name."""
    world = nuno.World(device="cpu")
    places = [(1.0, 0, 1), (0, 1.0, 1), (-1.0, 0, 1), (0, -1.0, 1)]
    boxes = [world.add(nuno.box((0.1, 0.1, 0.1), name=f"b{k}", position=place)) for k, place in enumerate(places)]
    for each in boxes:
        world.attach(each)
    for k in range(4):
        middle = 0.5 * (boxes[k].position + boxes[(k + 1) % 4].position)
        nuno.ball_joint(boxes[k], boxes[(k + 1) % 4], point=middle)
    scene, _ = saved_and_loaded(world, tmp_path)
    assert len(scene.joints) == 4 and all(joint.kind == "ball" for joint in scene.joints.values())
    for a, b in ((0, 1), (1, 2), (2, 0)):
        nuno.hinge(boxes[a], boxes[b], point=(0, 0, 1), axis=(0, 0, 1))
    _, report = saved_and_loaded(world, tmp_path)
    assert report.notes["a hinge or slider that closes a loop is left out"]
