"""Velocities that bodies are attached with, are given, and keep when they become another kind."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81
WEIGHTLESS = (0.0, 0.0, 0.0)
LIGHT = nuno.Cloth(area_density=0.3, air_drag=0.0)
FOAM = nuno.Soft(density=100.0)
SPIN = np.array([0.2, -0.1, 0.4])
SPEED = np.array([1.0, 2.0, -0.5])


def made(kind):
    """A body that a kind of material fits, and that material."""
    return {
        "cloth": (nuno.sheet((0.2, 0.1), (4, 2), position=(1.0, 0.0, 2.0)), LIGHT),
        "soft": (nuno.soft_box((0.1, 0.2, 0.1), (1, 2, 1), position=(1.0, 0.0, 2.0)), FOAM),
        "rigid": (nuno.box((0.1, 0.2, 0.3), position=(1.0, 0.0, 2.0)), nuno.Rigid(mass=0.3)),
    }[kind]


def attached(kind, gravity=WEIGHTLESS, **options):
    """A world with a body of a kind in it; from 25 substeps on, coordinates are doubles and lose no momentum."""
    world = nuno.World(device="cpu", gravity=gravity, substeps=30)
    body, material = made(kind)
    return world, world.attach(world.add(body), material, **options)


def rigid_field(body, velocity=SPEED, spin=SPIN):
    """The velocities of the vertices in a rigid motion about the centre of mass."""
    return velocity + np.cross(spin, body.vertices - body.centre_of_mass)


@pytest.mark.parametrize("kind", ["cloth", "soft", "rigid"])
def test_attached_with_a_velocity(kind):
    """All vertices have the rigid motion's velocities at once, and a second later the body is v t farther."""
    world, body = attached(kind, velocity=SPEED, angular_velocity=SPIN)
    # the solvers keep float32
    np.testing.assert_allclose(body.velocities, rigid_field(body), atol=1e-6)
    before, momentum = body.centre_of_mass, body.angular_momentum()
    world.run(1.0)
    # a rigid body's coordinates are float32: at 2 m each of 1,800 steps is rounded by up to 1.2e-7 m, this way or that
    np.testing.assert_allclose(body.centre_of_mass, before + SPEED, atol=1e-4 if kind == "rigid" else 1e-6)
    # the rigid solver's quaternion is float32, and a body that bends takes some of its turn to vibrate
    np.testing.assert_allclose(body.angular_momentum(), momentum, atol=1e-3 * np.linalg.norm(momentum))


@pytest.mark.parametrize("kind", ["cloth", "soft", "rigid"])
def test_set_at_any_time(kind):
    """Free fall, then thrown up: the height of a throw is v^2 / (2 g); places keep every bit when it is set."""
    world, body = attached(kind, gravity=(0.0, 0.0, -GRAVITY))
    world.run(0.1)
    places = body.vertices
    world.set_velocity(body, (0.0, 0.0, 0.5 * GRAVITY))
    np.testing.assert_array_equal(body.vertices, places)
    np.testing.assert_allclose(body.velocity, (0.0, 0.0, 0.5 * GRAVITY), atol=1e-6)
    np.testing.assert_allclose(body.angular_velocity, 0.0, atol=1e-6)
    start = body.centre_of_mass[2]
    world.run(0.5)
    # a step moves with the velocity of its end: g t dt / 2 short, of 1,800 steps a second
    assert body.centre_of_mass[2] - start == pytest.approx(GRAVITY / 8.0, abs=0.25 * GRAVITY / 1800.0 + 1e-4)


def test_velocities_of_vertices_and_by_world():
    """(n, 3) and (worlds, n, 3) reach each vertex; (worlds, 3) each world; two axes mean vertices where both fit."""
    world = nuno.World(device="cpu", gravity=WEIGHTLESS)
    cloth = world.add(nuno.sheet((0.1, 0.1), (2, 1)))
    rng = np.random.default_rng(0)
    each = rng.normal(size=(6, 3)).astype(np.float32)
    world.attach(cloth, LIGHT, velocity=each)
    np.testing.assert_array_equal(cloth.velocities, each)
    futures = world.imagine(6)
    futures.set_velocity(cloth, 2.0 * each)
    np.testing.assert_array_equal(futures.find("sheet").velocities, np.repeat(2.0 * each[None], 6, axis=0))
    apart = rng.normal(size=(6, 6, 3)).astype(np.float32)
    futures.set_velocity(cloth, apart)
    np.testing.assert_array_equal(futures.find("sheet").velocities, apart)
    box = futures.add(nuno.box((0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0)))
    futures.attach(box, velocity=each, angular_velocity=np.tile(SPIN, (6, 1)))
    np.testing.assert_allclose(box.velocity, each, rtol=1e-6)
    np.testing.assert_allclose(box.angular_velocity, np.tile(SPIN, (6, 1)), rtol=1e-6)


