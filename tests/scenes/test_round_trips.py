"""Worlds saved as MJCF and USD and loaded: the same bodies, joints, grips and rules, which move alike."""

import numpy as np
import pytest

import nuno
from scene_rooms import door_room, every_kind

FORMATS = [
    pytest.param(".xml", id="mjcf"),
    pytest.param(".usda", id="usda"),
    pytest.param(".usdc", id="usdc", marks=pytest.mark.long),
]
FLOAT = 2e-6
"""USD holds points, masses and joints' frames in single precision (6e-8), here of numbers of a few metres; a joint's
frame is made of several."""


@pytest.fixture(autouse=True)
def packages():
    """Both formats' packages."""
    pytest.importorskip("mujoco")
    pytest.importorskip("pxr")


def saved_and_loaded(world, path):
    """Return the scene that is read from what is written of a world, and the report of the writing."""
    report = nuno.save_scene(world, path)
    return nuno.load_scene(path, nuno.World(device="cpu", gravity=world.gravity)), report


@pytest.mark.parametrize("ending", FORMATS)
def test_every_body_comes_back(ending, tmp_path):
    """Kind of shape, place, vertices, material and masses of each body, static and dynamic."""
    world = every_kind()
    scene, _ = saved_and_loaded(world, tmp_path / f"kinds{ending}")
    assert set(scene.bodies) == {body.name for body in world.bodies}
    for body in world.bodies:
        found = scene.bodies[body.name]
        assert type(found.shape) is type(body.shape) and found.is_dynamic == body.is_dynamic, body.name
        np.testing.assert_allclose(found.vertices, body.vertices, rtol=0.0, atol=FLOAT, err_msg=body.name)
        np.testing.assert_array_equal(found.faces, body.faces, err_msg=body.name)
        assert (found.friction, found.group, found.collides_with) == (body.friction, body.group, body.collides_with)
        assert found.color == body.color
        if not body.is_dynamic:
            continue
        assert type(found.material) is type(body.material)
        np.testing.assert_allclose(found.mass, body.mass, rtol=FLOAT, err_msg=body.name)
        scale = np.abs(body.inertia).max()
        # axes of the inertia turned by 1e-6 (USD) change it by as much of its largest moment
        np.testing.assert_allclose(found.inertia, body.inertia, rtol=0.0, atol=5e-6 * scale, err_msg=body.name)
        np.testing.assert_allclose(found.centre_of_mass, body.centre_of_mass, rtol=0.0, atol=FLOAT)
        if not isinstance(body.material, nuno.Rigid):
            assert found.material.same_as(body.material), body.name
        else:
            assert found.material.restitution == 0.2 or body.material.restitution == 0.0
            assert found.material.air_drag == body.material.air_drag


@pytest.mark.parametrize("ending", FORMATS)
def test_sizes_of_shapes_come_back(ending, tmp_path):
    """Edges, radii and heights, of parts of compounds too."""
    world = every_kind()
    scene, _ = saved_and_loaded(world, tmp_path / f"kinds{ending}")
    for name, sizes in (("box", ("size",)), ("ball", ("radius",)), ("can", ("radius", "height")),
                        ("pill", ("radius", "height"))):  # fmt: skip
        for kind in ("static", "moving"):
            own, found = world.find(f"{kind} {name}").shape, scene.bodies[f"{kind} {name}"].shape
            for size in sizes:
                np.testing.assert_allclose(getattr(found, size), getattr(own, size), rtol=1e-12)
    parts = zip(world.find("moving hammer").shape.parts, scene.bodies["moving hammer"].shape.parts, strict=True)
    for (shape, place, turn), (other, there, turned) in parts:
        assert type(shape) is type(other)
        np.testing.assert_allclose(there, place, atol=1e-12)
        np.testing.assert_allclose(np.abs(np.dot(turn, turned)), 1.0, atol=1e-12)
    # a rest shape may lie anywhere: its edges are what counts
    faces = world.find("cut").faces
    edges = [np.asarray(each.shape.rest)[faces] for each in (world.find("cut"), scene.bodies["cut"])]
    own, found = (np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1) for corners in edges)
    np.testing.assert_allclose(found, own, rtol=0.0, atol=FLOAT)


