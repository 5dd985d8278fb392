"""The simulated robot in its world: time, links, snapshots, and what it holds."""

import time

import numpy as np
import pinocchio as pin
import pytest
from differences import FRAME, central_differences

import nuno
from nuno.errors import BodyStateError, InvalidInputError, RobotModelError, SimulationDiverged, UnknownNameError
from nuno.robot.controller_groups import controller_groups
from nuno.robot.goal import GoalStatus
from nuno.robot.simulated_robot import SimulatedRobot

BENT = {"arm_left_4_joint": -1.0, "arm_left_1_joint": 0.4, "head_1_joint": 0.2}


def test_the_programs_own_model_is_left_alone(simulated):
    """What the program plans with neither moves the robot, nor is moved by it."""
    robot = nuno.Humanoid()
    own = SimulatedRobot(robot, nuno.World(device="cpu"))
    before = own.angle_vector()
    robot.angle_vector(BENT)
    np.testing.assert_array_equal(own.angle_vector(), before)
    own.angle_vector({"head_1_joint": -0.3}, 0.5)
    own.wait_interpolation()
    assert robot.angle_vector()[robot.joint_index("head_1_joint")] == 0.2


def test_links_are_where_the_robot_is(simulated):
    """After each frame of a motion, whoever steps the world; the frames between touch nothing else."""
    simulated.angle_vector(BENT, 0.5)
    for _ in range(12):
        simulated.world.step()
        positions, quaternions = simulated.links.poses()
        np.testing.assert_allclose([body.position for body in simulated.links.bodies], positions, atol=1e-12)
        turns = np.abs(np.sum(quaternions * [body.quaternion for body in simulated.links.bodies], axis=1))
        np.testing.assert_allclose(turns, 1.0, atol=1e-12)
    assert simulated.is_interpolating()
    simulated.world.run(0.4)  # 24 frames at once
    assert not simulated.is_interpolating()
    np.testing.assert_allclose(simulated.actual.angle_vector()[simulated.robot.joint_index("head_1_joint")], 0.2)


def test_state_is_the_motion(simulated):
    """Velocities and accelerations are the derivatives of the configuration: central differences over two frames."""
    simulated.angle_vector(BENT, 2.0)
    simulated.sleep(0.5)
    start = simulated.now()
    state, rate, change = central_differences(simulated)
    np.testing.assert_allclose(state.v, rate, atol=1e-4)  # jerk of 1 rad/s3 over 6 frames squared
    np.testing.assert_allclose(state.a, change, atol=1e-9)  # a cubic's is linear
    assert state.time == pytest.approx(start + 2 * FRAME)
    assert np.abs(state.v).max() > 0.1


def test_no_joint_is_faster_than_its_limit(simulated):
    """Whatever a trajectory wants."""
    from nuno.robot.trajectory import JointTrajectory

    names = ("head_1_joint", "head_2_joint")
    limits = simulated.actual.velocity_limits
    client = simulated.controller_table["head_controller"][0]
    client.send_goal(JointTrajectory(names, [0.1, 0.2], [[0.2, 0.2], [-0.2, 0.0]]))
    while client.is_interpolating():
        before = simulated.state().q
        simulated.world.step()
        moved = np.abs(pin.difference(simulated.actual.model, before, simulated.state().q))[6:]
        assert (moved <= limits * FRAME * (1 + 1e-6)).all()
        assert (np.abs(simulated.state().v[6:]) <= limits * (1 + 1e-6)).all()


def test_spans_of_any_length(simulated):
    """Parts of frames lead to the same end, and no time at all changes nothing."""
    simulated.angle_vector(BENT, 0.5)
    simulated.sleep(0.2)
    before = simulated.state()
    simulated.world.run(0.0)
    assert simulated.state() is before
    for span in (0.003, 0.05, 0.0005):
        simulated.sleep(span)
    simulated.wait_interpolation()
    assert simulated.now() - before.time == pytest.approx(0.3, abs=2 * FRAME)
    elbow = simulated.robot.joint_index("arm_left_4_joint")
    assert simulated.angle_vector()[elbow] == pytest.approx(-1.0, abs=1e-9)


def test_waiting_in_the_background(simulated):
    """Where the world runs by itself whoever waits sleeps on its clock, and it is as fast as it was started."""
    simulated.world.start(20.0)
    begin, start = simulated.now(), time.perf_counter()
    simulated.angle_vector(BENT, 1.0)
    simulated.wait_interpolation()
    assert simulated.now() - begin >= 1.0 - 1e-9
    assert time.perf_counter() - start > 0.04  # 1 s at 20 times real time is 0.05; a busy machine takes longer
    simulated.sleep(0.2)
    simulated.world.stop()


def test_waiting_at_a_pace(links):
    """At twice real time half a second of the world takes a quarter of one, or more on a busy machine."""
    robot = SimulatedRobot(links.robot, links.world, links=links, real_time_factor=2.0)
    start = time.perf_counter()
    robot.sleep(0.5)
    assert time.perf_counter() - start > 0.5 / 2.0 - 0.02  # the first frame is not waited for
    robot.leave()
    with pytest.raises(InvalidInputError, match="real_time_factor"):
        SimulatedRobot(links.robot, links.world, links=links, real_time_factor=0.0)


