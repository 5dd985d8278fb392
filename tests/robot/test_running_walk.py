"""Walks that are worked out while they are walked."""

import dataclasses

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError
from nuno.robot import leg_motion
from nuno.robot.goal import GoalStatus
from nuno.robot.preview_control import TICK
from nuno.robot.running_walk import landing_after, run_on, set_off, steps_at
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.robot.stride import Stride
from nuno.robot.walk_planner import MARGIN, WalkPlanner
from nuno.robot.walking import plan_walk_footsteps

STRIDE = Stride(0.25, 0.1, 0.25, 0.05, 0.17)


@pytest.fixture
def planner(still_talos):
    """The planner of a Talos that stands."""
    return WalkPlanner(still_talos, None, None, None, MARGIN, True)


@pytest.fixture
def robot(still_talos):
    """A Talos in a world of its own."""
    return SimulatedRobot(still_talos, nuno.World(device="cpu"))


def joystick(robot, seconds, velocity):
    """Send a velocity, or what a function of time says, 20 times a second."""
    end, goal = robot.now() + seconds, None
    while robot.now() < end - 1e-9:
        given = velocity(robot.now()) if callable(velocity) else velocity
        goal = robot.send_velocity(*given)
        robot.sleep(0.05)
    return goal


def test_same_motion_as_a_planned_walk(planner, still_talos):
    """Over the same footsteps it is the walk that is planned as a whole: feet exactly, the body within 0.1 mm.

    The second pass joins the first by what is missed in the next 1.6 s in place of all that is; by then the weight of
    what is left, exp(-w t), is under 1 %.
    """
    walk = set_off(planner, np.array([0.1, 0.0, 0.1]))
    whole = plan_walk_footsteps(still_talos, walk.schedule.steps)
    assert len(walk.times) == len(whole.times)
    for time in np.arange(0.0, whole.duration, 0.3):
        own, other = walk.configuration_at(time), whole.configuration_at(time)
        np.testing.assert_allclose(own[:3], other[:3], atol=1e-4)
        np.testing.assert_allclose(own[7:], other[7:], atol=1e-3)
    end = walk.state_at(whole.duration)
    assert not end.v.any()


def test_other_velocities_join_without_a_jolt(planner):
    """At the landing where another velocity is taken, position and velocity are those of the walk before."""
    walk = set_off(planner, np.array([0.1, 0.0, 0.0]))
    at = landing_after(walk, 0)
    other = run_on(walk, at, np.array([0.1, 0.02, 0.0]))
    before, after = walk.state_at(at * TICK), other.state_at(at * TICK)
    np.testing.assert_allclose(before.q, after.q, atol=1e-9)  # what Newton's method leaves
    np.testing.assert_array_equal(before.v, after.v)
    later = other.state_at((at + 1) * TICK)
    assert np.abs(later.v - after.v).max() < 5.0 * TICK  # no joint is accelerated by more than 5 rad/s2


@pytest.mark.parametrize("velocity", [(0.1, 0.0, 0.0), (0.0, 0.04, 0.0), (0.0, 0.0, 0.1), (0.05, -0.02, -0.06)])
def test_steps_keep_the_velocity(velocity):
    """Step by step, decided anew at each, the middle of the feet goes at the velocity that was asked for."""
    velocity = np.array(velocity)
    feet = np.array([[0.0, 0.085, 0.0], [0.0, -0.085, 0.0]])
    last, ways = None, []
    for _ in range(8):
        step = steps_at(velocity, feet, STRIDE, last)[0]
        feet[step.foot], last = step.pose, step.foot
        ways.append(feet.copy())
    turned = ways[7].mean(axis=0)[2] - ways[3].mean(axis=0)[2]
    assert turned == pytest.approx(velocity[2] * 4.0 * STRIDE.step_time, abs=1e-12)
    if not velocity[2]:
        went = ways[7].mean(axis=0) - ways[3].mean(axis=0)
        np.testing.assert_allclose(went, velocity * 4.0 * STRIDE.step_time, atol=1e-12)


def test_no_velocity_closes_the_stance():
    """Without a velocity the other foot is put down beside the one that landed last, and that is all."""
    feet = np.array([[0.1, 0.085, 0.0], [0.0, -0.085, 0.0]])
    (step,) = steps_at(np.zeros(3), feet, STRIDE, 0)
    np.testing.assert_allclose([step.foot, *step.pose], [1, 0.1, -0.085, 0.0], atol=1e-12)


