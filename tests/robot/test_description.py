"""Descriptions: robots from tables and from URDF files, and what is wrong with them."""

import numpy as np
import pytest

import nuno
from nuno.errors import FileFormatError, InvalidInputError, MeshError, RobotModelError, UnknownNameError
from nuno.robot.description import find_description
from nuno.robot.pinocchio import pin

URDF = """<robot name="stick">
  <link name="base">
    <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.2 0 0"/><geometry>GEOMETRY</geometry></collision>
  </link>
  <joint name="shoulder" type="TYPE"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
</robot>"""


def stick(folder, geometry='<box size="0.4 0.1 0.1"/>', kind="revolute"):
    """Write a robot of two links, and return its path."""
    path = folder / "stick.urdf"
    path.write_text(URDF.replace("GEOMETRY", geometry).replace("TYPE", kind))
    return path


def test_a_urdf_needs_no_table(tmp_path):
    """Its links and joints are known, and it stands with its base at the origin."""
    robot = nuno.Humanoid(stick(tmp_path))
    assert (robot.name, robot.joint_names, robot.mass) == ("stick", ("shoulder",), 3.0)
    np.testing.assert_allclose(robot.frame_pose("arm").position, (0, 0, 0.5))
    links = robot.enter(nuno.World(device="cpu"))
    (body,) = links.bodies
    assert body.shape.size == (0.4, 0.1, 0.1)
    np.testing.assert_allclose(body.position, (0.2, 0, 0.5), atol=1e-12)


def test_a_third_robot_is_added_by_a_table_alone(tmp_path):
    """Promise: frames, feet, posture and cameras come from the table, files from beside it."""
    stick(tmp_path)
    table = tmp_path / "mine.toml"
    table.write_text("""
        [stick]
        urdf = "stick.urdf"
        posture = { shoulder = 0.5 }
        frames.hand = { link = "arm", position = [0.4, 0.0, 0.0] }
        feet.foot = { link = "base", position = [0.0, 0.0, -0.1], size = [0.2, 0.1] }
        cameras.eye = { frame = "hand", width = 32, height = 24, field_of_view = 1.5707963267948966 }
    """)
    robot = nuno.Humanoid("stick", robots=table)
    np.testing.assert_allclose(robot.position, (0, 0, 0.1), atol=1e-12)  # its sole on the floor
    np.testing.assert_allclose(robot.angle_vector(), [0.5])
    hand = (0.4 * np.cos(0.5), 0, 0.6 - 0.4 * np.sin(0.5))
    np.testing.assert_allclose(robot.frame_pose("hand").position, hand, atol=1e-12)
    assert np.isclose(robot.camera("eye").fx, 16.0)  # half of 32 px over tan 45 degrees
    np.testing.assert_allclose(np.ptp(robot.support_polygon(), axis=0), (0.2, 0.1), atol=1e-12)


def test_a_joint_that_turns_freely_has_no_limits(tmp_path):
    """Pinocchio keeps its cosine and sine; the angle goes in and out."""
    robot = nuno.Humanoid(stick(tmp_path, kind="continuous"))
    robot.angle_vector([2.5])
    arm = robot.frame_pose("arm").rotation
    np.testing.assert_allclose(arm[:, 0], (np.cos(2.5), 0, -np.sin(2.5)), atol=1e-12)
    robot.take_configuration(robot.configuration())
    np.testing.assert_allclose(robot.angle_vector(), [2.5])
    assert robot.joint_limits[1][0] == np.inf


@pytest.mark.parametrize(("entry", "told"), [
    ('frame.hand = { link = "arm" }', "has 'frame'; it may have urdf, srdf, posture, frames, feet, cameras, hands, g"),
    ('feet.foot = { link = "base" }', "the foot 'foot' of 'stick' needs the size of its sole"),
])  # fmt: skip
def test_slips_in_a_table_are_told(tmp_path, entry, told):
    """What would be passed over in silence, or be missed much later."""
    stick(tmp_path)
    (tmp_path / "mine.toml").write_text(f'[stick]\nurdf = "stick.urdf"\n{entry}\n')
    with pytest.raises(FileFormatError, match=told):
        nuno.Humanoid("stick", robots=tmp_path / "mine.toml")