@pytest.mark.parametrize("ending", FORMATS)
def test_every_joint_comes_back(ending, tmp_path):
    """Kind, place, axis, position, limits, friction, spring and motor."""
    world = every_kind()
    saved = {spec.kind: spec for spec in (grip.spec for grip in world.save().grips)}
    scene, _ = saved_and_loaded(world, tmp_path / f"kinds{ending}")
    names = {f"{joint.kind} {joint.body.name} {getattr(joint.target, 'name', None)}" for joint in scene.joints.values()}
    assert names == {
        "hinge bar 0 anchor", "slider bar 1 bar 0", "ball bar 2 bar 1", "fixed bar 3 bar 2", "hinge pendulum None",
    }  # fmt: skip
    own = {joint.body.name: joint for joint in scene.joints.values()}
    assert own["bar 0"].position == pytest.approx(0.25, abs=FLOAT)
    assert own["bar 1"].position == pytest.approx(0.05, abs=FLOAT)
    np.testing.assert_allclose(own["bar 0"].limits, (-0.5, 1.0), atol=FLOAT)
    np.testing.assert_allclose(own["bar 1"].limits, (-0.1, 0.2), atol=FLOAT)
    np.testing.assert_allclose(own["bar 2"].limits, (0.0, 0.8), atol=FLOAT)
    assert own["bar 1"].friction == 0.4
    spring, motor = own["bar 0"].spring, own["pendulum"].motor
    assert (spring.stiffness, spring.rest, spring.damping) == (2.0, 0.1, 0.3)
    assert (motor.velocity, motor.position, motor.damping, motor.max_effort) == (0.5, None, 2.0, 4.0)
    for grip in scene.world.save().grips:
        spec = grip.spec
        if spec.kind in ("slider", "ball", "fixed"):  # the only one of its kind
            np.testing.assert_allclose(spec.place, saved[spec.kind].place, atol=FLOAT)
            assert spec.max_force == pytest.approx(saved[spec.kind].max_force)


@pytest.mark.parametrize("ending", FORMATS)
def test_rules_come_back(ending, tmp_path):
    """Pairs that pass through each other, and the friction of a pair."""
    world = every_kind()
    scene, _ = saved_and_loaded(world, tmp_path / f"kinds{ending}")
    for room in (world, scene.world):
        names = {body.key: body.name for body in room.bodies}
        snapshot = room.save()
        assert [{names[a], names[b]} for a, b in snapshot.ignored] == [{"moving box", "moving ball"}]
        assert [({names[a], names[b]}, mu) for a, b, mu in snapshot.pair_friction] == [
            ({"moving box", "static box"}, 0.9)
        ]


@pytest.mark.parametrize("ending", FORMATS)
def test_loaded_worlds_move_alike(ending, tmp_path):
    """A door, a box and a towel in the middle of their motion go on as they would have."""
    world = door_room()
    world.run(0.1)
    scene, _ = saved_and_loaded(world, tmp_path / f"room{ending}")
    for body in world.bodies:
        if body.is_dynamic:
            found = scene.bodies[body.name]
            # a solved joint is off by some 1e-6 m, which no joint of a file is
            np.testing.assert_allclose(found.velocities, body.velocities, rtol=0.0, atol=2e-4, err_msg=body.name)
    assert len(scene.grips) == 1 and scene.grips[0].active
    world.run(0.1)
    scene.world.run(0.1)
    # the door from a velocity that is 1e-5 m/s off, the towel from vertices in single precision, before it folds
    for name, apart in (("door", 2e-5), ("crate", 5e-6), ("towel", 1e-4)):
        off = np.abs(scene.bodies[name].vertices - world.find(name).vertices).max()
        assert off < apart, f"{name}: {off}"
    assert scene.joints["hinge of door and frame"].position > 0.3, "the motor turns it"


