"""Servo commands: the torque law, against closed forms."""

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.robot_state import RobotState
from nuno.robot.servo import Servo, ServoCommand
from nuno.robot.simulated_robot import SimulatedRobot

WRIST = "arm_left_7_joint"
ELBOW = "arm_left_4_joint"


def at_rest(robot):
    """Return the robot's state at rest where it is."""
    nothing = np.zeros(robot.model.nv)
    return RobotState(0.0, robot.configuration(), nothing, nothing)


def held(robot):
    """Return angles, velocities and accelerations of joints that stay."""
    angles = robot.angle_vector()
    return angles, np.zeros_like(angles), np.zeros_like(angles)


def follow(robot, command, seconds, steps, gravity=(0.0, 0.0, 0.0)):
    """Return angles (steps, m) and velocities (steps, m) of the joints of a command, from rest."""
    servo, state = Servo(robot, command, gravity), at_rest(robot)
    angles, speeds = [], []
    for _ in range(steps):
        q, v, _ = servo.step(state, held(robot), None, seconds / steps)
        others = robot.angle_vector()
        others[servo.rows] = q
        velocity = np.zeros(robot.model.nv)
        velocity[6 + servo.rows] = v
        state = RobotState(0.0, robot.configuration_of(others, state.q[:7]), velocity, np.zeros(robot.model.nv))
        angles.append(q)
        speeds.append(v)
    return np.array(angles), np.array(speeds)


@pytest.mark.parametrize("damping", [0.1, 0.7])
def test_one_joint_is_a_damped_oscillator(talos, damping):
    """Without gravity: x = e^(-d w t) (cos(w' t) + d / sqrt(1 - d^2) sin(w' t)), w^2 = kp / I, d = kd / (2 I w)."""
    k = talos.joint_index(ELBOW)
    inertia = pin.crba(talos.model, talos.model.createData(), talos.configuration())[6 + k, 6 + k]
    w, start = 8.0, talos.angle_vector()[k]
    command = ServoCommand((ELBOW,), start + 0.1, kp=inertia * w**2, kd=2.0 * damping * w * inertia)
    angles, _ = follow(talos, command, 1.0, 60)
    t = np.arange(1, 61) / 60.0
    fast = w * np.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * w * t)
    expected = 0.1 - 0.1 * decay * (np.cos(fast * t) + damping * w / fast * np.sin(fast * t))
    # implicit Euler at 1 ms damps by w dt / 2 = 0.4 % of critical more, over 8 rad: 0.1 * 8 * 0.004 = 3 mm rad
    np.testing.assert_allclose(angles[:, 0] - start, expected, atol=3e-3)


def test_feedforward_holds_against_gravity(talos):
    """The torque of inverse dynamics and no gains: the arm stays where it is."""
    names = tuple(f"arm_left_{k}_joint" for k in range(1, 8))
    rows = [talos.joint_index(name) for name in names]
    still = at_rest(talos)
    torque = pin.rnea(talos.model, talos.model.createData(), still.q, still.v, still.a)[6:][rows]
    command = ServoCommand(names, talos.angle_vector()[rows], tau=torque)
    angles, speeds = follow(talos, command, 0.2, 12, (0.0, 0.0, -9.81))
    np.testing.assert_allclose(angles - talos.angle_vector()[rows], 0.0, atol=1e-9)  # an equilibrium: rounding only
    np.testing.assert_allclose(speeds, 0.0, atol=1e-9)


def test_an_arm_that_is_let_go_keeps_its_energy(talos):
    """No torques at all: what it loses in height it gains in speed."""
    names = tuple(f"arm_left_{k}_joint" for k in range(1, 5))
    rows = np.array([talos.joint_index(name) for name in names])
    model, data = talos.model, talos.model.createData()
    angles, speeds = follow(talos, ServoCommand(names, 0.0), 0.1, 10, (0.0, 0.0, -9.81))
    talos_angles = talos.angle_vector()
    before = pin.computePotentialEnergy(model, data, talos.configuration())
    talos_angles[rows] = angles[-1]
    q = talos.configuration_of(talos_angles, talos.configuration()[:7])
    v = np.zeros(model.nv)
    v[6 + rows] = speeds[-1]
    gained = pin.computeKineticEnergy(model, data, q, v)
    lost = before - pin.computePotentialEnergy(model, data, q)
    assert lost > 0.1  # [J] else the test says nothing
    assert gained == pytest.approx(lost, rel=0.03)  # Euler's first order: dt / t = 1 %, times up to 2


