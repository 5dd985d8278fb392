"""The command ``nuno scene``: a report, a picture, a converted file, and errors by name."""

import cv2
import numpy as np

import nuno
from nuno.__main__ import main
from nuno.scenes.show_scene import camera_for

URDF = """<robot name="lamp"><link name="foot">
<collision><geometry><box size="0.2 0.2 0.02"/></geometry></collision></link>
<link name="arm"><inertial><origin xyz="0 0 0.2"/><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.2"/><geometry><box size="0.03 0.03 0.4"/></geometry></collision></link>
<joint name="tilt" type="revolute"><parent link="foot"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def test_a_file_is_told_drawn_and_converted(tmp_path, capsys):
    """What is in it on the standard output, a picture with something on it, and the same scene as MJCF."""
    (tmp_path / "lamp.urdf").write_text(URDF)
    out, saved = tmp_path / "look", tmp_path / "lamp.xml"
    assert main(["scene", str(tmp_path / "lamp.urdf"), "--out", str(out), "--save", str(saved), "--device", "cpu"]) == 0
    said = capsys.readouterr().out
    assert "lamp.urdf: 1 static, 1 rigid; 1 hinge" in said and "no joint has a motor until joint.motor is set" in said
    assert cv2.imread(str(out / "scene.png")).std() > 5.0
    assert "<mujoco" in saved.read_text()


def test_bad_input_is_named(tmp_path, capsys):
    """No file, and a time that is none: status 2 and one line."""
    assert main(["scene", str(tmp_path / "gone.urdf")]) == 2
    assert "there is no scene file" in capsys.readouterr().err
    assert main(["scene", str(tmp_path / "gone.urdf"), "--seconds", "-1"]) == 2
    assert "--seconds must be" in capsys.readouterr().err


def test_the_camera_sees_what_moves():
    """All corners of a body that moves are in the image, however large the floor is."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((100, 100, 1), position=(0, 0, -0.5)))
    crate = world.add(nuno.box((0.2, 0.3, 0.4), position=(3, 2, 1)))
    world.attach(crate)
    camera = camera_for(world)
    pixels = camera.project(crate.vertices)
    assert (pixels >= 0).all() and (pixels < np.array([camera.width, camera.height])).all()
    assert np.ptp(pixels[:, 1]) > 0.3 * camera.height, "and large"
