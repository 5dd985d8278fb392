"""URDF files as scenes: Pinocchio's masses and places, joints with limits, and what is missing by name."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pytest

import nuno

pin = pytest.importorskip("pinocchio")

ARM = """<robot name="arm">
<material name="orange"><color rgba="1 0.5 0 1"/></material>
<link name="stand"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.1 0.1 0.5"/></geometry></collision></link>
<link name="upper"><inertial><origin xyz="0 0 -0.2"/><mass value="1.5"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><box size="0.04 0.04 0.4"/></geometry><material name="orange"/></visual>
  <collision><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.03" length="0.4"/></geometry></collision></link>
<link name="tool"><inertial><mass value="0.5"/>
  <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<link name="slide"><inertial><mass value="0.2"/>
  <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="stand"/><child link="upper"/><origin xyz="0.2 0 0.5"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="10" velocity="1"/>
  <dynamics damping="0.1" friction="0.05"/></joint>
<joint name="flange" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="0 0 -0.4"/></joint>
<joint name="rail" type="prismatic"><parent link="upper"/><child link="slide"/><origin xyz="0 0 -0.1"/>
  <axis xyz="0 0 1"/><limit lower="0.05" upper="0.2" effort="1" velocity="1"/></joint>
</robot>"""


def load(tmp_path, text=ARM, **options):
    """Return the scene of a text."""
    (tmp_path / "arm.urdf").write_text(text)
    return nuno.load_scene(tmp_path / "arm.urdf", nuno.World(device="cpu"), **options)


def test_links_that_are_fixed_together_are_one_body(tmp_path):
    """Masses and centres as their sums, shapes as a compound; the root stands still."""
    scene = load(tmp_path)
    assert set(scene.bodies) == {"stand", "upper", "slide"} and not scene.bodies["stand"].is_dynamic
    upper = scene.bodies["upper"]
    assert upper.mass == pytest.approx(2.0) and isinstance(upper.shape, nuno.Compound)
    # (1.5 kg at 0.3 m and 0.5 kg at 0.1 m) over 2 kg, under the shoulder at 0.5 m
    np.testing.assert_allclose(upper.centre_of_mass, (0.2, 0, 0.25), atol=1e-6)
    # Steiner: 0.02 + 1.5 * 0.05^2 + 0.001 + 0.5 * 0.15^2
    assert upper.inertia[0, 0] == pytest.approx(0.02 + 1.5 * 0.05**2 + 0.001 + 0.5 * 0.15**2, rel=1e-5)
    assert upper.color == (1.0, 0.5, 0.0)
    notes = scene.report.notes
    assert notes["links without a shape are balls of 1 cm that touch nothing"] == ("slide",)
    assert notes["joints that cannot be at 0 begin at a limit"] == ("rail",)


def test_joints_have_their_limits_and_brakes(tmp_path):
    """Place, axis, limits, friction and damping of both kinds of joints."""
    scene = load(tmp_path)
    shoulder, rail = scene.joints["shoulder"], scene.joints["rail"]
    assert (shoulder.kind, rail.kind) == ("hinge", "slider") and shoulder.target is scene.bodies["stand"]
    np.testing.assert_allclose(shoulder.limits, (-1.0, 2.0))
    assert shoulder.friction == 0.05 and shoulder.spring.damping == 0.1
    assert rail.position == pytest.approx(0.05, abs=1e-9) and rail.limits == pytest.approx((0.05, 0.2))
    np.testing.assert_allclose(shoulder.spec.other_place, [[0.2, 0, 0.25]], atol=1e-9)
    scene.world.run(0.2)
    assert rail.position > 0.05 - 1e-4, "it hangs on its lower stop, upside down"


def test_a_free_base_falls(tmp_path):
    """With ``fixed_base=False`` the root moves too, and all of it falls by g t^2 / 2."""
    text = ARM.replace('<link name="stand">', '<link name="stand"><inertial><mass value="3"/>'
                       '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>')  # fmt: skip
    scene = load(tmp_path, text, fixed_base=False)
    bodies = list(scene.bodies.values())
    assert all(body.is_dynamic for body in bodies)

    def height():
        return sum(body.mass * body.centre_of_mass[2] for body in bodies) / sum(body.mass for body in bodies)

    before = height()
    scene.world.run(0.2)
    # a substep of 1/600 s at most is too far by g t h / 2
    assert height() - before == pytest.approx(-0.5 * 9.81 * 0.04, abs=9.81 * 0.2 / 1200 + 1e-4)


def test_the_robots_that_are_there_load(tmp_path):
    """Panda of example-robot-data, through package:// names, with its mass; it hangs still for a frame or two."""
    try:
        files = distribution("example-robot-data").files
    except PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    path = str(next(Path(file.locate()).resolve() for file in files if file.name == "panda.urdf"))
    scene = nuno.load_scene(path, nuno.World(device="cpu"))
    model = pin.buildModelFromUrdf(path)
    moving = [body for body in scene.bodies.values() if body.is_dynamic]
    mass = sum(model.inertias[k].mass for k in range(1, model.njoints))
    assert sum(body.mass for body in moving) == pytest.approx(mass, rel=1e-5)
    assert len(scene.joints) == 9 and len(moving) == 9
    scene.world.run(0.05)
    assert max(np.abs(body.velocity).max() for body in moving) < 9.81 * 0.05 * 2.0, "nothing is pushed apart"


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ("<robot", nuno.FileFormatError, "cannot read"),
        ("<mujoco/>", nuno.FileFormatError, "its root is <mujoco>"),
        ('<robot name="r"><link name="a"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
         "</robot>",
         nuno.FileFormatError, "cannot read"),
        (ARM.replace('<sphere radius="0.05"/>', '<mesh filename="package://nowhere/gone.stl"/>'), nuno.MeshError,
         "package_dirs"),
        ('<robot name="r"><link name="a"/></robot>', nuno.FileFormatError, "holds no body"),
    ],
    ids=["cut", "other", "dangling", "mesh", "empty"],
)  # fmt: skip
def test_bad_files_are_named_errors(tmp_path, text, error, said):
    """Malformed XML, a link that is not there, a mesh that is not there: by name, and nothing is added."""
    world = nuno.World(device="cpu")
    (tmp_path / "bad.urdf").write_text(text)
    with pytest.raises(error, match=said):
        nuno.load_scene(tmp_path / "bad.urdf", world)
    assert world.bodies == ()


def test_package_dirs_are_looked_in(tmp_path):
    """A mesh in a folder that is named."""
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "packages" / "parts").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "packages" / "parts" / "cube.stl")
    text = ARM.replace('<sphere radius="0.05"/>', '<mesh filename="package://parts/cube.stl"/>')
    with pytest.raises(nuno.MeshError):
        load(tmp_path, text)
    scene = load(tmp_path, text, package_dirs=[tmp_path / "packages"])
    hull = scene.bodies["upper"].shape.parts[1][0]
    assert isinstance(hull, nuno.Hull) and len(hull.vertices) == 8
