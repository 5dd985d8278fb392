"""A robot with dynamics: closed forms of its motion, balance, contact, and what is said when it cannot."""

import numpy as np
import pinocchio as pin
import pytest
from lifter import lifter_in

import nuno
from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot.link_dynamics import LinkDynamics
from nuno.robot.whole_body import Gains

G = 9.81
PENDULUM = """
<robot name='pendulum'>
  <link name='base'/>
  <joint name='swing' type='revolute'><parent link='base'/><child link='bob'/><origin xyz='0 0 1'/><axis xyz='0 1 0'/>
    <limit lower='-3' upper='3' effort='50' velocity='20'/></joint>
  <link name='bob'>
    <inertial><origin xyz='0 0 -0.5'/><mass value='2'/>
      <inertia ixx='0.01' iyy='0.02' izz='0.02' ixy='0' ixz='0' iyz='0'/></inertial>
    <collision><origin xyz='0 0 -0.5'/><geometry><sphere radius='0.05'/></geometry></collision>
  </link>
</robot>
"""


def robot_in(world, name="talos", **options):
    """Return a robot with dynamics in a world."""
    return nuno.SimulatedRobot(nuno.Humanoid(name), world, dynamics=True, **options)


def momentum(robot):
    """Linear and angular momentum (6,) about the centre of mass, by Pinocchio."""
    state, model = robot.state(), robot.actual.model
    data = model.createData()
    return np.array(pin.computeCentroidalMomentum(model, data, state.q, state.v)), np.array(data.com[0])


def test_a_robot_in_free_fall_falls_as_any_body():
    """Its centre of mass falls by g t and g t^2 / 2 while motors hold its joints, and no angular momentum comes."""
    world = nuno.World(device="cpu")
    robot = robot_in(world)
    robot.balance.is_on = False  # motors alone
    _, start = momentum(robot)
    world.run(0.3)
    moved, centre = momentum(robot)
    mass = robot.actual.mass
    np.testing.assert_allclose(moved[:3], (0.0, 0.0, -mass * G * 0.3), rtol=2e-3, atol=0.05)
    np.testing.assert_allclose(moved[3:], 0.0, atol=0.2)
    # half a substep of symplectic Euler
    np.testing.assert_allclose(centre - start, (0.0, 0.0, -0.5 * G * 0.3 * (0.3 + 1 / 600)), atol=1e-3)


def test_it_moves_as_pinocchio_says():
    """Afloat in no gravity, its motors swing arms and a leg: joints and base go as by Pinocchio's forward dynamics.

    Within 1 % of the way that the joints go, 0.5 s long; Pinocchio's articulated-body algorithm takes steps of 0.1 ms.
    """
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0), substeps=40)
    model = nuno.Humanoid("talos")
    links = model.enter(world, "joints")
    dynamics = LinkDynamics(links)
    dynamics.joint_friction = np.zeros(len(model.joint_names))
    dynamics.attach()
    start = model.angle_vector()
    wanted = start.copy()
    for name, way in (("arm_left_2_joint", 0.3), ("arm_right_4_joint", -0.4), ("leg_left_4_joint", 0.3)):
        wanted[model.joint_index(name)] += way
    inertia = np.array(pin.crba(model.model, model.model.createData(), model.configuration())).diagonal()[6:]
    stiffness, damping = 60.0 * inertia, 8.0 * inertia
    nothing = np.zeros(len(start))
    dynamics.efforts = np.full(len(start), 1e3)  # no limit is met
    dynamics.drive(wanted, nothing, stiffness, damping, nothing)
    inner = model.model.copy()
    inner.gravity.linear = np.zeros(3)
    data, q, v, dt = inner.createData(), model.configuration(), np.zeros(inner.nv), 1e-4
    for _ in range(30):
        world.step()
        for _ in range(round(1 / 60 / dt)):
            torque = np.zeros(inner.nv)
            torque[6:] = stiffness * (wanted - model.angles_of(q)) - (damping + dynamics.joint_damping) * v[6:]
            v = v + 1 / 60 / round(1 / 60 / dt) * pin.aba(inner, data, q, v, torque)
            q = pin.integrate(inner, q, 1 / 60 / round(1 / 60 / dt) * v)
    mine = dynamics.read()[0][0]
    np.testing.assert_allclose(model.angles_of(mine), model.angles_of(q), atol=0.01 * 0.4)
    np.testing.assert_allclose(mine[:7], q[:7], atol=2e-3)
    assert np.abs(model.angles_of(q) - start).max() > 0.3


