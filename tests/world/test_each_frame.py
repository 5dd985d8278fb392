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


CALLS = {
    "run": lambda world, cube, grip, saved: world.run(0.1),
    "step": lambda world, cube, grip, saved: world.step(),
    "trace": lambda world, cube, grip, saved: world.trace(cube, [1.0]),
    "start": lambda world, cube, grip, saved: world.start(),
    "attach": lambda world, cube, grip, saved: world.attach("box"),
    "detach": lambda world, cube, grip, saved: world.detach(cube),
    "add": lambda world, cube, grip, saved: world.add(nuno.sphere(0.1)),
    "remove": lambda world, cube, grip, saved: world.remove(cube),
    "move": lambda world, cube, grip, saved: world.move("box", None),
    "set_material": lambda world, cube, grip, saved: world.set_material(cube, nuno.Soft(density=500.0)),
    "grip": lambda world, cube, grip, saved: world.grip(cube, 0, to=(0.0, 0.0, 1.0)),
    "release": lambda world, cube, grip, saved: grip.release(),
    "push": lambda world, cube, grip, saved: world.push(cube, (1.0, 0.0, 0.0), duration=0.1),
    "set_velocity": lambda world, cube, grip, saved: world.set_velocity(cube, (0.0, 0.0, 1.0)),
    "set_friction": lambda world, cube, grip, saved: world.set_friction(cube, "plate", 0.1),
    "ignore_contact": lambda world, cube, grip, saved: world.ignore_contact(cube, "plate"),
    "pose": lambda world, cube, grip, saved: world.find("box").translate((0.0, 0.0, 0.1)),
    "friction": lambda world, cube, grip, saved: setattr(cube, "friction", 0.1),
    "save": lambda world, cube, grip, saved: world.save(),
    "restore": lambda world, cube, grip, saved: world.restore(saved),
    "imagine": lambda world, cube, grip, saved: world.imagine(2),
}


@pytest.mark.parametrize("call", CALLS)
def test_what_changes_the_world_is_refused_in_each_frame(call):
    """The clock is behind the bodies there: a named error; the run goes on as if the call had not been made."""
    world, plain = falling(), falling()
    for each in (world, plain):
        each.add(nuno.box((0.1, 0.1, 0.1), name="box", position=(5.0, 0.0, 0.5)))
        each.grip("cube", 26, to=(0.05, 0.05, 0.11), compliance=1.0)
    cube, saved = world.find("cube"), world.save()
    grip, told = cube._dynamics.grips[0], []

    def look(time):
        with pytest.raises(nuno.BodyStateError, match=f"{call}.* each_frame"):
            CALLS[call](world, cube, grip, saved)
        told.append(time)

    world.run(0.1, each_frame=look)
    plain.run(0.1)
    assert len(told) == 6 and world.time == plain.time
    np.testing.assert_array_equal(cube.vertices, plain.find("cube").vertices)
    world.step()  # after the run all is as ever


def test_each_frame_reads():
    """Vertices, velocities, poses, wrenches and the state on the device are there in each frame."""
    world = falling()
    grip = world.grip("cube", 26, to=(0.05, 0.05, 0.11), compliance=1.0)
    cube, seen = world.find("cube"), []

    def look(time):
        assert np.isfinite(grip.wrench[0]).all() and world.state(cube)["positions"].shape == (1, 27)
        seen.append(cube.position[2])

    world.run(0.1, each_frame=look)
    assert len(set(seen)) == 6 and world.time == pytest.approx(0.1)


def test_a_push_that_ends_within_a_frame_moves_no_frame():
    """A span is its frames, to the bit, also behind the end of a push, and frames are told where they end."""
    ways = []
    for pieces in (1, 6):
        world = falling()
        world.run(0.013)
        body = world.find("cube")
        world.push(body, (0.3, 0.0, 0.0), duration=0.03)
        batch, times = world.imagine(2), []
        for _ in range(pieces):
            world.run(6.0 / pieces / 60.0, each_frame=times.append if pieces == 1 else None)
            batch.run(6.0 / pieces / 60.0)
        if pieces == 1:
            np.testing.assert_allclose(times, 0.013 + np.arange(1, 7) / 60.0, atol=1e-9)
        ways.append((body.vertices, batch.find(body.name).vertices[1]))
    for own in (ways[0][1], *ways[1]):
        np.testing.assert_array_equal(own, ways[0][0])