def test_torques_are_clipped(talos):
    """A huge gain accelerates a joint no faster than its effort limit does."""
    k = talos.joint_index(WRIST)
    inertia = pin.crba(talos.model, talos.model.createData(), talos.configuration())[6 + k, 6 + k]
    start = talos.angle_vector()[k]
    _, speeds = follow(talos, ServoCommand((WRIST,), start + 0.3, kp=1e6), 0.002, 2)
    assert speeds[0, 0] == pytest.approx(talos.effort_limits[k] / inertia * 0.001, rel=1e-6)


def test_any_gains_are_stable(talos):
    """Gains that would be unstable by an explicit rule bring the joint to where it is wanted."""
    k = talos.joint_index(WRIST)
    start = talos.angle_vector()[k]
    angles, _ = follow(talos, ServoCommand((WRIST,), start + 0.01, kp=1e5, kd=1e4), 1.0, 60)
    assert angles[-1, 0] == pytest.approx(start + 0.01, abs=1e-5)  # e^(-kp t / kd) = e^-10 of 0.01 rad


def test_joints_stop_at_their_limits(talos):
    """A torque beyond any other does not take a joint further."""
    k = talos.joint_index(ELBOW)
    lower = talos.joint_limits[0][k]
    angles, speeds = follow(talos, ServoCommand((ELBOW,), 0.0, tau=-40.0), 2.0, 60)
    assert angles[-1, 0] == lower and speeds[-1, 0] == 0.0


@pytest.mark.parametrize(
    "given",
    [
        {"names": ()},
        {"names": (ELBOW, ELBOW)},
        {"q": np.nan},
        {"q": [0.0, 0.0]},
        {"kp": -1.0},
        {"kd": -1.0},
        {"tau": np.inf},
    ],
)
def test_bad_commands_are_refused(given):
    """By name, before anything changes."""
    with pytest.raises(InvalidInputError):
        ServoCommand(**({"names": (ELBOW,), "q": 0.0} | given))


def test_the_simulated_robot_under_a_servo_command(still_talos):
    """It goes where the command wants it; its controller takes no goals meanwhile, and holds after that."""
    world = nuno.World(device="cpu")
    robot = SimulatedRobot(still_talos, world)
    with pytest.raises(UnknownNameError, match="tail"):
        robot.servo(ServoCommand(("tail",), 0.0))
    names = tuple(f"arm_left_{k}_joint" for k in range(1, 8))
    rows = [robot.robot.joint_index(name) for name in names]
    start = robot.angle_vector()
    wanted = start[rows]
    wanted[3] -= 0.2
    robot.servo(ServoCommand(names, wanted, kp=2000.0, kd=100.0))
    robot.angle_vector({"head_1_joint": 0.2}, 0.5, "head_controller")
    robot.angle_vector({ELBOW: 0.0}, 0.5, "larm_controller")
    assert not robot.is_interpolating("larm_controller")
    robot.sleep(1.0)
    angles = robot.angle_vector()
    torque = robot.torque_vector()[rows]
    # what the law asks for where it came to rest is what gravity needs
    np.testing.assert_allclose(torque, 2000.0 * (wanted - angles[rows]), atol=0.05)  # [N m] of up to 5
    assert np.abs(torque).max() > 1.0
    assert angles[robot.robot.joint_index("head_1_joint")] == pytest.approx(0.2, abs=1.01e-3)
    robot.servo(None)
    held_at = robot.angle_vector()
    robot.sleep(0.3)
    np.testing.assert_array_equal(robot.angle_vector(), held_at)
