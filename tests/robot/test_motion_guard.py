"""Robots without dynamics and static shapes: what they are kept out of, what is told, and what passes."""

import logging

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError
from nuno.robot.goal import GoalStatus
from nuno.robot.link_sweep import DEEP, MIN_ADVANCE
from nuno.robot.motion_guard import MotionGuard
from nuno.robot.servo import ServoCommand

ELBOW = "arm_left_4_joint"


def make(**options):
    """Talos on a floor."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    return nuno.SimulatedRobot(nuno.Humanoid(), world, **options)


def corners(robot, hands=False):
    """All vertices of the links (n, 3), or those of the left arm's last links."""
    bodies = robot.links.bodies
    if hands:
        first = robot.actual.model.getJointId("arm_left_5_joint")
        bodies = [b for b, j in zip(bodies, robot.links.joints, strict=True)
                  if first in robot.actual.model.supports[j]]  # fmt: skip
    return np.concatenate([body.vertices for body in bodies])


def corners_of(robot, name):
    """All vertices (n, 3) of links whose names begin so."""
    return np.concatenate([body.vertices for body, link in zip(robot.links.bodies, robot.links.names, strict=True)
                           if link.startswith(name)])  # fmt: skip


def extent(robot, run, hands=False):
    """The least and greatest coordinates (3,) of the links' vertices in a motion."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)

    def look(_):
        nonlocal low, high
        low, high = (
            np.minimum(low, corners(robot, hands).min(axis=0)),
            np.maximum(high, corners(robot, hands).max(axis=0)),
        )

    look(0.0)
    run(look)
    return low, high


@pytest.fixture(scope="module")
def beside():
    """How far to the left links get while Talos walks 0.3 m [m]."""
    robot = make()
    robot.go_pos(0.3, wait=False)
    _, high = extent(robot, lambda look: robot.world.run(6.0, each_frame=look))
    assert robot._base_goal.succeeded
    return float(high[1])


def wall_on_the_left(robot, gap, beside):
    """A wall beside what is reached."""
    return robot.world.add(nuno.box((4.0, 0.2, 2.0), name="wall", position=(0.0, beside + gap + 0.1, 1.0)))


@pytest.mark.long
def test_a_walk_ends_in_front_of_a_wall(caplog):
    """It says so, no link is in the wall at any frame, and the robot stands as near as its steps let it."""
    robot = make()
    robot.world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(1.05, 0.0, 1.0)))
    with caplog.at_level(logging.WARNING):
        went = []
        _, high = extent(robot, lambda look: (went.append(robot.go_pos(1.5, wait=False)),
                                              robot.world.run(10.0, each_frame=look)))  # fmt: skip
    goal, met = robot._base_goal, robot.state().collision
    assert goal.status == GoalStatus.ABORTED and "'wall'" in goal.text and "before its goal" in goal.text
    assert high[0] <= 1.0 + DEEP + MIN_ADVANCE
    assert robot.read_base().position[0] > 0.5  # a step is 0.18 m, and knees and hands 0.3 m ahead of the base
    assert met.body == "wall" and met.link in robot.links.names
    assert abs(met.point[0] - 1.0) < 0.02 and 2.0 < met.time < 8.0
    assert sum("would run into 'wall'" in record.message for record in caplog.records) == 1
    assert robot.go_pos(-0.2)  # and away from it again
    assert robot.state().collision is None


def test_go_pos_tells_that_it_did_not_get_there():
    """False, as of a real robot whose base stopped; its odometry tells where it is."""
    robot = make()
    robot.world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(0.75, 0.0, 1.0)))
    assert not robot.go_pos(1.0)
    assert not robot.gait.is_walking
    assert 0.0 <= robot.read_base().position[0] < 0.5


@pytest.mark.parametrize(("gap", "passes"), [pytest.param(0.05, True, marks=pytest.mark.long), (-0.05, False)])
def test_a_wall_at_the_side(beside, caplog, gap, passes):
    """5 cm beside what the links reach it is passed in silence; 5 cm nearer it is not."""
    robot = make()
    wall_on_the_left(robot, gap, beside)
    with caplog.at_level(logging.WARNING):
        assert robot.go_pos(0.3) is passes
    assert bool(caplog.records) is not passes


@pytest.mark.long
def test_a_velocity_ends_before_a_wall():
    """Also where it is sent again and again, and the walk is worked out step by step."""
    robot = make()
    robot.world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(1.05, 0.0, 1.0)))

    def drive(look):
        for _ in range(16):
            robot.send_velocity(0.15, 0.0, 0.0, hold=1.0)
            robot.world.run(0.5, each_frame=look)

    _, high = extent(robot, drive)
    assert high[0] <= 1.0 + DEEP + MIN_ADVANCE
    assert robot.read_base().position[0] > 0.3


def plate_in_the_way(robot, where=0.5, thickness=0.02):
    """A plate that the left forearm goes through as the elbow stretches, and the elbow's goal."""
    goal = robot.angle_vector()
    goal[robot.robot.joint_index(ELBOW)] = -0.3
    other = make()
    start = corners(other, hands=True)[:, 2].min()
    low, _ = extent(other, lambda look: (other.angle_vector(goal, 1.0), other.world.run(1.2, each_frame=look)), True)
    height = start + where * (low[2] - start)
    assert start - low[2] > 0.03
    robot.world.add(nuno.box((1.2, 1.6, thickness), name="table", position=(0.0, 0.9, height - 0.5 * thickness)))
    return goal, height