@pytest.mark.parametrize("kind", ["cloth", "soft", "rigid"])
def test_a_world_of_a_batch_and_a_copy_go_on_alike(kind):
    """Combination: thrown, saved, restored and imagined, a body goes on bit for bit."""
    world, body = attached(kind, gravity=(0.0, 0.0, -GRAVITY), velocity=SPEED, angular_velocity=SPIN)
    world.run(0.1)
    world.set_velocity(body, -SPEED, SPIN)
    saved = world.save()
    futures = world.imagine(2)
    world.run(0.2)
    after = body.vertices, body.velocities
    futures.run(0.2)
    for copy in (futures.find(body.name).vertices[1], futures.find(body.name).velocities[1]), None:
        if copy is None:
            world.restore(saved)
            world.run(0.2)
            copy = body.vertices, body.velocities
        np.testing.assert_array_equal(copy[0], after[0])
        np.testing.assert_array_equal(copy[1], after[1])


def falls_on(kind, other):
    """Switch a falling, turning body to another material after 0.2 s, and return what came of it.

    Returns:
        How far the centre of mass fell in 0.4 s [m], and the angular velocities before and after the switch [rad/s].
    """
    world, body = attached(kind, gravity=(0.0, 0.0, -GRAVITY), angular_velocity=SPIN)
    start = body.centre_of_mass[2]
    world.run(0.2)
    before, places, velocity = body.angular_velocity, body.vertices, body.velocity
    world.attach(body, other, keep_velocity=True)
    np.testing.assert_allclose(body.vertices, places, atol=1e-6)  # float32 about another origin
    np.testing.assert_allclose(body.velocity, velocity, atol=1e-6)
    after = body.angular_velocity
    world.run(0.2)
    return start - body.centre_of_mass[2], before, after


SWITCHES = [
    ("cloth", nuno.Rigid(mass=0.006)), ("cloth", nuno.Cloth(area_density=0.5, air_drag=0.0)),
    ("soft", nuno.Rigid(density=100.0)), ("soft", nuno.Soft(density=50.0)), ("rigid", nuno.Rigid(mass=2.0)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "other"), SWITCHES)
def test_a_falling_body_becomes_another_kind(kind, other):
    """Closed form: it falls on as if nothing had happened, g t^2 / 2, and turns on as it turned."""
    fallen, before, after = falls_on(kind, other)
    # a step moves with the velocity of its end: g t dt / 2 more than g t^2 / 2, of 1,800 steps a second
    assert fallen == pytest.approx(0.5 * GRAVITY * 0.16, abs=0.5 * GRAVITY * 0.4 / 1800.0 + 1e-4)
    np.testing.assert_allclose(after, before, atol=1e-5)


