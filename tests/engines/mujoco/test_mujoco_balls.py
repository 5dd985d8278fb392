"""Ball joints on MuJoCo with springs, friction and cones, against closed forms."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

G, STEP = 9.81, 1.0 / 480.0
INERTIA = 0.1**2 / 6.0  # [kg m2] of a cube of 1 kg and 10 cm, about any axis


def block_in(world, place=(0.0, 0.0, 1.1), name="block", drag=0.0):
    """Return a dynamic cube of 1 kg."""
    body = world.add(nuno.box((0.1, 0.1, 0.1), name=name, position=place))
    return world.attach(body, nuno.Rigid(mass=1.0, air_drag=drag))


def world_of(**settings):
    """Return an empty world of MuJoCo's."""
    return nuno.World(device="cpu", engine="mujoco", **settings)


def test_a_spring_swings_as_implicit_steps_have_it():
    """About an axis aslant, by the recursion of implicit Euler, within 0.2 % for the helper's share of the mass."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world)
    joint = nuno.ball_joint(block, None, point=block.position, spring=nuno.Spring(2.0, damping=0.002))
    world.set_velocity(block, (0.0, 0.0, 0.0), (3.0, 4.0, 0.0))
    angle, rate = 0.0, 5.0
    for _ in range(6):
        world.step()
        for _ in range(8):
            rate = (rate - STEP * 2.0 / INERTIA * angle) / (1.0 + (STEP**2 * 2.0 + STEP * 0.002) / INERTIA)
            angle += STEP * rate
        np.testing.assert_allclose(joint.position, angle * np.array((0.6, 0.8, 0.0)), atol=0.002 * 0.14)


@pytest.mark.parametrize("share", [0.9, 1.5])
def test_friction_holds_torques_of_any_direction_below_it_and_brakes_above(share):
    """Under 0.9 of it, aslant, it creeps by less than 0.15 mrad; under 1.5 it spins up by the rest, within 0.1 %."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world)
    joint = nuno.ball_joint(block, None, point=block.position, friction=0.01)
    torque = share * 0.01 * np.array((2.0, 3.0, 1.0)) / np.sqrt(14.0)
    world.push(block, (0.0, 0.0, 0.0), torque=torque, duration=1.0)
    world.run(0.3)
    if share < 1.0:
        assert np.linalg.norm(joint.position) < 1.5e-4
        np.testing.assert_allclose(joint.wrench[1], torque, rtol=0.02)  # less what moves the helper
        return
    np.testing.assert_allclose(block.angular_velocity, torque / 3.0 / INERTIA * 0.3, rtol=1e-3)


def test_friction_that_is_set_later_brakes_to_a_stop():
    """W = w0 - M t / I until it stands, within 0.1 %; without it again, what turns turns on."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world)
    joint = nuno.ball_joint(block, None, point=block.position)
    world.set_velocity(block, (0.0, 0.0, 0.0), (1.0, 2.0, 1.0))
    world.run(0.1)
    joint.friction = 0.01
    world.run(0.2)
    left = np.sqrt(6.0) - 0.01 / INERTIA * 0.2
    assert np.linalg.norm(block.angular_velocity) == pytest.approx(left, rel=1e-3)
    joint.friction = 0.0
    world.run(0.1)
    assert np.linalg.norm(block.angular_velocity) == pytest.approx(left, rel=1e-3)
    joint.friction = 0.01
    world.run(0.4)
    assert np.linalg.norm(block.angular_velocity) < 1e-6


@pytest.mark.parametrize("limit", [0.4, 1.5, 2.8])
def test_the_axis_leans_no_farther_than_its_cone(limit):
    """It comes to rest on it, within 0.3 mrad, where its effort is m g r sin(a), within 1 %; the rest is borne."""
    world = world_of()
    block = block_in(world, drag=3.0)
    joint = nuno.ball_joint(block, None, point=(0.0, 0.0, 1.0), limit=limit)
    world.set_velocity(block, (0.1, 0.05, 0.0), (-0.5, 1.0, 0.0))
    world.run(3.0)
    up = block.position - (0.0, 0.0, 1.0)
    assert np.arccos(up[2] / np.linalg.norm(up)) == pytest.approx(limit, abs=3e-4)
    assert joint.effort == pytest.approx(-G * 0.1 * np.sin(limit), rel=0.01)
    np.testing.assert_allclose(joint.wrench[0], (0.0, 0.0, -G), atol=0.01)
    world.set_velocity(block, (0.0, 0.0, 0.0), 0.5 * up / np.linalg.norm(up))
    world.run(0.1)
    assert np.linalg.norm(block.angular_velocity) > 0.3  # about its own axis it turns freely, but for the air


def test_two_bodies_keep_their_momenta():
    """What turns against each other in a joint with a spring, friction and a cone is no push from outside: to 1e-3."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    one, two = block_in(world), block_in(world, (0.0, 0.0, 1.3), "two")
    nuno.ball_joint(two, one, point=(0.0, 0.0, 1.2), limit=0.5, friction=0.005, spring=nuno.Spring(0.1))
    world.set_velocity(two, (0.1, 0.0, 0.0), (0.0, 1.0, 2.0))

    def momenta():
        turning = [np.cross(b.position, b.velocity) + INERTIA * b.angular_velocity for b in (one, two)]
        return np.array([one.velocity + two.velocity, sum(turning)])

    before = momenta()
    world.run(0.6)
    np.testing.assert_allclose(momenta(), before, atol=1e-3)
    assert one.angular_velocity[2] > 0.5  # friction has taken it along


@pytest.mark.long
def test_drives_in_a_batch_are_each_world_s_own_and_restored_to_the_bit():
    """A limited joint with a cone a world: each at its own; the first to the bit as alone, also from a snapshot."""
    world = nuno.World(device="cpu")
    block = block_in(world, drag=3.0)
    nuno.ball_joint(block, None, point=(0.0, 0.0, 1.0), limit=0.3, friction=0.01, max_force=100.0)
    world.set_velocity(block, (0.1, 0.05, 0.0), (-0.5, 1.0, 0.0))
    world.run(0.1)
    alone, futures = world.imagine(1, engine="mujoco"), world.imagine(3, engine="mujoco")
    joint = futures.find("block")._dynamics.grips[0]
    joint.limits = np.array([0.3, 0.5, 0.7])
    for each in (alone, futures):
        each.run(1.0)
    saved = alone.save()
    for each in (alone, futures):
        each.run(1.0)
    up = futures.find("block").position - (0.0, 0.0, 1.0)
    np.testing.assert_allclose(np.arccos(up[:, 2] / np.linalg.norm(up, axis=1)), (0.3, 0.5, 0.7), atol=1e-3)
    there = alone.find("block").position
    np.testing.assert_array_equal(futures.find("block").position[0], there)
    alone.restore(saved)
    alone.run(1.0)
    np.testing.assert_array_equal(alone.find("block").position, there)
