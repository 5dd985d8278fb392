"""Walking: what is planned stands on its soles, by the robot's own dynamics, and ends where it was to end."""

import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import nuno
from few_variants import few
from nuno.errors import InvalidInputError, RobotModelError, UnknownNameError, WalkError
from nuno.robot.footsteps import Footstep, middle_of
from nuno.robot.stride import Stride
from nuno.robot.support import convex_outline, distance_inside
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.walking import continue_walk, plan_walk, plan_walk_footsteps, plan_walk_velocity, stop_walk


@pytest.fixture(scope="module")
def ahead(still_talos):
    """Talos, 0.36 m ahead."""
    return plan_walk(still_talos, 0.36)


def footprint(robot, q):
    """Return the middle of the soles (x, y, yaw) in a configuration."""
    other = robot.copy()
    other.take_configuration(q)
    feet = [other.frame_pose(foot) for foot in robot.feet]
    return middle_of(
        np.array([[*pose.position[:2], np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0])] for pose in feet])
    )


def check_stands(robot, walk, margin):
    """Check the zero moment point from momenta by differences, which is another way than the walk's own check."""
    model, data = robot.model, robot.model.createData()
    momenta, centres = [], []
    for q, v in zip(walk.configurations, walk.velocities, strict=True):
        pin.computeCentroidalMomentum(model, data, q, v)
        momenta.append(data.hg.vector.copy())
        centres.append(data.com[0].copy())
    rates = (np.array(momenta)[2:] - np.array(momenta)[:-2]) / (2 * walk.dt)
    size = robot.description.frames[robot.feet[0]].size
    corners = np.array([(i * size[0] / 2, j * size[1] / 2, 0) for i in (-1, 1) for j in (-1, 1)])
    other, floor, nearest = robot.copy(), 0.0, np.inf
    for k in range(1, len(walk.times) - 1, 10):
        force = rates[k - 1, :3] + robot.mass * np.array([0, 0, 9.81])
        arm = centres[k] - [0, 0, floor]
        # the moment about the point on the floor is upright: rate of angular momentum = (point - centre) x force
        x = arm[0] - (arm[2] * force[0] + rates[k - 1, 4]) / force[2]
        y = arm[1] - (arm[2] * force[1] - rates[k - 1, 3]) / force[2]
        other.take_configuration(walk.configurations[k])
        standing = robot.feet if walk.support[k] == 0 else [robot.feet[walk.support[k] - 1]]
        soles = [other.frame_pose(foot).to_world(corners) for foot in standing]
        assert np.abs(np.concatenate(soles)[:, 2]).max() < 3e-4  # soles of the posture are 0.15 mm off the floor
        outline = convex_outline(np.concatenate(soles)[:, :2])
        nearest = min(nearest, distance_inside(outline, np.array([x, y])))
    # 5 ms differences of an acceleration that changes within 20 ms, times h/g
    assert nearest > margin - 0.002
    assert abs(nearest - walk.measures.margin) < 0.003


@pytest.mark.parametrize(
    "goal",
    [
        (0.36, 0, 0), (0.4, 0.1, 0.4),
        *(pytest.param(goal, marks=pytest.mark.long) for goal in ((0, 0.15, 0), (0, 0, -0.7), (-0.2, 0, 0))),
    ],
)  # fmt: skip
def test_talos_goes_there_and_stands(still_talos, goal):
    """Straight, aside, turning, all, and back: the end within 1 mm, 20 mm to the edge, feet still, limits kept."""
    walk = plan_walk(still_talos, *goal)
    np.testing.assert_allclose(footprint(still_talos, walk.configurations[-1]), goal, atol=1e-6)  # required: 1 mm
    own = walk.measures
    assert own.margin > 0.05  # required: 20 mm; half a sole is 62 mm wide
    assert max(own.zmp_rms) < 0.003
    assert own.drift < 1e-6 and own.drift_turn < 1e-6
    assert own.velocity_share < 0.5 and own.torque_share < 0.7 and own.angle_margin > 0.1
    assert own.collision is None
    check_stands(still_talos, walk, 0.05)


def test_g1_walks_straight(still_g1):
    """Its soles are 60 mm wide: of the 30 mm that there can be, 24 to 26 were found elsewhere."""
    walk = plan_walk(still_g1, 0.3)
    np.testing.assert_allclose(footprint(still_g1, walk.configurations[-1]), (0.3, 0, 0), atol=1e-6)
    assert walk.measures.margin > 0.024
    check_stands(still_g1, walk, 0.024)