@pytest.mark.parametrize("back", [LIGHT, nuno.Rigid(mass=0.006)])
def test_recognised_as_rigid_then_as_cloth(back):
    """A sheet falls as rigid and goes on as cloth with the velocities of all its vertices, and the other way round."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, -GRAVITY))
    sheet = world.add(nuno.sheet((0.2, 0.1), (4, 2)))
    first = nuno.Rigid(mass=0.006) if back is LIGHT else LIGHT
    world.attach(sheet, first, velocity=SPEED, angular_velocity=SPIN)
    world.run(0.1)
    before = sheet.velocities
    world.attach(sheet, back, keep_velocity=True)
    assert sheet.material is back
    # a cloth's vertices have oscillated by what float32 coordinates leave, 6e-8 m at 600 a second
    np.testing.assert_allclose(sheet.velocities, before, atol=1e-6 if back is LIGHT else 1e-4)


def test_momentum_is_kept_where_the_mass_is():
    """A crumpling cloth becomes rigid with its mass: p is kept, and omega is I^-1 L of its vertices."""
    world = nuno.World(device="cpu", gravity=WEIGHTLESS)
    cloth = world.add(nuno.sheet((0.2, 0.1), (8, 4)))
    velocities = np.random.default_rng(1).normal(size=(45, 3))
    world.attach(cloth, LIGHT, velocity=velocities)
    momentum, spin = cloth.momentum, np.linalg.solve(cloth.inertia, cloth.angular_momentum())
    world.attach(cloth, nuno.Rigid(mass=cloth.mass), keep_velocity=True)
    about = cloth.velocity  # of another centre of mass: that of the faces, not of the vertices
    np.testing.assert_allclose(cloth.angular_velocity, spin, rtol=1e-5)
    np.testing.assert_allclose(cloth.mass * about, momentum, atol=1e-6)


def test_from_rest_and_after_a_detach():
    """What is static has no velocity to keep: it starts at rest, also where it was detached at this instant."""
    world, body = attached("cloth", velocity=SPEED)
    world.run(0.1)
    world.detach(body)
    world.attach(body, nuno.Rigid(mass=0.1), keep_velocity=True)
    np.testing.assert_array_equal(body.velocities, np.zeros_like(body.vertices))


def test_another_kind_lets_go_of_grips_and_ties():
    """As when it is detached: what held the body as it was does not hold it as what it becomes."""
    world, body = attached("cloth", gravity=(0.0, 0.0, -GRAVITY))
    held = world.grip(body, [0], to=body.vertices[0])
    world.run(0.1)
    world.attach(body, nuno.Rigid(mass=0.01), keep_velocity=True)
    assert not held.active
    hold = world.grip(body, to=body.position)
    world.run(0.1)
    world.attach(body, LIGHT, keep_velocity=True)
    assert not hold.active
    world.run(0.1)
    assert body.velocity[2] < -0.09 * GRAVITY


def test_another_kind_in_a_batch_and_in_copies():
    """Each world keeps its own velocity; a world that is saved after the switch goes on bit for bit."""
    world, _ = attached("cloth")
    futures = world.imagine(3)
    speeds = np.outer((1.0, 2.0, 3.0), SPEED)
    futures.set_velocity("sheet", speeds, SPIN)
    futures.attach("sheet", nuno.Rigid(mass=0.1), keep_velocity=True)
    np.testing.assert_allclose(futures.find("sheet").velocity, speeds, atol=1e-6)
    futures.attach("sheet", LIGHT, keep_velocity=True)
    world.adopt(futures, 1)
    futures.run(0.1)
    world.run(0.1)
    np.testing.assert_array_equal(world.find("sheet").vertices, futures.find("sheet").vertices[1])


BAD = {
    "nan": dict(velocity=(0.0, np.nan, 0.0)),
    "two numbers": dict(velocity=(0.0, 1.0)),
    "another number of vertices": dict(velocity=np.zeros((7, 3))),
    "spin of two worlds": dict(angular_velocity=np.zeros((2, 3))),
    "spin on top of vertices": dict(velocity=np.zeros((15, 3)), angular_velocity=(0.0, 0.0, 1.0)),
    "text": dict(velocity="fast"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_velocities_change_nothing(name):
    """Every bad velocity is refused by name, before anything changes."""
    world, body = attached("cloth", velocity=SPEED)
    before = body.velocities
    with pytest.raises(nuno.InvalidInputError, match="velocity"):
        world.set_velocity(body, **BAD[name])
    np.testing.assert_array_equal(body.velocities, before)
    world.detach(body)
    with pytest.raises(nuno.InvalidInputError, match="velocity"):
        world.attach(body, LIGHT, **BAD[name])
    assert not body.is_dynamic


def test_bad_switches_change_nothing():
    """A body that is dynamic, static, rigid or given two velocities: errors that name the cure, and nothing changes."""
    world, body = attached("cloth", velocity=SPEED)
    before, own = body.velocities, body._dynamics
    with pytest.raises(nuno.BodyStateError, match="keep_velocity"):
        world.attach(body, nuno.Rigid())
    with pytest.raises(nuno.InvalidInputError, match="keep_velocity"):
        world.attach(body, nuno.Rigid(), velocity=SPEED, keep_velocity=True)
    with pytest.raises(nuno.InvalidInputError):
        world.attach(body, FOAM, keep_velocity=True)
    with pytest.raises(nuno.InvalidInputError):
        world.attach(body, nuno.Rigid(mass=[1.0, 2.0]), keep_velocity=True)
    assert body._dynamics is own
    np.testing.assert_array_equal(body.velocities, before)
    box = world.add(nuno.box((0.1, 0.1, 0.1)))
    with pytest.raises(nuno.BodyStateError, match="attach it with a velocity"):
        world.set_velocity(box, SPEED)
    with pytest.raises(nuno.InvalidInputError, match="velocity"):
        world.attach(box, velocity=np.zeros((8, 3)))
    assert not box.is_dynamic
