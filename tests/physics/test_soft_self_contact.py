"""A soft body that touches itself: a fork whose prongs are pressed together."""

import numpy as np
import pytest

import nuno
from few_variants import few
from nuno.mesh.tetrahedra import box_tetrahedra

CELL = 0.01  # [m]
FORCE = 0.075  # [N] on each prong; without contact they would be 9 mm past each other
SKIN = 5e-4  # [m], what is kept on each side (`nuno.world.coupled_tables.SKIN`)
FOAM = {"density": 1000.0, "youngs_modulus": 5e4, "damping": 0.02}


def fork():
    """Return vertices and tetrahedra of two prongs of 2 x 2 x 6 cells, 2 cells apart, on a base of 6 x 2 x 2."""
    vertices, tets = box_tetrahedra((6 * CELL, 2 * CELL, 8 * CELL), (6, 2, 8))
    middle = vertices[tets].mean(axis=1)
    tets = tets[(np.abs(middle[:, 0]) > CELL) | (middle[:, 2] < -2 * CELL)]
    used, tets = np.unique(tets, return_inverse=True)
    return vertices[used], tets.reshape(-1, 4)


VERTICES, TETS = fork()
TIP = np.isclose(VERTICES[:, 2], 4 * CELL)
RIGHT, LEFT = (TIP & np.isclose(VERTICES[:, 0], side * 3 * CELL) for side in (1, -1))
INNER_RIGHT, INNER_LEFT = (TIP & np.isclose(VERTICES[:, 0], side * CELL) for side in (1, -1))


def closed(self_contact, seconds=0.6, worlds=1, device="cpu"):
    """Return a weightless fork whose tips are pressed together ever harder for half a second, and then on."""
    world = nuno.World(device=device, gravity=(0.0, 0.0, 0.0))
    body = world.add(nuno.soft_tetrahedra(VERTICES, TETS, name="fork"))
    if worlds > 1:
        world = world.imagine(worlds)
    world.attach(body, nuno.Soft(**FOAM, self_contact=self_contact))
    body, force = world.find("fork"), np.zeros_like(VERTICES)
    force[RIGHT, 0], force[LEFT, 0] = -FORCE / RIGHT.sum(), FORCE / LEFT.sum()
    for frame in range(round(60 * seconds)):
        world.push(body, force * min(1.0, (frame + 1) / 30.0))
        world.run(1.0 / 60.0)
    return body


def gaps(vertices):
    """Distances between the inner sides of the tips [m], negative where they are through each other."""
    return vertices[..., INNER_RIGHT, 0] - vertices[..., INNER_LEFT, 0]


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_prongs_close_and_stay_apart(device):
    """Soft surfaces rest two skins apart; forces between two parts of a body add up to none."""
    body = closed(True, device=device)
    np.testing.assert_allclose(gaps(body.vertices), 2 * SKIN, atol=0.02e-3)  # the passes' 1e-8 m, and ringing
    assert np.linalg.norm(body.velocities, axis=-1).max() < 0.01
    mass = body._dynamics.solver.mass[0]
    # a thousandth of each prong's impulse; what rounding of coordinates adds while it rings is a tenth of that
    assert np.linalg.norm(mass @ body.velocities) < 1e-3 * FORCE * 0.35
    assert body.is_dynamic and not len(body._world.contacts(body))  # contacts are those with others
    found = body._world.contacts(body, itself=True)
    right = found.normals[:, 0] > 0.0
    assert set(found.others) == {"fork"} and right.sum() == len(found) // 2
    np.testing.assert_allclose(found.forces.sum(axis=0), 0.0, atol=1e-12)
    assert 0.1 * FORCE < found.forces[right, 0].sum() < FORCE  # the rest bends the prongs


def test_without_it_prongs_pass_through():
    """The default, for it costs nothing."""
    assert not nuno.Soft().self_contact
    assert (gaps(closed(False).vertices) < -5e-3).all()


def test_nothing_changes_until_it_touches():
    """Before the prongs meet the bits are those of a body that does not look for contacts."""
    np.testing.assert_array_equal(closed(True, 0.3).vertices, closed(False, 0.3).vertices)
    assert (gaps(closed(True, 0.3).vertices) > 2 * SKIN).all()


def test_a_batch_is_as_its_worlds_alone():
    """Lists, rows and passes are each world's own."""
    np.testing.assert_array_equal(closed(True, worlds=3).vertices, np.repeat(closed(True).vertices[None], 3, axis=0))


@pytest.mark.parametrize("layers", few([1, 2, 3], 1))
def test_a_thin_plate_does_not_push_itself(layers):
    """Its far side is near, too, but through the material: it falls and lies as one that does not touch itself."""

    def fallen(self_contact):
        world = nuno.World(device="cpu")
        world.add(nuno.box((1.0, 1.0, 0.02), position=(0.0, 0.0, -0.01)))
        plate = world.add(nuno.soft_box((0.02, 0.02, 0.002 * layers), cells=(10, 10, layers), position=(0, 0, 0.01)))
        world.attach(plate, nuno.Soft(**FOAM, self_contact=self_contact))
        world.run(0.1)
        return plate.vertices

    np.testing.assert_array_equal(fallen(True), fallen(False))


def test_it_can_be_changed_while_it_runs():
    """Another material in a running world; a pair that is ignored with itself is left alone."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    body = world.add(nuno.soft_tetrahedra(VERTICES, TETS))
    world.attach(body, nuno.Soft(**FOAM))
    world.run(0.05)
    assert not world._stepping.last
    world.set_material(body, nuno.Soft(**FOAM, self_contact=True))
    world.run(0.05)
    assert world._stepping.last
    saved = world.save()
    world.set_material(body, nuno.Soft(**FOAM))
    world.restore(saved)
    assert body.material.self_contact is True


@pytest.mark.parametrize("value", [2, "yes", np.array([True, False]), None])
def test_self_contact_is_true_or_false(value):
    """One value for all worlds."""
    with pytest.raises(nuno.InvalidInputError, match="self_contact"):
        nuno.Soft(self_contact=value)
