"""Save, restore, imagine and adopt: bit for bit, in memory and through a file."""

import json

import numpy as np
import pytest

import nuno
from nuno import BodyStateError, Cloth, FileFormatError, InvalidInputError, Path, SurfacePoints
from nuno.world.grips_of_worlds import grips_by_key


def room():
    """A world with something of everything that a snapshot holds."""
    world = nuno.World(device="cpu", gravity=(0, 0, -1.62), frame_rate=50, substeps=7)
    table = world.add(nuno.box((1, 1, 0.02), name="table", color=(0.5, 0.25, 0.0), friction=0.7, group=3))
    cup = world.add(nuno.cylinder(0.04, 0.1, name="cup", position=(0, 0, 0.1)))
    table.assoc(cup)
    world.add(nuno.mesh(([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), name="flag"))
    rag = world.add(nuno.sheet((0.3, 0.3), cells=(2, 2), name="rag", position=(2, 0, 1)))
    world.attach(rag)
    world.grip(rag, 0, to=(2, 0, 2))
    world.run(0.1)
    world.detach(rag)
    rag.rotate(0.3, "y")
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(3, 2), name="towel", position=(0, 0, 1)))
    world.attach(towel, Cloth(bending_rigidity=(1e-5, 2e-5), shear_stiffness=np.arange(1.0, 7.0)))
    grip = world.grip(towel, towel.at(0.4, 0.3), to=Path([0.0, 3.0], [(0, 0, 1), (0, 0, 2)]), compliance=1e-5)
    world.grip(towel, 11, to=world.find("flag"))
    world.push(towel, (0, 1, 0), duration=1.0)
    world.push(towel, (0.1, 0, 0))
    world.set_friction(towel, table, 0.9)
    world.ignore_contact(towel, cup)
    world.run(0.31)
    return world, towel, grip


def everything(world):
    """All that a snapshot has to bring back, as arrays and plain values."""
    arrays, plain = [], [world.time, world.gravity, world.frame_rate, world.substeps, world.world_count]
    for body in world.bodies:
        arrays += [body.vertices, body.velocities, body.position, body.quaternion, np.asarray(body.friction)]
        plain += [body.name, body.is_dynamic, body.is_deformed, body.thickness, body.color, body.group]
        plain += [body.parent.name if body.parent else None]
    return arrays, plain


def assert_same(a, b):
    """Check that two results of ``everything`` are equal, bit for bit."""
    for x, y in zip(a[0], b[0], strict=True):
        np.testing.assert_array_equal(x, y)
    assert a[1] == b[1]


def disturb(world, towel):
    """Change something of everything."""
    world.run(0.5)
    world.detach(towel)
    world.remove(towel)
    world.remove("rag")
    world.find("table").translate((1, 0, 0)).rotate(1.0, "z")
    world.find("flag").friction = 0.1
    world.add(nuno.sphere(1.0, name="towel"))
    world.set_friction("flag", "table", 0.2)


def test_restore_in_memory_is_exact_and_keeps_identity():
    """Everything comes back bit for bit, also what was removed, in the same objects, and runs on alike."""
    world, towel, grip = room()
    before, bodies, saved = everything(world), world.bodies, world.save()
    world.run(0.4)
    later = everything(world)
    disturb(world, towel)
    assert not grip.active
    world.restore(saved)
    assert_same(everything(world), before)
    assert world.bodies == bodies and grip.active and grip in towel._dynamics.grips
    world.run(0.4)
    assert_same(everything(world), later)
    world.restore(saved)
    assert_same(everything(world), before)


def test_restore_from_a_file_in_the_same_world(tmp_path):
    """A file does what memory does."""
    world, towel, grip = room()
    before, bodies = everything(world), world.bodies
    world.save(tmp_path / "room.npz")
    world.run(0.4)
    later = everything(world)
    disturb(world, towel)
    world.restore(tmp_path / "room.npz")
    assert_same(everything(world), before)
    assert world.bodies == bodies and grip.active
    world.run(0.4)
    assert_same(everything(world), later)


