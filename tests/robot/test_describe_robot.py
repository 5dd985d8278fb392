"""Tables guessed from URDFs: as those that were written by hand, where there are such, and readable always."""

import numpy as np
import pytest

import nuno
from nuno.__main__ import main
from nuno.errors import RobotModelError
from nuno.robot.controller_groups import controller_groups
from nuno.robot.limb_tree import tokens
from nuno.robot.srdf import read_srdf

LINK = """<link name="{0}">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{1}
</link>"""
BOX = '<collision><origin xyz="{}"/><geometry><box size="{}"/></geometry></collision>'
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/><axis xyz="{5}"/>
  <limit lower="-1" upper="1" velocity="2" effort="9"/></joint>"""


def robot_of(links, joints):
    """Return the text of a URDF."""
    made = [LINK.format(name, shape) for name, shape in links] + [JOINT.format(*own) for own in joints]
    return f'<robot name="guess">{"".join(made)}</robot>'


def dog(names=("FL", "FR", "RL", "RR")):
    """A box on four legs of two joints, whose shanks end in boxes of 4 by 2 cm, 0.4 m below."""
    links, joints = [("trunk", BOX.format("0 0 0", "0.5 0.2 0.1"))], []
    for name, x, y in zip(names, (0.2, 0.2, -0.2, -0.2), (0.1, -0.1, 0.1, -0.1), strict=True):
        links += [(f"{name}_a", ""), (f"{name}_b", BOX.format("0 0 -0.19", "0.04 0.02 0.02"))]
        joints.append((f"{name}_1", "revolute", "trunk", f"{name}_a", f"{x} {y} 0", "1 0 0"))
        joints.append((f"{name}_2", "revolute", f"{name}_a", f"{name}_b", "0 0 -0.2", "0 1 0"))
    return robot_of(links, joints)


def arm():
    """Three hinges up, and two fingers that slide along x: a gripper of 0.1 m, 0.3 m above the last hinge."""
    links = [("base", ""), ("a", ""), ("b", ""), ("c", BOX.format("0 0 0.05", "0.05 0.05 0.1"))]
    links += [(f"finger_{k}", BOX.format("0 0 0.1", "0.02 0.02 0.2")) for k in "lr"]
    joints = [(f"j{k + 1}", "revolute", *"base a b c".split()[k : k + 2], "0 0 0.3", "0 1 0") for k in range(3)]
    limited = JOINT.replace('lower="-1" upper="1"', 'lower="0" upper="0.05"')
    fingers = [limited.format(f"finger_{k}_joint", "prismatic", "c", f"finger_{k}", "0 0 0.1", f"{x} 0 0")
               for k, x in (("l", 1), ("r", -1))]  # fmt: skip
    return robot_of(links, joints).replace("</robot>", f"{''.join(fingers)}</robot>")


def guessed(tmp_path, text, **options):
    """Return a robot by the table that is guessed of a URDF."""
    path = tmp_path / "guess.urdf"
    path.write_text(text)
    nuno.describe_robot(path, tmp_path / "guess.toml", **options)
    return nuno.Humanoid("guess", robots=tmp_path / "guess.toml")


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_known_robots_are_guessed_as_they_were_described_by_hand(name, still_talos, still_g1, tmp_path):
    """The same roles but the stereo pair; the same controllers, soles within 15 mm, the hands' axes."""
    own = {"talos": still_talos, "g1": still_g1}[name]
    described = own.description
    nuno.describe_robot(described.urdf, tmp_path / "mine.toml", srdf=described.srdf, name=name)
    robot = nuno.Humanoid(name, robots=tmp_path / "mine.toml")
    assert controller_groups(robot) == controller_groups(own)
    assert robot.description.feet == described.feet
    assert set(described.hands) == set(robot.description.hands)
    robot.angle_vector(own.angle_vector())
    away = set(described.frames) - set(robot.description.frames)
    assert away == ({"head_camera"} if name == "g1" else set())  # its link is called by the camera's model, d435
    base = robot.frame_pose(robot.model.frames[2].name)
    mine = own.frame_pose(own.model.frames[2].name)
    for role in described.feet:
        here, there = (a.to_local(b.frame_pose(role).position[None])[0] for a, b in ((base, robot), (mine, own)))
        np.testing.assert_allclose(here, there, atol=0.015)
        assert np.abs(robot.description.frames[role].size - described.frames[role].size).max() < 0.015
    for role in described.hands:
        here, there = (a.rotation.T @ b.frame_pose(role).rotation for a, b in ((base, robot), (mine, own)))
        np.testing.assert_allclose(here, there, atol=1e-6)


def test_four_legs(tmp_path):
    """Soles are where the shanks end, and each leg has a controller."""
    robot = guessed(tmp_path, dog())
    assert set(robot.description.feet) == {
        "front_left_foot", "front_right_foot", "rear_left_foot", "rear_right_foot"
    }  # fmt: skip
    foot = robot.description.frames["front_left_foot"]
    np.testing.assert_allclose(foot.position, (0.0, 0.0, -0.2), atol=1e-4)
    np.testing.assert_allclose(foot.size, (0.04, 0.02), atol=1e-4)
    np.testing.assert_allclose(robot.frame_pose("front_left_foot").position[2], 0.0, atol=1e-9)
    groups = controller_groups(robot)
    assert groups["rear_right_leg_controller"] == ("RR_1", "RR_2")
    assert len(groups) == 4


