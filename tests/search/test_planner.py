"""Planning in imagination, against a closed form and a fixed open-loop plan."""

import numpy as np
import pytest

import nuno
from nuno.errors import EstimationError, InvalidInputError


def ball_in_flight():
    """Return a world with a ball of 1 kg in zero gravity, at rest at the origin."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    ball = world.add(nuno.sphere(0.05, name="ball"))
    world.attach(ball, nuno.Rigid(mass=1.0))
    return world, ball


def push(world, knots):
    """Push the ball for 0.1 s with a force (n, 1, 3) [N] in each world."""
    world.push("ball", knots[:, 0], duration=0.1)


def distance(world):
    """How far the ball is from (0.3, -0.2, 0.1) m."""
    return np.linalg.norm(world.find("ball").position - (0.3, -0.2, 0.1), axis=-1)


@pytest.mark.parametrize(("method", "spread", "within"), [("cem", 3.0, 0.01), ("mppi", 1.0, 0.05)])
def test_a_ball_is_pushed_to_its_goal(method, spread, within):
    """The force that takes it there in 1 s is x / (0.1 (1 - 0.05)) N; found, and the world is as it was."""
    world, ball = ball_in_flight()
    before = ball.position.copy()
    found = nuno.plan(
        world, push, distance, start=np.zeros((1, 3)), spread=spread, horizon=1.0, samples=64, iterations=10,
        method=method,
    )  # fmt: skip
    assert np.array_equal(ball.position, before) and world.time == 0.0
    exact = np.array([[0.3, -0.2, 0.1]]) / (0.1 * 0.95)
    assert found.cost < within
    np.testing.assert_allclose(found.knots, exact, atol=within / 0.095 * 1.05)
    assert (np.diff(found.history) <= 0.0).all() and len(found.history) == 10
    world.push(ball, found.knots[0], duration=0.1)
    world.run(1.0)
    assert np.linalg.norm(ball.position - (0.3, -0.2, 0.1)) == pytest.approx(found.cost, abs=1e-6)


def test_the_same_seed_gives_the_same_plan():
    """To the bit; another seed another one. Bounds hold."""
    world, _ = ball_in_flight()
    options = {"start": np.zeros((1, 3)), "spread": 3.0, "horizon": 0.5, "samples": 8, "iterations": 2}
    one, again, other = (nuno.plan(world, push, distance, seed=seed, **options) for seed in (1, 1, 2))
    assert np.array_equal(one.knots, again.knots) and not np.array_equal(one.knots, other.knots)
    bounded = nuno.plan(world, push, distance, bounds=(-1.0, [1.0, 0.0, 1.0]), **options)
    assert (bounded.knots >= -1.0).all() and (bounded.knots <= (1.0, 0.0, 1.0)).all()


@pytest.mark.long
def test_a_towel_is_laid_where_it_is_wanted():
    """A towel held by an edge: straight down its other edge folds under; the plan lays it flat on its place."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1.0, 1.0, 0.1), name="table", position=(0.0, 0.0, -0.05)))
    towel = world.add(nuno.sheet((0.24, 0.24), cells=(8, 8), name="towel", position=(0.0, 0.0, 0.3)))
    flat = towel.vertices - (0.0, 0.0, 0.298)
    world.attach(towel)
    edge = np.flatnonzero(flat[:, 0] > 0.119)
    hold = world.grip(towel, edge, to=flat[edge].mean(axis=0) + np.array((0.0, 0.0, 0.3)))
    world.run(1.0)
    hold.release()  # each motion takes hold anew
    start = towel.vertices[edge].mean(axis=0)
    span = 1.2

    def act(futures, knots):
        points = np.zeros((len(knots), 4, 3))
        points[:, 0] = start
        points[:, 1:, 0] = knots[:, :, 0]
        points[:, 1:, 2] = knots[:, :, 1]
        times = futures.time + np.linspace(0.0, span, 4)
        futures.grip("towel", edge, to=nuno.Path(times, points if futures.world_count > 1 else points[0]))

    def cost(futures):
        vertices = futures.find("towel").vertices
        return np.linalg.norm(np.reshape(vertices, (-1, *flat.shape)) - flat, axis=-1).mean(axis=-1)

    down = np.linspace(start[[0, 2]], (start[0], 0.01), 4)[1:]
    found = nuno.plan(world, act, cost, start=down, spread=(0.1, 0.05), horizon=span + 0.3, samples=16, iterations=3,
                      bounds=([-0.3, 0.005], [0.3, 0.4]))  # fmt: skip
    assert found.cost < 0.6 * found.history[0] or found.cost < 0.02
    act(world, found.knots[None])
    world.run(span + 0.3)
    assert cost(world)[0] == pytest.approx(found.cost, rel=1e-6)


