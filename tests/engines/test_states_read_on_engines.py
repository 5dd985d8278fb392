"""What reads states works on any engine: sweeps, recordings, films and the viewer, one test for each engine."""

import numpy as np
import pytest

import nuno

GRAVITY = 9.81  # [m/s2]


def room(engine):
    """Return a world with a ball and a towel that fall."""
    world = nuno.World(device="cpu", engine=engine)
    world.attach(world.add(nuno.sphere(0.05, name="ball", position=(0, 0, 2))))
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), name="towel", position=(1, 0, 2)))
    world.attach(towel, nuno.Cloth(air_drag=0.0))
    return world


def throw(world, params):
    """Throw the ball up at a speed, and return how high it is after 0.1 s, and how fast it fell."""
    world.set_velocity("ball", np.outer(params["speed"], (0.0, 0.0, 1.0)))
    world.run(0.1)
    return {"height": world.find("ball").position[:, 2], "towel": world.find("towel").vertices[..., 2].mean(axis=1)}


@pytest.mark.parametrize("engine", ["mujoco", pytest.param("newton", marks=pytest.mark.slow)])
def test_sweeps_recordings_films_and_the_viewer_work(engine, tmp_path):
    """Free fall in each: z = 2 + v t - g t^2 / 2, to the steps' g t h / 2 of 1.1 mm and Newton's floats of 0.2 mm."""
    pytest.importorskip(engine)
    pytest.importorskip("meshcat")
    found = nuno.sweep(throw, {"speed": [0.0, 1.0, 2.0]}, world=lambda: room(engine))
    assert not found.failures
    fallen = 0.5 * GRAVITY * 0.01
    np.testing.assert_allclose(found.values("height"), 2.0 + 0.1 * np.arange(3) - fallen, atol=1.5e-3)
    np.testing.assert_allclose(found.values("towel"), 2.0 - fallen, atol=1.5e-3)

    world = room(engine)
    recording = nuno.Recording(world)
    with nuno.Viewer(world, port=0) as viewer, viewer.record(tmp_path / "fall.html", rate=60.0) as film:
        for _ in range(6):
            world.run(1.0 / 60.0)
            recording.add()
    np.testing.assert_allclose(film.times, np.arange(7) / 60.0, atol=1e-9)
    assert (tmp_path / "fall.html").stat().st_size > 10_000
    ball = recording["ball"].vertices.mean(axis=1)
    np.testing.assert_allclose(ball[-1, 2], world.find("ball").position[2], atol=1e-6)
    recording.save(tmp_path / "fall.npz")
    again = nuno.Recording.load(tmp_path / "fall.npz")
    np.testing.assert_array_equal(again["towel"].vertices, recording["towel"].vertices)
