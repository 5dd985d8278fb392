"""Links with dynamics: closed forms of joints that rub and are damped, of tumbling, of slopes and of statics."""

import numpy as np

import nuno
from nuno.robot.link_dynamics import LinkDynamics

G = 9.81
PENDULUM = """
<robot name='pendulum'>
  <link name='base'/>
  <joint name='swing' type='revolute'><parent link='base'/><child link='bob'/><origin xyz='0 0 1'/><axis xyz='0 1 0'/>
    <limit lower='-3' upper='3' effort='50' velocity='20'/><dynamics friction='{friction}' damping='{damping}'/></joint>
  <link name='bob'>
    <inertial><origin xyz='0 0 -0.5'/><mass value='2'/>
      <inertia ixx='0.01' iyy='0.02' izz='0.02' ixy='0' ixz='0' iyz='0'/></inertial>
    <collision><origin xyz='0 0 -0.5'/><geometry><sphere radius='0.05'/></geometry></collision>
  </link>
</robot>
"""
STIFF = 2.0 * G * 0.5
"""[N m/rad] Of the pendulum, by gravity."""
INERTIA = 0.02 + 2.0 * 0.5**2
"""[kg m2] About its axis."""


def pendulum(folder, friction=0.0, damping=0.0, angle=0.1):
    """Return a world and the dynamics of a pendulum without torque."""
    path = folder / "pendulum.urdf"
    path.write_text(PENDULUM.format(friction=friction, damping=damping))
    world = nuno.World(device="cpu", substeps=40)
    model = nuno.Humanoid(path)
    model.angle_vector([angle])
    dynamics = LinkDynamics(model.enter(world, "joints"))
    dynamics.attach()
    nothing = np.zeros(1)
    dynamics.drive(nothing, nothing, nothing + 1e-9, nothing, nothing)
    return world, dynamics


def turns(world, dynamics, frames):
    """Return the angles [rad] where a pendulum turns round, from frame to frame."""
    found = [float(dynamics.joints[0].position)]
    for _ in range(frames):
        world.step()
        found.append(float(dynamics.joints[0].position))
    inner = np.array(found[1:-1])
    ways = np.diff(found)
    peaks = (ways[:-1] * ways[1:] < 0.0) & (np.abs(ways[1:]) > 1e-7)  # not what rounding moves of one that stands
    return np.abs(inner[peaks]), found


def test_friction_takes_the_same_of_each_swing_and_then_holds(tmp_path):
    """Coulomb friction f in a joint of stiffness k: each half swing is 2 f / k less, and it sticks within f / k.

    The angle is read at frames: of a swing of amplitude A up to A (w / 120)^2 / 2 is missed, 0.1 % of it.
    """
    friction = 0.06
    world, dynamics = pendulum(tmp_path, friction=friction)
    peaks, angles = turns(world, dynamics, 420)
    assert len(peaks) >= 6
    np.testing.assert_allclose(-np.diff([0.1, *peaks]), 2.0 * friction / STIFF, rtol=0.01)
    assert abs(angles[-1]) <= friction / STIFF
    assert abs(angles[-1] - angles[-60]) < 1e-6  # it stands


def test_damping_takes_the_same_share_of_each_swing(tmp_path):
    """Viscous damping d: amplitudes fall by exp(-d T / 4 I) from half swing to half swing."""
    damping = 0.1
    world, dynamics = pendulum(tmp_path, damping=damping)
    peaks, _ = turns(world, dynamics, 300)
    rate = damping / (2.0 * INERTIA)
    half = np.pi / np.sqrt(STIFF / INERTIA - rate**2)
    assert len(peaks) >= 5
    np.testing.assert_allclose(peaks[1:] / peaks[:-1], np.exp(-rate * half), rtol=5e-3)


def test_a_joint_sticks_below_its_friction_and_goes_above(tmp_path):
    """A motor's torque 2 % below and above what friction holds beside gravity."""
    for share, goes in ((0.98, False), (1.02, True)):
        world, dynamics = pendulum(tmp_path, friction=2.0, angle=0.0)
        nothing = np.zeros(1)
        dynamics.drive(nothing, nothing, nothing + 1e-9, nothing, nothing + 2.0 * share)
        world.run(0.5)
        assert (float(dynamics.joints[0].position) > 1e-4) == goes
