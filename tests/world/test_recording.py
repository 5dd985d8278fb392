"""Recordings: exact in memory and in their own files, and valid as glTF."""

import json
import struct

import numpy as np
import pytest
import trimesh

import nuno
from free_fall import free_fall  # noqa: F401
from nuno import BodyStateError, FileFormatError, InvalidInputError, Recording, UnknownNameError


def moving_room():
    """A world with a table, and a ball that a program moves."""
    world = nuno.World(device="cpu", frame_rate=10)
    world.add(nuno.box((1, 1, 0.1), name="table", color="red"))
    return world, world.add(nuno.soft_sphere(0.1, 0.1, name="ball", position=(0, 0, 1), color=(0.0, 0.5, 1.0)))


def recorded(frames=4):
    """A recording of a ball that moves 0.1 m a frame, from 1 m up."""
    world, ball = moving_room()
    recording = Recording(world)
    for _ in range(frames):
        recording.add()
        world.step()
        ball.translate((0, 0, 0.1))
    return recording


def parsed(path):
    """Return the JSON of a GLB file and its binary chunk, having checked the lengths that it states."""
    raw = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", raw)
    assert (magic, version, length) == (b"glTF", 2, len(raw)) and length % 4 == 0
    size, kind = struct.unpack_from("<II", raw, 12)
    assert kind == 0x4E4F534A and size % 4 == 0
    document = json.loads(raw[20 : 20 + size])
    binary, kind = struct.unpack_from("<II", raw, 20 + size)
    assert kind == 0x004E4942 and 28 + size + binary == length
    assert document["buffers"] == [{"byteLength": binary}]
    return document, raw[28 + size :]


