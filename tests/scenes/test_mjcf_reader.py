"""MJCF files of other programs: MuJoCo's own masses and motions, and what is left out by name."""

import numpy as np
import pytest

import nuno

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>
<worldbody>
  <geom name="ground" type="plane" size="2 2 0.1" friction="0.7"/>
  <body name="base" pos="0 0 1">
    <geom name="post" type="box" size="0.02 0.02 0.02"/>
    <body name="rod" pos="0 0 0" euler="0 0.4 0">
      <joint name="swing" type="hinge" axis="0 1 0" damping="0.01" armature="0.001"/>
      <geom name="pole" type="capsule" fromto="0 0 -0.1 0 0 -0.5" size="0.02" density="700" contype="0"
        conaffinity="0"/>
      <body name="tip" pos="0 0 -0.5"><geom name="bob" type="sphere" size="0.05" mass="0.4"/></body>
    </body>
  </body>
  <body name="free" pos="1 0 0.5"><freejoint/><geom type="box" size="0.1 0.05 0.02" rgba="1 0 0 1"/></body>
</worldbody>
<sensor><jointpos name="angle" joint="swing"/></sensor>
</mujoco>"""


def load(tmp_path, text, name="scene.xml", **options):
    """Return the scene of a text."""
    (tmp_path / name).write_text(text)
    return nuno.load_scene(tmp_path / name, nuno.World(device="cpu"), **options)


def test_bodies_have_their_kind_and_mass(tmp_path):
    """What is fixed together is one body, with MuJoCo's mass, centre and inertia; what does not move is static."""
    scene = load(tmp_path, ARM)
    assert set(scene.bodies) == {"ground", "base", "rod", "free"}
    assert scene.report.bodies == {"static": 2, "rigid": 2} and scene.report.joints == {"hinge": 1}
    assert isinstance(scene.bodies["ground"].shape, nuno.Plane) and scene.bodies["ground"].friction == 0.7
    assert scene.bodies["free"].shape.size == pytest.approx((0.2, 0.1, 0.04))
    assert scene.bodies["free"].color == pytest.approx((1, 0, 0))
    # boxes: 1000 kg/m3 by default
    assert scene.bodies["free"].mass == pytest.approx(1000.0 * 0.2 * 0.1 * 0.04, rel=1e-6)
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rod = model.body("rod").id
    np.testing.assert_allclose(scene.bodies["rod"].mass, model.body_subtreemass[rod], rtol=1e-6)
    np.testing.assert_allclose(scene.bodies["rod"].centre_of_mass, data.subtree_com[rod], atol=1e-6)
    notes = scene.report.notes
    assert notes["geoms that are only seen are left out"] == ("rod",)
    assert notes["the armature of joints is left out"] == ("swing",)
    assert notes["sensors are left out"] == ("angle",)


def test_a_pendulum_swings_as_in_mujoco(tmp_path):
    """Half a second of a damped pendulum, whose speed is then 1.34 rad/s: the angle to half a substep of it."""
    text = ARM.replace(' armature="0.001"', "")
    (tmp_path / "arm.xml").write_text(text)
    scene = nuno.load_scene(tmp_path / "arm.xml", nuno.World(device="cpu", substeps=40))
    model = mujoco.MjModel.from_xml_string(text.replace("<option ", '<option timestep="0.0002" integrator="RK4" '))
    data = mujoco.MjData(model)
    while data.time < 0.5 - 1e-9:
        mujoco.mj_step(model, data)
    scene.world.run(0.5)
    # an Euler step of h is h / 2 behind: 2.8e-4 rad at 2400 substeps a second; single precision adds some 2e-4
    assert scene.joints["swing"].position == pytest.approx(data.joint("swing").qpos[0], abs=6e-4)


def test_several_joints_of_one_body_are_a_chain(tmp_path):
    """Two slides and a hinge: two small bodies in between, the mass as it was."""
    text = """<mujoco><worldbody><body name="puck"><joint name="x" type="slide" axis="1 0 0"/>
    <joint name="y" type="slide" axis="0 1 0"/><joint name="spin" axis="0 0 1"/>
    <geom type="cylinder" size="0.1 0.02" mass="2"/></body></worldbody></mujoco>"""
    scene = load(tmp_path, text)
    assert [joint.kind for joint in scene.joints.values()] == ["slider", "slider", "hinge"]
    assert len(scene.bodies) == 3 and sum(body.mass for body in scene.bodies.values()) == pytest.approx(2.0)
    scene.world.push("puck", (1.0, 2.0, 0.0), duration=0.1)
    scene.world.run(0.1)
    # F t / m; gravity is borne by the slides
    np.testing.assert_allclose(scene.bodies["puck"].velocity, (0.05, 0.1, 0.0), atol=2e-3)