def test_restore_from_a_file_in_an_empty_world(tmp_path):
    """A new program gets the same room, and it runs on alike."""
    world, _, _ = room()
    world.save(tmp_path / "room.npz")
    other = nuno.World(device="cpu")
    other.restore(str(tmp_path / "room.npz"))
    assert_same(everything(other), everything(world))
    assert other.find("towel").material.same_as(world.find("towel").material)
    for w in (world, other):
        w.find("flag").translate((0, 0, 0.2))
        w.run(1.3)
    assert_same(everything(other), everything(world))
    assert other.save().ignored == world.save().ignored != () != other.save().pair_friction


def test_a_file_of_another_process_finds_its_bodies_by_name_and_shape(tmp_path):
    """Bodies that the program has made anew under the same names keep their identity."""
    world, _, _ = room()
    world.save(tmp_path / "room.npz")
    other = nuno.World(device="cpu")
    towel = other.add(nuno.sheet((0.6, 0.4), cells=(3, 2), name="towel"))
    table = other.add(nuno.box((2, 1, 0.02), name="table"))
    other.restore(tmp_path / "room.npz")
    assert other.find("towel") is towel and other.find("table") is not table
    assert_same(everything(other), everything(world))
    other.step()
    assert len(other.save().ignored) == len(other.save().pair_friction) == 1


