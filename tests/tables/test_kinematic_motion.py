"""Bodies that follow paths: where they are, what ends it, and that it is saved with the world."""

import json

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError
from nuno.shapes.path import path_as_it_is
from nuno.tables.kinematic_motion import paths_at

TURN = (np.cos(0.4), 0.0, 0.0, np.sin(0.4))


def moving_world(worlds=1):
    """Return a world with a plate that follows a path, and a sheet that lies on it."""
    world = nuno.World(device="cpu")
    plate = world.add(nuno.box((0.6, 0.6, 0.02), name="plate", position=(0, 0, -0.01)))
    world.add(nuno.sheet((0.2, 0.2), cells=(5, 5), name="sheet", position=(0, 0, 0.002)))
    world.attach("sheet", nuno.Cloth(thickness=0.004))
    path = nuno.Path([0.05, 0.55], [(0, 0, -0.01), (0.3, 0.1, 0.05)], [(1, 0, 0, 0), TURN], "minimum_jerk")
    if worlds > 1:
        world = world.imagine(worlds)
    world.move(plate, path)
    return world, world.find("plate"), path


def test_a_body_is_where_its_path_is():
    """Promise of the interface: also where nothing is dynamic, before the first key and after the last."""
    world = nuno.World(device="cpu")
    cup = world.add(nuno.cylinder(0.04, 0.1, position=(0, 0, 0.5)).rotate(0.3, "z"))
    lid = world.add(nuno.cylinder(0.04, 0.01, position=(0, 0, 0.6)))
    cup.assoc(lid)
    own = cup.quaternion
    path = nuno.Path([0.5, 1.0, 2.0], [(0, 0, 0.5), (0.2, 0, 0.5), (0.2, 0.1, 0.7)], interpolation="minimum_jerk")
    world.move(cup, path)
    for seconds in (0.3, 0.45, 0.5, 2.0):
        world.run(seconds)
        np.testing.assert_allclose(cup.position, path.at(world.time), atol=1e-12)
        np.testing.assert_allclose(lid.position, path.at(world.time) + np.array([0, 0, 0.1]), atol=1e-12)
    np.testing.assert_array_equal(cup.quaternion, own)  # the path has none
    np.testing.assert_array_equal(cup.position, [0.2, 0.1, 0.7])


def test_a_path_turns_a_body():
    """Promise of the interface: a path's quaternions are the body's."""
    world, plate, path = moving_world()
    world.run(0.3)
    np.testing.assert_allclose(plate.quaternion, path.quaternion_at(0.3), atol=1e-12)
    np.testing.assert_allclose(plate.position, path.at(0.3), atol=1e-12)


def test_a_path_of_poses_is_at_its_keys_to_the_bit():
    """Promise of copies: what bodies stood at is not normed anew where a path of it has ended."""
    turns = np.array([TURN, (0.6, 0.0, 0.0, 0.8)]) * (1.0 + 1e-15)
    places = np.array([[0.1, 0.2, 0.3], [1.0 / 3.0, 1e-3, 0.7]])
    path = path_as_it_is(np.array([0.5, 1.0]), places, turns)
    for time, key in ((0.2, 0), (0.5, 0), (1.0, 1), (3.0, 1)):
        ((place, turn),) = paths_at([path], np.array(time))
        np.testing.assert_array_equal(place, places[key])
        np.testing.assert_array_equal(turn, turns[key])


def test_a_move_ends_by_none_by_locate_and_by_another_path():
    """Promise of the interface: the body then stays where it is, where it is put, or goes the other way."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.sphere(0.1))
    there = nuno.Path([0.0, 1.0], [(0, 0, 0), (1, 0, 0)])
    world.move(body, there)
    world.run(0.5)
    world.move(body, None)
    world.run(0.2)
    np.testing.assert_allclose(body.position, [0.5, 0, 0], atol=1e-12)
    world.move(body, there)
    np.testing.assert_allclose(body.position, [0.7, 0, 0], atol=1e-12)  # at once
    body.locate((0, 2, 0))
    world.run(0.1)
    np.testing.assert_array_equal(body.position, [0, 2, 0])
    world.move(body, there)
    world.move(body, nuno.Path([0.8, 1.8], [(0, 0, 0), (0, 0, 1)]))
    world.run(0.5)
    np.testing.assert_allclose(body.position, [0, 0, 0.5], atol=1e-12)
    world.move(body, None)
    world.move(body, None)  # nothing to end, nothing happens


def test_a_batch_takes_a_path_for_each_world():
    """Promise of the interface: every argument that may differ by world takes one value or as many."""
    world = nuno.World(device="cpu").imagine(3)
    body = world.add(nuno.sphere(0.1))
    goal = np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]])
    world.move(body, nuno.Path([0.0, 1.0], np.stack([0 * goal, goal], axis=1)))
    world.run(0.5)
    np.testing.assert_allclose(body.position, 0.5 * goal, atol=1e-12)
    world.move(body, nuno.Path([0.0, 1.0], [(0, 0, 0), (1, 0, 0)]))
    np.testing.assert_allclose(body.position, [0.5, 0, 0], atol=1e-12)


def end_of(world):
    """Return what a world has become in a while: vertices, velocities and poses."""
    world.run(0.3)
    sheet, plate = world.find("sheet"), world.find("plate")
    return sheet.vertices, sheet.velocities, plate.position, plate.quaternion


@pytest.mark.parametrize("way", ["memory", "file", "imagine"])
def test_a_saved_world_goes_on_moving(way, tmp_path):
    """Promise: restored in the middle of a path, it goes on bit for bit as it did."""
    world, plate, _ = moving_world()
    world.run(0.25)
    saved = world.save(tmp_path / "room.npz")
    futures = world.imagine(2)
    expected = end_of(world)
    plate.locate((5, 5, 5))
    if way == "memory":
        world.restore(saved)
    elif way == "file":
        world = nuno.World(device="cpu")
        world.restore(tmp_path / "room.npz")
    if way == "imagine":
        got = [a[1] if a.ndim > e.ndim else a for a, e in zip(end_of(futures), expected, strict=True)]
    else:
        got = end_of(world)
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_adopting_a_world_takes_its_own_path():
    """Promise of adopt: world k's path becomes the one of the world."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.sphere(0.1))
    futures = world.imagine(2)
    futures.move(body, nuno.Path([0.0, 1.0], [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (0, 1, 0)]]))
    futures.run(0.5)
    world.adopt(futures, 1)
    world.run(0.25)
    np.testing.assert_allclose(body.position, [0, 0.75, 0], atol=1e-12)