def test_too_fast(robot):
    """A velocity beyond the stride is refused by name; the one that is kept goes on."""
    with pytest.raises(InvalidInputError, match="faster than the stride allows"):
        steps_at(np.array([1.0, 0.0, 0.0]), np.zeros((2, 3)), STRIDE)
    assert robot.send_velocity(1.0, 0.0, 0.0).status == GoalStatus.REJECTED
    going = robot.send_velocity(0.1, 0.0, 0.0)
    refused = robot.send_velocity(1.0, 0.0, 0.0)
    assert refused.status == GoalStatus.REJECTED
    assert "at most" in refused.text
    robot.sleep(0.5)
    assert going.status == GoalStatus.ACTIVE


def test_a_joystick_costs_as_much_as_the_way_that_is_walked(robot, monkeypatch):
    """Twenty other velocities a second cost no more inverse kinematics than one: at most 4 solutions a tick.

    A step of 200 ticks takes 200 of the second pass and 200 of the first, and the preview's 320 more of the first where
    the velocity changed: 3.6. Replanning whole walks took 1,800 for each velocity.
    """
    counts = [0]
    solve = leg_motion.LegMotion.solve

    def counted(*arguments):
        counts[0] += 1
        return solve(*arguments)

    monkeypatch.setattr(leg_motion.LegMotion, "solve", counted)
    goal = joystick(robot, 6.0, lambda t: (0.1 + 0.01 * np.sin(9.0 * t), 0.0, 0.0))
    assert robot.now() == pytest.approx(6.0)
    assert counts[0] <= 4.0 * 6.0 / TICK
    assert goal.status == GoalStatus.ACTIVE
    robot.wait_until(lambda: goal.is_done, 10.0)
    assert goal.succeeded
    # from the first landing, 1.8 s after it set off, to where it came to rest
    assert 0.45 < robot.footprint().position[0] < 0.75


def test_the_newest_velocity_counts(robot):
    """Of velocities that come between two landings the last is taken, and a robot that hears no more comes to rest."""
    joystick(robot, 4.0, (0.0, 0.0, 0.1))
    robot.send_velocity(0.1, 0.0, 0.0)
    goal = robot.send_velocity(0.0, 0.0, 0.1)
    robot.wait_until(lambda: goal.is_done, 10.0)
    assert goal.succeeded
    place = robot.footprint()
    assert np.abs(place.position[:2]).max() < 0.02  # it has turned where it was
    assert place.rotation[1, 0] > 0.2
    still = robot.odom.position
    robot.sleep(0.5)
    np.testing.assert_array_equal(robot.odom.position, still)


def test_stopping_and_other_goals(robot):
    """A place lets the robot come to rest and go there; a velocity takes over from a walk; both ends are told."""
    goal = joystick(robot, 2.5, (0.1, 0.0, 0.0))
    ahead = robot.footprint().position[0]
    there = robot.send_base(0.3, 0.0, 0.0, None, True)
    robot.wait_until(lambda: goal.is_done, 10.0)
    assert goal.status == GoalStatus.PREEMPTED
    robot.sleep(1.5)
    assert not there.is_done
    driven = joystick(robot, 1.0, (-0.1, 0.0, 0.0))
    assert there.status == GoalStatus.PREEMPTED
    robot.cancel_base()
    robot.wait_until(lambda: driven.is_done, 10.0)
    assert driven.status == GoalStatus.PREEMPTED
    assert not robot.gait.is_walking
    assert robot.footprint().position[0] > ahead


def test_snapshots_hold_the_velocity(robot):
    """A world that is restored in the midst of a joystick's walk goes the same way again, to the bit."""
    world = robot.world
    joystick(robot, 3.0, (0.1, 0.0, 0.05))
    saved = world.save()
    ways = []
    for _ in range(2):
        world.restore(saved)
        joystick(robot, 2.0, (0.1, 0.02, 0.0))
        robot.sleep(3.0)
        ways.append(robot.state().q)
    np.testing.assert_array_equal(*ways)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["talos", "g1"])
def test_random_velocities(name):
    """A minute of velocities at random: none is refused, no foot that stands moves, and soles stay on the floor."""
    robot = SimulatedRobot(nuno.Humanoid(name), nuno.World(device="cpu"))
    stride = dataclasses.astuple(Stride.of(robot.robot))[:3]
    rng = np.random.default_rng(3)
    floor = robot.footprint().position[2]
    for _ in range(30):
        x, y, yaw = rng.uniform(-0.4, 0.4, 3) * stride * (1.0, 0.5, 0.5)
        goal = joystick(robot, 2.0, (x, y, yaw))
        assert goal.status == GoalStatus.ACTIVE, goal.text
        soles = [robot.actual.frame_pose(foot) for foot in robot.actual.feet]
        assert min(abs(sole.position[2] - floor) for sole in soles) < 1e-4