def test_a_walk_begins_and_ends_at_rest(still_talos, ahead):
    """From where the robot stands, with both feet on the floor; the posture is the same again."""
    q = still_talos.configuration()
    np.testing.assert_allclose(ahead.configurations[0], q, atol=1e-3)  # the SRDF's soles are not quite level
    assert ahead.support[0] == ahead.support[-1] == 0
    for k in (0, -1):
        assert np.abs(ahead.velocities[k]).max() == 0.0
        assert np.abs(ahead.velocities[1 if k == 0 else -2]).max() < 1e-2
    np.testing.assert_allclose(ahead.configurations[-1][7:], q[7:], atol=0.02)  # the weight is midway between the soles
    np.testing.assert_allclose(ahead.zmp[-1], (0.36, 0.0), atol=1e-3)


def test_the_same_call_gives_the_same_walk(still_talos, ahead):
    """Bit for bit; and the robot has not moved."""
    before = still_talos.configuration()
    again = plan_walk(still_talos, 0.36)
    np.testing.assert_array_equal(again.configurations, ahead.configurations)
    np.testing.assert_array_equal(still_talos.configuration(), before)


def test_a_place_in_the_world_makes_no_difference(still_talos, ahead):
    """Seen from the robot, a walk is the same elsewhere."""
    other = still_talos.copy()
    other.stand((3.0, -2.0, 0.0), yaw=2.0)
    walk = plan_walk(other, 0.36)
    np.testing.assert_allclose(walk.configurations[:, 7:], ahead.configurations[:, 7:], atol=1e-6)


def test_a_walk_goes_to_another_process(ahead):
    """Pickled, it is the same and can be stopped."""
    other = pickle.loads(pickle.dumps(ahead))
    np.testing.assert_array_equal(other.configurations, ahead.configurations)
    np.testing.assert_array_equal(stop_walk(other, 1.3).configurations, stop_walk(ahead, 1.3).configurations)


def test_between_ticks_and_outside(ahead):
    """Linear between ticks, at rest outside."""
    k = 500
    np.testing.assert_array_equal(ahead.configuration_at(ahead.times[k]), ahead.configurations[k])
    half = ahead.configuration_at(ahead.times[k] + 0.5 * ahead.dt)
    np.testing.assert_allclose(half[7:], ahead.configurations[k : k + 2, 7:].mean(axis=0), atol=1e-12)
    np.testing.assert_array_equal(ahead.state_at(99.0).q, ahead.configurations[-1])
    assert not ahead.state_at(99.0).v.any()


def test_arms_are_held_or_move(still_talos):
    """The joints that are not of the legs keep what they are given; the walk is balanced with them."""
    arms = {"arm_left_4_joint": -1.8, "arm_right_4_joint": -1.8}
    held = plan_walk(still_talos, 0.18, arms=arms)
    row = 7 + still_talos.joint_index("arm_left_4_joint")
    assert (held.configurations[:, row] == -1.8).all()
    assert held.measures.margin > 0.05
    start = still_talos.angle_vector()[still_talos.joint_index("arm_left_4_joint")]
    moves = JointTrajectory(("arm_left_4_joint",), np.array([1.0, 3.0]), np.array([[start], [-1.8]]), np.zeros((2, 1)))
    moving = plan_walk(still_talos, 0.18, arms=moves)
    np.testing.assert_allclose(moving.configurations[[0, -1], row], [start, -1.8], atol=1e-12)
    assert moving.measures.margin > 0.05


def test_a_load_is_balanced(still_talos, ahead):
    """5 kg, 0.4 m ahead of the base: the whole leans back, and a check without the load would say so."""
    walk = plan_walk(still_talos, 0.36, load=(5.0, (0.4, 0.0, 0.1)))
    assert walk.measures.margin > 0.05
    back = ahead.configurations[-1][0] - walk.configurations[-1][0]
    # the body's centre of mass goes back by what the load asks for: about 5/95 of 0.4 m
    assert abs(back - 5.0 / (still_talos.mass + 5.0) * 0.4) < 0.01


def test_given_footsteps(still_talos):
    """They are made as they are given."""
    steps = (Footstep(0, 0.1, 0.1, 0.1), Footstep(1, 0.1, -0.09, 0.0))
    walk = plan_walk_footsteps(still_talos, steps)
    np.testing.assert_allclose(walk.feet[-1][:, [0, 1, 3]], [step.pose for step in steps], atol=1e-12)
    assert walk.footsteps == steps