def test_an_srdf_names_groups_and_posture(tmp_path):
    """Its groups count in place of the tree's, unions of others do not; postures go by their names."""
    srdf = tmp_path / "guess.srdf"
    srdf.write_text("""<robot name="guess">
      <group name="front"><joint name="FL_1"/><joint name="FL_2"/><joint name="FR_1"/><joint name="FR_2"/></group>
      <group name="rear"><chain base_link="trunk" tip_link="RL_b"/><chain base_link="trunk" tip_link="RR_b"/></group>
      <group name="all"><group name="front"/><group name="rear"/></group>
      <group_state name="odd" group="all"/>
      <group_state name="standing" group="all"><joint name="FL_2" value="0.25"/></group_state>
    </robot>""")
    robot = guessed(tmp_path, dog(), srdf=srdf)
    assert controller_groups(robot) == {
        "front_controller": ("FL_1", "FL_2", "FR_1", "FR_2"), "rear_controller": ("RL_1", "RL_2", "RR_1", "RR_2")
    }  # fmt: skip
    assert robot.description.posture == "standing"
    assert robot.angle_vector()[robot.joint_index("FL_2")] == 0.25
    srdf.write_text('<robot><group name="a"><group name="a"/></group></robot>')
    assert read_srdf(srdf, robot.model).groups == {"a": ()}  # a group of itself ends
    srdf.write_text("<robot>")
    with pytest.raises(RobotModelError, match="as an SRDF"):
        read_srdf(srdf, robot.model)


def test_a_single_arm(tmp_path):
    """It is the right one; its hand lies between the fingertips, y along the fingers' way, 0.1 m wide."""
    robot = guessed(tmp_path, arm())
    hand = robot.description.hands["right_hand"]
    assert (hand.joint, hand.open, hand.closed) == ("finger_l_joint", 0.05, 0.0)
    assert np.isclose(hand.width, 0.1, atol=1e-4)
    pose = robot.frame_pose("right_hand")
    last = robot.frame_pose("c")
    assert 0.25 < last.to_local(pose.position[None])[0][2] < 0.3
    turned = last.rotation.T @ pose.rotation
    np.testing.assert_allclose(turned[:, 2], (0, 0, 1), atol=1e-6)
    np.testing.assert_allclose(np.abs(turned[:, 1]), (1, 0, 0), atol=1e-6)
    assert controller_groups(robot) == {
        "rarm_controller": ("j1", "j2", "j3"), "rhand_controller": ("finger_l_joint", "finger_r_joint")
    }  # fmt: skip
    ri = nuno.SimulatedRobot(robot, nuno.World(device="cpu"))
    assert ri.start_grasp("rarm") == [False]  # there is nothing to hold
    assert ri.angle_vector()[robot.joint_index("finger_l_joint")] == pytest.approx(0.0, abs=1e-3)


def test_words_in_names():
    """Underscores, capitals and a side before a limb part words."""
    assert tokens(["LHipYaw"]) >= {"l", "hip", "yaw"}
    assert tokens(["RLEG_KNEE"]) >= {"r", "leg", "knee"}
    assert tokens(["arm_left_1_joint"]) == {"arm", "left", "joint"}
    assert "l" not in tokens(["link_1"])


def test_the_command(tmp_path, capsys):
    """It writes the table to the terminal or to a file; bad input is named."""
    path = tmp_path / "guess.urdf"
    path.write_text(dog())
    assert main(["describe-robot", str(path)]) == 0
    said = capsys.readouterr().out
    assert f'urdf = "{path}"' in said
    assert "[guess.feet]" in said
    out = tmp_path / "tables" / "mine.toml"
    out.parent.mkdir()
    assert main(["describe-robot", str(path), "--out", str(out), "--name", "rex"]) == 0
    assert "CHECK" in capsys.readouterr().out
    assert nuno.Humanoid("rex", robots=out).description.urdf.samefile(path)
    assert 'urdf = "../guess.urdf"' in out.read_text()
    assert main(["describe-robot", str(tmp_path / "none.urdf")]) == 2
    assert "no URDF file" in capsys.readouterr().err


def test_links_and_joints_of_one_name(tmp_path):
    """Some URDFs call a joint as its link: the link is meant, and a hand without shapes gets no volume."""
    path = tmp_path / "guess.urdf"
    path.write_text(arm().replace('"j3"', '"c"'))
    robot = nuno.Humanoid(path)
    np.testing.assert_allclose(robot.frame_pose("c").position, (0, 0, 0.9), atol=1e-9)
    assert "hands.right_hand" in nuno.describe_robot(path)
    path.write_text(arm().replace(BOX.format("0 0 0.05", "0.05 0.05 0.1"), ""))
    assert "hands.right_hand" not in nuno.describe_robot(path)
