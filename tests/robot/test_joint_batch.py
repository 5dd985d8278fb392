"""Joints of many copies, moved together: to the bit what each copy gives alone."""

import numpy as np
import pytest

from nuno.robot.joint_batch import JointBatch
from nuno.robot.simulated_joints import SimulatedJoints
from nuno.robot.trajectory import JointTrajectory

FRAME = 1.0 / 60.0  # [s]
GROUPS = {"head": ("head_1_joint", "head_2_joint"), "arm": ("arm_left_1_joint", "arm_left_4_joint")}


def copies(robot):
    """Return joints of four copies: one rests, one goes through points, one is sent too fast, and one begins later."""
    made = [SimulatedJoints(robot, GROUPS) for _ in range(4)]
    rows = made[0].rows
    here = made[0].positions
    points = here[rows["arm"]] + np.array([[0.1, -0.2], [0.2, -0.1], [0.05, -0.3]])
    speeds = np.array([[0.2, 0.1], [-0.3, 0.2], [0.0, 0.0]])
    made[1].send("arm", JointTrajectory(GROUPS["arm"], [0.11, 0.3, 0.52], points, speeds))
    made[2].send("head", JointTrajectory(GROUPS["head"], [0.05], here[rows["head"]][None] + (0.3, 0.2)))
    made[3].send("arm", JointTrajectory(GROUPS["arm"], [0.2], points[:1]), start_time=0.15)
    return made


def test_together_and_alone_are_the_same_to_the_bit(still_talos):
    """Through starts, points on the way, lags behind the speed limit, ends of goals and rest."""
    alone, together = copies(still_talos), copies(still_talos)
    batch = JointBatch(together)
    asked = 0
    for _ in range(45):
        for own in alone:
            own.step(FRAME)
            own.take_step()
        motion, desired, _ = batch.step(FRAME)
        due = batch.due(FRAME)
        asked += due.sum()
        for k in np.flatnonzero(due):
            batch.scatter(k)
            together[k].step(FRAME)
            together[k].take_step()
            batch.gather(k)
        batch.take(~due, FRAME, motion, desired)
        for k, own in enumerate(alone):
            assert batch.clock[k] == own.clock
            np.testing.assert_array_equal(batch.motion[:, k], (own.positions, own.velocities, own.accelerations))
            np.testing.assert_array_equal(batch.desired[:, k], own.desired)
    assert 3 <= asked <= 45  # of 180: starts, points, ends, and frames in which a goal is late
    for k, own in enumerate(together):
        batch.scatter(k)
        assert own.clock == alone[k].clock and np.array_equal(own.positions, alone[k].positions)
        for name, controller in own.controllers.items():
            other = alone[k].controllers[name]
            assert (controller.goal is None) == (other.goal is None)
            if controller.goal is not None:
                assert controller.goal.status == other.goal.status and controller.goal.is_done


def test_the_lag_is_in_the_scene(still_talos):
    """The head of the third copy is at its speed limit at first: else the test above would not hold what it says."""
    own = copies(still_talos)[2]
    own.step(FRAME)
    own.take_step()
    k = own.rows["head"][0]
    assert own.velocities[k] == pytest.approx(own.velocity_limits[k], rel=1e-8)
    assert own.desired[0][k] > own.positions[k]