def test_a_pendulum_swings_with_its_period(tmp_path):
    """A joint without torque: T = 2 pi sqrt(I / (m g l)) for small swings, within 0.5 %."""
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    world = nuno.World(device="cpu", substeps=40)
    model = nuno.Humanoid(path)
    model.angle_vector([0.1])
    links = model.enter(world, "joints")
    dynamics = LinkDynamics(links)
    dynamics.attach()
    nothing = np.zeros(1)
    dynamics.drive(nothing, nothing, nothing + 1e-9, nothing, nothing)
    period = 2 * np.pi * np.sqrt((0.02 + 2 * 0.5**2) / (2 * G * 0.5)) * (1 + 0.1**2 / 16)
    crossings, before = [], 0.1
    for _ in range(240):
        world.step()
        angle = float(dynamics.joints[0].position)
        if before * angle < 0:
            crossings.append(world.time - (1 / 60) * abs(angle) / (abs(angle) + abs(before)))
        before = angle
    assert np.mean(np.diff(crossings)) * 2 == pytest.approx(period, rel=5e-3)


def test_standing_bears_the_weight(standing):
    """At rest: it stands still, its joints' torques are those of inverse dynamics within 1 % of the largest."""
    world, robot = standing
    world.run(0.3)
    state = robot.state()
    assert state.fallen is None and state.over_torque == ()
    assert np.abs(state.v).max() < 2e-3
    told = robot.read()
    assert dict(told.contacts) == {"left_foot": True, "right_foot": True}
    assert robot.actual.support_polygon()[:, 0].min() < told.zero_moment_point[0] < 0.1
    # arms hang on nothing else: their torques are gravity's
    model = robot.actual.model
    gravity = pin.computeGeneralizedGravity(model, model.createData(), state.q)[6:]
    arms = [k for k, name in enumerate(robot.actual.joint_names) if name.startswith(("arm", "torso", "head"))]
    np.testing.assert_allclose(state.torques[arms], gravity[arms], atol=0.01 * np.abs(gravity[arms]).max())


def test_an_arm_goes_where_it_is_sent(standing):
    """Within 0.01 rad at the end of the motion and 0.002 rad 0.6 s later, while the robot stands."""
    world, robot = standing
    wanted = robot.angle_vector()
    k = robot.actual.joint_index("arm_left_4_joint")
    wanted[k] -= 0.6
    robot.angle_vector(wanted, 0.8)
    robot.wait_interpolation()
    arms = [n for n, name in enumerate(robot.actual.joint_names) if name.startswith("arm")]
    assert np.abs(robot.actual.angle_vector() - wanted)[arms].max() < 0.01
    world.run(0.6)
    assert np.abs(robot.actual.angle_vector() - wanted)[arms].max() < 0.002
    assert robot.state().fallen is None


def test_restored_it_goes_on_bit_for_bit(standing):
    """With an arm under way: the same bits again after ``restore``."""
    world, robot = standing
    wanted = robot.angle_vector()
    wanted[robot.actual.joint_index("arm_right_1_joint")] += 0.3
    robot.angle_vector(wanted, 0.5)
    world.run(0.1)
    saved = world.save()
    world.run(0.2)
    once = robot.state()
    world.restore(saved)
    world.run(0.2)
    again = robot.state()
    assert np.array_equal(once.q, again.q) and np.array_equal(once.v, again.v)


@pytest.mark.long
@pytest.mark.parametrize("push", [(0.0, 7.0, 0.0), pytest.param((7.0, 0.0, 0.0), marks=pytest.mark.long)])
def test_a_light_push_is_survived(standing, push):
    """7 N s on the base: its centre of mass goes as far as a critically damped mass, J / (m e rate), and back.

    Or less far, as trunk and posture are held besides: 0.7 to 1.1 of that. Ahead the zero moment point would have to
    leave nine tenths of the soles from 8 N s on; 10 N s sideways are 1.11.
    """
    world, robot = standing
    _, start = momentum(robot)
    world.push(robot.links.bodies[0], np.array(push) / 0.05, duration=0.05)
    far = 0.0
    for _ in range(90):
        world.step()
        far = max(far, float(np.linalg.norm((momentum(robot)[1] - start)[:2])))
    expected = np.linalg.norm(push) / (robot.actual.mass * np.e * Gains().centre_rate)
    assert 0.7 * expected < far < 1.1 * expected
    # soles have slid by that much
    assert np.linalg.norm((momentum(robot)[1] - start)[:2]) < 2.5e-3 and robot.state().fallen is None


@pytest.mark.long
def test_a_shove_throws_it_over_and_it_is_said(standing, caplog):
    """800 N for 0.2 s: it falls, says so once with reason and time, lies on the floor, and stands again when set up."""
    world, robot = standing
    world.push(robot.links.bodies[0], (800.0, 0.0, 0.0), duration=0.2)
    world.run(1.6)
    state = robot.state()
    assert state.fallen is not None and "at t = " in state.fallen
    assert sum("fell" in record.message for record in caplog.records) == 1
    assert 0.0 < state.q[2] < 0.5
    assert min(float(body.vertices[:, 2].min()) for body in robot.links.bodies) > -0.01
    robot.set_up((1.0, 0.0, 0.0))
    world.run(0.3)
    assert robot.state().fallen is None
    assert robot.state().q[0] == pytest.approx(1.0, abs=0.03) and robot.state().q[2] > 0.9


