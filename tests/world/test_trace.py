"""Traces: a run that tells where a body is at many instants is the run that it would be without."""

import numpy as np
import pytest

import nuno

TIMES = np.array([0.0, 1 / 60, 2 / 60, 0.05, 0.061, 0.9, 55 / 60, 1.0])
"""[s] Now, frames, in between, and a gap of more frames than a run goes through at once."""


def cloth(worlds=1, device="cpu"):
    """Return a world, or a batch of some, in which a cloth hangs by two corners and swings onto a ball."""
    world = nuno.World(device=device)
    world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.9)))
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="towel", position=(0.0, 0.0, 1.0)))
    futures = world.imagine(worlds) if worlds > 1 else world
    drag = np.linspace(0.5, 2.0, worlds) if worlds > 1 else 0.5
    futures.attach(towel, nuno.Cloth(air_drag=drag))
    path = nuno.Path([0.0, 0.5], [(0.0, -0.1, 1.0), (0.1, -0.1, 1.1)], interpolation="minimum_jerk")
    futures.grip(towel, [0, 4], to=path)
    return futures, futures.find("towel")


def cube():
    """Return a world in which a rigid cube falls beside a soft one, onto a plate that moves."""
    world = nuno.World(device="cpu")
    plate = world.add(nuno.box((1.0, 1.0, 0.1), name="plate", position=(0.0, 0.0, -0.05)))
    world.add(nuno.box((0.1, 0.1, 0.1), name="cube", position=(0.2, 0.0, 0.06)))
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2), name="soft", position=(0.0, 0.0, 0.06)))
    for name in ("cube", "soft"):
        world.attach(name)
    world.move(plate, nuno.Path([0.0, 1.0], [(0.0, 0.0, -0.05), (0.2, 0.0, -0.05)]))
    return world, world.find("cube")


def stopped_at(world, body, times):
    """Return the vertices by running from one instant to the next."""
    found = []
    for time in times:
        world.run(max(0.0, time - world.time), progress=False)
        found.append(body.vertices.astype(np.float32))
    return np.array(found)


@pytest.mark.parametrize("make", [cloth, lambda: cloth(3), cube], ids=["one", "batch", "rigid, and a plate that moves"])
def test_a_trace_is_what_stopping_at_each_instant_shows(make):
    """To the bit; and so is the state that it ends in."""
    world, body = make()
    other, same = make()
    traced = world.trace(body, TIMES)
    assert traced.dtype == np.float32
    np.testing.assert_array_equal(traced, stopped_at(other, same, TIMES))
    np.testing.assert_array_equal(body.vertices, same.vertices)
    assert world.time == pytest.approx(1.0, abs=1e-9)
    assert np.ptp(traced, axis=0).max() > 0.01


@pytest.mark.cuda
def test_a_trace_on_cuda_is_what_stopping_at_each_instant_shows():
    """To the bit there too, though nobody waits between the instants."""
    world, body = cloth(3, "cuda:0")
    np.testing.assert_array_equal(world.trace(body, TIMES), stopped_at(*cloth(3, "cuda:0"), TIMES))


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_a_trace_that_diverges_leaves_the_last_good_state(device):
    """As a run does: what comes before the piece of the run is kept."""
    world, body = cloth(2, device)
    world.trace(body, [0.1])
    before = body.vertices
    force = np.zeros((2, 3))
    force[1] = np.float32(3e38)
    world.push(body, force)
    with pytest.raises(nuno.SimulationDiverged) as error:
        world.trace(body, 0.1 + np.arange(1, 5) / 60.0)
    assert error.value.worlds == (1,)
    np.testing.assert_array_equal(body.vertices, before)
    assert world.time == pytest.approx(0.1)


@pytest.mark.parametrize("times", [[], [0.1, 0.1], [0.2, 0.1], [-0.1, 0.1], [np.nan]])
def test_times_must_increase_from_now(times):
    """Nothing moves where they do not."""
    world, body = cloth()
    with pytest.raises(nuno.InvalidInputError, match="times"):
        world.trace(body, times)
    assert world.time == 0.0


def test_what_cannot_be_traced():
    """A static body has no dynamics, and a world in the background is made by another thread."""
    world, body = cloth()
    with pytest.raises(nuno.BodyStateError, match="static"):
        world.trace("ball", [0.1])
    world.start()
    with pytest.raises(nuno.BodyStateError, match="background"):
        world.trace(body, [world.time + 1.0])
    world.stop()
