"""Rigid bodies in copies of their world: where they were, in the order in which they were, to the bit."""

import json

import numpy as np
import pytest

import nuno


def two_boxes():
    """A floor and two boxes on it, static."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    a = world.add(nuno.box((0.1, 0.1, 0.1), name="a", position=(0.0, 0.0, 0.05)))
    b = world.add(nuno.box((0.1, 0.1, 0.1), name="b", position=(1.0, 0.0, 0.05)))
    return world, a, b


def one_after_the_other():
    """The second box is dynamic after the first was: the solver's origin is where the first stood."""
    world, a, b = two_boxes()
    world.attach(a)
    world.run(0.1)
    world.detach(a)
    world.attach(b)
    return world


def the_last_first():
    """Both are dynamic, and the one that was added last came first: its place is the origin, and the first slot."""
    world, a, b = two_boxes()
    world.attach(b)
    world.attach(a)
    return world


def changed_since():
    """Boxes went, came, were moved and deformed since the solver was last told of static bodies."""
    world, a, b = two_boxes()
    post = world.add(nuno.cylinder(0.03, 0.1, name="post", position=(0.5, 0.0, 0.05)))
    rag = world.add(nuno.sheet((0.2, 0.2), (3, 3), name="rag", position=(0.0, 0.0, 0.15)))
    world.attach(rag)
    world.attach(b)
    world.run(0.2)
    world.detach(rag)
    world.attach(a)
    world.remove(post)
    world.add(nuno.sphere(0.05, name="ball", position=(1.2, 0.0, 0.05)))
    rag.translate((0.0, 0.0, 0.2))
    return world


def places(world):
    """The vertices of all bodies."""
    return {body.name: body.vertices for body in world.bodies}


def assert_equal(found, expected):
    """Check that all bodies are where others are, in every world of a batch."""
    assert found.keys() == expected.keys()
    for name, vertices in expected.items():
        np.testing.assert_array_equal(found[name], np.broadcast_to(vertices, found[name].shape), err_msg=name)


@pytest.mark.parametrize("make", [one_after_the_other, the_last_first, changed_since])
@pytest.mark.parametrize("way", ["imagine", "adopt", "memory", "furnished", "file", "same"])
def test_copies_have_their_rigid_bodies_where_they_are(make, way, tmp_path):
    """A batch, another world, one that has had rigid bodies of its own, a file and the same world: equal for 0.5 s."""
    world = make()
    world.find("b").translate((0.0, 0.0, 0.02))
    here = places(world)
    if way == "imagine":
        copy = world.imagine(2)
    elif way == "adopt":
        futures = world.imagine(2)
        world.run(0.1)
        world.adopt(futures, 1)
        copy, world = world, futures
    elif way == "same":
        saved, copy = world.save(), world
        world = world.imagine(1)
        copy.run(0.2)
        copy.detach("b")
        copy.remove("a")
        copy.attach(copy.add(nuno.sphere(0.1, position=(3.0, 0.0, 0.1))))
        copy.run(0.1)
        copy.restore(saved)
    else:
        copy = nuno.World(device="cpu")
        if way == "furnished":
            copy.attach(copy.add(nuno.box((0.2, 0.2, 0.2), name="own", position=(7.0, 0.0, 0.1))))
            copy.run(0.1)
        saved = world.save(tmp_path / "boxes.npz")
        copy.restore(tmp_path / "boxes.npz" if way == "file" else saved)
    assert_equal(places(copy), here)
    for _ in range(2):
        copy.run(0.25)
        world.run(0.25)
        later = {name: each.reshape(-1, *here[name].shape)[0] for name, each in places(world).items()}
        assert_equal(places(copy), later)


def test_a_cloth_meets_the_box_that_it_is_over_in_the_batch():
    """It fell on nothing there, as the box stood a metre away; its highest point is on the box, above 0.1 m."""
    world = one_after_the_other()
    towel = world.add(nuno.sheet((0.3, 0.3), (8, 8), position=(1.0, 0.0, 0.2)))
    world.attach(towel)
    futures = world.imagine(2)
    futures.run(1.0)
    assert futures.find(towel.name).vertices[..., 2].max() > 0.1


def test_a_copy_that_fails_leaves_the_rigid_bodies():
    """A snapshot for another batch with a material that does not fit it changes nothing, the solver included."""
    world = the_last_first()
    saved = world.save()
    before, scene = places(world), world._rigid
    object.__setattr__(saved.bodies[1].dynamics, "material", nuno.Rigid(density=[1.0, 2.0, 3.0]))
    with pytest.raises(nuno.InvalidInputError):
        world.restore(saved)
    assert_equal(places(world), before)
    assert world._rigid is scene


def test_restoring_again_and_again_makes_nothing_anew():
    """A world that is as it was saved, but for its motion, keeps its solver: restoring it is quick."""
    world = the_last_first()
    world.run(0.1)
    saved, scene = world.save(), world._rigid
    for _ in range(2):
        world.run(0.2)
        world.restore(saved)
        assert world._rigid is scene


def test_a_file_of_an_older_format_with_rigid_bodies(tmp_path):
    """It does not say what their places are relative to: refused by name; without dynamic ones it is read."""
    world = the_last_first()
    for name, rigid in (("rigid.npz", True), ("static.npz", False)):
        if not rigid:
            world.detach("a")
            world.detach("b")
            world = world_without_solver(world)
        world.save(tmp_path / name)
        with np.load(tmp_path / name) as file:
            arrays = dict(file)
        header = json.loads(str(arrays["header"]))
        header["format"] = 2
        header["world"]["fields"].pop("rigid")
        np.savez(tmp_path / name, **{**arrays, "header": np.array(json.dumps(header))})
    other = nuno.World(device="cpu")
    with pytest.raises(nuno.FileFormatError, match="'a', 'b'"):
        other.restore(tmp_path / "rigid.npz")
    other.restore(tmp_path / "static.npz")
    assert_equal(places(other), places(world))


def world_without_solver(world):
    """The same static bodies in a new world."""
    other = nuno.World(device="cpu")
    for body in world.bodies:
        other.add(world.remove(body))
    return other


def test_a_static_body_that_went_along_a_path_and_back_is_met_where_it_is():
    """The solver leads it; put back to where it was told of it before, it was still met at the path's end."""
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((0.5, 0.5, 0.1), name="table", position=(0.0, 0.0, -0.05)))
    ball = world.add(nuno.box((0.05, 0.05, 0.05), name="ball", position=(0.0, 0.0, 1.0)))
    world.attach(ball)
    world.run(1.0 / 60.0)
    world.move(table, nuno.Path([world.time, world.time + 0.1], [(0.0, 0.0, -0.05), (5.0, 0.0, -0.05)]))
    world.run(0.1)
    table.locate((0.0, 0.0, -0.05))
    world.run(1.0)
    assert ball.position[2] == pytest.approx(0.025, abs=1e-4)  # at rest on it, half its height above


def test_a_batch_takes_room_for_its_own_bodies_and_more_where_one_comes():
    """Copies of a box on a floor have room for two parts in each world; a third body moves as it does alone."""
    world, a, b = two_boxes()
    world.remove(b)
    world.attach(a)
    world.run(0.1)
    batch = world.imagine(3)
    batch.run(1.0 / 60.0)
    assert batch._rigid.solver.table.parts.capacity == 2
    for each in (world, batch):
        if each is world:
            each.run(1.0 / 60.0)
        each.attach(each.add(nuno.box((0.1, 0.1, 0.1), name="c", position=(0.04, 0.0, 0.17))))
        each.run(0.2)
    assert_equal(places(batch), places(world))