def accessor(document, binary, index):
    """Return what an accessor reads, having checked that it fills its view and states its bounds."""
    entry = document["accessors"][index]
    view = document["bufferViews"][entry["bufferView"]]
    dtype, size = {5126: ("<f4", 4), 5125: ("<u4", 4)}[entry["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3}[entry["type"]]
    assert view["byteLength"] == entry["count"] * width * size and view["byteOffset"] % size == 0
    assert view["byteOffset"] + view["byteLength"] <= len(binary)
    values = np.frombuffer(binary, dtype, entry["count"] * width, view["byteOffset"]).reshape(-1, width)
    if "min" in entry:
        np.testing.assert_array_equal(values.min(axis=0), np.array(entry["min"], dtype=dtype))
        np.testing.assert_array_equal(values.max(axis=0), np.array(entry["max"], dtype=dtype))
    return values


def test_frames_are_the_bodies_vertices():
    """Every frame is what ``vertices`` were then; what never moved is kept once."""
    world, ball = moving_room()
    recording = Recording(world)
    seen = []
    for _ in range(3):
        recording.add()
        seen.append(ball.vertices)
        world.step()
        ball.rotate(0.2, "z")
    np.testing.assert_array_equal(recording["ball"].vertices, seen)
    np.testing.assert_allclose(recording.times, (0.0, 0.1, 0.2))
    assert len(recording) == 3 and recording["table"].vertices.shape == (1, 8, 3)
    np.testing.assert_allclose(recording["ball"].skin()[0], nuno.sphere(0.1, position=(0, 0, 1)).vertices, atol=1e-12)


@pytest.mark.usefixtures("free_fall")
def test_of_runs_the_world():
    """A cloth in free fall, in whole frames and a shorter last one: its height is that of steps of a frame."""
    world = nuno.World(device="cpu", frame_rate=50)
    towel = world.add(nuno.sheet((0.3, 0.3), (2, 2), name="towel", position=(0, 0, 1)))
    world.add(nuno.box((1, 1, 0.1), position=(0, 0, -9)))
    world.attach(towel)
    recording = Recording.of(world, 0.25, bodies=["towel"])
    np.testing.assert_allclose(recording.times, [*np.arange(13) / 50, 0.25], atol=1e-12)
    assert world.time == pytest.approx(0.25) and [body.name for body in recording.bodies] == ["towel"]
    # semi-implicit Euler: after n steps of h, g h2 n (n + 1) / 2; the last step is half as long
    n = np.arange(13)
    fall = 9.81 / 50**2 * n * (n + 1) / 2
    last = fall[-1] + (12 / 50 + 0.01) * 9.81 * 0.01
    height = recording["towel"].vertices[:, :, 2].mean(axis=1)
    np.testing.assert_allclose(1.0 - height, [*fall, last], atol=1e-6)  # of float32, summed over 13 steps


@pytest.mark.usefixtures("free_fall")
def test_recording_changes_nothing():
    """A world that is recorded goes on as one that is not, bit for bit, also over more frames than are run at once."""
    ends = []
    for recorded_ in (False, True):
        world = nuno.World(device="cpu")
        towel = world.add(nuno.sheet((0.3, 0.3), (2, 2), position=(0, 0, 1)))
        world.attach(towel)
        if recorded_:
            Recording.of(world, 1.11)
        else:
            world.run(1.11)
        ends.append((towel.vertices, world.time))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert ends[0][1] == pytest.approx(ends[1][1], abs=1e-12)


def test_file_round_trip(tmp_path):
    """Loaded, everything is as it was, number for number, without the world."""
    recording = recorded()
    recording.save(tmp_path / "take.npz")
    again = Recording.load(tmp_path / "take.npz")
    np.testing.assert_array_equal(again.times, recording.times)
    for before, after in zip(recording.bodies, again.bodies, strict=True):
        assert (before.name, before.color) == (after.name, after.color)
        np.testing.assert_array_equal(before.vertices, after.vertices)
        np.testing.assert_array_equal(before.faces, after.faces)
        np.testing.assert_array_equal(before.skin(), after.skin())
    again.save(tmp_path / "copy.npz")
    np.testing.assert_array_equal(Recording.load(tmp_path / "copy.npz")["ball"].skin(), recording["ball"].skin())
    with pytest.raises(BodyStateError, match="no world"):
        again.add()


def test_batch(tmp_path):
    """A batch is recorded with all its worlds; one of them is exported."""
    world, _ = moving_room()
    futures = world.imagine(2)
    recording = Recording(futures)
    for k in range(2):
        recording.add()
        futures.step()
        futures.find("ball").locate(np.array([[0.0, 0, 1], [0, 0, 1 + k]]))
    recording.add()
    assert recording["ball"].vertices.shape[:2] == (3, 2)
    recording.save(tmp_path / "take.npz")
    np.testing.assert_array_equal(Recording.load(tmp_path / "take.npz")["ball"].skin(), recording["ball"].skin())
    with pytest.raises(InvalidInputError, match="batch of 2 worlds"):
        recording.export(tmp_path / "take.glb")
    recording.export(tmp_path / "take.glb", world=1)
    assert trimesh.load(tmp_path / "take.glb").geometry["ball"].bounds[1, 2] == pytest.approx(1.1)


def test_glb(tmp_path):
    """Every accessor and view fits, and playing the animation gives the recorded frames."""
    recording = recorded(5)
    recording.export(tmp_path / "take.glb")
    document, binary = parsed(tmp_path / "take.glb")
    assert document["asset"]["version"] == "2.0"
    names = [mesh["name"] for mesh in document["meshes"]]
    ball, table = document["meshes"][names.index("ball")], document["meshes"][names.index("table")]
    assert "weights" not in table and "targets" not in table["primitives"][0]
    primitive = ball["primitives"][0]
    first = accessor(document, binary, primitive["attributes"]["POSITION"])
    targets = [accessor(document, binary, target["POSITION"]) for target in primitive["targets"]]
    faces = accessor(document, binary, primitive["indices"]).reshape(-1, 3)
    np.testing.assert_array_equal(faces, recording["ball"].faces)
    assert len(targets) == len(ball["weights"]) == 4

    (animation,) = document["animations"]
    (channel,) = animation["channels"]
    node = document["nodes"][channel["target"]["node"]]
    assert channel["target"]["path"] == "weights" and document["meshes"][node["mesh"]]["name"] == "ball"
    sampler = animation["samplers"][channel["sampler"]]
    times = accessor(document, binary, sampler["input"])[:, 0]
    np.testing.assert_allclose(times, recording.times - recording.times[0], atol=1e-7)
    weights = accessor(document, binary, sampler["output"]).reshape(len(times), len(targets))
    for weight, frame in zip(weights, recording["ball"].skin(), strict=True):
        played = first + np.tensordot(weight, targets, axes=1)
        np.testing.assert_allclose(played, frame, atol=2.4e-7)  # two roundings to float32, at 1.5 m
    used = {view for entry in document["accessors"] for view in [entry["bufferView"]]}
    assert used == set(range(len(document["bufferViews"])))
    assert sum(view["byteLength"] for view in document["bufferViews"]) == len(binary)


def test_glb_stands_upright_in_trimesh(tmp_path):
    """Read back, the first frame is where it was, with z up turned to glTF's y up, in the body's colour."""
    recording = recorded()
    recording.export(tmp_path / "take.glb")
    scene = trimesh.load(tmp_path / "take.glb")
    assert set(scene.geometry) == {"ball", "table"}
    ball = scene.geometry["ball"]
    transform = scene.graph[scene.graph.geometry_nodes["ball"][0]][0]
    placed = trimesh.transform_points(ball.vertices, transform)
    x, y, z = recording["ball"].skin()[0].T
    np.testing.assert_allclose(placed, np.stack([x, z, -y], axis=1), atol=2.4e-7)
    linear = ((0.5 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(ball.visual.material.baseColorFactor, np.round([0, 255 * linear, 255, 255]), atol=1)


def test_every_second_frame(tmp_path):
    """``every`` thins the animation: frames 0, 2 and 4 of 5."""
    recording = recorded(5)
    recording.export(tmp_path / "take.glb", every=2)
    document, binary = parsed(tmp_path / "take.glb")
    times = accessor(document, binary, document["animations"][0]["samplers"][0]["input"])[:, 0]
    np.testing.assert_allclose(times, (0.0, 0.2, 0.4), atol=1e-7)


def test_wrong_use(tmp_path):
    """An empty recording, a frame twice, an unknown body and wrong extensions are named."""
    world, _ = moving_room()
    recording = Recording(world)
    with pytest.raises(InvalidInputError, match="empty"):
        recording.save(tmp_path / "take.npz")
    recording.add()
    with pytest.raises(BodyStateError, match="later"):
        recording.add()
    with pytest.raises(InvalidInputError, match=r"\.npz, got 'take\.glb'"):
        recording.save(tmp_path / "take.glb")
    with pytest.raises(InvalidInputError, match=r"\.glb, got 'take\.npz'"):
        recording.export(tmp_path / "take.npz")
    with pytest.raises(UnknownNameError, match="ball, table"):
        recording["cup"]
    with pytest.raises(UnknownNameError, match="cup"):
        Recording(world, ["cup"])
    with pytest.raises(InvalidInputError, match="at least one body"):
        Recording(nuno.World(device="cpu"))
    assert not list(tmp_path.iterdir())


def rewritten(path, change):
    """Write a recording's arrays again, after ``change`` to them."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    change(arrays)
    np.savez(path, **arrays)


def header_with(**values):
    """Return a change of a recording's header."""

    def change(arrays):
        arrays["header"] = np.array(json.dumps(json.loads(str(arrays["header"][()])) | values))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (header_with(version=2), "this version of nuno reads 'nuno-recording' 1"),
        (header_with(format=1), "of the format 1 1"),
        (lambda arrays: arrays.pop("header"), "as a recording"),
        (lambda arrays: arrays.pop("times"), "damaged"),
        (lambda arrays: arrays.update(vertices_1=arrays["vertices_1"][:2]), "damaged.*2 frames of 4"),
        (lambda arrays: arrays.update(faces_0=arrays["faces_0"] + 8), "damaged.*must lie in"),
        (lambda arrays: arrays.pop("skin_weights_1"), "damaged"),
    ],
)
def test_files_that_are_none(tmp_path, change, message):
    """Newer, foreign and damaged files are named errors."""
    path = tmp_path / "take.npz"
    recorded().save(path)
    rewritten(path, change)
    with pytest.raises(FileFormatError, match=message):
        Recording.load(path)


def test_foreign_files(tmp_path):
    """A saved world, text, half a file and no file at all are none, either."""
    world, _ = moving_room()
    world.save(tmp_path / "room.npz")
    (tmp_path / "text.npz").write_text("no recording")
    recorded().save(tmp_path / "take.npz")
    (tmp_path / "half.npz").write_bytes((tmp_path / "take.npz").read_bytes()[:500])
    for name in ("room", "text", "half", "missing"):
        with pytest.raises(FileFormatError):
            Recording.load(tmp_path / f"{name}.npz")
