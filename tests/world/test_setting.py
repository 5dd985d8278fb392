"""Velocities, vertices and poses that are set in some worlds, and states that are read on the device."""

import copy
import pickle

import numpy as np
import pytest

import nuno
from nuno import BodyStateError, InvalidInputError


def batch_of(count=3):
    """A batch with a cloth, a box that falls and a ledge, after two frames."""
    world = nuno.World(device="cpu", substeps=5)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.1, 0.1, 0.02), name="ledge", position=(0.4, 0.0, 0.05)))
    world.attach(world.add(nuno.sheet((0.2, 0.2), (4, 4), name="cloth", position=(0.0, 0.0, 0.1))))
    world.attach(world.add(nuno.box((0.05, 0.05, 0.05), name="box", position=(0.4, 0.0, 0.1))))
    batch = world.imagine(count)
    batch.run(0.05)
    return world, batch


def seen(world, k=None):
    """Positions and velocities of all bodies of a world, or of world k of a batch."""
    arrays = [a for body in world.bodies for a in (body.vertices, body.velocities)]
    return [a if k is None else a[k] for a in arrays]


ALONG = np.stack(np.meshgrid(*2 * [np.linspace(-0.1, 0.1, 5)]), axis=-1).reshape(25, 2)
WAVED = np.array([np.column_stack([ALONG, 0.15 + 0.01 * np.sin(20.0 * ALONG[:, 0] + k)]) for k in range(3)])
CHANGES = {
    "vertices": lambda w, own, **k: w.set_vertices("cloth", own(WAVED), **k),
    "velocity": lambda w, own, **k: w.set_velocity("cloth", own(np.eye(3)), own(np.ones((3, 3))), **k),
    "rigid velocity": lambda w, own, **k: w.set_velocity("box", own(np.eye(3)), own(np.ones((3, 3))), **k),
    "pose": lambda w, own, **k: w.set_pose("cloth", own(np.eye(3)), own(np.full((3, 4), 0.5)), **k),
    "rigid pose": lambda w, own, **k: w.set_pose("box", own(0.2 + np.eye(3)), own(np.full((3, 4), 0.5)), **k),
    "static pose": lambda w, own, **k: w.set_pose("ledge", own(0.3 * np.eye(3)), **k),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_is_set_in_some_worlds_is_set_as_alone(change):
    """The worlds that are named are what they are alone, now and later; the others are as if nothing had happened."""
    world, batch = batch_of()
    before = batch.save()
    change(batch, lambda values: values, worlds=[1, 2])
    now = [seen(batch, k) for k in range(3)]
    batch.run(0.1)
    for k in range(3):
        world.restore(before.pick(k))
        if k:
            change(world, lambda values, k=k: values[k])
        for found, expected in zip(now[k], seen(world), strict=True):
            np.testing.assert_array_equal(found, expected)
        world.run(0.1)
        for found, expected in zip(seen(batch, k), seen(world), strict=True):
            np.testing.assert_array_equal(found, expected)


def test_vertices_are_where_they_were_set():
    """In all worlds, at rest or at a velocity; what cannot be set is named."""
    _, batch = batch_of()
    places = np.random.default_rng(1).random((25, 3))
    batch.set_vertices("cloth", places, (0.0, 1.0, 0.0))
    np.testing.assert_allclose(batch.find("cloth").vertices, np.broadcast_to(places, (3, 25, 3)), atol=1e-7)
    np.testing.assert_array_equal(batch.find("cloth").velocities[2], np.tile((0.0, 1.0, 0.0), (25, 1)))
    with pytest.raises(BodyStateError, match="set_pose"):
        batch.set_vertices("box", np.zeros((8, 3)))
    with pytest.raises(InvalidInputError, match="vertices"):
        batch.set_vertices("cloth", np.zeros((2, 25, 3)))
    for wrong in ([3], np.ones(2, dtype=bool), [1, 1]):
        with pytest.raises(InvalidInputError, match="worlds"):
            batch.set_pose("box", (0.0, 0.0, 1.0), worlds=wrong)
    with pytest.raises(BodyStateError, match="static"):
        batch.set_velocity("ledge", (0.0, 0.0, 1.0), worlds=[0])
    batch.move("ledge", nuno.Path([0.0, 9.0], np.zeros((2, 3))))
    with pytest.raises(BodyStateError, match="path"):
        batch.set_pose("ledge", (0.0, 0.0, 1.0), worlds=[0])


@pytest.mark.parametrize("worlds", [1, 3])
def test_states_are_views_that_are_filled_anew(worlds):
    """With copy=False arrays are the same from step to step, and hold the present state; copies stay as they are."""
    _, batch = batch_of(worlds)
    for name in ("cloth", "box"):
        body = batch.find(name)
        kept, copied = batch.state(name, copy=False), batch.state(name)
        positions = np.from_dlpack(kept["positions"])
        before = positions.copy()
        batch.run(0.05)
        again = batch.state(name, copy=False)
        assert all(again[key].ptr == kept[key].ptr for key in kept)
        shape = (worlds, *np.shape(body.vertices)[-2:])
        np.testing.assert_allclose(positions, body.vertices.reshape(shape), atol=1e-6)
        np.testing.assert_array_equal(kept["velocities"].numpy(), body.velocities.reshape(shape).astype(np.float32))
        np.testing.assert_array_equal(copied["positions"].numpy(), before)


def test_the_force_of_contacts_by_world():
    """A box of 0.1 kg at rest on the floor is borne with its weight in each world; one in the air with nothing."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    box = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.05))), nuno.Rigid(mass=0.1))
    batch = world.imagine(2)
    batch.set_pose(box, (0.0, 0.0, 1.0), worlds=[1])
    batch.run(0.3)
    force = batch.contact_force(box)
    assert force.shape == (2,)
    # an impulse of the last substep: within 1 % of the mean once at rest
    np.testing.assert_allclose(force.numpy(), [(0.0, 0.0, 0.981), (0.0, 0.0, 0.0)], atol=0.01)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps], ids=["copy", "deepcopy", "pickle"])
def test_a_world_is_not_copied_by_accident(copied):
    """A copy would share its bodies: it is refused, with what copies a world."""
    world, _ = batch_of()
    with pytest.raises(BodyStateError, match=r"imagine|save"):
        copied(world)
