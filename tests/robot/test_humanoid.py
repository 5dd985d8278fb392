"""Humanoids: where their frames are, their joints, limits, mass and cameras."""

import xml.etree.ElementTree as xml

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError, RobotModelError, UnknownNameError


def rotation(axis, angle):
    """Return Rodrigues' matrix."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def numbers(element, key, default):
    """Return the numbers of an attribute."""
    return np.array([float(n) for n in (default if element is None else element.get(key, default)).split()])


def link_pose(robot, link):
    """Return a link's (4, 4) pose in the world from the URDF's text alone: no Pinocchio."""
    parents = {joint.find("child").get("link"): joint for joint in xml.parse(robot.description.urdf).iter("joint")
               if joint.find("child") is not None}  # fmt: skip
    pose = np.eye(4)
    while link in parents:
        joint = parents[link]
        xyz, rpy = (numbers(joint.find("origin"), key, "0 0 0") for key in ("xyz", "rpy"))
        step = np.eye(4)
        step[:3, 3] = xyz
        step[:3, :3] = rotation((0, 0, 1), rpy[2]) @ rotation((0, 1, 0), rpy[1]) @ rotation((1, 0, 0), rpy[0])
        if joint.get("type") in ("revolute", "continuous"):
            angle = robot.angle_vector()[robot.joint_names.index(joint.get("name"))]
            step[:3, :3] = step[:3, :3] @ rotation(numbers(joint.find("axis"), "xyz", "1 0 0"), angle)
        pose = step @ pose
        link = joint.find("parent").get("link")
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = robot.rotation, robot.position
    return base @ pose


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_links_are_where_the_urdf_says(name, request):
    """Forward kinematics agree with the URDF's own chain of transforms, at random angles and a turned base."""
    robot = request.getfixturevalue(name)
    lower, upper = robot.joint_limits
    robot.angle_vector(np.random.default_rng(3).uniform(lower, upper))
    robot.translate((0.3, -0.2, 0.1)).rotate(0.7, (1, 2, 3))
    for role in ("left_wrist", "right_wrist", "imu", "left_foot"):
        link = robot.description.frames[role].link
        expected, pose = link_pose(robot, link), robot.frame_pose(link)
        np.testing.assert_allclose(pose.position, expected[:3, 3], atol=1e-9)  # rounding of 10 transforms
        np.testing.assert_allclose(pose.rotation, expected[:3, :3], atol=1e-9)


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_mass_is_that_of_the_links(name, request):
    """The sum of the URDF's masses; the centre of mass stands over the feet."""
    robot = request.getfixturevalue(f"still_{name}")
    masses = [float(mass.get("value")) for mass in xml.parse(robot.description.urdf).iter("mass")]
    assert np.isclose(robot.mass, sum(masses), rtol=1e-9)
    low, high = robot.support_polygon().min(axis=0), robot.support_polygon().max(axis=0)
    assert (robot.centre_of_mass[:2] > low).all() and (robot.centre_of_mass[:2] < high).all()


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_it_stands_where_it_is_put(name, request):
    """The point between the soles, and both soles flat, facing the way that is asked for."""
    robot = request.getfixturevalue(name)
    robot.stand((0.4, -0.3, 0.2), yaw=1.1)
    left, right = robot.frame_pose("left_foot"), robot.frame_pose("right_foot")
    np.testing.assert_allclose(0.5 * (left.position + right.position), (0.4, -0.3, 0.2), atol=1e-9)
    forward = (np.cos(1.1), np.sin(1.1), 0)
    for foot in (left, right):  # Talos' own posture turns its soles by 3 mrad against each other
        np.testing.assert_allclose(foot.rotation[:, 0], forward, atol=5e-3)
        np.testing.assert_allclose(foot.rotation[:, 2], (0, 0, 1), atol=5e-3)
    across = left.position - right.position
    assert across @ (-np.sin(1.1), np.cos(1.1), 0) > 0.15  # the left foot is on the left


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_hands_of_all_robots_have_the_same_axes(name, request):
    """Promise of the table: z out of the hand, here downwards and forwards; x up when z is forward, so now forward."""
    robot = request.getfixturevalue(f"still_{name}")
    for side, sign in (("left", 1), ("right", -1)):
        hand, wrist = robot.frame_pose(f"{side}_hand"), robot.frame_pose(f"{side}_wrist")
        assert hand.rotation[2, 2] < -0.7 and hand.rotation[0, 0] > 0.7
        assert (hand.position - wrist.position) @ hand.rotation[:, 2] > 0.1
        assert sign * hand.position[1] > 0.2