def test_what_grips_bore_is_in_files_and_copies(tmp_path):
    """A grip tells of the last frame before a world was saved, read or imagined; a file of format 5 says nothing."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="towel", position=(0, 0, 1)))
    world.attach(towel)
    grip = world.grip(towel, [0, 4], to=towel.vertices[[0, 4]].mean(axis=0))
    world.run(0.2)
    borne = np.concatenate(grip.wrench)
    assert np.linalg.norm(borne[:3]) > 0.1  # [N]
    path, copies = tmp_path / "towel.npz", world.imagine(2)
    saved = world.save(path)
    for own in grips_by_key(copies).values():
        np.testing.assert_array_equal(np.concatenate(own.wrench, axis=-1), [borne, borne])
    world.run(0.1)
    assert not np.array_equal(np.concatenate(grip.wrench), borne)
    for kept in (saved, path):
        world.restore(kept)
        np.testing.assert_array_equal(np.concatenate(grip.wrench), borne)
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"])) | {"format": 5}
    for own in header["world"]["fields"]["grips"]:
        del own["fields"]["borne"]
    arrays["header"] = np.array(json.dumps(header))
    np.savez(tmp_path / "older.npz", **arrays)
    world.restore(tmp_path / "older.npz")
    np.testing.assert_array_equal(np.concatenate(grip.wrench), 0.0)


def test_files_that_cannot_be_read(tmp_path):
    """No file, damaged files, other formats and pickles raise FileFormatError, and nothing changes."""
    world, _, _ = room()
    path = tmp_path / "room.npz"
    world.save(path)
    data = path.read_bytes()
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    assert header["format"] == 6 and header["units"]["length"] == "m" and len(header["meshes"]) == 5

    def variant(name, **changes):
        changed = {**arrays, "header": np.array(json.dumps({**header, **changes}))}
        np.savez(tmp_path / name, **changed)

    variant("newer.npz", format=7)
    variant("strange.npz", world={"type": "Path", "fields": {}})
    fields = header["world"]["fields"]
    variant("engine.npz", world={"type": "Snapshot", "fields": {**fields, "engine": "odd"}})
    variant("missing.npz", world={"type": "Snapshot", "fields": {"time": 0.0}})
    variant("swapped.npz", meshes=dict.fromkeys(header["meshes"], "0"))
    np.savez(tmp_path / "pickle.npz", header=np.array({"format": 1}, dtype=object))
    np.savez(tmp_path / "other.npz", numbers=np.arange(3))
    (tmp_path / "text.npz").write_text("no zip")
    (tmp_path / "cut.npz").write_bytes(data[: len(data) // 2])
    before = everything(world)
    for name in ("newer", "engine", "strange", "missing", "swapped", "pickle", "other", "text", "cut", "absent"):
        with pytest.raises(FileFormatError) as error:
            world.restore(tmp_path / f"{name}.npz")
        assert "allow_pickle" not in str(error.value)  # NumPy's advice to load it unsafely
    assert_same(everything(world), before)


def test_imagine_copies_everything_and_touches_nothing():
    """All worlds of the batch are equal to now, and run on as this one does."""
    world, towel, _ = room()
    before = everything(world)
    futures = world.imagine(3)
    assert futures.world_count == 3 and futures.time == world.time
    copy = futures.find("towel")
    assert copy is not towel and copy.vertices.shape == (3, 12, 3)
    for k in range(3):
        np.testing.assert_array_equal(copy.vertices[k], towel.vertices)
    futures.run(0.7)
    assert_same(everything(world), before)
    world.run(0.7)
    for body in world.bodies:
        np.testing.assert_array_equal(futures.find(body.name).vertices[1], body.vertices)


def test_arguments_by_world_and_adopt():
    """Grips, pushes, poses and materials may differ by world; adopting one makes it now."""
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((1, 1, 0.02), name="table"))
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(3, 2), name="towel", position=(0, 0, 1)))
    futures = world.imagine(2)
    futures.attach(towel, Cloth(area_density=[0.1, 0.2], friction=[0.3, 0.6]))
    futures.find("table").locate([(0, 0, 0), (0, 0, -1)])
    goals = np.array([(0, 0, 2.0), (0, 1, 3)])
    grip = futures.grip(towel, towel.at([0.0, 1.0], 0.0).per_world(), to=Path([0.0, 1.0], goals[:, None].repeat(2, 1)))
    futures.grip(towel, [[11], [-1]], to=goals)
    futures.push(towel, [(1, 0, 0), (2, 0, 0)])
    futures.run(0.5)
    shape = futures.find("towel").vertices
    # in the first world two corners are led to one place, where the cloth, 4 mm thick, keeps its layers apart
    np.testing.assert_allclose(shape[[0, 1], [0, 3]], goals, atol=0.004)
    np.testing.assert_allclose(shape[0, 11], goals[0], atol=0.004)
    world.adopt(futures, 1)
    assert world.find("towel") is towel and world.bodies == (table, towel) and world.time == 0.5
    np.testing.assert_array_equal(towel.vertices, shape[1])
    np.testing.assert_array_equal(table.position, (0, 0, -1))
    assert towel.material.area_density == 0.2 and towel.friction == 0.6 and table.friction == 0.5
    assert grip.active and grip.body is not towel and len(towel._dynamics.grips) == 2
    futures.run(0.5)
    world.run(0.5)
    np.testing.assert_array_equal(towel.vertices, futures.find("towel").vertices[1])


def test_detached_in_a_batch():
    """A body detached in a batch has a shape for each world, and one of them is adopted."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(3, 2), position=(0, 0, 1)))
    futures = world.imagine(2)
    futures.attach(towel)
    futures.grip(towel, [[0], [5]], to=(0, 0, 3))
    futures.run(0.2)
    futures.detach(towel)
    shape = futures.find("sheet").vertices
    assert not np.array_equal(shape[0], shape[1]) and futures.find("sheet").position.shape == (2, 3)
    again = futures.save()
    futures.find("sheet").locate((0, 0, 0))
    futures.restore(again)
    np.testing.assert_array_equal(futures.find("sheet").vertices, shape)
    world.adopt(futures, 0)
    np.testing.assert_array_equal(towel.vertices, shape[0])
    np.testing.assert_array_equal(towel.position, shape[0].mean(axis=0))


def test_wrong_batches_are_refused():
    """A batch is not imagined further as a whole; what is by world must fit the batch."""
    world, towel, _ = room()
    futures = world.imagine(2)
    with pytest.raises(BodyStateError):
        futures.imagine(2)
    with pytest.raises(InvalidInputError):
        futures.grip(towel, np.zeros((3, 1), int), to=(0, 0, 0))
    with pytest.raises(InvalidInputError):
        futures.grip(towel, SurfacePoints(np.zeros((3, 1), int), [[(1.0, 0, 0)]] * 3), to=(0, 0, 0))
    with pytest.raises(InvalidInputError):
        futures.grip(towel, 0, to=np.zeros((3, 3)))
    with pytest.raises(InvalidInputError):
        futures.find("table").locate(np.zeros((3, 3)))
    with pytest.raises(InvalidInputError):
        world.adopt(world, 0)


