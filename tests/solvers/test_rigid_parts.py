"""Rigid bodies that are joined go through a frame in parts of the worlds: rows grow, and nothing depends on parts."""

import numpy as np

import nuno
from nuno.rigid import rigid_arrays

WORLDS = 8
"""Two parts of four."""


def flaps(worlds):
    """Return where the bodies of these worlds are after 0.6 s, (worlds, n, 3) [m], and how long rows are.

    A flap hangs on a post; balls that lie on it leap by another speed in each world, and come down after each other.
    """
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    flap = world.add(nuno.box((0.5, 0.5, 0.04), name="flap", position=(0.0, 0.0, 0.2)))
    post = world.add(nuno.box((0.5, 0.04, 0.4), name="post", position=(0.0, 0.3, 0.2)))
    world.attach(flap, nuno.Rigid(mass=5.0))
    world.attach(post, nuno.Rigid(mass=50.0))
    nuno.hinge(flap, post, point=(0.0, 0.27, 0.2), axis=(1.0, 0.0, 0.0))
    names = ["flap", "post"]
    for k in range(8):
        ball = world.add(nuno.sphere(0.03, name=f"ball {k}", position=(0.08 * (k % 4) - 0.12, 0.08 * (k // 4), 0.26)))
        world.attach(ball, nuno.Rigid(mass=0.1))
        names.append(ball.name)
    futures = world.imagine(len(worlds))
    for k, name in enumerate(names[2:]):
        leaps = np.where(worlds % 4 == 2, 0.0, 1.0 + 0.2 * worlds)  # where nothing leaps rows are too short at once
        velocity = np.stack([0.02 * k * (worlds % 3), np.zeros(len(worlds)), leaps], axis=1)
        futures.set_velocity(name, velocity)
    futures.run(0.6, progress=False)
    places = np.stack([futures.find(name).pose()[0].reshape(-1, 3) for name in names], axis=1)
    return places, futures._rigid.solver.manifolds.row


def test_rows_that_grow_on_the_way_change_nothing(monkeypatch):
    """Where rows are too short in some worlds, in others or in none, every body goes the same way to the bit."""
    long, room = flaps(np.arange(WORLDS))
    assert room == rigid_arrays.ROW
    monkeypatch.setattr(rigid_arrays, "ROW", 1)
    short, grown = flaps(np.arange(WORLDS))
    assert 1 < grown < room
    np.testing.assert_array_equal(short, long)


def test_a_world_of_a_batch_is_what_it_is_alone():
    """The last world of each part has the bits that it has by itself."""
    together, _ = flaps(np.arange(WORLDS))
    for k in (3, 7):
        alone, _ = flaps(np.array([k]))
        np.testing.assert_array_equal(alone[0], together[k])


def test_what_is_gone_back_to_goes_on_as_it_did():
    """Copies of the taken places suffice: after another future has filled others, all goes on with the same bits."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    boxes = [
        world.add(nuno.box((0.1, 0.1, 0.1), name=f"box {k}", position=(0.0, 0.0, 0.05 + 0.101 * k))) for k in (0, 1)
    ]
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.3, 0.0, 0.05)))
    for body in (*boxes, ball):
        world.attach(body, nuno.Rigid(mass=1.0))
    world.run(0.2, progress=False)
    solver = world._rigid.solver
    kept = solver.copies({})
    ends = []
    for push in (0.0, 3.0, 0.0):  # the second time the ball runs into the boxes
        assert not solver.take_copies(kept)
        world.set_velocity(ball, (-push, 0.0, 0.0))
        world.run(0.3, progress=False)
        ends.append(np.concatenate([body.pose()[0] for body in (*boxes, ball)]))
    assert np.abs(ends[1] - ends[0]).max() > 0.01
    np.testing.assert_array_equal(ends[2], ends[0])
