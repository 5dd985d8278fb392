"""What contacts tell: layers of a cloth on each other, and what all gave over a frame."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]
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


def balance(world, body, frames):
    """Of each frame what a body's momentum and weight took, and what contacts gave, (frames, 3) [N s] each."""
    taken, given = [], []
    for _ in range(frames):
        before = body.momentum
        world.step()
        taken.append(body.momentum - before - body.mass * np.array(world.gravity) / world.frame_rate)
        given.append(sum(world.contacts(body).impulses.values(), start=np.zeros(3)))
    return np.array(taken), np.array(given)


@pytest.mark.parametrize("device", DEVICES)
def test_impulses_of_a_rigid_body_at_rest_and_in_a_bounce(device):
    """Balance of momentum, frame by frame: of an impact too, whose force no last substep knows."""
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    ball = world.add(nuno.sphere(0.05, position=(0.0, 0.0, 0.3), name="ball"))
    crate = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.5, 0.0, 0.05), name="crate"))
    lid = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.5, 0.0, 0.15), name="lid"))
    for body, mass in ((ball, 1.0), (crate, 2.0), (lid, 1.0)):
        world.attach(body, nuno.Rigid(mass=mass, restitution=0.5 if body is ball else 0.0))
    taken, given = balance(world, ball, 40)
    assert given[:, 2].max() > 2.0  # it bounced, from 2.2 m/s
    # velocities are float32, and so are sums of up to 1 N s
    np.testing.assert_allclose(given, taken, atol=1e-5)
    world.run(0.5)
    told = world.contacts(crate).impulses
    assert set(told) == {"floor", "lid"}
    np.testing.assert_allclose(told["floor"], (0.0, 0.0, 3.0 * GRAVITY / 60.0), atol=1e-4)
    np.testing.assert_allclose(told["lid"], (0.0, 0.0, -GRAVITY / 60.0), atol=1e-4)
    np.testing.assert_allclose(world.contacts(lid).impulses["crate"], -told["lid"], atol=1e-12)


def test_the_impulse_of_what_has_left():
    """Balance of momentum of a ball that comes and goes at 20 m/s: it is 0.3 m away again when the frame ends."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    world.add(nuno.plane(name="floor"))
    ball = world.add(nuno.sphere(0.05, position=(0.0, 0.0, 0.06), name="ball"))
    world.attach(ball, nuno.Rigid(mass=1.0, restitution=1.0), velocity=(0.0, 0.0, -20.0))
    taken, given = balance(world, ball, 1)
    assert ball.position[2] > 0.3 and taken[0, 2] > 39.0
    np.testing.assert_allclose(given, taken, atol=1e-4)


@pytest.mark.parametrize("device", DEVICES)
def test_impulses_between_a_rigid_body_a_cloth_and_a_soft_one(device):
    """Balance of momentum, frame by frame, while a box falls on a held towel and a soft cube on the box."""
    world = nuno.World(device=device)
    towel = world.add(nuno.sheet((0.3, 0.3), (10, 10), position=(0.0, 0.0, 0.3), name="towel"))
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.36), name="box"))
    cube = world.add(nuno.soft_box((0.08, 0.08, 0.08), (2, 2, 2), position=(0.0, 0.0, 0.46), name="cube"))
    world.attach(towel)
    world.attach(box, nuno.Rigid(mass=0.2))
    world.attach(cube, nuno.Soft(density=100.0))
    world.grip(towel, [0, 10, 110, 120], to=(0.0, 0.0, 0.3))
    taken, given = balance(world, box, 30)
    assert given[:, 2].max() > 1.5 * 0.2 * GRAVITY / 60.0
    # float32 moves of bodies, summed over 30 substeps
    np.testing.assert_allclose(given, taken, atol=1e-3 * 0.2 * GRAVITY / 60.0)
    told, saved = world.contacts(box).impulses, world.save()
    assert set(told) == {"towel", "cube"}
    for name, impulse in told.items():
        np.testing.assert_allclose(world.contacts(name).impulses["box"], -impulse, atol=1e-15)
    world.restore(saved)
    assert world.contacts(box).impulses == {}  # known from the next frame on


def test_impulses_are_those_of_the_last_frame_of_each_world():
    """However many frames a run has; in a batch by world; none of another past after a restore."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.05)))
    world.attach(box, nuno.Rigid(mass=2.0))
    futures = world.imagine(3)
    futures.set_material(box, nuno.Rigid(mass=[1.0, 2.0, 3.0]))
    saved = world.save()
    world.run(0.5)
    whole = 2.0 * GRAVITY / 60.0
    np.testing.assert_allclose(world.contacts(box).impulses["floor"], (0.0, 0.0, whole), atol=1e-4)
    world.run(1.0 / 120.0)
    np.testing.assert_allclose(world.contacts(box).impulses["floor"], (0.0, 0.0, 0.5 * whole), atol=1e-4)
    futures.run(0.5)
    told = futures.contacts(box).impulses["floor"]
    np.testing.assert_allclose(told[:, 2], whole * np.array([0.5, 1.0, 1.5]), atol=1e-4)
    world.restore(saved)
    assert world.contacts(box).impulses == {}
    world.run(0.5)
    other = world.add(nuno.box((0.1, 0.1, 0.1), position=(1.0, 0.0, 0.05)))
    world.attach(other)
    np.testing.assert_allclose(world.contacts(box).impulses["floor"], (0.0, 0.0, whole), atol=1e-4)
    world.remove("floor")
    assert world.contacts(box).impulses == {}