def test_actuators_are_motors(tmp_path):
    """Position and velocity servos by their gains and gear; a force without a command is none, and is told."""
    text = """<mujoco><worldbody>
    <body name="a"><joint name="ja"/><geom size="0.1"/></body>
    <body name="b" pos="1 0 0"><joint name="jb"/><geom size="0.1"/></body>
    <body name="c" pos="2 0 0"><joint name="jc"/><geom size="0.1"/></body></worldbody>
    <actuator><position joint="ja" kp="5" kv="0.5" gear="2" forcerange="-3 3"/><velocity joint="jb" kv="4"/>
    <motor name="push" joint="jc"/></actuator>
    <keyframe><key name="go" ctrl="0.6 0.5 0"/></keyframe></mujoco>"""
    scene = load(tmp_path, text, keyframe="go")
    servo, runner = scene.joints["ja"].motor, scene.joints["jb"].motor
    # gear g: torque g (kp (u - g q) - kv g w), so that it rests at u / g
    assert (servo.stiffness, servo.damping, servo.position, servo.max_effort) == pytest.approx((20.0, 2.0, 0.3, 6.0))
    assert (runner.velocity, runner.damping, runner.position) == (0.5, 4.0, None)
    assert scene.joints["jc"].motor is None
    assert scene.report.notes["actuators of pure force give none until joint.motor is set"] == ("push",)


def test_flexes_are_cloth_and_soft_bodies(tmp_path):
    """A plate's stiffness by its thickness, masses, held corners; a rope is left out by name."""
    text = """<mujoco><worldbody>
    <flexcomp name="flag" type="grid" count="5 4 1" spacing="0.1 0.1 0.1" pos="0 0 1" dim="2" mass="0.06"
      radius="0.002">
      <elasticity young="2e5" poisson="0.25" thickness="0.004" damping="0.01" elastic2d="both"/><pin id="0 1 2 3"/>
      <contact selfcollide="none"/></flexcomp>
    <flexcomp name="jelly" type="grid" count="3 3 3" spacing="0.05 0.05 0.05" pos="1 0 1" dim="3" mass="0.2"
      radius="0.001">
      <elasticity young="3e4" poisson="0.3" damping="0.02"/></flexcomp>
    <flexcomp name="rope" type="grid" count="5 1 1" spacing="0.1 0.1 0.1" pos="2 0 1" dim="1" mass="0.1" radius="0.01">
      <edge stiffness="100"/></flexcomp>
    </worldbody></mujoco>"""
    scene = load(tmp_path, text)
    flag, jelly = scene.bodies["flag"], scene.bodies["jelly"]
    assert isinstance(flag.material, nuno.Cloth) and isinstance(jelly.material, nuno.Soft)
    # E t, E t / (2 (1 + nu)), E t^3 / (12 (1 - nu^2)); 0.06 kg over 0.4 m x 0.3 m
    cloth = flag.material
    assert (cloth.stretch_stiffness, cloth.shear_stiffness) == pytest.approx((800.0, 320.0))
    assert cloth.bending_rigidity == pytest.approx(2e5 * 0.004**3 / (12 * (1 - 0.25**2)))
    assert (cloth.area_density, cloth.thickness, cloth.damping) == pytest.approx((0.5, 0.004, 0.01))
    # a body's mass in the lattice of MuJoCo: 0.2 kg over a cube of 0.1 m
    assert (jelly.material.density, jelly.material.youngs_modulus) == pytest.approx((200.0, 3e4))
    assert jelly.mass == pytest.approx(0.2, rel=1e-5)
    assert len(scene.grips) == 1 and scene.grips[0].body is flag
    before = flag.vertices
    scene.world.run(0.1)
    moved = np.linalg.norm(flag.vertices - before, axis=1)
    assert moved[:4].max() < 1e-6 and moved[4:].min() > 1e-3, "what is held stays, the rest falls"
    assert scene.report.notes["ropes (flexes of one dimension) are left out"] == ("rope",)


