"""The torque that a grip bears, of every kind of grip, with its sign: a lever's weight times its arm."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81
LENGTH, DENSITY = 0.2, 200.0
MASS = DENSITY * LENGTH * 0.05**2
LEVER = MASS * GRAVITY * LENGTH / 2.0
"""[N m] What a level bar's weight does about one of its ends: (0, LEVER, 0) for a bar along +x."""


def mean_torque(world, grip, frames=30):
    """The mean of what a grip bears over some frames: force [N], torque [N m]."""
    told = []
    for _ in range(frames):
        world.step()
        told.append(grip.wrench)
    return np.mean([force for force, _ in told], axis=0), np.mean([torque for _, torque in told], axis=0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_rigid_bar_held_at_its_end(direction):
    """Equilibrium: x times weight, about the held body's origin, which is at the end of the bar."""
    world = nuno.World(device="cpu")
    bar = world.add(nuno.compound([(nuno.Box((LENGTH, 0.05, 0.05)), (0.5 * direction * LENGTH, 0.0, 0.0))]))
    world.attach(bar, nuno.Rigid(mass=MASS))
    grip = world.grip(bar, to=bar.position)
    world.run(0.5)
    force, torque = mean_torque(world, grip)
    np.testing.assert_allclose(force, (0.0, 0.0, -MASS * GRAVITY), atol=1e-3)
    np.testing.assert_allclose(torque, (0.0, direction * LEVER, 0.0), atol=0.002 * LEVER)


def soft_bar(world, direction):
    """A soft bar along x whose one end is at the origin, and the vertices of that end."""
    bar = world.add(nuno.soft_box((LENGTH, 0.05, 0.05), (8, 2, 2), position=(0.5 * direction * LENGTH, 0.0, 0.0)))
    world.attach(bar, nuno.Soft(density=DENSITY, youngs_modulus=3e5, damping=0.05, air_drag=5.0))
    return bar, np.flatnonzero(np.abs(bar.vertices[:, 0]) < 1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("how", ["stiff", "compliant", "weld"])
def test_a_soft_bar_held_at_its_end(how, direction):
    """Equilibrium: its weight at half of its length, about the mean of the held points."""
    world = nuno.World(device="cpu")
    bar, end = soft_bar(world, direction)
    if how == "weld":
        block = world.add(nuno.box((0.05, 0.05, 0.05), position=(-0.025 * direction, 0.0, 0.0)))
        world.attach(block, nuno.Rigid(mass=1.0))
        world.grip(block, to=block.position)
        world.ignore_contact(bar, block)
        grip = world.weld(bar, block, end)
    else:
        grip = world.grip(bar, end, to=bar.vertices[end].mean(axis=0), compliance=0.0 if how == "stiff" else 1e-5)
    world.run(1.0)
    force, torque = mean_torque(world, grip)
    np.testing.assert_allclose(force, (0.0, 0.0, -MASS * GRAVITY), atol=0.01 * MASS * GRAVITY)
    # the bar sags by 1 mm, and its middle comes no nearer
    np.testing.assert_allclose(torque, (0.0, direction * LEVER, 0.0), atol=0.02 * LEVER)