def test_a_table_may_say_nothing_of_hands_legs_and_sensors(tmp_path):
    """A robot with one hand closes "arms"; what the others ask for is refused by name."""
    stick(tmp_path)
    (tmp_path / "mine.toml").write_text("""
        [stick]
        urdf = "stick.urdf"
        frames.right_hand = { link = "arm" }
        hands.right_hand = { low = [-0.1, -0.1, -0.1], high = [0.1, 0.1, 0.1] }
    """)
    robot = nuno.SimulatedRobot(nuno.Humanoid("stick", robots=tmp_path / "mine.toml"), nuno.World(device="cpu"))
    assert robot.start_grasp() == [False] and robot.stop_grasp("rarm") == [True]  # there is nothing to hold
    with pytest.raises(UnknownNameError, match="left_hand"):
        robot.start_grasp("larm")
    with pytest.raises(RobotModelError, match="no force sensors in its legs"):
        robot.zmp_vector()
    with pytest.raises(RobotModelError, match="no inertial measurement unit"):
        robot.gyro_vector()
    with pytest.raises(RobotModelError, match="no legs"):
        robot.robot.reach({"right_hand": (0.1, 0.0, 0.5)})
    assert robot.go_pos(0.1) is False
    assert robot.force_vector() == {}


def test_a_robot_without_joints(tmp_path):
    """Stands there; nothing is asked of it, and nothing fails."""
    path = tmp_path / "post.urdf"
    path.write_text("<robot name='post'><link name='post'/></robot>")
    robot = nuno.SimulatedRobot(nuno.Humanoid(path), nuno.World(device="cpu"))
    assert robot.angle_vector([], 1.0).shape == (0,)
    assert robot.wait_interpolation() == []
    assert robot.angle_vector().shape == (0,)


def test_bad_robots_raise_named_errors(tmp_path):
    """What was received and what is valid."""
    with pytest.raises(UnknownNameError, match="no robot named 'hal'; there are: g1, talos"):
        nuno.Humanoid("hal")
    with pytest.raises(RobotModelError, match="no URDF file"):
        nuno.Humanoid(tmp_path / "none.urdf")
    with pytest.raises(MeshError, match=r"1 meshes of 'stick' are not there, the first is 'package://lost/arm\.stl'"):
        nuno.Humanoid(stick(tmp_path, '<mesh filename="package://lost/arm.stl"/>'))
    with pytest.raises(RobotModelError, match="'shoulder' is neither"):
        nuno.Humanoid(stick(tmp_path, kind="floating"))
    with pytest.raises(RobotModelError, match="no SRDF file"):
        nuno.Humanoid(stick(tmp_path), srdf=tmp_path / "none.srdf")
    (tmp_path / "torn.urdf").write_text("<robot name='torn'><link")
    with pytest.raises(RobotModelError, match="as a URDF"):
        nuno.Humanoid(tmp_path / "torn.urdf")
    (tmp_path / "odd.stl").write_text("no mesh")
    with pytest.raises(MeshError, match="cannot read the meshes of 'stick'"):
        nuno.Humanoid(stick(tmp_path, '<mesh filename="odd.stl"/>')).self_collisions()


def test_bad_tables_raise_named_errors(tmp_path):
    """A table that is torn, or says too little."""
    table, urdf = tmp_path / "mine.toml", stick(tmp_path)
    entries = {
        "[stick": (FileFormatError, "table of robots"),
        "[stick]\nposture = {}": (FileFormatError, "'urdf'"),
        "[stick]\nurdf = 'stick.urdf'\nframes.hand = { link = 'leg' }": (UnknownNameError, "no link named 'leg'"),
        "[stick]\nurdf = 'stick.urdf'\nposture = 'sit'": (UnknownNameError, "no posture named 'sit'"),
        "[stick]\nurdf = 'stick.urdf'\nposture = { hip = 1.0 }": (UnknownNameError, "no joint named 'hip'"),
        "[stick]\nurdf = 'stick.urdf'\nframes.hand = { link = 'arm', position = [0.0] }": (InvalidInputError, "shape"),
    }
    for text, (error, message) in entries.items():
        table.write_text(text)
        with pytest.raises(error, match=message):
            nuno.Humanoid("stick", robots=table)
    assert find_description(urdf, None, None, None).feet == ()


BARE = """<robot name="bare">
  <link name="base">
    <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>LIMIT</joint>
</robot>"""
NO_SPEED = '<limit lower="-1" upper="1" velocity="0" effort="0"/>'


def bare(folder, limit=NO_SPEED):
    """Write a robot without any shapes, and return its path."""
    path = folder / "bare.urdf"
    path.write_text(BARE.replace("LIMIT", limit))
    return path