def test_welds_connections_and_excludes(tmp_path):
    """Fixed and ball joints, and pairs that pass through each other."""
    text = """<mujoco><worldbody>
    <body name="a" pos="0 0 1"><freejoint/><geom size="0.1"/></body>
    <body name="b" pos="0.15 0 1"><freejoint/><geom size="0.1"/></body>
    <body name="c" pos="0 0.3 1"><freejoint/><geom size="0.1"/></body></worldbody>
    <contact><exclude body1="a" body2="b"/></contact>
    <equality><weld name="glue" body1="a" body2="c"/><connect name="pivot" body1="b" anchor="0 0 0.2"/></equality>
    </mujoco>"""
    scene = load(tmp_path, text)
    assert {name: joint.kind for name, joint in scene.joints.items()} == {"glue": "fixed", "pivot": "ball"}
    assert scene.joints["pivot"].target is None and scene.joints["glue"].target.name == "c"
    assert len(scene.world.save().ignored) == 1
    np.testing.assert_allclose(scene.world.save().grips[-1].spec.other_place, [[0.15, 0, 1.2]], atol=1e-9)


def test_contact_masks_are_mujocos(tmp_path):
    """Two bodies touch where either's mask wants to; Nuno's masks say the same of every pair."""
    masks = {"a": (1, 1), "b": (0, 1), "c": (2, 0), "d": (4, 2), "e": (0, 0)}
    bodies = "".join(
        f'<body name="{name}" pos="{k} 0 1"><freejoint/><geom size="0.1" contype="{t}" conaffinity="{a}"/></body>'
        for k, (name, (t, a)) in enumerate(masks.items())
    )
    scene = load(tmp_path, f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    for a, (type_a, affinity_a) in masks.items():
        for b, (type_b, affinity_b) in masks.items():
            if a != b:
                one, other = scene.bodies[a], scene.bodies[b]
                touch = bool(one.group & other.collides_with) and bool(other.group & one.collides_with)
                assert touch == bool(type_a & affinity_b or type_b & affinity_a), (a, b)


def test_a_key_frame_is_where_it_begins(tmp_path):
    """Places and velocities of the key that is named; one that is not there is refused with those that are."""
    text = """<mujoco><worldbody><body name="a" pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody>
    <keyframe><key name="up" qpos="0 0 3 1 0 0 0" qvel="1 0 0 0 2 0"/></keyframe></mujoco>"""
    assert load(tmp_path, text).bodies["a"].position[2] == 1.0
    body = load(tmp_path, text, keyframe="up").bodies["a"]
    np.testing.assert_allclose(body.position, (0, 0, 3))
    np.testing.assert_allclose(body.velocity, (1, 0, 0), atol=1e-7)
    np.testing.assert_allclose(body.angular_velocity, (0, 2, 0), atol=1e-7)
    with pytest.raises(nuno.FileFormatError, match="no key frame named 'down'; there are: up"):
        load(tmp_path, text, keyframe="down")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><worldbody>", "cannot read"),
        ("hello", "cannot read"),
        ("<mujoco><worldbody><body><geom size='-1'/></body></worldbody></mujoco>", "cannot read"),
        ("<mujoco><asset><mesh name='m' file='gone.stl'/></asset></mujoco>", "gone.stl"),
        ("<mujoco><worldbody/></mujoco>", "holds no body"),
        ("<mujoco><custom><text name='nuno' data='{oops'/></custom><worldbody><geom size='1'/></worldbody></mujoco>",
         "Nuno part is damaged"),
    ],
    ids=["cut", "text", "size", "mesh", "empty", "part"],
)  # fmt: skip
def test_bad_files_are_named_errors(tmp_path, text, said):
    """What MuJoCo refuses, with what it says; nothing is added to the world."""
    world = nuno.World(device="cpu")
    (tmp_path / "bad.xml").write_text(text)
    with pytest.raises(nuno.FileFormatError, match=said):
        nuno.load_scene(tmp_path / "bad.xml", world)
    assert world.bodies == ()


def test_a_scene_that_cannot_be_added_leaves_the_world_as_it_was(tmp_path, monkeypatch):
    """Bodies that were added before the failure are taken away."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 1), name="mine"))
    (tmp_path / "arm.xml").write_text(ARM)
    monkeypatch.setattr("nuno.scenes.build_world._join", lambda *_: (_ for _ in ()).throw(nuno.BodyStateError("no")))
    with pytest.raises(nuno.BodyStateError):
        nuno.load_scene(tmp_path / "arm.xml", world)
    assert [body.name for body in world.bodies] == ["mine"]


def test_names_that_are_taken_get_numbers(tmp_path):
    """The scene's own names lead to its bodies, twice the same file in one world."""
    (tmp_path / "arm.xml").write_text(ARM)
    world = nuno.World(device="cpu", gravity=(0, 0, -1.62))
    first, second = (nuno.load_scene(tmp_path / "arm.xml", world) for _ in range(2))
    assert first.bodies["rod"].name == "rod" and second.bodies["rod"].name == "rod_1"
    assert "the world keeps its own gravity" in second.report.notes and world.gravity[2] == -1.62
