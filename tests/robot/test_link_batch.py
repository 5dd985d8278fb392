"""Links of a robot's copies, worked out together: to the bit where those of each robot alone are."""

import numpy as np
import pytest

import nuno

SEEDS = range(3)


def test_shapes_are_where_each_robot_has_them(still_talos):
    """Random postures of all joints, fingers half closed among them, and another base: places and turns."""
    links = still_talos.copy().enter(nuno.World(device="cpu"))
    robot, model = links.robot, links.robot.model
    lower, upper = (np.clip(limit, -3.0, 3.0) for limit in robot.joint_limits)
    random, alone, axes, origins, angles = np.random.default_rng(0), [], [], [], []
    for _ in range(5):
        base = random.normal(size=7)
        base[3:] /= np.linalg.norm(base[3:])
        robot.move_to(random.uniform(lower, upper), base)
        alone.append([part.copy() for part in links.poses()])
        axes.append([placement.rotation.copy() for placement in robot.data.oMi])
        origins.append([placement.translation.copy() for placement in robot.data.oMi])
        angles.append(robot.angle_vector())
    assert len(axes[0]) == model.njoints and any(own for own in links.finger_bodies.bodies)
    together = links.poses_at(np.array(axes), np.array(origins), np.array(angles))
    for k in range(2):
        np.testing.assert_array_equal(together[k], [own[k] for own in alone])
        some = links.poses_at(np.array(axes), np.array(origins), np.array(angles), np.array([7, 2]))
        np.testing.assert_array_equal(some[k], together[k][:, [7, 2]])


@pytest.mark.long
def test_different_ways_are_those_of_robots_alone():
    """Arms, a gripper and bent knees, other in each world, beside a towel: links, base and towel to the bit."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0.55, 0.2, 1.0)))
    world.attach(towel)
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    world.run(0.1)
    saved, names = world.save(), list(robot.actual.joint_names)
    now = robot.actual.angle_vector()
    wanted = np.repeat(now[None], len(SEEDS), axis=0)
    for k in SEEDS:
        for name, turn in (("arm_left_2_joint", 0.2), ("arm_left_4_joint", -0.4), ("gripper_left_joint", -0.3)):
            wanted[k, names.index(name)] += turn * (k + 1) / 3
    for side in ("left", "right"):  # the second one stoops, its soles stay
        for joint, turn in ((3, -0.1), (4, 0.2), (5, -0.1)):
            wanted[1, names.index(f"leg_{side}_{joint}_joint")] += turn
    futures = world.imagine(len(SEEDS))
    futures.robot.angle_vector(wanted, 0.4)
    for seconds in (0.25, 0.3):
        futures.run(seconds)
    for k in SEEDS:
        world.restore(saved)
        robot.angle_vector(wanted[k], 0.4)
        for seconds in (0.25, 0.3):
            world.run(seconds)
        state = futures.robot.state()[k]
        assert np.array_equal(state.q, robot.state().q) and np.array_equal(state.v, robot.state().v)
        for body in (*robot.links.bodies, towel):
            np.testing.assert_array_equal(futures.find(body.name).vertices[k], body.vertices)
    assert np.abs(futures.robot.state()[1].q[2] - futures.robot.state()[0].q[2]) > 1e-3  # the base went down


def test_many_frames_at_once_are_those_one_by_one():
    """Two copies of which one's arm comes to rest earlier: run at once, and stepped; links, joints, loads to the bit.

    A hand leads a corner of a cloth, and a cube. In the first frame the commands are looked at; one takes up another
    piece as its way ends.
    """
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    hand = robot.hands["left_hand"].body
    sheet = world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=hand.position - (0.0, 0.0, 0.3)))
    cube = world.add(nuno.box((0.05, 0.05, 0.05), name="cube", position=hand.position - (0.0, -0.4, 0.0)))
    world.attach(sheet)
    world.attach(cube, nuno.Rigid(density=300.0))
    world.grip(sheet, [0], to=hand)
    world.grip(cube, to=hand)
    found = []
    for at_once in (True, False):
        futures = world.imagine(2)
        futures.robot.angle_vector({"arm_left_4_joint": [-0.6, -0.5]}, 0.1)
        futures.robot.angle_vector({"arm_left_4_joint": [-0.4, -0.6], "arm_right_4_joint": [-0.6, -0.5]}, 0.15)
        counted, begin = [], futures.robot.begin_frame
        futures.robot.begin_frame = lambda start, end, own=counted, begin=begin: (own.append(end), begin(start, end))
        if at_once:
            futures.run(0.3)
        else:
            for _ in range(18):
                futures.step()
        places = [body._position for body in futures.bodies] + [body._quaternion for body in futures.bodies]
        places += [futures.find(body.name).vertices for body in (sheet, cube)]
        states = futures.robot.state()
        found.append((len(counted), places, [state.q for state in states], [state.v for state in states], futures.time))
    assert found[0][0] < 8 and found[1][0] == 18
    for k in (1, 2, 3):
        for together, alone in zip(found[0][k], found[1][k], strict=True):
            np.testing.assert_array_equal(together, alone)
    assert found[0][4] == found[1][4]