def test_a_velocity_is_kept_and_changed_under_way(still_talos):
    """From standing to standing; under way it goes on otherwise, the motion and the feet on the floor continuous."""
    walk = plan_walk_velocity(still_talos, 0.12, 0.0, 0.0, 4.0)
    np.testing.assert_allclose(footprint(still_talos, walk.configurations[-1]), (0.48, 0, 0), atol=1e-6)
    other = continue_walk(walk, 2.5, 0.08, 0.0, 0.1, 4.0)
    k = round(2.5 / walk.dt)
    assert other.times[0] == walk.times[k]
    np.testing.assert_allclose(other.configurations[0], walk.configurations[k], atol=1e-8)
    np.testing.assert_array_equal(other.velocities[0], walk.velocities[k])
    # the next tick differs by what another acceleration makes of 5 ms
    assert np.abs(other.configurations[1] - walk.configurations[k + 1]).max() < 1e-5
    assert other.measures.margin > 0.03 and other.times[-1] > walk.times[-1]


@pytest.mark.parametrize("time", few([0.3, 0.9, 1.3, 2.6, 2.9, 3.5], 0.9, 2.6))
def test_a_walk_stops_within_a_step(still_talos, time):
    """The foot in the air lands, the other comes beside it: two steps at most, and the robot stands."""
    walk = plan_walk(still_talos, 1.0, check_collisions=False)
    stopped = stop_walk(walk, time)
    assert np.isclose(stopped.times[0], time) and len(stopped.footsteps) <= 2
    assert stopped.times[-1] - time < 2 * walk.plan.schedule.stride.step_time + 1.8
    np.testing.assert_allclose(stopped.configurations[0], walk.configurations[round(time / walk.dt)], atol=1e-8)
    assert stopped.measures.margin > 0.02 and stopped.support[-1] == 0
    feet = stopped.feet[-1][:, [0, 1, 3]]
    assert np.isclose(np.hypot(*(feet[0] - feet[1])[:2]), walk.plan.schedule.stride.stance, atol=1e-6)


def test_what_cannot_be_done_is_refused(still_talos):
    """Steps longer than legs, faster than balance and joints allow, a sole on the other."""
    long = replace(Stride.of(still_talos), step_length=0.8)
    with pytest.raises(WalkError, match="legs do not reach"):
        plan_walk(still_talos, 1.6, stride=long)
    fast = replace(Stride.of(still_talos), single_support=0.15, double_support=0.05)
    with pytest.raises(WalkError, match="cannot walk so") as caught:
        plan_walk(still_talos, 0.6, stride=fast)
    assert caught.value.measures is not None
    with pytest.raises(WalkError, match="one sole within"):
        plan_walk_footsteps(still_talos, [Footstep(0, 0.0, 0.0, 0.0)])
    with pytest.raises(WalkError, match=r"at least 70 mm are asked for"):
        plan_walk(still_talos, 0.2, margin=0.07)


def test_links_that_run_into_each_other_are_refused(still_talos):
    """An arm in the trunk; who knows better may turn that off."""
    arms = {"arm_left_1_joint": -0.8, "arm_left_3_joint": -1.5, "arm_left_4_joint": -2.0}
    with pytest.raises(WalkError, match="would run into"):
        plan_walk(still_talos, 0.2, arms=arms)
    assert plan_walk(still_talos, 0.2, arms=arms, check_collisions=False).measures.collision is None


def test_bad_input_is_refused(still_talos, ahead):
    """Named errors, nothing moved."""
    for bad in ({"x": np.nan}, {"y": np.inf}, {"yaw": "far"}):
        with pytest.raises(InvalidInputError):
            plan_walk(still_talos, **bad)
    with pytest.raises(InvalidInputError, match="beyond their limits"):
        plan_walk(still_talos, 0.2, arms={"arm_left_4_joint": 1.0})
    with pytest.raises(InvalidInputError, match="joint of a leg"):
        plan_walk(still_talos, 0.2, arms={"leg_left_4_joint": 1.0})
    with pytest.raises(UnknownNameError):
        plan_walk(still_talos, 0.2, arms={"third_arm": 1.0})
    with pytest.raises(InvalidInputError, match="load"):
        plan_walk(still_talos, 0.2, load=3.0)
    with pytest.raises(InvalidInputError, match="faster than the stride allows"):
        plan_walk_velocity(still_talos, 2.0)
    with pytest.raises(InvalidInputError, match="seconds"):
        plan_walk_velocity(still_talos, 0.1, seconds=0.0)
    with pytest.raises(InvalidInputError, match="time must be"):
        stop_walk(ahead, 100.0)


def test_robots_that_do_not_walk_are_refused(still_talos, tmp_path):
    """Without legs, and with a foot in the air."""
    urdf = tmp_path / "stick.urdf"
    urdf.write_text('<robot name="stick"><link name="base"/></robot>')
    with pytest.raises(RobotModelError, match="no legs"):
        plan_walk(nuno.Humanoid(urdf), 0.2)
    lifted = still_talos.copy()
    lifted.angle_vector({"leg_left_4_joint": 1.4})
    with pytest.raises(WalkError, match="both soles on the floor"):
        plan_walk(lifted, 0.2)