def test_a_hand_stops_on_a_table():
    """No deeper than 5 mm, its goal is aborted with the reason; where it stopped it may rest, and leave again."""
    robot = make()
    goal, height = plate_in_the_way(robot)
    start = robot.angle_vector()
    robot.angle_vector(goal, 1.0)
    low, _ = extent(robot, lambda look: robot.world.run(1.2, each_frame=look), True)
    depth = height - low[2]
    assert 0.0 < depth <= DEEP + MIN_ADVANCE
    own = robot.joints.controllers["larm_controller"].goal
    assert own.status == GoalStatus.ABORTED and "'table'" in own.text
    met = robot.state().collision
    assert met.body == "table" and "left" in met.link and abs(met.point[2] - height) < 0.03
    robot.angle_vector({"head_1_joint": 0.3}, 0.5)  # the hand rests on the table meanwhile
    robot.wait_interpolation()
    assert robot.state().collision is None
    assert robot.actual.angle_vector()[robot.actual.joint_index("head_1_joint")] == pytest.approx(0.3)
    robot.angle_vector(start, 1.0)
    robot.wait_interpolation()
    np.testing.assert_allclose(robot.actual.angle_vector(), start, atol=1e-9)


def test_only_what_leads_there_stops():
    """The head goes on while an arm is stopped."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    goal[robot.robot.joint_index("head_1_joint")] = 0.4
    robot.angle_vector(goal, 1.0)
    robot.world.run(1.2)
    assert robot.joints.controllers["larm_controller"].goal.status == GoalStatus.ABORTED
    assert robot.actual.angle_vector()[robot.actual.joint_index("head_1_joint")] == pytest.approx(0.4)


def test_a_walk_that_would_carry_an_arm_into_something():
    """An arm that moves while the robot walks: whichever of the two is to end, no link is in the table at any time."""
    robot = make()
    goal, height = plate_in_the_way(robot)
    leg = max(corners_of(robot, "leg_left")[:, 1].max(), corners_of(robot, "base_link")[:, 1].max())
    low, high = np.array([-1.5, leg + 0.1, height - 0.02]), np.array([1.5, leg + 1.7, height])
    robot.world.remove("table")
    robot.world.add(nuno.box(tuple(high - low), name="table", position=0.5 * (low + high)))
    deepest = []

    def look(_):
        points = corners(robot, hands=True)
        deepest.append(np.minimum(points - low, high - points).min(axis=1).max())

    robot.go_pos(0.2, wait=False)
    robot.world.run(0.5)
    robot.angle_vector(goal, 1.0, controller_type="larm_controller")
    robot.world.run(7.0, each_frame=look)
    assert max(deepest) <= DEEP + MIN_ADVANCE
    assert robot.state().collision.body == "table"
    arm = robot.joints.controllers["larm_controller"].goal
    assert GoalStatus.ABORTED in (arm.status, robot._base_goal.status)
    assert not robot.gait.is_walking


def of_guard(caplog):
    """Return what was reported of collisions; another test may have loaded scikit-robot, which is reported too."""
    return [record for record in caplog.records if record.name == "nuno.robot.motion_guard"]


def test_modes(caplog):
    """Warn lets the robot through and tells once, ignore is silent, and so is a pair whose contact is ignored."""
    told = {}
    for mode in ("warn", "ignore", "stop"):
        robot = make(collisions=mode)
        goal, _ = plate_in_the_way(robot)
        if mode == "stop":
            for body in robot.links.bodies:
                robot.world.ignore_contact(body, "table")
        start = robot.angle_vector()
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            for wanted in (goal, start, goal):
                robot.angle_vector(wanted, 1.0)
                robot.world.run(1.2)
                np.testing.assert_allclose(robot.actual.angle_vector(), wanted, atol=1e-9)
        told[mode] = [record.message for record in of_guard(caplog)]
        assert (robot.state().collision is not None) is (mode == "warn")
    assert not told["ignore"] and not told["stop"]
    assert told["warn"] and len(set(told["warn"])) == len(told["warn"])
    with pytest.raises(InvalidInputError, match="stop"):
        make(collisions="bounce")
    robot.collisions = "warn"
    with pytest.raises(InvalidInputError, match="collisions"):
        robot.collisions = "no"
    assert robot.collisions == "warn"


def rod_in_the_arc(robot, aside=0.0):
    """A rod of 1 cm, upright, in the middle of the arc that the left hand goes through as the trunk turns."""
    swing = {"torso_1_joint": -1.2}
    other = make()
    hand = "left_hand"
    start = other.actual.frame_pose(hand).position
    other.angle_vector(swing, 0.1)  # as fast as its limits let it
    ways = [start]
    for _ in range(60):
        other.world.step()
        ways.append(other.actual.frame_pose(hand).position)
    ways = np.array(ways)
    step = np.linalg.norm(np.diff(ways, axis=0), axis=1).max()
    middle = ways[np.argmin(np.abs(np.linalg.norm(ways - ways[0], axis=1) - 0.5 * np.linalg.norm(ways[-1] - ways[0])))]
    robot.world.add(nuno.cylinder(0.005, 0.4, name="rod", position=middle + np.array([0.0, 0.0, aside])))
    return swing, step


def test_a_thin_rod_stops_a_fast_swing():
    """A hand that goes many times the rod's width in a frame does not pass through it; a rod elsewhere is nothing."""
    robot = make()
    swing, step = rod_in_the_arc(robot)
    assert step > 0.03
    robot.angle_vector(swing, 0.1)
    robot.world.run(1.0)
    assert robot.state().collision.body == "rod"
    assert robot.actual.angle_vector()[robot.actual.joint_index("torso_1_joint")] > -1.0
    far = make()
    rod_in_the_arc(far, aside=1.5)
    far.angle_vector(swing, 0.1)
    far.world.run(1.0)
    assert far.state().collision is None
    assert far.actual.angle_vector()[far.actual.joint_index("torso_1_joint")] == pytest.approx(-1.2)


