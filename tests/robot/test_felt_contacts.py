"""What a robot with dynamics feels: contact forces of its links and wrenches of its wrists, against closed forms."""

import numpy as np
import pinocchio as pin
import pytest

import nuno

G = 9.81
ELBOW = "arm_right_4_joint"
HAND = ("arm_right_7_link", "gripper_right_fingertip_1_link", "gripper_right_fingertip_3_link")
SOLES = {"leg_left_6_link", "leg_right_6_link"}


def lower_hand(robot, angle=0.5):
    """Send the right hand down by the elbow, and wait until it rests on what is there."""
    k = robot.actual.joint_index(ELBOW)
    robot.angle_vector({ELBOW: robot.angle_vector()[k] + angle}, 1.0)
    robot.sleep(2.5)


def hand_points(robot):
    """Return the vertices (n, 3) [m] of the right hand and its fingers."""
    return np.concatenate([robot.links.bodies[robot.links.names.index(name)].vertices for name in HAND])


def by_table(state):
    """Return the force (3,) [N] that the table exerts on the right hand."""
    return sum(state.contacts[name]["table"] for name in HAND if name in state.contacts)


def table_under(robot, gap=0.03):
    """Return a box 0.1 m high under the robot's right hand."""
    x, y = hand_points(robot)[:, :2].mean(axis=0)
    z = hand_points(robot)[:, 2].min() - gap - 0.05
    return nuno.box((0.4, 0.3, 0.1), name="table", position=(float(x), float(y), float(z)))


def touching(state):
    """Return the sum of all contact forces (3,) [N]."""
    return sum(force for own in state.contacts.values() for force in own.values())


def linear_momentum(robot):
    """Return the momentum (3,) [N s] of the whole robot."""
    model, state = robot.actual.model, robot.state()
    return np.array(pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v))[:3]


def pressing(robot, before):
    """Return the force (3,) [N] that the world does to the right hand by its wrist's sensor, as it felt nothing before.

    Args:
        robot: The robot.
        before: (3,) [N] in the world's axes, what the sensor felt when nothing touched the hand.
    """
    pose = robot.actual.frame_pose("right_wrist")
    return pose.rotation @ robot.read().wrenches["right_wrist"][:3] - before


@pytest.fixture(scope="module")
def lowered(floor_world):
    """What the wrist felt before (3,) [N], and a snapshot in which the hand has come to rest on a table."""
    world, robot, saved = floor_world
    world.restore(saved)
    free = robot.actual.frame_pose("right_wrist").rotation @ robot.read().wrenches["right_wrist"][:3]
    world.add(table_under(robot))
    lower_hand(robot)
    return free, world.save()


@pytest.fixture
def on_a_table(floor_world, lowered):
    """The world and the robot of ``floor_world``, its right hand on a table, and what its wrist felt before."""
    world, robot, _ = floor_world
    free, saved = lowered
    world.restore(saved)
    return world, robot, free


def test_contacts_bear_the_robot(standing):
    """At rest both soles touch the floor and nothing else does: together they bear its weight, within 0.1 %."""
    world, robot = standing
    world.run(0.3)
    state = robot.state()
    assert {link: set(own) for link, own in state.contacts.items()} == {
        "leg_left_6_link": {"floor"}, "leg_right_6_link": {"floor"},
    }  # fmt: skip
    weight = robot.actual.mass * G
    np.testing.assert_allclose(touching(state), (0.0, 0.0, weight), atol=1e-3 * weight)


def test_contacts_are_what_moves_the_robot(standing):
    """With both arms swinging: the sum of contact forces is m (a - g), frame by frame, within 0.5 % of the weight."""
    world, robot = standing
    wanted = robot.angle_vector()
    for name in ("arm_left_2_joint", "arm_right_2_joint"):
        wanted[robot.actual.joint_index(name)] += 0.5 if "left" in name else -0.5
    robot.angle_vector(wanted, 0.4)
    weight, moved, before = robot.actual.mass * G, 0.0, linear_momentum(robot)
    for _ in range(24):
        world.step()
        now = linear_momentum(robot)
        caused = (now - before) * world.frame_rate
        np.testing.assert_allclose(touching(robot.state()), caused + np.array([0.0, 0.0, weight]), atol=5e-3 * weight)
        moved, before = max(moved, np.linalg.norm(caused)), now
    assert moved > 0.02 * weight  # else it would be statics again