def test_a_file_of_format_1_loads(tmp_path):
    """Promise: files from before bodies had paths, whose records have no such field, can be read."""
    world = nuno.World(device="cpu")
    world.add(nuno.sphere(0.1, name="ball", position=(1, 2, 3)))
    world.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as file:
        arrays = dict(file)
    header = json.loads(str(arrays.pop("header")[()]))
    header["format"] = 1
    for record in header["world"]["fields"]["bodies"]:
        assert record["fields"].pop("path") is None
    np.savez(tmp_path / "old.npz", header=np.array(json.dumps(header)), **arrays)
    old = nuno.World(device="cpu")
    old.restore(tmp_path / "old.npz")
    np.testing.assert_array_equal(old.find("ball").position, [1, 2, 3])


def test_bad_moves_raise_named_errors_and_change_nothing():
    """Promise of the interface: what was received and what is valid, before anything changes."""
    world, plate, path = moving_world()
    sheet = world.find("sheet")
    other = world.add(nuno.sphere(0.1, position=(2, 0, 0)))
    frame = nuno.Coordinates()
    frame.assoc(other)
    before = plate.position
    with pytest.raises(BodyStateError, match="dynamic"):
        world.move(sheet, path)
    with pytest.raises(BodyStateError, match="follows another frame"):
        world.move(other, path)
    with pytest.raises(BodyStateError, match="follows a path"):
        frame.assoc(plate)
    with pytest.raises(InvalidInputError, match="Path"):
        world.move(plate, (0, 0, 1))
    with pytest.raises(InvalidInputError, match="2 worlds"):
        world.move(plate, nuno.Path([0.0], np.zeros((2, 1, 3))))
    with pytest.raises(BodyStateError, match="in no world"):
        world.move(nuno.sphere(0.1), path)
    np.testing.assert_array_equal(plate.position, before)
    towel = world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), name="towel"))
    world.move(towel, path)
    with pytest.raises(BodyStateError, match="follows a path"):
        world.attach(towel)
    assert not towel.is_dynamic


def test_a_removed_body_stands_still():
    """Promise of remove: the body is its own again, where it is now."""
    world, plate, path = moving_world()
    world.run(0.3)
    world.remove(plate)
    world.run(0.1)
    np.testing.assert_allclose(plate.position, path.at(0.3), atol=1e-12)
    world.add(plate)
    world.run(0.1)
    np.testing.assert_allclose(plate.position, path.at(0.3), atol=1e-12)


def test_many_links_cost_little():
    """A new path for each of 40 bodies every frame makes no table anew (identity of the colliders' arrays)."""
    world, _, _ = moving_world()
    links = [world.add(nuno.sphere(0.02, position=(0.1 * k, 1.0, 0))) for k in range(40)]
    for _ in range(3):
        now, end = world.time, world.time + 1.0 / 60.0
        for link in links:
            world.move(link, nuno.Path([now, end], [link.position, link.position + np.array([0, 0, 0.001])]))
        world.step()
        tables = [id(colliders) for colliders in world._colliders.values()]
    assert tables
    for link in links:
        world.move(link, nuno.Path([world.time, world.time + 1.0], [link.position, (0, 0, 1)]))
    world.step()
    assert [id(colliders) for colliders in world._colliders.values()] == tables


def test_a_run_that_rounds_to_nothing_is_none():
    """What a sleep of the rest of a frame leaves: no time passes, also where bodies are on their way."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.1, 0.1), (4, 4), position=(0.0, 0.0, 0.1)))
    world.attach(cloth)
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(1.0, 0.0, 0.1)))
    world.move(box, nuno.Path([0.0, 10.0], [(1.0, 0.0, 0.1), (2.0, 0.0, 0.1)]))
    world.run(0.1)
    before, now = cloth.vertices, world.time
    world.run(1e-15)
    np.testing.assert_array_equal(cloth.vertices, before)
    assert world.time == now
