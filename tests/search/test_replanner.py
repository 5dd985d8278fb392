"""Replanning: against a plan that is made once, where the world is not as imagined."""

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError

GOAL = np.array((0.3, -0.2, 0.1))  # [m]


def ball_in_wind(wind=0.0):
    """Return a world with a ball of 1 kg, in the air a wind [N] along x that imagined worlds can be without."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    ball = world.add(nuno.sphere(0.05, name="ball"))
    world.attach(ball, nuno.Rigid(mass=1.0))
    world.push(ball, (wind, 0.0, 0.0))
    return world, ball


def push(world, motion):
    """Push the ball with the knots' forces [N], each for its share of the time; futures know of no wind."""
    if world.world_count > 1:
        world.push("ball", (0.0, 0.0, 0.0))
    world.push("ball", motion.values[..., 0, :], duration=motion.seconds / motion.values.shape[-2])


AHEAD = 0.4
"""[s] The ball is to be where its velocity takes it in this time: it comes to its goal at the rate 1 / AHEAD."""
HORIZON = 0.2
"""[s]"""


def miss(world):
    """How far from the goal the ball's velocity takes it after the horizon."""
    ball = world.find("ball")
    return np.linalg.norm(ball.position + AHEAD * ball.velocity - GOAL, axis=-1)


OPTIONS = {
    "now": lambda world: np.zeros(3), "start": np.zeros((1, 3)), "spread": 1.0, "horizon": HORIZON, "samples": 32,
    "iterations": 4,
}  # fmt: skip


def test_replanning_makes_good_what_was_not_imagined():
    """A wind of 0.5 N blows that no future knows of: one plan drifts for ever, replanning leans against it.

    Where it rests, the force that it imagines to need cancels the wind: the distance is W (h^2 / 2 + AHEAD h) = 0.05 m.
    """
    wind, missed = 0.5, []
    for periods in (1, 25):
        world, ball = ball_in_wind(wind)
        found = nuno.replan(world, push, miss, every=0.1, periods=periods, bounds=(-3.0, 3.0), **OPTIONS)
        world.run(max(0.0, 2.5 - world.time))
        assert len(found.plans) == len(found.motions) == len(found.planning_seconds) == periods and not found.done
        missed.append(np.linalg.norm(ball.position - GOAL))
    assert missed[0] > 1.0  # W t^2 / 2 = 1.6 m, and on from the push
    assert missed[1] == pytest.approx(wind * (0.5 * HORIZON**2 + AHEAD * HORIZON), abs=0.03)


def test_the_next_plan_starts_from_what_is_left():
    """Warm start: the first candidate of a period is the rest of the motion before, which costs what it promised.

    The world is as imagined and all plans end at the same time, so that costs never rise from period to period.
    """
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    hand = world.add(nuno.sphere(0.01, name="hand"))
    costs = []

    def lead(own, motion):
        own.move("hand", motion.path(own.time))

    def cost(futures):
        costs.append(np.linalg.norm(futures.find("hand").position - GOAL, axis=-1))
        return costs[-1]

    found = nuno.replan(
        world, lead, cost, now=lambda own: own.find("hand").position, start=np.tile(0.5 * GOAL, (2, 1)), spread=0.05,
        horizon=1.0, every=0.25, periods=9, shrink=True, samples=8, iterations=1,
    )  # fmt: skip
    assert len(found.plans) == 4 and world.time == pytest.approx(1.0)
    assert [motion.seconds for motion in found.motions] == pytest.approx([1.0, 0.75, 0.5, 0.25])
    for before, after in zip(found.motions, found.motions[1:], strict=False):
        np.testing.assert_allclose(after.now, before.at([0.25])[0], atol=1e-9)
    promised = [own.cost for own in found.plans]
    assert (np.diff(promised) <= 1e-9).all() and promised[-1] < promised[0]
    assert [tried[0] for tried in costs[1:]] == pytest.approx(promised[:-1], abs=1e-6)  # its start is the rest
    assert np.linalg.norm(hand.position - GOAL) == pytest.approx(promised[-1], abs=1e-9)


