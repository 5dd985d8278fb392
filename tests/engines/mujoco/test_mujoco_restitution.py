"""Restitution on MuJoCo: bounces against Newton's law of impact."""

import logging

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")


def _named(world, name):
    return next(body for body in world.bodies if body.name == name)


@pytest.mark.parametrize("e", [0.2, 0.5, 0.8, 1.0])
def test_a_ball_comes_back_at_its_share_of_the_height(e):
    """A ball that fell by 0.5 m rises to e^2 of that, to 0.1 % of 0.5 m, of which the contact's own give takes half."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.55)))
    world.attach(ball, nuno.Rigid(restitution=e))
    fall = np.sqrt(2 * 0.5 / 9.81)
    world.run(fall + e * fall - 3 / 480)
    heights = []
    for _ in range(7):
        heights.append(float(ball.position[2]) - 0.05)
        world.run(1 / 480)
    assert max(heights) == pytest.approx(0.5 * e**2, abs=0.0005)


def test_the_livelier_of_two_counts_in_each_world_and_momentum_is_kept():
    """A ball hits one of twice its mass: (1 + e) / 3 of its speed is the other's, to 0.1 %."""
    world = nuno.World(device="cpu", engine="mujoco", gravity=(0.0, 0.0, 0.0))
    a = world.add(nuno.sphere(0.05, name="a"))
    b = world.add(nuno.sphere(0.05, name="b", position=(0.2, 0.0, 0.0)))
    world.attach(a, nuno.Rigid(mass=1.0, restitution=0.2))
    world.attach(b, nuno.Rigid(mass=2.0))
    world.set_velocity(a, (2.0, 0.0, 0.0))
    futures = world.imagine(3)
    futures.set_material("b", nuno.Rigid(mass=2.0, restitution=np.array([0.0, 0.5, 0.9])))
    futures.run(0.2)
    e = np.array([0.2, 0.5, 0.9])
    np.testing.assert_allclose(_named(futures, "b").velocity[:, 0], 2.0 * (1 + e) / 3, rtol=1e-3)
    np.testing.assert_allclose(
        _named(futures, "a").velocity[:, 0] + 2.0 * _named(futures, "b").velocity[:, 0], 2.0, atol=1e-6
    )


def test_a_ball_that_sticks_as_it_bounces_rolls_on():
    """Friction takes 2/7 of the speed along the floor, and gives the spin of rolling; to 1 %."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor", friction=1.0))
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.07)))
    world.attach(ball, nuno.Rigid(restitution=0.5, friction=1.0))
    world.set_velocity(ball, (1.0, 0.0, -2.0))
    world.run(0.03)
    assert ball.velocity[0] == pytest.approx(5.0 / 7.0, rel=0.01)
    assert ball.angular_velocity[1] == pytest.approx(5.0 / 7.0 / 0.05, rel=0.01)


def test_what_bounces_comes_to_rest_and_stands():
    """A stack of boxes of restitution 0.5 stays within 0.1 mm, also with frames that are cut short."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    boxes = [world.add(nuno.box((0.1,) * 3, name=f"b{k}", position=(0.0, 0.0, 0.05 + 0.1 * k))) for k in range(4)]
    start = np.array([box.position for box in boxes])
    for box in boxes:
        world.attach(box, nuno.Rigid(density=500.0, restitution=0.5))
    for _ in range(50):
        world.run(0.011)
    assert np.abs(np.array([box.position for box in boxes]) - start).max() < 1e-4
    np.testing.assert_allclose(world.contacts(boxes[0]).forces.sum(axis=0), (0.0, 0.0, 0.5 * 9.81), atol=0.01)


@pytest.mark.parametrize("e", [0.3, 0.7])
def test_a_corner_of_a_box_bounces_by_the_law_of_impact(e):
    """Without friction the impulse is (1 + e) v / (1 / m + r^2 / I): velocity and spin to 0.1 %."""
    world = nuno.World(device="cpu", engine="mujoco", gravity=(0.0, 0.0, 0.0))
    world.add(nuno.plane(name="floor", friction=0.0))
    box = world.add(nuno.box((0.1, 0.1, 0.1), name="box", position=(0.0, 0.0, 0.12)).rotate(0.3, "y"))
    world.attach(box, nuno.Rigid(mass=1.0, restitution=e, friction=0.0))
    world.set_velocity(box, (0.0, 0.0, -2.0))
    world.run(15 / 480)  # it meets the floor after 29 ms
    arm, moment = 0.05 * (np.cos(0.3) - np.sin(0.3)), 0.1**2 / 6.0
    impulse = (1.0 + e) * 2.0 / (1.0 + arm**2 / moment)
    assert box.velocity[2] == pytest.approx(impulse - 2.0, abs=1e-3 * impulse)
    assert abs(box.angular_velocity[1]) == pytest.approx(impulse * arm / moment, rel=1e-3)


