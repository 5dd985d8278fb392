"""What other programs make of the files that Nuno writes: MuJoCo's masses and motion, Newton's bodies and joints."""

import numpy as np
import pytest

import nuno
from scene_rooms import door_room, every_kind


def test_mujoco_reads_the_same_masses_and_places(tmp_path):
    """Every rigid body at its place with its mass and inertia, cloth and soft bodies with theirs, in the key frame."""
    mujoco = pytest.importorskip("mujoco")
    world = every_kind()
    nuno.save_scene(world, tmp_path / "kinds.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "kinds.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for body in world.bodies:
        if not body.is_dynamic:
            continue
        if isinstance(body.material, nuno.Rigid):
            own = model.body(body.name)
            np.testing.assert_allclose(data.body(body.name).xpos, body.position, atol=1e-6, err_msg=body.name)
            np.testing.assert_allclose(own.mass[0], body.mass, rtol=1e-6)
            r = data.body(body.name).ximat.reshape(3, 3)
            inertia = r @ np.diag(own.inertia) @ r.T
            np.testing.assert_allclose(inertia, body.inertia, rtol=0.0, atol=1e-6 * np.abs(body.inertia).max())
        else:
            flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, body.name)
            first, count = model.flex_vertadr[flex], model.flex_vertnum[flex]
            np.testing.assert_allclose(data.flexvert_xpos[first : first + count], body.vertices, atol=1e-6)
            mass = model.body_mass[model.flex_vertbodyid[first : first + count]].sum()
            np.testing.assert_allclose(mass, body.mass, rtol=1e-5, err_msg=body.name)


def test_a_door_swings_in_mujoco_as_in_nuno(tmp_path):
    """A motor that pulls a door open: its angle after 0.3 s to half a substep of its speed."""
    mujoco = pytest.importorskip("mujoco")
    world = nuno.World(device="cpu", substeps=40)
    door = world.add(nuno.box((0.8, 0.03, 0.9), name="door", position=(0, 0, 0.5)))
    world.attach(door, nuno.Rigid(density=100.0))
    joint = nuno.hinge(
        door, None, point=(-0.4, 0, 0.5), axis=(0, 0, 1), position=0.3, spring=nuno.Spring(0.0, damping=0.1),
        motor=nuno.Motor(position=1.0, stiffness=5.0, damping=0.5, max_effort=30.0),
    )  # fmt: skip
    nuno.save_scene(world, tmp_path / "door.xml", joints={"hinge": joint})
    spec = mujoco.MjSpec.from_file(str(tmp_path / "door.xml"))
    spec.option.timestep, spec.option.integrator = 2e-4, mujoco.mjtIntegrator.mjINT_RK4
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    start = data.joint("hinge").qpos[0]
    while data.time < 0.3 - 1e-9:
        mujoco.mj_step(model, data)
    world.run(0.3)
    assert start == pytest.approx(0.3, abs=1e-9)
    # half a substep of 1/2400 s at under 2 rad/s is 4e-4 rad; single precision as much again
    assert joint.position == pytest.approx(data.joint("hinge").qpos[0], abs=8e-4)
    assert joint.position > 0.35


@pytest.mark.slow
def test_newton_reads_the_same_bodies_from_usd(tmp_path):
    """Masses, cloth's particles and the joint of a room, as Newton's own importer finds them."""
    newton = pytest.importorskip("newton")
    pytest.importorskip("newton_usd_schemas")
    world = door_room()
    nuno.save_scene(world, tmp_path / "room.usda")
    builder = newton.ModelBuilder()
    builder.add_usd(str(tmp_path / "room.usda"))
    masses = dict(zip((label.split("/")[-1] for label in builder.body_label), builder.body_mass, strict=True))
    for name in ("door", "crate"):
        assert masses[name] == pytest.approx(world.find(name).mass, rel=1e-5)
    assert len(builder.particle_q) == len(world.find("towel").vertices)
    assert sum(builder.particle_mass) == pytest.approx(world.find("towel").mass, rel=1e-3)