def test_bad_arguments_are_named():
    """Shapes, spreads, methods and costs that cannot be used; a start from which nothing is possible."""
    world, _ = ball_in_flight()
    options = {"start": np.zeros((1, 3)), "spread": 1.0, "horizon": 0.1, "samples": 4, "iterations": 1}
    for wrong, named in (
        ({"start": [0.0]}, "start"), ({"spread": 0.0}, "spread"), ({"spread": [1.0, 2.0]}, "spread"),
        ({"method": "grid"}, "method"), ({"samples": 1}, "samples"), ({"elites": 9}, "elites"),
        ({"horizon": 0.0}, "horizon"), ({"bounds": (1.0, 0.0)}, "lower bounds"), ({"temperature": 0.0}, "temperature"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=named):
            nuno.plan(world, push, distance, **{**options, **wrong})
    with pytest.raises(InvalidInputError, match="one number for each of 4"):
        nuno.plan(world, push, lambda futures: 1.0, **options)
    with pytest.raises(EstimationError, match="finite cost"):
        nuno.plan(world, push, lambda futures: np.full(4, np.nan), **options)


def test_a_plan_of_fast_cloth_that_is_imagined_roughly_is_told_once(caplog):
    """A sheet in a grip at 6 m/s goes farther in a substep than it is thick: told of a rough plan, once for a world."""

    def planned(speed, thorough, world=None):
        if world is None:
            world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
            world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(3, 3), name="towel")))
        corner = world.find("towel").vertices[0].copy()

        def act(futures, knots):
            ends = corner + knots[:, 0] * speed * 0.1
            path = np.stack([np.broadcast_to(corner, ends.shape), ends], axis=1)
            futures.grip("towel", [0], to=nuno.Path(futures.time + np.array([0.0, 0.1]), path))

        def cost(futures):
            return -futures.find("towel").vertices[:, 0, 0]

        caplog.clear()
        nuno.plan(world, act, cost, start=[[1.0, 0.0, 0.0]], spread=0.01, horizon=0.1, samples=2, iterations=1,
                  thorough=thorough)  # fmt: skip
        told = [record.message for record in caplog.records if "fast frames" in record.message]
        assert all("'towel'" in message and "thorough=True" in message for message in told)
        return len(told), world

    told, world = planned(6.0, False)
    assert told == 1
    assert planned(6.0, False, world)[0] == 0
    assert planned(0.2, False)[0] == 0
    assert planned(6.0, True)[0] == 0


def test_a_plan_that_is_imagined_roughly_has_floats():
    """A sheet with substeps by the rule, fewer than 25 a frame: floats in imagination, and doubles with thorough.

    Floats have no more than 24 bits of their own, so what is read of them relative to the origin is a float to the bit.
    """
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    sheet = world.add(nuno.sheet((0.1, 0.1), cells=(3, 3), name="towel"))
    world.attach(sheet)
    assert sheet.resolution.substeps * 60 < 1500
    for thorough in (False, True):
        found = []

        def act(futures, knots):
            start = futures.find("towel").vertices[:, 0]
            ways = np.stack([start, start + knots[:, 0] / 3.0], axis=1)
            futures.grip("towel", [0], to=nuno.Path(futures.time + np.array([0.0, 0.1]), ways))

        def cost(futures, found=found):
            found.append(futures.find("towel").vertices)
            return np.zeros(2)

        nuno.plan(world, act, cost, start=[[0.01, 0.0, 0.02]], spread=0.01, horizon=0.1, samples=2, iterations=1,
                  thorough=thorough)  # fmt: skip
        assert np.array_equal(found[0], found[0].astype(np.float32)) is not thorough


@pytest.mark.parametrize("thorough", [True, False])
def test_each_iteration_begins_where_the_world_is(thorough):
    """To the bit, a moving cloth, a soft body that is held and a box: what futures go back to is the world itself."""
    world = nuno.World(device="cpu")
    world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="cloth")), velocity=(0.0, 0.1, 0.0))
    soft = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(1, 1, 1), name="soft", position=(0.5, 0.0, 0.0)))
    world.attach(soft)
    world.grip(soft, [0], to=soft.vertices[0])
    world.attach(world.add(nuno.box((0.1, 0.1, 0.1), name="box", position=(-0.5, 0.0, 0.0))))
    world.run(0.02)
    state = [world.find(name).vertices for name in ("cloth", "soft", "box")]
    state += [world.find(name).velocities for name in ("cloth", "soft", "box")]
    begun = []

    def act(futures, knots):
        begun.append(
            [futures.find(name).vertices for name in ("cloth", "soft", "box")]
            + [futures.find(name).velocities for name in ("cloth", "soft", "box")]
        )
        futures.push("box", knots[:, 0], duration=0.02)

    def cost(futures):
        return -futures.find("box").position[:, 2]

    options = {"start": np.ones((1, 3)), "spread": 1.0, "horizon": 0.04, "thorough": thorough}
    found = nuno.plan(world, act, cost, samples=17, iterations=3, **options)
    assert len(begun) == 3
    for own in begun:
        for now, expected in zip(own, state, strict=True):
            assert np.array_equal(now, np.broadcast_to(expected, now.shape))
    futures = world.imagine(2, thorough=thorough)
    futures.push("box", found.knots[0], duration=0.02)
    futures.run(0.04)
    if thorough:  # else coordinates of the plan's cloth are floats
        assert cost(futures)[0] == found.cost