def test_it_ends_when_done_and_acts_through_execute():
    """``execute`` is called once a period with a single motion; ``done`` ends it after the first."""
    world, _ = ball_in_wind()
    told = []
    found = nuno.replan(
        world, push, miss, every=0.1, periods=5, done=lambda own: own.time > 0.15,
        execute=lambda own, motion: told.append((own.world_count, motion.values.shape)), **OPTIONS,
    )  # fmt: skip
    assert found.done and told == [(1, (1, 3))] * 2 and world.time == pytest.approx(0.2)


def test_the_same_seed_gives_the_same_motions():
    """To the bit, in all periods; each period has samples of its own."""
    runs = []
    for seed in (1, 1, 2):
        world, ball = ball_in_wind()
        found = nuno.replan(world, push, miss, every=0.1, periods=2, seed=seed, **OPTIONS)
        runs.append(np.array([*(own.knots for own in found.plans), ball.position[None]]))
    assert np.array_equal(runs[0], runs[1]) and not np.array_equal(runs[0], runs[2])


def test_bad_arguments_are_named():
    """Functions that are none or fail, periods longer than the horizon, numbers of another count."""
    world, _ = ball_in_wind()
    options = OPTIONS | {"every": 0.1, "periods": 1, "samples": 2, "iterations": 1}
    for wrong, named in (
        ({"now": 1}, "now"), ({"now": lambda own: np.zeros(2)}, "what now returns"), ({"every": 0.6}, "every"),
        ({"now": lambda own: 1 / 0}, "now failed: ZeroDivisionError"), ({"periods": 0}, "periods"),
        ({"start": [0.0]}, "start"), ({"execute": 3}, "execute"), ({"done": "yes"}, "done"), ({"seed": -1}, "seed"),
        ({"shrink": 1}, "shrink"), ({"execute": lambda own, motion: 1 / 0}, "execute failed"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=named):
            nuno.replan(world, push, miss, **{**options, **wrong})
    assert world.time == 0.0


def test_futures_that_are_set_back_have_the_bits_of_new_ones(monkeypatch):
    """Plans, and what comes of them, of a cloth that a hand leads: the batch is imagined once, or anew each time."""
    from nuno.search.planned_futures import PlannedFutures

    imagined, own = [], nuno.World.imagine
    monkeypatch.setattr(nuno.World, "imagine", lambda *given, **named: imagined.append(1) or own(*given, **named))

    def run(anew):
        world = nuno.World(device="cpu")
        world.add(nuno.box((0.6, 0.6, 0.02), name="table", position=(0.0, 0.0, -0.01)))
        cloth = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="cloth", position=(0.0, 0.0, 0.002)))
        world.attach(cloth)
        held = []

        def now(world):
            while held:
                held.pop().release()
            return world.find("cloth").vertices[24].astype(float)

        def act(world, motion):
            grip = world.grip("cloth", [24], to=motion.path(world.time))
            if world.world_count == 1:
                held.append(grip)

        def cost(futures):
            return np.linalg.norm(futures.find("cloth").vertices[:, 24] - (0.0, 0.0, 0.05), axis=1)

        begin = PlannedFutures.begin

        def begin_anew(self, *given):
            return begin(PlannedFutures(self._world), *given)

        monkeypatch.setattr(PlannedFutures, "begin", begin_anew if anew else begin)
        imagined.clear()
        found = nuno.replan(
            world, act, cost, now=now, start=[(0.1, 0.1, 0.1), (0.0, 0.0, 0.05)], spread=0.05, horizon=0.2, every=0.1,
            periods=3, samples=4, iterations=2, bounds=(-0.3, 0.3), thorough=False,
        )  # fmt: skip
        monkeypatch.setattr(PlannedFutures, "begin", begin)
        return [plan.knots.tobytes() for plan in found.plans], cloth.vertices.tobytes(), len(imagined)

    plans, vertices, times = run(anew=False)
    assert (plans, vertices, 3) == run(anew=True) and times == 1