def test_detached_it_stands_still_and_walks_as_it_is_sent(standing):
    """Frozen in its posture at no cost; kinematic again, and dynamic again."""
    world, robot = standing
    robot.detach()
    before = robot.state().q.copy()
    assert not any(body.is_dynamic for body in robot.links.bodies)
    world.run(0.2)
    np.testing.assert_allclose(robot.state().q, before, atol=1e-6)  # joints beyond a limit come back to it
    wanted = robot.angle_vector()
    wanted[robot.actual.joint_index("head_1_joint")] -= 0.1
    robot.angle_vector(wanted, 0.3)
    robot.wait_interpolation()
    np.testing.assert_allclose(robot.actual.angle_vector(), wanted, atol=1e-9)
    robot.attach()
    world.run(0.2)
    assert robot.is_dynamic and robot.state().fallen is None


@pytest.mark.long
def test_a_hand_stops_at_a_table(standing):
    """A static box before the hand: the forearm presses on it instead of going through."""
    world, robot = standing
    hand = robot.links.bodies[robot.links.names.index("arm_right_7_link")]
    low = hand.vertices[:, 2].min()
    x, y = hand.vertices[:, :2].mean(axis=0)
    table = world.add(nuno.box((0.4, 0.3, 0.1), position=(float(x), float(y), float(low) - 0.08)))
    robot.angle_vector({"arm_right_4_joint": robot.angle_vector()[robot.actual.joint_index("arm_right_4_joint")] + 0.5},
                       1.0)  # fmt: skip
    world.run(1.6)
    top = float(table.vertices[:, 2].max())
    assert hand.vertices[:, 2].min() > top - 5e-3
    assert robot.state().fallen is None


def test_a_joint_that_is_torn_apart_is_told_once(tmp_path, caplog):
    """A finger bears 1e4 N across its slide; 1.1e4 N for a frame tear 0.05 kg off, which a warning tells by name."""
    robot = lifter_in(tmp_path, nuno.World(device="cpu"), dynamics=True)
    robot.sleep(0.05)
    finger = robot.links.bodies[robot.links.names.index("a")]
    robot.world.push(finger, (9e3, 0.0, 0.0), duration=1 / 60)
    robot.sleep(1 / 60)
    assert not caplog.records
    robot.world.push(finger, (1.1e4, 0.0, 0.0), duration=1 / 60)
    robot.sleep(3 / 60)
    (record,) = [own for own in caplog.records if "torn" in own.getMessage()]
    assert "'lifter/a'" in record.getMessage() and "set_up()" in record.getMessage()
    apart = float(record.args[4])
    # Euler's steps go further by one in the ten that a frame has; one more or less with the force is a fifth
    assert apart == pytest.approx(1.1 * 0.5 * (1e3 / 0.05) / 60**2, rel=0.2)
    robot.set_up()
    robot.sleep(3 / 60)
    assert len([own for own in caplog.records if "torn" in own.getMessage()]) == 1
    assert robot.balance.dynamics.gaps().max() < 1e-6  # [m], floats


@pytest.mark.parametrize("link", ["palm", "a"])
def test_a_link_that_was_detached_by_itself_is_named_with_its_cure(tmp_path, link):
    """Frames are refused, and both cures that the error names join the links anew: the joints bear them again."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=True)
    body = robot.links.bodies[robot.links.names.index(link)]
    for cure in (robot.set_up, lambda: (robot.detach(), robot.attach())):
        world.detach(body)
        with pytest.raises(BodyStateError, match=r"was released.*robot.set_up\(\)"):
            robot.sleep(1 / 60)
        cure()
        robot.sleep(2 / 60)
        assert body.is_dynamic and robot.balance.dynamics.gaps().max() < 1e-6  # [m], floats
    world.remove(body)
    with pytest.raises(BodyStateError, match=f"add 'lifter/{link}' to the world"):
        robot.sleep(1 / 60)
    world.add(body)
    robot.set_up()
    robot.sleep(2 / 60)
    assert robot.balance.dynamics.gaps().max() < 1e-6
    world.remove(body)
    robot.detach()
    assert not robot.is_dynamic
    robot.leave()
    assert not world.bodies and not world.drivers


def test_bad_calls_are_named():
    """Links of another kind, attached twice, detached twice."""
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    with pytest.raises(InvalidInputError, match="dynamics=True"):
        robot.attach()
    with pytest.raises(BodyStateError, match="has no dynamics"):
        robot.detach()
    with pytest.raises(InvalidInputError, match="one body for each joint"):
        LinkDynamics(robot.links)


@pytest.mark.long
def test_it_walks_on_true_feet(standing):
    """0.3 m ahead: it arrives within 2 cm, upright, both feet on the floor, no motor at its limit."""
    _, robot = standing
    start = robot.state().q[:2].copy()
    assert robot.go_pos(0.3, 0.0, 0.0)
    state = robot.state()
    assert state.q[0] - start[0] == pytest.approx(0.3, abs=0.02) and state.fallen is None
    assert all(robot.read().contacts.values())
