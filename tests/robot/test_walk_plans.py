"""Walks are planned once for robots that stand alike and are to go alike."""

import gc

import numpy as np
import pytest

import nuno
from nuno.robot import walk_plans
from nuno.robot.walk_plans import WalkPlans


def test_equal_walks_are_one(monkeypatch):
    """The same start, place, time and load give one walk, as by ``plan_walk``; another of any of these another."""
    robot, plans, calls = nuno.Humanoid("talos"), WalkPlans(), []
    real = walk_plans.plan_walk
    monkeypatch.setattr(walk_plans, "plan_walk", lambda *a, **b: calls.append(a) or real(*a, **b))
    walk = plans.plan(robot, 0.05, 0.0, 0.0, None)
    np.testing.assert_array_equal(walk.configurations, real(robot, 0.05).configurations)
    assert plans.plan(robot.copy(), 0.05, 0.0, 0.0, None) is walk and len(calls) == 1
    loaded = plans.plan(robot, 0.05, 0.0, 0.0, None, (2.0, np.array([0.1, 0.0, 0.2])))
    assert loaded is not walk and len(calls) == 2
    robot.angle_vector({"arm_left_4_joint": -1.0})
    assert plans.plan(robot, 0.05, 0.0, 0.0, None) is not walk and len(calls) == 3
    early = plans.stop(walk, float(walk.times[50]))
    assert plans.stop(walk, float(walk.times[50])) is early is not plans.stop(walk, float(walk.times[60]))
    del loaded, early
    gc.collect()
    assert len(plans._walks) == 1  # nothing is kept that nobody has


def test_refusals_are_words():
    """What is too far is no walk, and is not planned again."""
    robot, plans = nuno.Humanoid("talos"), WalkPlans()
    why = plans.plan(robot, 60.0, 0.0, 0.0, None)
    assert isinstance(why, str) and "100 steps" in why and plans.plan(robot, 60.0, 0.0, 0.0, None) is why
    walk = plans.plan(robot, 0.03, 0.0, 0.0, 1.0)
    with pytest.raises(nuno.NunoError, match="faster than the stride"):
        plans.go_on(walk, float(walk.times[20]), 5.0, 0.0, 0.0, 1.0)
