"""Links with dynamics: closed forms of joints that rub and are damped, of tumbling, of slopes and of statics."""

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.robot.description import robot_data
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
PANDA = "panda_description/urdf/panda.urdf"
FEET = ("left", "right")


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


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_all_joints_read_at_once_are_what_each_tells():
    """Positions and velocities to rounding, hinges and sliders, base free and fixed, one world and a batch."""
    talos = nuno.Humanoid("talos")
    for model in (talos, nuno.Humanoid(talos.description.urdf), nuno.Humanoid(robot_data() / PANDA)):
        world = nuno.World(device="cpu")
        dynamics = LinkDynamics(model.enter(world, "joints"))
        dynamics.attach()
        n = len(model.joint_names)
        dynamics.drive(model.angle_vector(), np.full(n, 0.5), dynamics.stiffness, dynamics.damping, np.zeros(n))
        world.run(0.1)
        for read in (dynamics, dynamics.imagined(world.imagine(2))):
            q, v = read.read()
            for k, joint in enumerate(read.joints):
                told = [model.angles_of(own)[k] for own in q]
                np.testing.assert_allclose(told, np.broadcast_to(joint.position, len(q)), atol=1e-9)
                np.testing.assert_allclose(v[:, 6 + k], joint.velocity, atol=1e-9)
            base = read.bodies[0]
            if base.is_dynamic:
                np.testing.assert_allclose(q[:, :3], np.broadcast_to(base.pose()[0], (len(q), 3)), atol=1e-12)


def momenta(model, q, v):
    """Return momentum and angular momentum about the centre of mass (6,), the energy of motion [J], the centre (3,)."""
    data = model.createData()
    moved = np.array(pin.computeCentroidalMomentum(model, data, q, v))
    return moved, pin.computeKineticEnergy(model, data, q, v), np.array(data.com[0])


