"""Scores of shapes whose score is known, and the scripted baselines."""

import numpy as np
import pytest

import nuno
from nuno.envs import TASKS, ClothVectorEnv, CoverTask, FoldTask, HangTask, ScriptedPolicy, SpreadTask
from nuno.envs.cloth_task import SIDE
from nuno.envs.top_view import TopView

SMALL = {"cells": (4, 4), "substeps": 5, "device": "cpu"}


def score_of(task, vertices, place=(0.0, 0.0, 0.0)):
    """Return the score of one world with the cloth in a shape."""
    world = task.world()
    world.set_vertices("cloth", vertices)
    view = TopView(world, world.find("cloth"))
    return task.score(vertices[None], np.array([place]), view)[0], view


def test_the_view_from_above_measures_area():
    """A flat cloth of 0.3 m covers 900 fields of a square centimetre; turned, as many, but for some on its rim."""
    task = FoldTask(**SMALL)
    _, view = score_of(task, task.flat((0.1, -0.05), 0.0))
    assert view.area()[0] == pytest.approx(SIDE**2, rel=1e-9)
    fields = np.argwhere(view.covered()[0])
    np.testing.assert_allclose((fields.mean(axis=0) + 0.5) / 100.0 - 0.45, (0.1, -0.05), atol=1e-9)
    _, view = score_of(task, task.flat((0.0, 0.0), np.pi / 6))
    assert view.area()[0] == pytest.approx(SIDE**2, rel=0.02)  # 120 fields on the rim, each in or out: 11 of 900
    inside = view.covered_at(np.array([[(0.0, 0.0), (0.2, 0.2), (0.0, 0.14), (-0.44, 0.44)]]))
    assert inside.tolist() == [[True, False, True, False]]


def test_spread_counts_the_area():
    """Flat it is 1; folded in half, a half."""
    task = SpreadTask(**SMALL)
    flat = task.flat((0.0, 0.0), 0.0)
    assert score_of(task, flat)[0] == 1.0
    folded = flat.copy()
    folded[:, 1] = np.abs(folded[:, 1])
    assert score_of(task, folded)[0] == pytest.approx(0.5, abs=0.02)


def test_fold_wants_halves_on_each_other_and_no_heap():
    """Flat is 0, a perfect fold 1, a fold along the other axis and a heap nearly nothing."""
    task = FoldTask(**SMALL)
    flat = task.flat((0.05, 0.0), 0.0)
    assert score_of(task, flat)[0] == pytest.approx(0.0, abs=1e-9)
    folded = flat.copy()
    folded[:, 1] = np.abs(folded[:, 1])
    assert score_of(task, folded)[0] == pytest.approx(1.0, abs=0.02)
    across = flat.copy()
    across[:, 0] = np.abs(across[:, 0])
    assert score_of(task, across)[0] == pytest.approx(0.0, abs=1e-9)
    heap = flat * (0.1, 0.1, 1.0)
    assert score_of(task, heap)[0] < 0.05


def test_hang_wants_both_sides_of_the_rod_alike():
    """On the table it is 0, held before the bar a quarter, hung over it by halves nearly 1."""
    task = HangTask(**SMALL)
    flat, bar = task.flat((0.0, 0.0), 0.0), (0.0, 0.1, 0.3)
    assert score_of(task, flat, bar)[0] == 0.0
    held = np.column_stack([flat[:, 0], np.zeros(25), flat[:, 1] + 0.3])
    assert score_of(task, held, bar)[0] == 0.25
    hung = np.column_stack([flat[:, 0], 0.1 + 0.02 * np.sign(flat[:, 1] - 1e-6), 0.3 - np.abs(flat[:, 1])])
    s = 0.4  # two of five rows are behind it, the row on the bar is not
    assert score_of(task, hung, bar)[0] == pytest.approx((1.0 + 12.0 * s * (1.0 - s)) / 4.0)


def test_cover_counts_the_box():
    """A cloth beside the box covers none of it, one over its middle all, one up to its middle half."""
    task = CoverTask(**SMALL)
    place = np.array((0.0, 0.2, 0.03))
    for y, share in ((-0.05, 0.0), (0.2, 1.0), (0.05, 0.5)):
        vertices = task.flat((0.0, y), 0.0)
        vertices[:, 2] = 0.1
        assert score_of(task, vertices, place)[0] == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name != "cover" else ()) for name in TASKS]
)
def test_the_script_does_better_than_chance(name):
    """Within an episode it solves what it can with so few cells, and far more than random motion."""
    env = ClothVectorEnv(name, 3, autoreset_mode="Disabled", cells=(8, 8), device="cpu")
    policy, best = ScriptedPolicy(env), {}
    random = np.random.default_rng(0)
    for who in ("script", "chance"):
        first = env.reset(seed=11)[1]["score"]
        best[who], solved = first, np.zeros(3, dtype=bool)
        for _ in range(env.task.horizon):
            actions = policy.act() if who == "script" else random.uniform(-1.0, 1.0, (3, 8))
            _, _, terminations, truncations, infos = env.step(actions)
            best[who] = np.maximum(best[who], infos["score"])
            solved |= terminations
            ended = terminations | truncations
            if ended.all():
                break
            if ended.any():
                env.reset(options={"reset_mask": ended})
        if who == "script":
            assert solved.sum() >= 2
    assert best["script"].mean() > best["chance"].mean() + 0.1


@pytest.mark.long
def test_starts_are_at_rest_on_the_table():
    """Dropped cloths lie on the table, whole; every start draws from its generator alone."""
    for task in (cls(**SMALL) for cls in TASKS.values()):
        start, again = (task.start(np.random.default_rng(2)) for _ in range(2))
        np.testing.assert_array_equal(start.vertices, again.vertices)
        assert start.vertices[:, 2].min() > 0.0 and np.abs(start.vertices[:, :2]).max() < 0.4
        assert start.hands.shape == (2, 3)
    dropped = SpreadTask(**SMALL).dropped
    assert dropped.shape == (8, 25, 3) and dropped[..., 2].max() < 0.2


def test_a_task_of_ones_own():
    """A subclass is a task: here one that wants the cloth at the right."""

    class Right(FoldTask):
        """The score is how far right the cloth is."""

        name = "right"
        done_at = 0.9

        def score(self, vertices, places, view):
            """Return the mean x over 0.3 m."""
            return np.clip(vertices[..., 0].mean(axis=1) / 0.3, 0.0, 1.0)

    env = ClothVectorEnv(Right(**SMALL, material=nuno.Cloth(area_density=0.3)), 2)
    env.reset(seed=0)
    assert env.step(np.zeros((2, 8)))[4]["score"].shape == (2,)