def test_a_compound_in_a_file(tmp_path):
    """A shape made of others comes back with its parts."""
    world = nuno.World(device="cpu")
    cup = nuno.mesh(nuno.box((1, 1, 1)).surface()).shape
    parts = [(nuno.Box((1, 2, 3)), (0, 0, 1)), (nuno.Sphere(0.5), (1, 0, 0), (0, 1, 0, 0)), cup]
    world.add(nuno.compound(parts, position=(0, 0, 1)))
    world.save(tmp_path / "room.npz")
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "room.npz")
    np.testing.assert_array_equal(other.bodies[0].vertices, world.bodies[0].vertices)
    assert other.bodies[0].shape.parts[:2] == world.bodies[0].shape.parts[:2]


def test_a_file_finds_a_mesh_that_was_looked_at(tmp_path):
    """A mesh whose inside was asked for is the same shape still: its body keeps its identity."""
    source = nuno.box((1, 1, 1)).surface()
    world = nuno.World(device="cpu")
    world.add(nuno.mesh(source, name="block"))
    world.save(tmp_path / "room.npz")
    other = nuno.World(device="cpu")
    block = other.add(nuno.mesh(source, name="block"))
    assert block.is_solid
    other.restore(tmp_path / "room.npz")
    assert other.bodies == (block,)


def test_a_file_finds_a_compound_with_parts_of_triangles(tmp_path):
    """Parts with arrays, also such as have kept their hull since: the program's own body is the one in the file."""

    def tray():
        block = nuno.mesh(nuno.box((1, 1, 1)).surface()).shape
        return nuno.compound([block, (block, (2, 0, 0))], name="tray", position=(0, 0, 2))

    world, other = nuno.World(device="cpu"), nuno.World(device="cpu")
    world.attach(world.add(tray()), nuno.Rigid(mass=1.0))
    world.run(0.05)
    world.save(tmp_path / "room.npz")
    own = other.add(tray())
    other.restore(tmp_path / "room.npz")
    assert other.bodies == (own,) and own.is_dynamic
    np.testing.assert_array_equal(own.vertices, world.bodies[0].vertices)


def test_a_file_with_rules_for_a_body_that_was_removed(tmp_path):
    """It raised KeyError when it was read; the rules hold again when the body comes back."""
    world = nuno.World(device="cpu")
    a, b = world.add(nuno.sphere(0.1, name="a")), world.add(nuno.sphere(0.1, name="b"))
    world.set_friction(a, b, 0.9)
    world.ignore_contact(a, b)
    world.remove(b)
    world.save(tmp_path / "one.npz")
    world.restore(tmp_path / "one.npz")
    world.add(b)
    assert world._rules.friction == {frozenset((a.key, b.key)): 0.9} and len(world._rules.ignored) == 1


def test_a_body_forgets_a_parent_that_it_had_meanwhile():
    """A body without a parent when it was saved has none again, also where both left the world in between."""
    world = nuno.World(device="cpu")
    cup = world.add(nuno.cylinder(0.04, 0.1, position=(0.1, 0.2, 0.3)).rotate(0.3, (1, 2, 3)))
    tray = world.add(nuno.box((0.3, 0.3, 0.02), position=(0.3, 0.1, 0.7)).rotate(1.1, (3, 1, 2)))
    pose, saved = cup.pose(), world.save()
    tray.assoc(cup)
    for body in (cup, tray):
        world.remove(body)
    tray.translate((1.0, 0.0, 0.0))
    world.restore(saved)
    assert cup.parent is None
    np.testing.assert_array_equal(np.concatenate(cup.pose()), np.concatenate(pose))


def test_a_body_that_follows_a_frame_is_where_it_was_to_the_bit():
    """A frame that is no body is not saved; where it stands as before, rounding moves nothing."""
    world = nuno.World(device="cpu")
    frame = nuno.Coordinates((0.3, -0.2, 0.7)).rotate(0.7, (1, 2, 3))
    cup = world.add(nuno.cylinder(0.04, 0.1, position=(0.1, 0.2, 0.3)).rotate(0.3, (3, 2, 1)))
    frame.assoc(cup)
    pose, saved = np.concatenate(cup.pose()), world.save()
    cup.translate((0.1, 0.0, 0.0))
    world.restore(saved)
    assert cup.parent is frame
    np.testing.assert_array_equal(np.concatenate(cup.pose()), pose)