@pytest.mark.parametrize("ending", FORMATS)
def test_a_loaded_scene_is_imagined_saved_and_restored(ending, tmp_path):
    """A batch of it, one future of which is adopted; and a snapshot, to the bit."""
    scene, _ = saved_and_loaded(door_room(), tmp_path / f"room{ending}")
    world = scene.world
    futures = world.imagine(3)
    futures.push("crate", np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    futures.run(0.1)
    places = futures.find("crate").position[:, 0]
    # x = F t^2 / 2 m of a body that flies freely, with the first step's error of the frame's substeps
    np.testing.assert_allclose(places[1:] - places[0], [0.01, 0.02], rtol=0.1)
    snapshot = world.save(tmp_path / "room.npz")
    world.adopt(futures, 2)
    assert world.find("crate").position[0] == places[2]
    world.restore(snapshot)
    world.run(0.1)
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "room.npz")
    other.run(0.1)
    for body in world.bodies:
        np.testing.assert_array_equal(other.find(body.name).vertices, body.vertices)


def test_one_world_of_a_batch_is_saved(tmp_path):
    """The one that is asked for; without a number the batch is refused."""
    world = nuno.World(device="cpu")
    crate = world.add(nuno.box((0.1, 0.1, 0.1), name="crate", position=(0, 0, 1)))
    world.attach(crate, nuno.Rigid())
    futures = world.imagine(2)
    futures.set_pose("crate", [[0.0, 0, 1], [0.5, 0, 2]])
    for ending in (".xml", ".usda"):
        nuno.save_scene(futures, tmp_path / f"one{ending}", 1)
        scene = nuno.load_scene(tmp_path / f"one{ending}", nuno.World(device="cpu"))
        np.testing.assert_allclose(scene.bodies["crate"].position, (0.5, 0, 2), atol=1e-6)
        with pytest.raises(nuno.InvalidInputError, match="batch of 2"):
            nuno.save_scene(futures, tmp_path / f"two{ending}")
        with pytest.raises(nuno.InvalidInputError, match="from 0 to 1"):
            nuno.save_scene(futures, tmp_path / f"two{ending}", 2)


def test_what_a_format_has_not_is_told_once(tmp_path, caplog):
    """Paths, pushes and grips between vertices; one message for all, and the same in the report."""
    world = door_room()
    cart = world.add(nuno.box((0.1, 0.1, 0.1), name="cart", position=(3, 0, 0.05)))
    world.move(cart, nuno.Path([0.0, 1.0], [(3, 0, 0.05), (4, 0, 0.05)]))
    world.push("crate", (1.0, 0, 0))
    world.grip("towel", world.find("towel").at(0.55, 0.5), to=(0.1, 0.5, 0.8))
    for ending in (".xml", ".usda"):
        caplog.clear()
        report = nuno.save_scene(world, tmp_path / f"room{ending}")
        assert report.notes["follows a path, and is saved where it is now"] == ("cart",)
        assert report.notes["is pushed, which is not saved"] == ("crate",)
        assert any("between vertices" in what for what in report.notes)
        assert not report.complete and "cart" in str(report)
        assert len([record for record in caplog.records if "scene_report" in record.name]) == 1


def test_a_file_is_whole_or_not_there(tmp_path):
    """A folder that is not there, and an ending that is no format's."""
    world = door_room()
    with pytest.raises(nuno.FileWriteError, match="no such folder"):
        nuno.save_scene(world, tmp_path / "nowhere" / "room.xml")
    with pytest.raises(nuno.InvalidInputError, match="must end with"):
        nuno.save_scene(world, tmp_path / "room.obj")
    with pytest.raises(nuno.InvalidInputError, match="no bodies"):
        nuno.save_scene(nuno.World(device="cpu"), tmp_path / "room.xml")
    assert not list(tmp_path.iterdir())
