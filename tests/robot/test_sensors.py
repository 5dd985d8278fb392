"""Sensors: what they tell of a motion that is known in closed form, and what rate, delay, noise and bias do to it."""

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.robot_state import RobotState
from nuno.robot.sensor_model import Channel, SensorModel
from nuno.robot.sensors import Sensors

G = 9.81


def moved(robot, time=0.0, v=None, a=None):
    """A state of a robot where it is, with velocities and accelerations by index."""
    nv = robot.model.nv
    speeds = np.zeros(nv), np.zeros(nv)
    for array, given in zip(speeds, (v, a), strict=True):
        for k, value in (given or {}).items():
            array[k] = value
    return RobotState(time, robot.configuration(), *speeds)


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_a_robot_that_stands_is_in_balance(name, request):
    """Statics: the feet bear the weight at the centre of mass; the joints' torques are gravity's less the feet's."""
    robot = request.getfixturevalue(name)
    read = Sensors(robot).read()
    np.testing.assert_array_equal(read.positions, robot.angle_vector())
    # what the ankles bear is the weight above them: all but the feet beyond the sensors
    model = robot.model
    total = 0.0
    for side in ("left", "right"):
        joint = model.frames[robot.frame_index(f"{side}_ankle")].parentJoint
        force = robot.frame_pose(f"{side}_ankle").rotation @ read.wrenches[f"{side}_ankle"][:3]
        np.testing.assert_allclose(force[:2], 0.0, atol=1e-9 * robot.mass * G)
        total += force[2] + model.inertias[joint].mass * G
    assert total == pytest.approx(robot.mass * G, rel=1e-9)
    np.testing.assert_allclose(read.zero_moment_point, robot.centre_of_mass[:2], atol=1e-9)
    assert read.contacts == {"left_foot": True, "right_foot": True}
    # virtual work: torques do as much as the weight and the feet's forces do, for any motion with the feet in place
    J = np.vstack([pin.computeFrameJacobian(model, robot.scratch, robot.configuration(),
                                            robot.frame_index(foot), pin.LOCAL) for foot in robot.feet])  # fmt: skip
    free = np.linalg.svd(J)[2][J.shape[0] :]  # velocities that leave the feet where they are
    gravity = pin.computeGeneralizedGravity(model, robot.scratch, robot.configuration())
    torques = np.concatenate([np.zeros(6), read.torques])
    np.testing.assert_allclose(free @ (torques - gravity), 0.0, atol=1e-8 * robot.mass * G)


def test_the_imu_at_rest_and_in_known_motion(talos):
    """Talos' unit looks down: gravity's reaction is -z. Falling it feels nothing; spinning, w x (w x r) at its arm."""
    sensors = Sensors(talos)
    rest = sensors.read()
    turn = talos.frame_pose("imu").rotation
    np.testing.assert_allclose(turn @ rest.specific_force, (0, 0, G), atol=1e-9)
    np.testing.assert_allclose(nuno.Coordinates(quaternion=rest.orientation).rotation, turn, atol=1e-12)
    base = talos.rotation
    falling = moved(talos)
    falling.a[:3] = base.T @ (0.0, 0.0, -G)
    np.testing.assert_allclose(sensors.read(falling, stance=()).specific_force, 0.0, atol=1e-9)
    spinning = moved(talos, v={5: 2.0})  # about the base's z
    read = sensors.read(spinning, stance=())
    np.testing.assert_allclose(read.angular_velocity, turn.T @ base @ (0, 0, 2.0), atol=1e-9)
    arm = base.T @ (talos.frame_pose("imu").position - talos.position)
    inwards = np.cross((0, 0, 2.0), np.cross((0, 0, 2.0), arm))
    np.testing.assert_allclose(turn @ read.specific_force, base @ inwards + (0, 0, G), atol=1e-9)


def test_a_joint_that_accelerates_needs_its_inertia_in_torque(talos):
    """The change of torque is the joint's entry of the mass matrix (times the acceleration), the base being held."""
    sensors = Sensors(talos)
    k = 6 + talos.joint_index("arm_left_4_joint")
    rest = sensors.read(moved(talos), stance=())
    read = sensors.read(moved(talos, a={k: 3.0}), stance=())
    mass = pin.crba(talos.model, talos.scratch, talos.configuration())
    mass = np.triu(mass) + np.triu(mass, 1).T
    np.testing.assert_allclose(read.torques - rest.torques, 3.0 * mass[6:, k], atol=1e-9)


def test_a_robot_that_leans_accelerates_its_zero_moment_point_backwards(talos):
    """Cart and table (Kajita 2003): p = c - (height) a / g for a body that is translated as a whole."""
    sensors = Sensors(talos)
    state = moved(talos)
    state.a[:3] = talos.rotation.T @ (0.4, 0.0, 0.0)
    read = sensors.read(state)
    centre = talos.centre_of_mass
    assert read.zero_moment_point[0] == pytest.approx(centre[0] - centre[2] * 0.4 / G, abs=1e-9)
    assert read.zero_moment_point[1] == pytest.approx(centre[1], abs=1e-9)