def tumbling_talos():
    """Return Talos afloat in no gravity, thrown with a spin as one body: its world, its dynamics, its velocity."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0), substeps=20)
    model = nuno.Humanoid("talos")
    dynamics = LinkDynamics(model.enter(world, "joints"))
    dynamics.attach()
    spin, velocity = np.array((0.5, 2.0, 0.3)), np.array((0.3, -0.2, 1.0))
    for body in dynamics.bodies:
        arm = np.asarray(body.centre_of_mass) - model.centre_of_mass
        world.set_velocity(body, velocity + np.cross(spin, arm), spin)
    return world, dynamics, velocity


@pytest.mark.long
def test_a_tumbling_robot_keeps_momentum_and_energy():
    """2 rad/s, motors hold its joints: 1 s later all as it was, but for a part in 500 in energy and in spin.

    What motors that give way by the centrifugal forces, some tenths of a milliradian, take and give back is in there.
    """
    world, dynamics, velocity = tumbling_talos()
    model = dynamics.robot.model
    q, v = (part[0] for part in dynamics.read())
    first, energy, start = momenta(model, q, v)
    np.testing.assert_allclose(first[:3], dynamics.robot.mass * velocity, rtol=1e-4)
    world.run(1.0)
    q, v = (part[0] for part in dynamics.read())
    last, left, end = momenta(model, q, v)
    np.testing.assert_allclose(last[:3], first[:3], atol=1e-3 * np.linalg.norm(first[:3]))
    np.testing.assert_allclose(last[3:], first[3:], atol=2e-3 * np.linalg.norm(first[3:]))
    np.testing.assert_allclose(end - start, velocity * 1.0, atol=1e-3)
    assert left == pytest.approx(energy, rel=2e-3)


@pytest.mark.long
def test_swinging_limbs_change_no_momentum():
    """The same while motors swing both arms and a knee: the pose changes, the momenta do not."""
    world, dynamics, _ = tumbling_talos()
    robot = dynamics.robot
    q, v = (part[0] for part in dynamics.read())
    first, energy, _ = momenta(robot.model, q, v)
    wanted = robot.angle_vector()
    for name, way in (("arm_left_2_joint", 0.6), ("arm_right_4_joint", -0.8), ("leg_left_4_joint", 0.5)):
        wanted[robot.joint_index(name)] += way
    nothing = np.zeros(len(wanted))
    dynamics.drive(wanted, nothing, 0.02 * dynamics.stiffness, 0.15 * dynamics.damping, nothing)
    world.run(0.6)
    q, v = (part[0] for part in dynamics.read())
    last, left, _ = momenta(robot.model, q, v)
    assert np.abs(robot.angles_of(q) - robot.angle_vector()).max() > 0.3
    assert abs(left - energy) > 0.005 * energy  # motors work
    np.testing.assert_allclose(last[:3], first[:3], atol=2e-3 * np.linalg.norm(first[:3]))
    np.testing.assert_allclose(last[3:], first[3:], atol=4e-3 * np.linalg.norm(first[3:]))


@pytest.mark.long
@pytest.mark.parametrize("share", [0.9, pytest.param(1.2, marks=pytest.mark.long)])
def test_feet_stick_and_slide_at_the_angle_of_friction(share):
    """Talos on stiff motors on a slope aside, friction 0.1: it slides at g (sin - mu cos), and below atan(mu) stops.

    The slope is gravity's. The start, when motors give way and weight comes onto the feet by and by, is a small shove.
    """
    mu = 0.1
    slope = np.arctan(share * mu)
    world = nuno.World(device="cpu", gravity=(0.0, G * np.sin(slope), -G * np.cos(slope)))
    world.add(nuno.plane(name="floor", friction=mu))
    model = nuno.Humanoid("talos")
    dynamics = LinkDynamics(model.enter(world, "joints"), friction=mu)
    dynamics.attach()
    feet = [body for body in dynamics.bodies if "leg" in body.name and "_6_link" in body.name]
    speeds, places = [], []
    for _ in range(72):
        world.step()
        q, v = (part[0] for part in dynamics.read())
        speeds.append(momenta(model.model, q, v)[0][1] / model.mass)
        places.append([foot.pose()[0][1] for foot in feet])
    pull = G * (np.sin(slope) - mu * np.cos(slope))
    assert (speeds[29] - speeds[11]) / 0.3 == pytest.approx(pull, rel=0.05)
    if share < 1.0:  # it stands: its trunk still sways on the motors
        np.testing.assert_allclose(places[48:], np.broadcast_to(places[48], (24, 2)), atol=1e-4)
    else:
        assert (speeds[-1] - speeds[41]) / 0.5 == pytest.approx(pull, rel=0.05)


@pytest.fixture(scope="module")
def resting():
    """A Talos that stands on a floor with 2.5 kg in each hand, at rest; `test_felt_contacts.py` has one without."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    for side in ("left", "right"):
        place = robot.actual.frame_pose(f"{side}_hand").position
        box = world.add(nuno.box((0.1, 0.1, 0.1), name=f"{side} load", position=place))
        world.attach(box, nuno.Rigid(mass=2.5))
        for other in robot.links.bodies:
            world.ignore_contact(box, other)
        nuno.fixed_joint(box, robot.links.bodies[robot.links.names.index(f"arm_{side}_7_link")])
    world.run(4.0)
    return world, robot


def soles(world, robot):
    """Return, of each foot, the joint that carries it, and the force and moment on it about the world's origin."""
    found = []
    for foot in robot.actual.description.feet:
        link = robot.actual.description.frames[foot].link
        joint = robot.actual.model.frames[robot.actual.frame_index(link)].parentJoint
        points = world.contacts(robot.links.bodies[joint - 1])
        forces = np.asarray(points.forces)
        found.append((joint, forces.sum(axis=0), np.cross(points.points, forces).sum(axis=0)))
    return found