@pytest.mark.parametrize("version", [1, 2, 3])
def test_old_files_of_moving_rigid_bodies(version, tmp_path):
    """Before format 3 they do not say where those are: they are refused by name, and what is static is read."""
    world = nuno.World(device="cpu")
    world.attach(world.add(nuno.box((0.1, 0.1, 0.1), name="brick")))
    world.save(tmp_path / "now.npz")
    with np.load(tmp_path / "now.npz") as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"])) | {"format": version}
    np.savez(tmp_path / "then.npz", **{**arrays, "header": np.array(json.dumps(header))})
    if version < 3:
        with pytest.raises(FileFormatError, match="'brick'"):
            world.restore(tmp_path / "then.npz")
    else:
        world.restore(tmp_path / "then.npz")


def test_a_push_moves_in_time_with_its_snapshot():
    """``at`` takes the end of a push along: restored later, it acts for as long as it had left."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    brick = world.add(nuno.box((0.1, 0.1, 0.1), name="brick"))
    world.attach(brick, nuno.Rigid(mass=1.0))
    world.push(brick, (1.0, 0.0, 0.0), duration=0.2)
    saved = world.save()
    world.run(1.0)
    world.restore(saved.at(world.time))
    world.run(1.0)
    # 1 N on 1 kg for 0.2 s; a push that had ended would leave it at rest
    np.testing.assert_allclose(brick.velocity, (0.2, 0.0, 0.0), atol=1e-5)


def test_some_worlds_of_a_batch_go_on_as_in_it():
    """Two of three worlds with other materials, grips, paths and friction, as a batch: the same bits 0.2 s later."""
    world = nuno.World(device="cpu", substeps=7)
    table = world.add(nuno.box((1, 1, 0.02), name="table"))
    world.add(nuno.sheet((0.3, 0.2), cells=(3, 2), name="towel", position=(0, 0, 0.1)))
    futures = world.imagine(3)
    futures.attach("towel", Cloth(bending_rigidity=(1e-5, 2e-5), stretch_stiffness=np.array([500.0, 1000.0, 2000.0])))
    lift = np.array([[(0, 0, 0), (0, 0, 0.05 * k)] for k in range(3)])
    futures.move("table", Path([0.0, 0.4], 0.2 * lift))
    start = futures.find("towel").vertices[:, 0]
    futures.grip("towel", 0, to=Path([0.0, 0.4], start[:, None] + lift))
    futures.set_friction("towel", "table", np.array([0.1, 0.5, 0.9]))
    futures.run(0.2)
    some = nuno.World(device="cpu")
    some.restore(futures.save().pick([2, 0]))
    assert some.world_count == 2
    for batch in (futures, some):
        batch.run(0.2)
    for name in ("vertices", "velocities"):
        np.testing.assert_array_equal(getattr(some.find("towel"), name), getattr(futures.find("towel"), name)[[2, 0]])
    np.testing.assert_array_equal(some.find(table.name).position, futures.find(table.name).position[[2, 0]])
    for wrong in ([1], [0, 3], [0.0, 1.0], 3, True, "all"):
        with pytest.raises(InvalidInputError):
            futures.save().pick(wrong)


def test_copies_of_one_world_and_of_equal_worlds_are_alike():
    """A batch that one world was spread to, and one that has each world's own numbers, go on with the same bits."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="cloth", position=(0.0, 0.0, 0.1)))
    soft = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(1, 1, 1), name="soft", position=(0.5, 0.0, 0.1)))
    world.attach(cloth, velocity=(0.0, 0.3, 0.0))
    world.attach(soft)
    world.grip(cloth, [0], to=cloth.vertices[0])
    world.run(0.02)
    spread = world.imagine(18)  # more than a vector's lanes
    equal = nuno.World(device="cpu")
    equal.restore(spread.save())
    for batch in (spread, equal):
        batch.grip("cloth", batch.find("cloth").at([0.3], [0.6]), to=(0.0, 0.0, 0.1), compliance=1e-3)
        batch.run(0.05)
    for name in ("cloth", "soft"):
        assert np.array_equal(spread.find(name).vertices, equal.find(name).vertices)
        assert np.array_equal(spread.find(name).velocities, equal.find(name).velocities)