def test_an_arm_between_two_posts():
    """What is between them passes, and stops at the one that is moved to where the hand goes."""
    robot, other = make(), make()
    start = robot.angle_vector()
    goal = start.copy()
    goal[robot.robot.joint_index(ELBOW)] = -1.8
    low, high = extent(other, lambda look: (other.angle_vector(goal, 0.5), other.world.run(0.6, each_frame=look)), True)
    finger = other.links.bodies[other.links.names.index("gripper_left_inner_double_link")]
    there = 0.5 * (finger.vertices.min(axis=0) + finger.vertices.max(axis=0))
    posts = [
        robot.world.add(nuno.cylinder(0.005, 2.0, name=f"post {k}", position=(there[0], y, 1.0)))
        for k, y in enumerate((low[1] - 0.02, high[1] + 0.02))
    ]
    robot.angle_vector(goal, 0.5)
    robot.wait_interpolation()
    assert robot.state().collision is None
    np.testing.assert_allclose(robot.actual.angle_vector(), goal, atol=1e-9)
    robot.angle_vector(start, 0.5)
    robot.wait_interpolation()
    posts[1].locate((there[0], there[1], 1.0))
    robot.angle_vector(goal, 0.5)
    robot.wait_interpolation()
    assert robot.state().collision.body == "post 1"
    assert robot.actual.angle_vector()[robot.actual.joint_index(ELBOW)] > -1.75


def test_static_shapes_that_are_moved():
    """What is put in the way or taken out of it after a command counts, and so does what is on its own way there."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    table = robot.world.find("table")
    place = table.position.copy()
    start = robot.angle_vector()
    table.locate(place - np.array([0.0, 0.0, 2.0]))
    robot.angle_vector(goal, 1.0)
    robot.world.run(0.05)
    assert robot.state().collision is None
    table.locate(place)
    robot.world.run(1.2)
    assert robot.state().collision is not None
    robot.angle_vector(start, 1.0)
    robot.wait_interpolation()
    robot.angle_vector(goal, 1.0)
    robot.world.run(0.05)
    assert robot.state().collision is not None
    table.locate(place - np.array([0.0, 0.0, 2.0]))
    robot.world.run(1.2)
    assert robot.state().collision is None
    np.testing.assert_allclose(robot.actual.angle_vector(), goal, atol=1e-9)


@pytest.mark.parametrize(("arrives", "stops"), [(0.3, True), (3.0, False)])
def test_a_static_shape_that_follows_a_path(arrives, stops):
    """It counts where it is at each time: a table that comes in time is in the way, one that comes later is not."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    table = robot.world.find("table")
    place, now = table.position.copy(), robot.world.time
    away = place + np.array([0.0, 3.0, 0.0])
    robot.world.move(table, nuno.Path([now, now + arrives], [away, place if stops else away]))
    robot.angle_vector(goal, 1.0)
    robot.world.run(1.2)
    assert (robot.state().collision is not None) is stops


