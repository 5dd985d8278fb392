"""Joints that are made with a position, and motors that exert a torque or force."""

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError

G = 9.81


def bar(world, **options):
    """Add a bar of 1 kg along x on a hinge about y at its end, at the origin."""
    body = world.add(nuno.box((0.4, 0.05, 0.05), position=(0.2, 0.0, 0.0)))
    world.attach(body, nuno.Rigid(mass=1.0))
    return body, nuno.hinge(body, None, point=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0), **options)


def test_a_hinge_begins_at_its_position():
    """It reads 0.3 rad as it is made, and stops at a limit of 0.5 rad 0.2 rad further."""
    world = nuno.World(device="cpu")
    body, joint = bar(world, position=0.3, limits=(-1.0, 0.5))
    assert joint.position == pytest.approx(0.3, abs=1e-6)
    world.run(1.0)
    assert joint.position == pytest.approx(0.5, abs=1e-4)
    assert np.arcsin(-body.vertices[:, 2].mean() / 0.2) == pytest.approx(0.2, abs=1e-3)


def test_a_slider_begins_at_its_position():
    """It reads 20 mm as it is made, and falls to a stop at -30 mm: 50 mm."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0)))
    world.attach(body, nuno.Rigid(mass=1.0))
    joint = nuno.slider(body, None, axis=(0.0, 0.0, 1.0), position=0.02, limits=(-0.03, 0.1))
    assert joint.position == pytest.approx(0.02, abs=1e-6)
    world.run(0.5)
    assert joint.position == pytest.approx(-0.03, abs=1e-4) and body.position[2] == pytest.approx(0.95, abs=1e-4)


@pytest.mark.parametrize("gains", [{}, {"position": 0.0, "stiffness": 10.0}, {"damping": 0.1}])
def test_a_motor_exerts_an_effort(gains):
    """One that exerts what gravity asks for, m g l / 2, holds a bar level, whatever its gains."""
    world = nuno.World(device="cpu")
    _, joint = bar(world, motor=nuno.Motor(effort=-G * 0.2, **gains))
    world.run(0.2)
    assert joint.effort == pytest.approx(-G * 0.2, rel=2e-3)
    assert joint.position == pytest.approx(0.0, abs=2e-3)


def test_an_effort_alone_turns_what_is_free():
    """A torque on a bar without gravity: an angle of tau t^2 / 2 I; beyond its limit, the limit's."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    _, joint = bar(world, motor=nuno.Motor(effort=0.2, max_effort=0.1))
    world.run(0.5)
    inertia = (0.4**2 + 0.05**2) / 12 + 0.2**2
    assert joint.position == pytest.approx(0.5 * 0.1 * 0.5**2 / inertia, rel=0.01)


def test_bad_positions_and_efforts_are_named():
    """Beyond a turn, not finite, and an effort beside a velocity that is kept exactly."""
    world = nuno.World(device="cpu")
    with pytest.raises(InvalidInputError, match="within -pi and pi"):
        bar(world, position=4.0)
    with pytest.raises(InvalidInputError, match="position"):
        bar(world, position=np.nan)
    with pytest.raises(InvalidInputError, match="keeps no velocity exactly"):
        nuno.Motor(velocity=1.0, effort=1.0)