def test_a_robot_without_shapes_moves(tmp_path):
    """Kinematic models of people have links alone; they enter a world, and their joints arrive."""
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid(bare(tmp_path, NO_SPEED.replace('"0"', '"2"'))), world)
    assert world.bodies == ()
    robot.angle_vector([0.5], 0.3)
    assert robot.wait_interpolation() == [False]
    np.testing.assert_allclose(robot.angle_vector(), [0.5], atol=1e-6)
    world.step()


def test_a_velocity_limit_of_zero_is_assumed_with_a_warning(tmp_path, caplog):
    """Generators of URDFs leave zeros where nothing was known: the log says so once, by name and with the cure."""
    robot = nuno.SimulatedRobot(nuno.Humanoid(bare(tmp_path)), nuno.World(device="cpu"))
    (speed, effort) = [own.getMessage() for own in caplog.records if own.levelname == "WARNING"]
    assert "velocity of 1 joints to zero or not at all, the first is 'shoulder'" in speed
    assert "velocity_limits in a table" in speed
    assert "effort of 1 joints to zero" in effort
    assert robot.robot.velocity_limits == np.pi
    assert robot.robot.effort_limits == np.inf
    assert np.isclose(robot.angle_vector_duration([0.0], [0.5]), 0.5 / np.pi)
    robot.angle_vector([0.5])  # five times the shortest
    robot.wait_interpolation()
    assert np.isclose(robot.now(), 2.5 / np.pi, atol=2.0 / robot.world.frame_rate)


def test_a_table_gives_velocity_limits_and_groups(tmp_path, caplog):
    """They take the place of the URDF's, and nothing is assumed; what names no joint is refused by name."""
    bare(tmp_path, NO_SPEED.replace('effort="0"', 'effort="1"'))
    table = tmp_path / "mine.toml"
    entry = '[bare]\nurdf = "bare.urdf"\ngroups.swing = ["shoulder"]\nvelocity_limits.shoulder = 0.25\n'
    table.write_text(entry)
    robot = nuno.SimulatedRobot(nuno.Humanoid("bare", robots=table), nuno.World(device="cpu"))
    assert not [own for own in caplog.records if own.levelname == "WARNING"]
    assert robot.robot.velocity_limits == 0.25
    assert set(robot.controller_table) == {"default_controller", "swing_controller"}
    table.write_text(entry.replace("velocity_limits.shoulder", "velocity_limits.elbow"))
    with pytest.raises(UnknownNameError, match="'elbow'; there are: shoulder"):
        nuno.Humanoid("bare", robots=table)
    table.write_text(entry.replace('["shoulder"]', '["shoulder", "shoulder"]'))
    with pytest.raises(InvalidInputError, match="'shoulder' is in the groups 'swing' and 'swing'"):
        nuno.SimulatedRobot(nuno.Humanoid("bare", robots=table), nuno.World(device="cpu"))


def test_convex_shapes_of_a_urdf_are_taken(tmp_path):
    """Pinocchio makes a hull of a mesh that <collision_checking> names; the body is that hull."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.2, 0.3, 0.4)).export(tmp_path / "brick.stl")
    path = stick(tmp_path, '<mesh filename="brick.stl"/>')
    checking = '<collision_checking><convex name="brick"/></collision_checking>'
    named = path.read_text().replace("<collision>", '<collision name="brick">')
    path.write_text(named.replace("</collision>", f"</collision>{checking}"))
    robot = nuno.Humanoid(path)
    assert "Convex" in type(robot.geometry._read(pin.GeometryType.COLLISION).geometryObjects[0].geometry).__name__
    (body,) = robot.enter(nuno.World(device="cpu")).bodies
    assert len(body.shape.vertices) == 8
    np.testing.assert_allclose(np.ptp(body.shape.vertices, axis=0), (0.2, 0.3, 0.4), atol=1e-6)


def test_package_names_with_a_slash_too_many_are_found(tmp_path):
    """As Pinocchio finds them."""
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "mine").mkdir()
    trimesh.creation.box((0.2, 0.3, 0.4)).export(tmp_path / "mine" / "brick.stl")
    robot = nuno.Humanoid(stick(tmp_path, '<mesh filename="package:///mine/brick.stl"/>'))
    (body,) = robot.enter(nuno.World(device="cpu")).bodies
    np.testing.assert_allclose(np.ptp(body.shape.vertices, axis=0), (0.2, 0.3, 0.4), atol=1e-6)