def test_angles_by_name_and_by_order(talos):
    """Promise of the interface: both set the same, a mapping leaves the others, and a copy is returned."""
    before = talos.angle_vector()
    got = talos.angle_vector({"arm_left_4_joint": -1.0, "head_2_joint": 0.3})
    changed = [talos.joint_names[k] for k in np.flatnonzero(got != before)]
    assert sorted(changed) == ["arm_left_4_joint", "head_2_joint"]
    assert got[talos.joint_index("arm_left_4_joint")] == -1.0
    got[:] = 0.0
    assert talos.angle_vector()[talos.joint_index("head_2_joint")] == 0.3
    np.testing.assert_array_equal(talos.angle_vector(before), before)


def test_limits_are_those_of_the_urdf(still_talos):
    """Each limit as the URDF's text has it."""
    lower, upper = still_talos.joint_limits
    for joint in xml.parse(still_talos.description.urdf).iter("joint"):
        limit = joint.find("limit")
        if limit is not None and joint.get("name") in still_talos.joint_names:
            k = still_talos.joint_index(joint.get("name"))
            assert (lower[k], upper[k]) == (float(limit.get("lower")), float(limit.get("upper")))
            assert still_talos.velocity_limits[k] == float(limit.get("velocity"))
            assert still_talos.effort_limits[k] == float(limit.get("effort"))


def test_a_configuration_goes_back_and_forth(talos):
    """``take_configuration`` is the inverse of ``configuration``."""
    talos.translate((0.3, 0.1, 0)).rotate(-0.4, "z")
    talos.angle_vector({"torso_1_joint": 0.4})
    q, hand = talos.configuration(), talos.frame_pose("left_hand")
    talos.stand()
    talos.take_configuration(q)
    np.testing.assert_allclose(talos.frame_pose("left_hand").position, hand.position, atol=1e-12)


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_the_head_camera_looks_forward(name, request):
    """A point 1.2 m ahead and below lies in its image, one further left appears further left, one behind nowhere."""
    camera = request.getfixturevalue(f"still_{name}").camera()
    middle, left = camera.project([(1.2, 0.0, 0.7), (1.2, 0.1, 0.7)])
    assert 0 <= middle[0] < camera.width and left[0] < middle[0]
    assert np.isnan(camera.project((-1.0, 0.0, 1.0))).all()
    assert camera.camera_to_world[:3, 2] @ (1, 0, 0) > 0.6
    own = request.getfixturevalue(f"still_{name}").description.cameras["head"]
    edge = np.arctan(0.5 * camera.width / camera.fx)  # half the field of view, at the image's edge
    assert np.isclose(2 * edge, own.field_of_view)


def test_what_follows_the_robot_goes_along(talos):
    """It is a frame as all others: what is assoc'd to its base follows."""
    cup = nuno.Coordinates((0.3, 0, 1.0))
    talos.assoc(cup)
    talos.translate((0, 0, 0.1), wrt="world")
    np.testing.assert_allclose(cup.position, (0.3, 0, 1.1), atol=1e-12)
    talos.dissoc(cup)


def test_unknown_names_and_bad_angles_raise_and_change_nothing(talos):
    """Named errors that say what there is."""
    before = talos.angle_vector()
    with pytest.raises(UnknownNameError, match=r"no joint named 'elbow'; there are: .*arm_left_4_joint"):
        talos.angle_vector({"head_1_joint": 0.2, "elbow": 1.0})
    with pytest.raises(UnknownNameError, match=r"no frame named 'tail'; there are: .*left_hand"):
        talos.frame_pose("tail")
    with pytest.raises(UnknownNameError, match="no camera named 'wrist'; there are: head"):
        talos.camera("wrist")
    with pytest.raises(InvalidInputError, match=r"'arm_left_4_joint': 1.0000 is not in \[-2.3562, 0.0000\]"):
        talos.angle_vector({"arm_left_4_joint": 1.0})
    with pytest.raises(InvalidInputError, match="shape"):
        talos.angle_vector(before[:-1])
    with pytest.raises(InvalidInputError, match="finite"):
        talos.angle_vector({"head_1_joint": float("nan")})
    np.testing.assert_array_equal(talos.angle_vector(), before)


def test_a_robot_without_legs_says_so():
    """A named error where legs are needed; frames and joints work without."""
    from nuno.robot.description import robot_data

    arm = nuno.Humanoid(robot_data() / "panda_description" / "urdf" / "panda.urdf")
    assert np.isfinite(arm.frame_pose("panda_link8").position).all()
    with pytest.raises(RobotModelError, match="'panda' has no legs"):
        arm.support_polygon()
    with pytest.raises(RobotModelError, match="no legs"):
        arm.reach({"panda_link8": (0.4, 0, 0.4)})
    reached = arm.reach({"panda_link8": (0.4, 0.1, 0.4)}, stance=["panda_link0"], check_collisions=False)
    assert reached
    np.testing.assert_allclose(arm.frame_pose("panda_link8").position, (0.4, 0.1, 0.4), atol=5e-4)  # the tolerance
