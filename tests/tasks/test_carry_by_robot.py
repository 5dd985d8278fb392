"""Carrying a mat by a whole robot, without weight; with weight it takes minutes (benchmarks/carry.py --body weight)."""

import numpy as np
import pytest

import nuno
from nuno.bodies.make_bodies import soft_box
from nuno.tasks.carry_by_robot import carry_by_robot
from nuno.tasks.carry_mat import CELLS, FOAM, SIZE, WALK, plan_arms
from nuno.tasks.carry_plan import make_plan

pytestmark = pytest.mark.long


def plan_of(robot, distance, **times):
    """A plan of one distance between the hands."""
    tracks = plan_arms(robot, arm_distances=[distance], **times)
    return make_plan(tracks, soft_box(SIZE, cells=CELLS), FOAM, hold="support", arm_friction=0.5)


def test_a_mat_is_carried_and_one_is_lost():
    """Hands near each other under the mat's middle carry it; hands far apart lose it while it is laid down."""
    robot = nuno.Humanoid("talos")
    before = robot.configuration()
    seen = []
    found = carry_by_robot(
        robot, plan_of(robot, 0.22, settle=0.6, seconds=0.4), 0, np.array([0.05, 0.0]), dynamics=False, goal=WALK,
        watch=lambda driver, mat, time: seen.append((time, driver.state().q[:3])),
    )  # fmt: skip
    assert found.reason == "" and np.isnan(found.failed_at)
    assert 0.0 < found.value < 0.01
    assert found.base_error < 1e-6  # without weight the base is where the walk has it
    assert len(seen) == 60 and seen[-1][0] == pytest.approx(0.4)
    np.testing.assert_array_equal(robot.configuration(), before)
    lost = carry_by_robot(
        robot, plan_of(robot, 0.445, settle=1.5, seconds=0.2), 0, np.array([0.05, 0.12]), dynamics=False, goal=WALK
    )
    assert "lost contact" in lost.reason or "fell by more than" in lost.reason
    assert lost.failed_at < 0.0 and np.isnan(lost.value)
