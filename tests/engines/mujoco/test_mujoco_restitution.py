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
    """A ball that fell by 0.5 m rises to e^2 of that; to 1 % of 0.5 m, as it sinks in by up to v h = 6.5 mm."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.55)))
    world.attach(ball, nuno.Rigid(restitution=e))
    fall = np.sqrt(2 * 0.5 / 9.81)
    world.run(fall + e * fall)
    heights = []
    for _ in range(5):
        heights.append(float(ball.position[2]) - 0.05)
        world.run(1 / 480)
    assert max(heights) == pytest.approx(0.5 * e**2, abs=0.005)


def test_the_livelier_of_two_counts_in_each_world_and_momentum_is_kept():
    """A ball hits one of twice its mass: (1 + e) / 3 of its speed is the other's, to the spring's 0.02 (1 - e)."""
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
    np.testing.assert_allclose(_named(futures, "b").velocity[:, 0], 2.0 * (1 + e) / 3, atol=0.02)
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


def test_beside_what_deforms_it_is_refused_before_anything_changes():
    """Of attach, set_material and imagine; what is replaced by a restored world does not count."""
    world = nuno.World(device="cpu")
    ball = world.attach(world.add(nuno.sphere(0.05, name="ball", position=(0, 0, 1))), nuno.Rigid(restitution=0.5))
    saved = world.save()
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), name="towel"))
    world.attach(towel)
    match = "mujoco has no restitution beside deformables; engines that have: nuno"
    with pytest.raises(nuno.EngineCapabilityError, match=match):
        world.imagine(2, engine="mujoco")
    other = nuno.World(device="cpu", engine="mujoco")
    towel = other.attach(other.add(nuno.sheet((0.1, 0.1), (2, 2), name="towel")))
    ball = other.add(nuno.sphere(0.05, name="ball", position=(0, 0, 1)))
    with pytest.raises(nuno.EngineCapabilityError, match=match):
        other.attach(ball, nuno.Rigid(restitution=0.5))
    other.attach(ball)
    with pytest.raises(nuno.EngineCapabilityError, match=match):
        other.set_material(ball, nuno.Rigid(restitution=0.5))
    other.restore(saved)
    assert _named(other, "ball").is_dynamic and [body.name for body in other.bodies] == ["ball"]


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