@pytest.fixture(scope="module")
def statics(resting):
    """Torques of all joints (n,) [N m], told and by statics, means of 3 s; and velocities of its frames, (180, n)."""
    world, robot = resting
    model, data = robot.actual.model, robot.actual.model.createData()
    told, wanted, speeds = [], [], []
    for _ in range(180):
        world.step()
        speeds.append(robot.state().v[6:])
        q = robot.state().q
        tau = np.array(pin.computeGeneralizedGravity(model, data, q))
        pin.computeJointJacobians(model, data, q)
        loads = [
            (joint, np.array((0.0, 0.0, -2.5 * G)), np.cross(world.find(f"{side} load").pose()[0], (0, 0, -2.5 * G)))
            for side in ("left", "right") for joint in (model.getJointId(f"arm_{side}_7_joint"),)
        ]  # fmt: skip
        for joint, force, moment in [*loads, *soles(world, robot)]:
            jacobian = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD)
            tau -= jacobian.T @ np.concatenate([force, moment])
        told.append(robot.state().torques)
        wanted.append(tau[6:])
    return np.mean(told, axis=0), np.mean(wanted, axis=0), np.array(speeds)


@pytest.mark.long
@pytest.mark.parametrize("group", ["leg_left", "leg_right", "arm_left", "arm_right", "torso"])
def test_at_rest_all_torques_are_those_of_inverse_dynamics(resting, statics, group):
    """Hips, knees, ankles, trunk, arms and wrists: gravity, the loads, and what contact does to the soles; within 1 %.

    Of the largest of each group, over the mean of 3 s: balance sways the loaded robot.
    """
    mine, theirs, _ = statics
    rows = [k for k, name in enumerate(resting[1].actual.joint_names) if name.startswith(group)]
    np.testing.assert_allclose(mine[rows], theirs[rows], atol=0.01 * np.abs(theirs[rows]).max())


@pytest.mark.long
def test_friction_holds_the_arms_of_a_robot_at_rest(resting, statics):
    """Coulomb: wrists rub by 1 N m, which bears what they need, so that nothing in the arms moves.

    Balance commands torques anew in each frame, and sways: 0.02 rad/s (standard deviation over 0.5 s, of the joint that
    moves most; median of six times 0.5 s). In one of four the left forearm turns by 0.05 to 0.1. Before, friction
    let go and held in turns from substep to substep, and a forearm shook by 0.13 to 0.24 rad/s all the time.
    """
    rows = [k for k, name in enumerate(resting[1].actual.joint_names) if name.startswith("arm")]
    shakes = statics[2][:, rows].reshape(6, 30, -1).std(axis=1).max(axis=1)
    assert np.median(shakes) < 0.05


@pytest.mark.long
def test_the_zero_moment_point_is_that_of_the_contact_forces(resting):
    """Of the soles' contacts, and of inverse dynamics with what the hands hold: within 1 mm; the weight: 0.2 %."""
    world, robot = resting
    found = soles(world, robot)
    force, moment = sum(own[1] for own in found), sum(own[2] for own in found)
    assert force[2] == pytest.approx((robot.actual.mass + 5.0) * G, rel=2e-3)
    point = np.array((-moment[1], moment[0])) / force[2]
    np.testing.assert_allclose(robot.read().zero_moment_point[:2], point, atol=1e-3)


@pytest.mark.long
def test_ankles_read_the_weight(resting):
    """Both ankles together bear all but the feet below them: within 1 %."""
    _, robot = resting
    told, model = robot.read().wrenches, robot.actual.model
    up = [(robot.actual.frame_pose(f"{side}_ankle").rotation @ told[f"{side}_ankle"][:3])[2] for side in FEET]
    feet = [model.inertias[model.getJointId(f"leg_{side}_6_joint")].mass for side in FEET]
    assert abs(sum(up)) == pytest.approx((robot.actual.mass + 5.0 - sum(feet)) * G, rel=0.01)