def test_each_command_is_looked_at_once(monkeypatch):
    """Ticks in between compare numbers; a walk and an arm's motion are one look each, at rest there is none."""
    looks = [0]
    own = MotionGuard._look

    def counted(*arguments):
        looks[0] += 1
        return own(*arguments)

    monkeypatch.setattr(MotionGuard, "_look", counted)
    robot = make()
    robot.world.add(nuno.box((0.5, 0.5, 0.5), name="box", position=(3.0, 0.0, 0.25)))
    robot.world.run(0.5)
    assert looks[0] == 0
    robot.angle_vector({"head_1_joint": 0.3}, 1.0)
    robot.world.run(1.5)
    assert looks[0] == 1
    robot.go_pos(0.2)
    assert looks[0] <= 3  # the controllers of the legs begin and end to hold


def test_a_motion_that_begins_inside_may_leave(caplog):
    """A table that is put into a hand does not hold it, but lets it no deeper."""
    robot = make()
    goal, height = plate_in_the_way(robot)
    table = robot.world.find("table")
    lowest = corners(robot, hands=True)[:, 2].min()
    table.locate((0.0, 0.9, lowest + 0.02 - 0.01))  # 2 cm of the hand in it
    with caplog.at_level(logging.WARNING):
        robot.angle_vector({ELBOW: -1.9}, 1.0)
        robot.wait_interpolation()
    assert of_guard(caplog) and all("when it sets off" in record.message for record in of_guard(caplog))
    assert robot.state().collision is None
    assert robot.actual.angle_vector()[robot.actual.joint_index(ELBOW)] == pytest.approx(-1.9)
    assert height < lowest and len(goal)


def test_a_torque_law_stops_at_a_table():
    """Where nothing can be looked ahead to, each frame is swept; the law ends and the joints hold."""
    robot = make()
    goal, height = plate_in_the_way(robot)
    names = [f"arm_left_{k}_joint" for k in range(1, 8)]
    wanted = [goal[robot.robot.joint_index(name)] for name in names]
    robot.servo(ServoCommand(names, wanted, kp=200.0, kd=20.0))
    low, _ = extent(robot, lambda look: robot.world.run(2.0, each_frame=look), True)
    assert 0.0 <= height - low[2] + MIN_ADVANCE and height - low[2] <= DEEP + MIN_ADVANCE
    assert robot.state().collision.body == "table"
    assert not robot.state().v.any()


def test_futures_stop_each_for_itself():
    """Each world of a batch has its own commands; those that are free go on, all with the bits that they have alone."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    start = robot.angle_vector()
    wanted = np.array([start, goal, 0.5 * (start + goal), start])
    wanted[3, robot.actual.joint_index("head_1_joint")] = 0.4
    futures = robot.world.imagine(4)
    futures.robot.angle_vector(wanted, 1.0)
    futures.run(1.2)
    met = [state.collision for state in futures.robot.state()]
    assert met[0] is None and met[3] is None and met[1].body == "table"
    found = futures.robot.angle_vector()
    np.testing.assert_allclose(found[[0, 3]], wanted[[0, 3]], atol=1e-9)
    alone = robot.world.imagine(1)
    alone.robot.angle_vector(goal, 1.0)
    alone.run(1.2)
    np.testing.assert_array_equal(alone.robot.angle_vector()[0], found[1])


def test_what_is_under_way_stops_in_futures_too():
    """A motion that was begun before, and a walk."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    robot.angle_vector(goal, 1.0)
    robot.world.run(0.05)
    futures = robot.world.imagine(2)
    futures.run(1.2)
    robot.world.run(1.2)
    assert all(state.collision.body == "table" for state in futures.robot.state())
    np.testing.assert_array_equal(futures.robot.angle_vector()[1], robot.actual.angle_vector())


def test_restored_worlds_stop_again():
    """With the same bits, from a snapshot taken on the way there."""
    robot = make()
    goal, _ = plate_in_the_way(robot)
    robot.angle_vector(goal, 1.0)
    robot.world.run(0.05)
    saved = robot.world.save()
    robot.world.run(1.2)
    first, met = robot.actual.angle_vector().copy(), robot.state().collision
    assert met is not None
    robot.world.restore(saved)
    robot.world.run(1.2)
    np.testing.assert_array_equal(robot.actual.angle_vector(), first)
    assert robot.state().collision.link == met.link and robot.state().collision.time == met.time


def test_frozen_cloth_is_passed():
    """It gives way, and is taken hold of."""
    robot = make()
    _, height = plate_in_the_way(robot)
    robot.world.remove("table")
    robot.world.add(nuno.sheet((1.0, 1.0), cells=(4, 4), name="towel", position=(0.0, 0.9, height)))
    robot.angle_vector({ELBOW: -0.3}, 1.0)
    robot.wait_interpolation()
    assert robot.state().collision is None
