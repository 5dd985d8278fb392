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


@pytest.mark.parametrize("direction", [1.0, pytest.param(-1.0, marks=pytest.mark.long)])
@pytest.mark.parametrize("how", ["stiff", "compliant", pytest.param("weld", marks=pytest.mark.long)])
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


@pytest.mark.parametrize("axis", range(3))
def test_a_torque_on_a_held_rigid_body_is_borne(axis):
    """Equilibrium: the grip bears the torque that the body is pushed with, with its sign, and no force."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    cube = world.add(nuno.box((0.05, 0.06, 0.07)))
    world.attach(cube, nuno.Rigid(mass=0.2))
    grip = world.grip(cube, to=cube.position)
    asked = np.zeros(3)
    asked[axis] = 0.02
    world.push(cube, (0.0, 0.0, 0.0), torque=asked)
    world.run(0.5)
    force, torque = mean_torque(world, grip)
    np.testing.assert_allclose(force, 0.0, atol=1e-4)
    np.testing.assert_allclose(torque, asked, atol=0.002 * 0.02)


def test_a_heavy_body_welded_to_a_light_one_turns_with_it():
    """Exact: a pair of 1000 times each other's inertia turns as one about its common axis, at the mean spin."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    heavy = world.add(nuno.box((0.1, 0.1, 0.1)))
    light = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.1)))
    world.attach(heavy, nuno.Rigid(mass=1.0), angular_velocity=(0.0, 0.0, 2.0))
    world.attach(light, nuno.Rigid(mass=0.001), angular_velocity=(0.0, 0.0, 2.0))
    world.ignore_contact(heavy, light)
    weld = world.weld(heavy, light)
    world.push(heavy, (0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.001), duration=0.1)
    world.run(1.0)
    inertia = 1.001 * 0.1**2 / 6.0
    spin = 2.0 + 0.001 * 0.1 / inertia
    for body in (heavy, light):
        np.testing.assert_allclose(body.angular_velocity, (0.0, 0.0, spin), atol=1e-3 * spin)
    assert abs(heavy.quaternion @ light.quaternion) > np.cos(0.5 * 1e-3)  # less than 1 mrad apart
    assert weld.active
