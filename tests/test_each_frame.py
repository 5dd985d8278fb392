"""What a run tells after each frame."""

import numpy as np
import pytest

import nuno


def falling(device="cpu"):
    """Return a world in which a soft cube falls onto a plate that moves."""
    world = nuno.World(device=device)
    plate = world.add(nuno.box((1.0, 1.0, 0.1), name="plate", position=(0.0, 0.0, -0.05)))
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2), name="cube", position=(0.0, 0.0, 0.06)))
    world.attach("cube", nuno.Soft())
    world.move(plate, nuno.Path([0.0, 1.0], [(0.0, 0.0, -0.05), (0.2, 0.0, -0.05)], interpolation="minimum_jerk"))
    return world


def test_a_run_that_tells_its_frames_is_the_same_run():
    """To the bit; 70.5 frames are told of as 71, with the state at the end of each."""
    plain, told = falling(), falling()
    times, places = [], []

    def see(time):
        times.append(time)
        places.append(told.find("cube").vertices.mean())

    told.run(70.5 / 60.0, each_frame=see)
    plain.run(70.5 / 60.0)
    np.testing.assert_array_equal(told.find("cube").vertices, plain.find("cube").vertices)
    np.testing.assert_allclose(times, [*np.arange(1, 71) / 60.0, 70.5 / 60.0], atol=1e-9)
    assert told.time == plain.time and len(set(places)) > 60


def test_what_a_frame_raises_ends_the_run():
    """The world is then as it was before the piece of the run."""
    world = falling()
    before = world.find("cube").vertices

    def stop(time):
        raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        world.run(0.5, each_frame=stop)
    np.testing.assert_array_equal(world.find("cube").vertices, before)
    assert world.time == 0.0


def test_a_world_in_the_background_tells_no_frames():
    """Its frames are made by another thread."""
    world = falling()
    world.start()
    with pytest.raises(nuno.BodyStateError, match="background"):
        world.run(0.1, each_frame=lambda time: None)
    world.stop()