def test_one_foot_bears_all_and_none_in_the_air(talos):
    """By the stance that is given, or by the height of the soles."""
    sensors = Sensors(talos)
    read = sensors.read(stance=("left_foot",))
    assert read.contacts == {"left_foot": True, "right_foot": False}
    talos.translate((0, 0, 0.1))
    read = sensors.read()
    assert read.contacts == {"left_foot": False, "right_foot": False}
    assert np.isnan(read.zero_moment_point).all()
    foot = talos.model.inertias[talos.model.frames[talos.frame_index("left_ankle")].parentJoint].mass
    pull = talos.frame_pose("left_ankle").rotation @ read.wrenches["left_ankle"][:3]
    np.testing.assert_allclose(pull, (0, 0, -foot * G), atol=1e-9)  # it hangs


def test_models_sample_delay_disturb_and_repeat(talos):
    """A joint that turns at 1 rad/s, told 10 ms late at 50 Hz while read at 1 kHz; the seed decides the noise."""
    models = {
        "positions": SensorModel(rate=50.0, latency=0.01),
        "torques": SensorModel(noise=0.5, bias=2.0),
        "angular_velocity": SensorModel(bias=(0.0, 0.0, 0.1)),
        "orientation": SensorModel(bias=(0.0, 0.02, 0.0)),
    }
    runs = [Sensors(talos, models=models, seed=seed) for seed in (1, 1, 2)]
    exact = Sensors(talos)
    q, told = talos.configuration(), []
    head = talos.joint_index("head_1_joint")
    noise = []
    for k in range(200):
        q[7 + head] = 0.001 * k
        state = RobotState(0.001 * k, q.copy(), np.zeros(talos.model.nv), np.zeros(talos.model.nv))
        reads = [sensors.read(state) for sensors in runs]
        told.append(reads[0].positions[head])
        np.testing.assert_array_equal(reads[0].torques, reads[1].torques)
        assert (reads[0].torques != reads[2].torques).all()
        noise.append(reads[0].torques - exact.read(state).torques)
    # taken every 20 ms, told 10 ms later; the first one at once
    expected = [0.02 * max(0, (k - 10) // 20) for k in range(200)]
    np.testing.assert_allclose(told, expected, atol=1e-12)
    assert reads[0].sampled["positions"] == pytest.approx(0.18)
    # 6,400 draws: the mean is known to 0.5 / 80, the deviation to 0.5 / 113; four of each
    assert np.mean(noise) == pytest.approx(2.0, abs=4 * 0.5 / 80)
    assert np.std(noise) == pytest.approx(0.5, abs=4 * 0.5 / 113)
    np.testing.assert_allclose(reads[0].angular_velocity, (0, 0, 0.1), atol=1e-9)
    true = exact.read(state).orientation
    between = nuno.Coordinates(quaternion=true).rotation.T @ nuno.Coordinates(quaternion=reads[0].orientation).rotation
    np.testing.assert_allclose(pin.log3(between), (0, 0.02, 0), atol=1e-9)


def test_a_channel_begins_anew_when_time_goes_back():
    """As in a world that was restored: the same readings again, to the bit."""
    channel = Channel("torques", SensorModel(noise=1.0, rate=10.0, latency=0.05), 3, 0)
    times = np.arange(50) / 100.0
    first = [channel.read(t, np.zeros(3))[1] for t in times]
    again = [channel.read(t, np.zeros(3))[1] for t in times]
    np.testing.assert_array_equal(first, again)
    assert len(np.unique(first, axis=0)) == 5  # samples in half a second at 10 Hz, and the last one has come


def test_bad_input(talos, g1):
    """Named errors that say what is valid."""
    with pytest.raises(UnknownNameError, match="positions"):
        Sensors(talos, models={"smell": SensorModel()})
    with pytest.raises(InvalidInputError, match=r"noise of 'left_wrist' must be a number or \(6,\), got shape \(3,\)"):
        Sensors(talos, models={"left_wrist": SensorModel(noise=(1.0, 1.0, 1.0))})
    with pytest.raises(InvalidInputError, match="noise must be"):
        SensorModel(noise=-1.0)
    with pytest.raises(InvalidInputError, match="rate"):
        SensorModel(rate=0.0)
    with pytest.raises(InvalidInputError, match=r"a state of 'talos' has q \(39,\)"):
        Sensors(talos).read(moved(g1))
    with pytest.raises(UnknownNameError, match="left_foot"):
        Sensors(talos).read(stance=("tail",))
    with pytest.raises(InvalidInputError, match="links are those of another robot"):
        Sensors(talos, g1.enter(nuno.World(device="cpu")))


@pytest.mark.parametrize(
    "wrong", [{"latency": -0.1}, {"latency": float("nan")}, {"rate": 0.0}, {"noise": -1.0}, {"bias": [[1.0]]}]
)
def test_no_sensor_is_so(wrong):
    """Samples from the future, no samples, noise below none."""
    with pytest.raises(InvalidInputError, match=next(iter(wrong))):
        SensorModel(**wrong)
