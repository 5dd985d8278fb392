"""Stance: feet that stand keep their places while the legs move."""

import numpy as np
from differences import central_differences

import nuno


def test_what_was_planned_with_feet_on_the_ground_arrives_so(simulated):
    """The whole body reaches, the driver has the joints only: hand, base and feet end where the plan has them."""
    plan = nuno.Humanoid()
    feet = {foot: plan.frame_pose(foot) for foot in plan.feet}
    assert plan.reach({"left_hand": (0.5, 0.2, 0.9)})
    assert np.linalg.norm(plan.position - simulated.actual.position) > 0.02  # [m] the trunk has its part in it
    simulated.angle_vector(plan.angle_vector(), 1.0)
    while simulated.is_interpolating():
        simulated.world.step()
        held = simulated.actual.frame_pose("left_foot")
        np.testing.assert_allclose(held.position, feet["left_foot"].position, atol=1e-12)
        # joints in between are not of the plan: the other foot scrapes, within what counts as standing
        other = simulated.actual.frame_pose("right_foot").position - feet["right_foot"].position
        assert np.linalg.norm(other) < 5e-3
    for frame in ("left_hand", "right_foot"):
        there = simulated.actual.frame_pose(frame).position
        # reach() lets feet be 0.1 mm off, which is seen at the hand; goals arrive exactly
        np.testing.assert_allclose(there, plan.frame_pose(frame).position, atol=2e-4)
    assert simulated.read().contacts == {"left_foot": True, "right_foot": True}
    assert simulated.go_pos(0.1)


def test_the_base_moves_as_its_velocity_says(simulated):
    """Derivatives of the configuration, by central differences, while it crouches."""
    knees = {f"leg_{side}_{k}_joint": angle
             for side in ("left", "right") for k, angle in ((3, -0.7), (4, 1.4), (5, -0.7))}  # fmt: skip
    simulated.angle_vector(knees, 2.0)
    simulated.sleep(0.5)
    state, rate, change = central_differences(simulated)
    assert np.abs(state.v[:6]).max() > 0.05
    # third derivatives of about 1 m/s3, over a sixth of the frame's square; twice that for differences of velocities
    np.testing.assert_allclose(state.v[:6], rate[:6], atol=2e-4)
    np.testing.assert_allclose(state.a[:6], change[:6], atol=1e-3)


def test_arms_and_a_lifted_leg_leave_the_base(simulated):
    """What does not carry the robot does not move it; the lower foot carries it."""
    base = simulated.actual.position
    simulated.angle_vector({"arm_left_4_joint": -1.0, "leg_right_4_joint": 1.3}, 0.5)
    simulated.wait_interpolation()
    np.testing.assert_array_equal(simulated.actual.position, base)
    # with the right foot in the air, the left leg bends: the left foot stays, the body sinks towards it
    foot = simulated.actual.frame_pose("left_foot").position
    simulated.angle_vector({"leg_left_3_joint": -0.6, "leg_left_4_joint": 1.2, "leg_left_5_joint": -0.6}, 0.5)
    simulated.wait_interpolation()
    np.testing.assert_allclose(simulated.actual.frame_pose("left_foot").position, foot, atol=1e-12)
    assert simulated.actual.position[2] < base[2] - 0.02
