"""Scene files on either engine, beside MuJoCo itself on the same file."""

import numpy as np
import pytest

import nuno

mujoco = pytest.importorskip("mujoco", minversion="4.0")

ROOM = """<mujoco><option timestep="0.001" integrator="implicitfast"/>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="upper" pos="0 0 1"><joint name="first" axis="0 1 0" damping="0.02"/>
    <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" contype="0" conaffinity="0"/>
    <body name="lower" pos="0.3 0 0"><joint name="second" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" contype="0" conaffinity="0"/></body></body>
  <body name="crate" pos="0.2 0.6 0.3"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("engine", ["nuno", "mujoco"])
def test_a_scene_moves_as_mujoco_itself_moves_it(engine, tmp_path):
    """A double pendulum after 0.5 s and 2.26 rad, within 0.01 rad for steps twice as long; a crate that fell stands."""
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    (tmp_path / "room.xml").write_text(ROOM)
    world = nuno.World(device="cpu", engine=engine)
    scene = nuno.load_scene(tmp_path / "room.xml", world)
    world.run(0.5)
    angles = [float(scene.joints[name].position) for name in ("first", "second")]
    np.testing.assert_allclose(angles, data.qpos[:2], atol=0.01)
    np.testing.assert_allclose(scene.bodies["crate"].position, data.body("crate").xpos, atol=3e-4)  # contacts give way
