"""Settings of a world, changed while bodies move: all solvers go by them from the next frame on."""

import numpy as np
import pytest

import nuno

G = 9.81


def room(**options):
    """A rigid box, a cloth, a soft cube and a held box, in the air."""
    world = nuno.World(device="cpu", **options)
    world.attach(world.add(nuno.box((0.1,) * 3, name="box", position=(0.0, 0.0, 5.0))), nuno.Rigid(mass=1.0))
    cloth = world.add(nuno.sheet((0.1, 0.1), (3, 3), name="cloth", position=(1.0, 0.0, 5.0)))
    world.attach(cloth, nuno.Cloth(air_drag=0.0))
    world.attach(world.add(nuno.soft_box((0.1,) * 3, (2, 2, 2), name="soft", position=(2.0, 0.0, 5.0))))
    held = world.add(nuno.box((0.1,) * 3, name="held", position=(3.0, 0.0, 5.0)))
    world.attach(held, nuno.Rigid(mass=2.0))
    return world, world.grip(held, to=held.position)


def speeds(world):
    """Vertical velocities of what falls [m/s]."""
    return np.array([world.find(name).velocity[..., 2] for name in ("box", "cloth", "soft")])


def test_gravity_may_change_while_bodies_fall():
    """All that moves accelerates by the new one, v = g t to within rounding, and a grip bears the new weight."""
    world, grip = room()
    world.run(0.1)
    before = speeds(world)
    world.gravity = (0.0, 0.0, 0.5 * G)
    np.testing.assert_array_equal(speeds(world), before)
    world.run(0.1)
    np.testing.assert_allclose(speeds(world), -0.05 * G, rtol=2e-5)
    np.testing.assert_allclose(grip.wrench[0], (0.0, 0.0, 2.0 * 0.5 * G), atol=1e-3)
    assert grip.active


def test_futures_have_a_gravity_of_their_own():
    """A batch falls as it is told, and its world as before."""
    world, _ = room()
    futures = world.imagine(2)
    futures.gravity = (0.0, 0.0, -0.25 * G)
    for own in (world, futures):
        own.run(0.1)
    np.testing.assert_allclose(speeds(world), -0.1 * G, rtol=2e-5)
    np.testing.assert_allclose(speeds(futures), -0.025 * G, rtol=1e-4)


def test_substeps_and_frame_rate_hold_for_what_moves_already():
    """A fall by semi-implicit steps of h says how long they are: z = -g t (t + h) / 2."""
    world, _ = room(substeps=4)
    box = world.find("box")
    world.run(0.1)
    assert box.position[2] == pytest.approx(5.0 - 0.5 * G * 0.1 * (0.1 + 1.0 / 240.0), abs=1e-6)
    start = box.position[2]
    world.set_velocity(box)
    world.substeps, world.frame_rate = 1, 20.0
    world.run(0.1)
    assert box.position[2] == pytest.approx(start - 0.5 * G * 0.1 * (0.1 + 1.0 / 20.0), abs=1e-6)


def test_equal_settings_change_no_bit():
    """What was set to what it was goes on as if nobody had asked."""
    (one, _), (other, _) = room(), room()
    one.run(0.05)
    other.run(0.05)
    other.gravity, other.frame_rate, other.substeps = other.gravity, 60, None
    one.run(0.05)
    other.run(0.05)
    for body in one.bodies:
        np.testing.assert_array_equal(body.vertices, other.find(body.name).vertices)


@pytest.mark.parametrize(
    ("name", "value"), [("gravity", (1.0, 2.0)), ("gravity", (0.0, 0.0, np.nan)), ("frame_rate", 0.0), ("substeps", 0)]
)
def test_bad_settings_are_named(name, value):
    """And leave the world as it was."""
    world, _ = room()
    before = getattr(world, name)
    with pytest.raises(nuno.InvalidInputError, match=name):
        setattr(world, name, value)
    assert getattr(world, name) == before


def test_nobody_changes_them_within_a_run():
    """Dynamic bodies are ahead of the clock there."""
    world, _ = room()

    def look(time):
        world.gravity = (0.0, 0.0, 0.0)

    with pytest.raises(nuno.BodyStateError, match="gravity was called in each_frame"):
        world.run(0.1, each_frame=look)
