"""What contacts tell: layers of a cloth on each other."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81
FOLD = 0.01  # [m], radius


def folded(seconds=1.0, worlds=1):
    """A strip of a napkin folded over at half of its length, on a floor, after some time."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    flat = nuno.sheet((0.2, 0.05), (20, 5))
    along = flat.vertices[:, 0] + 0.1
    turn = np.clip((along - 0.1) / FOLD, 0.0, np.pi)
    beyond = np.maximum(along - 0.1 - np.pi * FOLD, 0.0)
    x = np.minimum(along, 0.1) + FOLD * np.sin(turn) - beyond
    shape = np.column_stack([x, flat.vertices[:, 1], 0.003 + FOLD * (1.0 - np.cos(turn))])
    napkin = world.add(nuno.cloth_mesh(shape, flat.faces, flat.vertices[:, :2], name="napkin"))
    if worlds > 1:
        world = world.imagine(worlds)
    world.attach(napkin, nuno.Cloth(bending_rigidity=1e-7, air_drag=5.0))
    world.run(seconds)
    return world, world.find("napkin")


def test_a_folded_napkin_bears_its_upper_layer():
    """Equilibrium: the lower layer holds the weight of what lies on it; the layers' forces add up to nothing."""
    world, napkin = folded()
    found = world.contacts(napkin, itself=True)
    own = np.array([name == "napkin" for name in found.others])
    weight = napkin.mass * GRAVITY
    np.testing.assert_allclose(found.forces[own].sum(axis=0), 0.0, atol=1e-6 * weight)
    assert found.forces[~own].sum(axis=0)[2] == pytest.approx(weight, rel=0.01)
    lifted = own & (found.normals[:, 2] > 0.5)
    assert found.points[lifted, 2].min() > found.points[own & (found.normals[:, 2] < -0.5), 2].max()
    # the upper layer is 0.069 m of 0.2 m, and the fold hangs on it in part
    assert 0.069 / 0.2 * weight < found.forces[lifted, 2].sum() < (0.069 + np.pi * FOLD) / 0.2 * weight


def test_itself_is_asked_for():
    """Contacts are those with others, unless asked for; a cloth that may pass through itself has none of its own."""
    world, napkin = folded(0.2)
    assert set(world.contacts(napkin).others) == {"floor"}
    assert set(world.contacts(napkin, itself=True).others) == {"floor", "napkin"}
    world.ignore_contact(napkin, napkin)
    assert set(world.contacts(napkin, itself=True).others) == {"floor"}


def test_asking_changes_nothing_and_worlds_are_told_apart():
    """The world goes on bit for bit; a world of a batch has the contacts that it has alone."""
    world, napkin = folded(0.2)
    futures, _ = folded(0.2, worlds=2)
    alone, both = world.contacts(napkin, itself=True), futures.contacts("napkin", itself=True)
    for k in range(2):
        np.testing.assert_array_equal(both.forces[both.worlds == k], alone.forces)
    saved = world.save()
    world.run(0.1)
    after = napkin.vertices
    world.restore(saved)
    world.contacts(napkin, itself=True)
    world.run(0.1)
    np.testing.assert_array_equal(napkin.vertices, after)