def test_what_touches_a_floor_already_bounces_off_it_and_not_aside():
    """A ball that lies exactly on the floor, 1 m from its origin, and is given 1 m/s down: half of that up, 0.1 %."""
    world = nuno.World(device="cpu", engine="mujoco", gravity=(0.0, 0.0, 0.0))
    world.add(nuno.plane(name="floor"))
    ball = world.add(nuno.sphere(0.05, name="ball", position=(1.0, 0.0, 0.05)))
    world.attach(ball, nuno.Rigid(restitution=0.5))
    world.set_velocity(ball, (0.0, 0.0, -1.0))
    world.run(0.02)
    np.testing.assert_allclose(ball.velocity, (0.0, 0.0, 0.5), atol=1e-3)


@pytest.mark.long
def test_it_bounces_beside_cloth_in_a_batch_restored_and_back_in_nuno():
    """To the same bits alone, in a batch of three and from a snapshot; to e^2 of its height; Nuno's world goes on."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    towel = world.attach(world.add(nuno.sheet((0.2, 0.1), (4, 2), name="towel", position=(0.5, 0.0, 0.05))))
    ball = world.attach(world.add(nuno.sphere(0.05, name="ball", position=(0, 0, 0.55))), nuno.Rigid(restitution=0.5))
    futures, alone = world.imagine(3, engine="mujoco"), world.imagine(1, engine="mujoco")
    fall = np.sqrt(2 * 0.5 / 9.81)
    alone.run(0.3)
    saved = alone.save()
    for each in (futures, alone):
        each.run(1.5 * fall - each.time)
    there = _named(alone, "ball").position
    assert there[2] - 0.05 == pytest.approx(0.125, abs=0.001)  # about the top, by at most half a frame
    np.testing.assert_array_equal(_named(futures, "ball").position, [there] * 3)
    alone.restore(saved)
    alone.run(1.5 * fall - alone.time)
    np.testing.assert_array_equal(_named(alone, "ball").position, there)
    assert _named(alone, "towel").vertices[:, 2].max() < 0.01  # it has come down beside it
    world.adopt(futures, 1)
    np.testing.assert_allclose(ball.position, there, atol=1e-6)
    world.run(0.1)
    assert towel.is_dynamic and world.engine.name == "nuno"


def test_what_touches_is_told_without_the_bounce_that_was():
    """Just after a bounce nothing touches, at whatever distance the pair was let bounce."""
    world = nuno.World(device="cpu", engine="mujoco", frame_rate=480)
    world.add(nuno.plane(name="floor"))
    ball = world.attach(world.add(nuno.sphere(0.05, name="ball", position=(0, 0, 0.1))), nuno.Rigid(restitution=0.8))
    while ball.velocity[2] <= 0.0:
        world.step()
    assert ball.position[2] > 0.05 and len(world.contacts(ball).points) == 0
    assert world.contacts(ball).forces.sum() == 0.0


def test_a_static_mesh_that_is_not_convex_takes_no_bounce_and_a_warning_says_so(caplog):
    """It is a rigid flex, which no explicit pair may name."""
    world = nuno.World(device="cpu", engine="mujoco")
    points = np.array([(-1, -1, 0.2), (1, -1, 0.2), (1, 1, 0.2), (-1, 1, 0.2), (0, 0, 0)], dtype=float)
    bowl = world.add(nuno.mesh((points, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]), name="bowl"))
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.4)))
    world.attach(ball, nuno.Rigid(restitution=0.5))
    with caplog.at_level(logging.WARNING):
        world.run(0.02)
    assert f"'{ball.name}' and '{bowl.name}' have the restitution 0 in place of 0.5" in caplog.text
