"""Worlds read: how many rigid bodies move, at once."""

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError


def test_many_rigid_bodies_are_read_as_one_by_one():
    """Poses, and velocities of their frames, of two worlds; a centre of mass beside the frame's origin."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    ball = world.add(nuno.sphere(0.1, name="ball"))
    rod = world.add(nuno.box((0.4, 0.1, 0.1), name="rod", position=(1.0, 0.0, 0.0)))
    world.attach(ball)
    world.attach(rod, nuno.Rigid(mass=2.0, inertia=np.eye(3) * 0.1, centre_of_mass=(0.1, 0.0, 0.0)))
    futures = world.imagine(2)
    futures.set_velocity(rod, [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)], [(0.0, 0.0, 2.0), (0.0, 3.0, 0.0)])
    futures.run(0.1)
    places, turns, velocities, spins = futures.rigid_motion([rod, "ball"])
    for k, name in enumerate(("rod", "ball")):
        body = futures.find(name)
        np.testing.assert_allclose(places[:, k], body.pose()[0], atol=1e-12)
        np.testing.assert_allclose(turns[:, k], np.broadcast_to(body.pose()[1], (2, 4)), atol=1e-12)
        np.testing.assert_allclose(spins[:, k], body.angular_velocity, atol=1e-12)
        arm = places[:, k] - body.centre_of_mass
        np.testing.assert_allclose(velocities[:, k], body.velocity + np.cross(body.angular_velocity, arm), atol=1e-9)
    assert np.abs(velocities[:, 0] - futures.find("rod").velocity).max() > 0.1
    with pytest.raises(nuno.InvalidInputError, match="at least one"):
        world.rigid_motion(())


def test_what_has_no_such_motion_is_refused():
    """Static bodies, soft ones, one body in place of several, and nothing at all."""
    world = nuno.World(device="cpu")
    box = world.add(nuno.box((0.1, 0.1, 0.1), name="box"))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (2, 2, 2), name="cube", position=(1.0, 0.0, 0.0)))
    world.attach(cube)
    for given, error in (
        ([box], BodyStateError), ([cube], InvalidInputError), (box, InvalidInputError), ("box", InvalidInputError),
        (None, InvalidInputError),
    ):  # fmt: skip
        with pytest.raises(error):
            world.rigid_motion(given)