@pytest.mark.long
def test_a_wrist_reads_what_a_table_does_to_the_hand(on_a_table):
    """A hand that presses a static table stops there; its wrist reads the table's force, within 1 %.

    Inverse dynamics with the feet alone would miss it.
    """
    world, robot, free = on_a_table
    state = robot.state()
    assert hand_points(robot)[:, 2].min() > world.find("table").vertices[:, 2].max() - 1e-3
    force = by_table(state)
    assert SOLES < set(state.contacts) <= SOLES | set(HAND) and force[2] > 20.0
    np.testing.assert_allclose(pressing(robot, free), force, atol=0.01 * np.linalg.norm(force))
    weight = robot.actual.mass * G
    np.testing.assert_allclose(touching(state), (0.0, 0.0, weight), atol=1e-3 * weight)
    assert state.fallen is None


@pytest.mark.long
def test_a_wrist_reads_what_a_scale_shows(standing):
    """A plate on a spring goes down by F / k under the hand, and the wrist reads F, within 2 %."""
    world, robot = standing
    pose = robot.actual.frame_pose("right_wrist")
    free = pose.rotation @ robot.read().wrenches["right_wrist"][:3]
    plate, stiffness, mass = world.add(table_under(robot)), 5000.0, 2.0
    world.attach(plate, nuno.Rigid(mass=mass))
    spring = nuno.Spring(stiffness, rest=mass * G / stiffness, damping=200.0)  # it bears the plate as it is
    scale = nuno.slider(plate, None, axis=(0.0, 0.0, 1.0), spring=spring)
    lower_hand(robot)
    shown = -stiffness * scale.position
    assert shown > 10.0
    assert pressing(robot, free)[2] == pytest.approx(shown, rel=0.02)


def test_zero_moment_point_of_contacts_is_that_of_inverse_dynamics(standing):
    """Standing: within 1 mm of where the weight acts, the centre of mass' place on the floor."""
    world, robot = standing
    world.run(0.3)
    state, model = robot.state(), robot.actual.model
    centre = pin.centerOfMass(model, model.createData(), state.q)
    np.testing.assert_allclose(robot.read().zero_moment_point, centre[:2], atol=1e-3)


def felt_by_copies(world, seconds):
    """Let some seconds pass; return what the joints of two imagined copies then bear, and what the table does to them.

    Returns:
        (2, n, 6) [N, N m] and (2, 3) [N].
    """
    futures = world.imagine(2)
    futures.run(seconds)
    world.run(seconds)
    states = futures.robot.state()
    return [state.joint_wrenches for state in states], [by_table(state) for state in states]


@pytest.mark.long
def test_feelings_are_restored_and_imagined(on_a_table):
    """A restored robot reads what it read, and a copy in an imagined world feels what the robot does, bit for bit."""
    world, robot, _ = on_a_table
    world.step()
    told, state, saved = robot.read(), robot.state(), world.save()
    wrenches, forces = felt_by_copies(world, 0.05)
    np.testing.assert_array_equal(wrenches, [robot.state().joint_wrenches] * 2)
    np.testing.assert_array_equal(forces, [by_table(robot.state())] * 2)
    world.restore(saved)
    np.testing.assert_array_equal(robot.state().joint_wrenches, state.joint_wrenches)
    for name, wrench in told.wrenches.items():
        np.testing.assert_array_equal(robot.read().wrenches[name], wrench)


def test_without_dynamics_nothing_is_felt():
    """A robot that goes where it is sent is touched by nothing that is known; its readings follow from its motion."""
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    world.step()
    assert robot.state().contacts == {} and robot.state().joint_wrenches is None


@pytest.mark.long
def test_a_copy_whose_hand_presses_a_table_keeps_the_bits(on_a_table):
    """A copy of a robot that presses a table goes on bit for bit, also where a first contact point is not near."""
    world, robot, _ = on_a_table
    world.step()
    wrenches, forces = felt_by_copies(world, 0.5)
    np.testing.assert_array_equal(wrenches, [robot.state().joint_wrenches] * 2)
    np.testing.assert_array_equal(forces, [by_table(robot.state())] * 2)
