"""Copies of a world beside one that was built on its own and never saved: on the real solvers, to the bit."""

import numpy as np
import pytest

import nuno

G, SPAN = 9.81, 0.2


def room():
    """Cloth, soft and rigid bodies in motion, with contacts, a grip on a path, a push and a joint under way."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    towel = world.add(nuno.sheet((0.3, 0.2), (6, 4), name="towel", position=(0.0, 0.0, 0.12)))
    world.attach(towel, nuno.Cloth(damping=0.002), velocity=(0.3, -0.2, 0.1))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (2, 2, 2), name="cube", position=(0.5, 0.0, 0.06)))
    world.attach(cube, velocity=(0.0, 0.4, -0.3), angular_velocity=(1.0, 0.0, 2.0))
    brick = world.add(nuno.box((0.1, 0.08, 0.06), name="brick", position=(-0.5, 0.0, 0.2)))
    world.attach(brick, velocity=(0.2, 0.1, 0.5), angular_velocity=(3.0, -1.0, 2.0))
    post = world.add(nuno.box((0.05, 0.05, 0.2), name="post", position=(-1.0, 0.0, 0.3)))
    flap = world.add(nuno.box((0.2, 0.05, 0.02), name="flap", position=(-0.87, 0.0, 0.3)))
    world.attach(flap, angular_velocity=(0.0, 1.0, 0.0))
    nuno.hinge(flap, post, point=(-0.97, 0.0, 0.3), axis=(0, 1, 0))
    corner = towel.vertices[0]
    world.grip(towel, [0], to=nuno.Path([0.0, 0.5], [corner, corner + np.array((0.0, 0.05, 0.1))]), compliance=1e-4)
    world.push(brick, (0.5, 0.0, 0.0), torque=(0.0, 0.01, 0.0), duration=0.3)
    return world


def motion(world):
    """Positions, velocities and momenta of all bodies, by name."""
    found = {}
    for body in world.bodies:
        found[body.name] = [body.vertices, body.velocities]
        if body.is_dynamic:
            found[body.name] += [body.velocity, body.angular_velocity, body.momentum, body.kinetic_energy]
    return found


def assert_equal(found, expected):
    """Check two of ``motion``, to the bit, and that something moves."""
    assert found.keys() == expected.keys()
    for name in expected:
        for a, b in zip(found[name], expected[name], strict=True):
            np.testing.assert_array_equal(a, b, err_msg=name)
    assert min(np.abs(expected[name][1]).max() for name in ("towel", "cube", "brick", "flap")) > 0.01


@pytest.fixture(scope="module")
def halfway():
    """How a world of its own moves at half of the time and at the end of it; nothing is ever saved of it."""
    world = room()
    world.run(SPAN)
    half = motion(world)
    world.run(SPAN)
    return half, motion(world)


@pytest.mark.parametrize("how", ["memory", "file", "same world", "imagined", "adopted"])
def test_a_copy_goes_on_as_a_world_that_was_never_copied(how, halfway, tmp_path):
    """At once and after another span: velocities, multipliers, pushes, paths and contacts are all in the copy."""
    world = room()
    world.run(SPAN)
    if how == "same world":
        saved = world.save()
        world.run(0.1)
        world.restore(saved)
        copy = world
    elif how == "imagined":
        copy = world.imagine(1)
    elif how == "adopted":
        futures = world.imagine(2)
        world.run(0.1)
        world.adopt(futures, 1)
        copy = world
    else:
        copy = nuno.World(device="cpu")
        copy.restore(world.save() if how == "memory" else world.save(tmp_path / "room.npz") and tmp_path / "room.npz")
    assert_equal(motion(copy), halfway[0])
    copy.run(SPAN)
    assert_equal(motion(copy), halfway[1])


def test_a_restored_body_falls_by_the_closed_form(tmp_path):
    """V = v0 - g t and x = x0 + v0 t - g t^2 / 2, where half of the time was before it was saved."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.2, 0.2), (2, 2), name="cloth", position=(0.0, 0.0, 5.0)))
    brick = world.add(nuno.box((0.1, 0.1, 0.1), name="brick", position=(1.0, 0.0, 5.0)))
    world.attach(cloth, nuno.Cloth(air_drag=0.0), velocity=(1.0, 0.0, 2.0))
    world.attach(brick, velocity=(1.0, 0.0, 2.0))
    world.run(0.25)
    world.save(tmp_path / "fall.npz")
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "fall.npz")
    other.run(0.25)
    for name, x in (("cloth", 0.0), ("brick", 1.0)):
        body = other.find(name)
        np.testing.assert_allclose(body.velocity, (1.0, 0.0, 2.0 - G * 0.5), atol=1e-4)
        # symplectic substeps of 1/60 s over n fall by g t dt / 2 more than the parabola: 4 mm of 1.2 m at n = 10
        np.testing.assert_allclose(body.centre_of_mass, (x + 0.5, 0.0, 5.0 + 1.0 - 0.5 * G * 0.25), atol=6e-3)
