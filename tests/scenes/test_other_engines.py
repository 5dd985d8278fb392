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


@pytest.mark.long
def test_a_written_strip_bends_in_mujoco_as_its_rigidity_says(tmp_path):
    """A cantilever that hangs by its weight has the rigidity of the elastica that hangs as low, within 4 %."""
    mujoco = pytest.importorskip("mujoco", minversion="4.0")
    length, cells = 0.2, 12
    step, rigidity = length / cells, 2e-3
    world = nuno.World(device="cpu")
    strip = world.add(nuno.sheet((length, 3 * step), cells=(cells, 3), name="strip", position=(0.5 * length, 0.0, 0.5)))
    world.attach(strip, nuno.Cloth(bending_rigidity=rigidity, area_density=0.2, shear_stiffness=400.0))
    world.ignore_contact(strip, strip)
    start = strip.vertices
    held = np.flatnonzero(start[:, 0] < 1.5 * step)
    world.grip(strip, held, to=start[held].mean(axis=0))
    nuno.save_scene(world, tmp_path / "strip.xml")
    spec = mujoco.MjSpec.from_file(str(tmp_path / "strip.xml"))
    spec.option.integrator, spec.option.timestep = mujoco.mjtIntegrator.mjINT_DISCRETE, 2e-3
    model = spec.compile()
    model.dof_damping[:] = 6.0 * model.body_mass[model.dof_bodyid]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(1500):
        mujoco.mj_step(model, data)
    tip = data.flexvert_xpos[start[:, 0] > length - 1e-6].mean(axis=0)
    # two held columns clamp the strip halfway between them; theta'' = -G (1 - s) cos(theta), as in the engines' tests
    ratio = (0.5 - tip[2]) / (tip[0] - 0.5 * step)
    felt = np.exp(np.interp(np.log(ratio), np.log((0.58572, 0.78857, 1.06680)), np.log((5.0, 7.0, 10.0))))
    assert 0.2 * 9.81 * (length - 0.5 * step) ** 3 / rigidity / felt == pytest.approx(1.0, abs=0.04)