def test_restored_in_the_middle_of_a_motion(simulated):
    """It goes on as it did, to the bit; the goal is under way again."""
    simulated.angle_vector(BENT, 1.0)
    simulated.sleep(0.4)
    goal = simulated.controller_table["larm_controller"][0].goal
    saved = simulated.world.save()
    simulated.wait_interpolation()
    end, bodies = simulated.state(), [body.position for body in simulated.links.bodies]
    assert goal.status == GoalStatus.SUCCEEDED
    simulated.angle_vector({"arm_left_4_joint": -0.4}, 0.3)
    simulated.wait_interpolation()
    simulated.world.restore(saved)
    assert goal.status == GoalStatus.ACTIVE and simulated.now() == saved.time
    simulated.world.run(end.time - saved.time)
    np.testing.assert_array_equal(simulated.state().q, end.q)
    np.testing.assert_array_equal([body.position for body in simulated.links.bodies], bodies)
    assert goal.status == GoalStatus.SUCCEEDED


def test_snapshot_files_and_imagined_worlds(simulated, tmp_path):
    """Files hold the links as they are; imagined worlds take the robot along; its own world waits meanwhile."""
    simulated.angle_vector(BENT, 1.0)
    simulated.sleep(0.5)
    simulated.world.save(tmp_path / "room.npz")
    alone = nuno.World(device="cpu")
    alone.restore(tmp_path / "room.npz")
    futures = simulated.world.imagine(2)
    hand = simulated.world.find("talos/gripper_left_base_link")
    where = hand.position
    alone.run(0.5)
    futures.run(0.5)
    np.testing.assert_allclose(alone.find(hand.name).position, where, atol=1e-12)
    np.testing.assert_array_equal(hand.position, where)
    simulated.sleep(0.5)
    np.testing.assert_array_equal(futures.find(hand.name).position, [hand.position] * 2)
    assert np.linalg.norm(hand.position - where) > 0.01


def test_a_frame_that_fails_leaves_the_robot_as_it_was(simulated, monkeypatch):
    """Its motion goes on from there when the world does."""
    simulated.angle_vector(BENT, 1.0)
    simulated.sleep(0.3)
    before = simulated.state()

    def fail(*_):
        raise SimulationDiverged("towel", before.time)

    with monkeypatch.context() as patch:
        patch.setattr(simulated.world._stepping, "run", fail)
        with pytest.raises(SimulationDiverged):
            simulated.wait_interpolation()
    assert simulated.state() is before
    np.testing.assert_array_equal(simulated.actual.configuration(), before.q)
    simulated.wait_interpolation()
    np.testing.assert_allclose(simulated.angle_vector({}), simulated.angle_vector(), atol=1.01e-3)
    assert simulated.now() == pytest.approx(before.time + 0.7, abs=2 * FRAME)


def test_an_idle_robot_asks_nothing_of_its_world(simulated):
    """Its links keep their paths, and colliders are not told of them anew."""
    simulated.angle_vector(BENT, 0.2)
    simulated.wait_interpolation()
    simulated.world.run(0.1)
    paths = [body._path for body in simulated.links.bodies]
    version = simulated.world._collider_version
    simulated.world.run(0.5)
    assert [body._path for body in simulated.links.bodies] == paths
    assert simulated.world._collider_version == version
    np.testing.assert_array_equal(simulated.state().v, 0.0)


def test_leaving(still_talos):
    """The links go, the world goes on; a second time is an error, and so is a second driver."""
    world = nuno.World(device="cpu")
    robot = SimulatedRobot(still_talos, world)
    robot.angle_vector(BENT, 1.0)
    with pytest.raises(BodyStateError, match="already"):
        SimulatedRobot(still_talos, world, links=robot.links)
    with pytest.raises(InvalidInputError, match="another world"):
        SimulatedRobot(still_talos, nuno.World(device="cpu"), links=robot.links)
    robot.leave()
    assert not world.bodies and not world.drivers and not robot.is_interpolating()
    world.run(0.1)
    for call in (
        robot.leave, lambda: robot.angle_vector(BENT, 1.0), lambda: robot.go_pos(0.2), lambda: robot.sleep(0.1),
        lambda: robot.start_grasp("larm"), lambda: robot.send_velocity(0.1, 0.0, 0.0),
    ):  # fmt: skip
        with pytest.raises(BodyStateError, match="left"):  # nothing would ever end what they wait for
            call()


