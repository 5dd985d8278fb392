"""Running for a long time: what cannot be counted or has no room is refused by name before anything happens."""

import tracemalloc

import numpy as np
import pytest

import nuno
from nuno.mesh import memory_limit


def scene():
    """Return a world with a small cloth, and the cloth."""
    world = nuno.World(device="cpu")
    return world, world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), name="towel", position=(0, 0, 1))))


@pytest.mark.parametrize("seconds", [1e30, 1.1e9, 3.0e38])
@pytest.mark.parametrize("verb", ["run", "record"])
def test_a_time_that_the_clock_does_not_count_is_refused(seconds, verb):
    """Promise: an error that names the time and the bound, and a world as it was."""
    world, towel = scene()
    before = towel.vertices
    with pytest.raises(nuno.InvalidInputError, match=r"seconds .* up to 1e\+09 s"):
        world.run(seconds) if verb == "run" else nuno.Recording.of(world, seconds)
    assert world.time == 0.0
    np.testing.assert_array_equal(towel.vertices, before)


def test_the_bound_is_of_the_clock():
    """Promise: it counts where a run would end, not how long it is, and a later instant of a trace likewise."""
    world, towel = scene()
    world.run(1.0 / 60.0)
    with pytest.raises(nuno.InvalidInputError, match="seconds"):
        world.run(1e9)
    with pytest.raises(nuno.InvalidInputError, match="times"):
        world.trace(towel, [1.0, 2e9])
    assert world.time == pytest.approx(1.0 / 60.0)


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("progress", [False, None])
def test_a_long_run_takes_no_memory_for_its_time(told, progress):
    """Exact: a run of 31 years, stopped at its 40th frame, took a byte for each 10,000 frames at most."""

    class Stopped(Exception):
        pass

    frames = []

    def look(time):
        frames.append(time)
        if len(frames) == 40:
            raise Stopped

    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 1)))
    if not told:
        world.move("box", nuno.Path([0.0, 1e9], [(0, 0, 0), (1, 0, 0)]))
    tracemalloc.start()
    with pytest.raises(Stopped):
        world.run(9.9e8, progress, each_frame=look)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 9.9e8 * world.frame_rate / 10_000


def test_what_has_no_room_is_refused_before_it_begins():
    """Promise: a recording, a trace and a turned grip that need terabytes name what they need, and nothing happened."""
    world, towel = scene()
    with pytest.raises(nuno.NotEnoughMemoryError, match=r"a recording of \d+ frames would need"):
        nuno.Recording.of(world, 9e8)
    turned = nuno.Path([0.0, 1e9], [(0, 0, 1), (0, 0, 1)], quaternions=[(1, 0, 0, 0), (0, 0, 0, 1)])
    with pytest.raises(nuno.NotEnoughMemoryError, match=r"a grip along a path that turns for 1e\+09 s would need"):
        world.grip(towel, [0], to=turned)
    assert world.time == 0.0 and not towel._dynamics.grips


def test_a_trace_that_has_no_room_is_refused(monkeypatch):
    """Promise: the memory of all instants is asked for first: 1000 of 9 vertices, in 100 kB."""
    world, towel = scene()
    monkeypatch.setattr(memory_limit, "free_bytes", lambda device: 100_000)
    with pytest.raises(nuno.NotEnoughMemoryError, match="a trace of 1000 instants would need"):
        world.trace(towel, np.arange(1, 1001) / 60.0)
    assert world.time == 0.0
    assert world.trace(towel, [1 / 60, 2 / 60]).shape == (2, 9, 3)
