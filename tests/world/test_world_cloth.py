"""World with the cloth solver: exact snapshots, batches equal to single worlds, undisturbed bodies."""

import numpy as np
import pytest

import nuno
from nuno import Path


@pytest.fixture(scope="module")
def moment():
    """A world with a gripped cloth above a table, in motion, and its snapshot."""
    world = nuno.World(device="cpu", substeps=10)
    world.add(nuno.box((1, 1, 0.02), name="table"))
    cloth = world.add(nuno.sheet((0.3, 0.2), cells=(6, 4), name="cloth", position=(0, 0, 0.1)))
    world.attach(cloth)
    world.grip(cloth, cloth.at(0.3, 0.3), to=Path([0.0, 1.0], [(-0.06, -0.04, 0.1), (0, 0, 0.3)]))
    world.grip(cloth, [0], to=(-0.15, -0.1, 0.15))
    world.run(0.2)
    return world, cloth, world.save()


@pytest.fixture
def room(moment):
    """The world at that moment, and what its cloth is 0.2 s later."""
    world, cloth, saved = moment
    world.restore(saved)
    world.run(0.2)
    later = cloth.vertices
    world.restore(saved)
    return world, cloth, later


def test_restored_worlds_run_on_bit_for_bit(room, tmp_path):
    """From memory, from a file, and in a new world."""
    world, cloth, later = room
    world.save(tmp_path / "world.npz")
    world.run(0.2)
    np.testing.assert_array_equal(cloth.vertices, later)
    other = nuno.World(device="cpu")
    for restored in (world, other):
        restored.restore(tmp_path / "world.npz")
        restored.run(0.2)
        np.testing.assert_array_equal(restored.find("cloth").vertices, later)


def test_a_batch_is_its_single_worlds_bit_for_bit(room):
    """Each imagined world runs as this one does, and goes on so after it is adopted."""
    world, cloth, later = room
    futures = world.imagine(3)
    futures.run(0.2)
    for vertices in futures.find("cloth").vertices:
        np.testing.assert_array_equal(vertices, later)
    world.adopt(futures, 1)
    np.testing.assert_array_equal(cloth.vertices, later)
    futures.run(0.1)
    world.run(0.1)
    np.testing.assert_array_equal(cloth.vertices, futures.find("cloth").vertices[1])


def test_what_is_done_to_others_leaves_a_cloth_bit_for_bit(room):
    """Attaching, running and removing another cloth out of reach, in runs of the same lengths."""
    world, cloth, _ = room
    now, saved = cloth.vertices, world.save()
    for seconds in (0.1, 0.1):
        world.run(seconds)
    alone = cloth.vertices
    world.restore(saved)
    rag = world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=(5, 0, 1)))
    world.attach(rag)
    np.testing.assert_array_equal(cloth.vertices, now)
    world.run(0.1)
    world.remove(world.detach(rag))
    world.run(0.1)
    np.testing.assert_array_equal(cloth.vertices, alone)


def test_detach_keeps_the_shape_and_others_rest_on_it(room):
    """A detached cloth is a collider in the shape that it has."""
    world, cloth, _ = room
    shape = cloth.vertices
    world.detach(cloth)
    np.testing.assert_array_equal(cloth.vertices, shape)
    top = shape[np.argmax(shape[:, 2])]
    rag = world.add(nuno.sheet((0.06, 0.06), cells=(3, 3), position=top + np.array((0, 0, 0.02))))
    world.attach(rag)
    world.run(0.15)
    # free fall of 0.15 s is 11 cm: without the cloth under it the rag would be well below its highest point
    assert rag.vertices[:, 2].max() > top[2] - 0.02
    world.attach(world.detach(rag))
    np.testing.assert_array_equal(cloth.vertices, shape)


def test_state_on_the_device(room):
    """The arrays for other libraries hold what vertices says."""
    world, cloth, _ = room
    state = world.state(cloth)
    # float32 at lengths below 1 m
    np.testing.assert_allclose(state["positions"].numpy()[0], cloth.vertices, atol=1e-7)
    np.testing.assert_array_equal(state["velocities"].numpy()[0], cloth.velocities)


def test_a_cloth_that_ignores_itself_folds_through_itself():
    """A flap that is carried down through the cloth's other half stops on it, or goes through, also after a restore."""

    def lowest_flap(ignore):
        world = nuno.World(device="cpu", gravity=(0, 0, 0), substeps=10)
        cloth = world.add(nuno.sheet((0.4, 0.2), cells=(8, 4), name="cloth"))
        world.attach(cloth, nuno.Cloth(thickness=0.01, friction=0.0))
        if ignore:
            world.ignore_contact(cloth, cloth)
            world.restore(world.save())
        rows, start = np.arange(5) * 9, cloth.vertices
        flat = (rows[:, None] + np.arange(5, 9)).ravel()
        world.grip(cloth, flat, to=start[flat].mean(axis=0))
        over = [start[rows].mean(axis=0), (-0.1, 0, 0.15), (0.1, 0, 0.05), (0.1, 0, -0.05)]
        world.grip(cloth, rows, to=Path([0.0, 0.5, 1.0, 1.5], over), compliance=0.05)
        world.run(1.5)
        return cloth.vertices[rows, 2].mean()

    assert lowest_flap(ignore=False) > 0.0
    assert lowest_flap(ignore=True) < 0.0
