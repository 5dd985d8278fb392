"""Air drag means the same for all kinds of bodies."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81
SPEED, SPIN = np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.2, -0.3])
DRAG, SUBSTEPS = 3.0, 30
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]


def thrown(kind, drag, gravity=(0.0, 0.0, 0.0), device="cpu", **options):
    """A world with one body of a kind in it."""
    body, material = {
        "cloth": (nuno.sheet((0.2, 0.1), (4, 2)), nuno.Cloth(air_drag=drag)),
        "soft": (nuno.soft_box((0.1, 0.2, 0.1), (1, 2, 1)), nuno.Soft(air_drag=drag)),
        "rigid": (nuno.box((0.1, 0.2, 0.3)), nuno.Rigid(air_drag=drag)),
    }[kind]
    world = nuno.World(device=device, gravity=gravity, substeps=SUBSTEPS)
    return world, world.attach(world.add(body), material, **options)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("kind", ["cloth", "soft", "rigid"])
def test_velocity_and_spin_decay(kind, device):
    """Closed form: each substep divides by 1 + drag dt, which is exp(-drag t) within drag^2 t dt / 2."""
    world, body = thrown(kind, DRAG, device=device, velocity=SPEED, angular_velocity=SPIN)
    spin = body.angular_momentum()
    world.run(0.5)
    left = (1.0 + DRAG / 60.0 / SUBSTEPS) ** (-30 * SUBSTEPS)
    assert left == pytest.approx(np.exp(-0.5 * DRAG), rel=DRAG**2 * 0.5 / 60.0 / SUBSTEPS)
    np.testing.assert_allclose(body.velocity, left * SPEED, rtol=1e-4)
    # what turns stretches a little as it spins, and a vibration takes some of that
    np.testing.assert_allclose(body.angular_momentum(), left * spin, atol=1e-3 * np.linalg.norm(spin))


@pytest.mark.parametrize("kind", ["cloth", "soft", "rigid"])
def test_terminal_velocity(kind):
    """Closed form: what falls comes to g / drag."""
    world, body = thrown(kind, 20.0, gravity=(0.0, 0.0, -GRAVITY))
    world.run(1.0)
    np.testing.assert_allclose(body.velocity, (0.0, 0.0, -GRAVITY / 20.0), atol=1e-4)


def test_a_rigid_body_by_world_and_in_copies():
    """Each world has its own drag; a saved, restored or adopted one goes on bit for bit; a material changes it."""
    world, box = thrown("rigid", 0.0, velocity=SPEED)
    futures = world.imagine(3)
    futures.set_material(box, nuno.Rigid(air_drag=[0.0, 1.0, 2.0]))
    saved = futures.save()
    futures.run(0.5)
    after = futures.find("box").vertices
    speeds = np.linalg.norm(futures.find("box").velocity, axis=1)
    expected = (1.0 + np.array([0.0, 1.0, 2.0]) / 1800.0) ** -900.0
    np.testing.assert_allclose(speeds / np.linalg.norm(SPEED), expected, rtol=1e-4)
    futures.restore(saved)
    world.adopt(futures, 2)
    assert world.find("box").material.air_drag == 2.0
    futures.run(0.5)
    world.run(0.5)
    np.testing.assert_array_equal(futures.find("box").vertices, after)
    np.testing.assert_array_equal(world.find("box").vertices, after[2])