def test_groups_come_from_the_model(still_g1, still_talos):
    """Limbs by the frames at their ends, with fingers apart; without such frames all joints are one group."""
    groups = controller_groups(still_g1)
    assert sorted(joint for own in groups.values() for joint in own) == sorted(still_g1.joint_names)
    assert groups["rarm_controller"][0] == "right_shoulder_pitch_joint" and len(groups["rarm_controller"]) == 7
    assert groups["torso_controller"] == ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")
    assert "head_controller" not in groups  # its camera is on the torso
    assert controller_groups(still_talos)["rhand_controller"] == ("gripper_right_joint",)
    plain = nuno.Humanoid(still_talos.description.urdf, package_dirs=still_talos.description.package_dirs)
    assert controller_groups(plain) == {"fullbody_controller": plain.joint_names}


def test_a_robot_without_roles(still_talos):
    """It moves its joints; what it has not is said so."""
    plain = nuno.Humanoid(still_talos.description.urdf, package_dirs=still_talos.description.package_dirs)
    robot = SimulatedRobot(plain, nuno.World(device="cpu"))
    robot.angle_vector({"head_1_joint": 0.2}, 0.3)
    assert robot.wait_interpolation() == [False]
    for ask in (robot.accel_vector, robot.zmp_vector):
        with pytest.raises((RobotModelError, UnknownNameError)):
            ask()
    with pytest.raises(UnknownNameError, match="left_hand"):
        robot.start_grasp("larm")
    assert robot.force_vector() == {}
    assert robot.go_pos(0.1) is False


def test_a_towel_is_taken_and_weighed(simulated):
    """The gripper closes on a corner, the arm lifts it, the wrist bears its weight; opened, all is as before."""
    world = simulated.world
    wrist = simulated.actual.frame_pose("left_wrist").rotation
    empty = wrist @ simulated.force_vector("larm")
    hand = simulated.actual.frame_pose("left_hand").position
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(10, 10), position=(hand[0], hand[1], hand[2] - 0.095)))
    towel.rotate(np.pi / 2, "x")
    world.attach(towel, nuno.Cloth(area_density=0.5, damping=2.0))
    for body in simulated.links.bodies:
        world.ignore_contact(towel, body)  # only the grip is to bear it
    kept = world.grip(towel, np.arange(len(towel.vertices)), to=towel.position)
    assert simulated.start_grasp("larm") == [True]
    kept.release()
    assert simulated.hands["left_hand"].held == (towel,)
    simulated.sleep(4.0)
    wrist = simulated.actual.frame_pose("left_wrist").rotation
    weight = 0.5 * 0.04 * 9.81
    borne = (empty - wrist @ simulated.force_vector("larm"))[2]
    assert borne == pytest.approx(weight, rel=0.02)  # required
    assert simulated.stop_grasp("larm") == [True]
    assert simulated.hands["left_hand"].held == ()
    simulated.sleep(0.1)
    np.testing.assert_allclose(wrist @ simulated.force_vector("larm"), empty, atol=1e-6)
    world.remove(towel)


def test_arms_move_while_it_walks(simulated):
    """And the legs take no goals meanwhile; the links follow the base."""
    assert simulated.go_pos(0.15, wait=False) is True
    simulated.angle_vector({"arm_left_4_joint": -1.0}, 1.0, "larm_controller")
    legs = simulated.controller_table["lleg_controller"][0]
    simulated.angle_vector({"leg_left_4_joint": 0.5}, 1.0, "lleg_controller")
    assert legs.goal.status == GoalStatus.REJECTED and "walk" in legs.goal.text
    simulated.wait_interpolation("larm_controller")
    elbow = simulated.actual.joint_index("arm_left_4_joint")
    assert simulated.angle_vector()[elbow] == pytest.approx(-1.0, abs=1.01e-3)
    assert np.abs(simulated.state().v[:6]).max() > 0.0
    saved = simulated.world.save()
    goal = simulated._base_goal
    simulated.wait_until(lambda: goal.is_done)
    assert goal.status == GoalStatus.SUCCEEDED
    end = simulated.state()
    simulated.world.restore(saved)
    assert goal.status == GoalStatus.ACTIVE
    simulated.world.run(end.time - saved.time)
    np.testing.assert_array_equal(simulated.state().q, end.q)
    for body, position in zip(simulated.links.bodies, simulated.links.poses()[0], strict=True):
        np.testing.assert_allclose(body.position, position, atol=1e-12)


def test_a_walk_takes_the_place_of_another(simulated):
    """A velocity changes the walk under way; a place is gone to from where the robot comes to rest."""
    simulated.go_velocity(0.1, sec=4.0)
    first = simulated._base_goal
    simulated.sleep(2.0)
    assert simulated.go_velocity(0.05, sec=1.0) is True
    second = simulated._base_goal
    assert first.status == GoalStatus.PREEMPTED and second.status == GoalStatus.ACTIVE
    speed = np.abs(simulated.state().v[:6]).max()
    simulated.world.step()
    assert np.abs(np.abs(simulated.state().v[:6]).max() - speed) < 0.1  # no jump
    place = simulated.footprint().translate((0.1, 0.0, 0.0))
    assert simulated.go_pos(0.1) is True
    assert second.status == GoalStatus.PREEMPTED
    np.testing.assert_allclose(simulated.footprint().position, place.position, atol=2e-3)
