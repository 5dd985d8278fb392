"""scikit-robot's models, whose joints are in another order, and vectors that are in nobody's."""

import logging
import sys

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.simulated_robot import SimulatedRobot


@pytest.fixture
def robot(still_talos):
    """A Talos in a world of its own."""
    return SimulatedRobot(still_talos, nuno.World(device="cpu"))


@pytest.fixture(scope="module")
def other():
    """scikit-robot's model of Talos."""
    pytest.importorskip("skrobot")
    from skrobot.model import RobotModel

    made = RobotModel()
    made.load_urdf_file(str(nuno.Humanoid("talos").description.urdf), include_mimic_joints=True)
    return made


class Joint:
    """A joint as scikit-robot has them."""

    def __init__(self, name, angle):
        self.name, self.angle = name, angle

    def joint_angle(self, angle=None):
        """Set it where an angle is given."""
        self.angle = self.angle if angle is None else angle
        return self.angle


class Model:
    """A model whose joints are in the reverse order."""

    def __init__(self, robot):
        angles = robot.angle_vector()
        self.joint_list = [Joint(name, angle) for name, angle in zip(robot.robot.joint_names, angles, strict=True)][
            ::-1
        ]

    def angle_vector(self):
        """In the model's own order."""
        return np.array([own.joint_angle() for own in self.joint_list])


def test_a_model_is_taken_by_names(robot):
    """The arm that the other model moves is the arm that moves, and nothing else does."""
    model, before = Model(robot), robot.angle_vector()
    arm = robot.robot.joint_index("arm_left_4_joint")
    next(own for own in model.joint_list if own.name == "arm_left_4_joint").joint_angle(-0.9)
    sent = robot.angle_vector(model, 2.0)
    expected = before.copy()
    expected[arm] = -0.9
    np.testing.assert_array_equal(sent, expected)
    robot.wait_interpolation()
    np.testing.assert_allclose(robot.angle_vector(), expected, atol=1e-3)
    robot.angle_vector_sequence([model, {"arm_left_4_joint": -1.0}], 1.0)
    robot.wait_interpolation()
    robot.show_on(model)
    np.testing.assert_allclose(model.angle_vector(), robot.angle_vector()[::-1], atol=1e-12)


def test_another_order_is_refused(robot):
    """A vector in the other order would drive joints beyond their limits: it is refused by name, and nothing moves."""
    model, before = Model(robot), robot.angle_vector()
    with pytest.raises(InvalidInputError, match=r"another model's order.*scikit-robot model itself"):
        robot.angle_vector(model.angle_vector(), 2.0)
    assert not robot.is_interpolating()
    with pytest.raises(InvalidInputError, match=r"av has 31 angles, 'talos' has 32 joints: \w+"):
        robot.angle_vector(before[1:], 2.0)
    robot.sleep(0.1)
    np.testing.assert_array_equal(robot.angle_vector(), before)
    assert robot.angle_vector(before, 1.0) is not False  # what the encoders tell is always taken


def test_an_order_that_is_not_known_is_told_of_once(robot, monkeypatch, caplog):
    """Where scikit-robot is loaded a bare vector may be in its order: the log says which order is meant."""
    monkeypatch.setitem(sys.modules, "skrobot", object())
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            robot.angle_vector(robot.angle_vector(), 1.0)
    assert sum("in the order of joint_names" in record.message for record in caplog.records) == 1


def test_angles_from_names(robot):
    """Some angles by name, the others as they were last known."""
    found = robot.angle_vector_from_names({"head_1_joint": 0.1})
    expected = robot.angle_vector()
    expected[robot.robot.joint_index("head_1_joint")] = 0.1
    np.testing.assert_array_equal(found, expected)
    with pytest.raises(UnknownNameError):
        robot.angle_vector_from_names({"tail": 0.1})
    with pytest.raises(InvalidInputError, match="joint_list"):
        robot.show_on(robot)


def test_limb_controllers(robot):
    """Each limb's controller by its name; a limb that is not there is named."""
    assert robot.larm_controller["joint_names"] == list(robot.joints.controllers["larm_controller"].names)
    for name in ("rarm", "lhand", "rhand", "head", "torso", "lleg", "rleg"):
        assert getattr(robot, f"{name}_controller")["controller_type"] == f"{name}_controller"
    with pytest.raises(UnknownNameError):
        robot.fullbody_controller  # noqa: B018


def test_cancelling_one_controller(robot):
    """Only the arm that was named stops."""
    robot.angle_vector({"arm_left_4_joint": -1.2, "arm_right_4_joint": -1.2}, 4.0)
    robot.sleep(0.5)
    robot.cancel_angle_vector("larm_controller")
    robot.sleep(0.1)
    assert not robot.is_interpolating("larm_controller")
    assert robot.is_interpolating("rarm_controller")
    with pytest.raises(UnknownNameError):
        robot.cancel_angle_vector("tail_controller")


def test_moving_in_two_calls(robot):
    """move_to_send sets off, move_to_wait is there; a trajectory of the base is the straight way."""
    assert not robot.move_to_wait()
    way = robot.move_trajectory(0.2, 0.0, 0.1, 2.0)
    np.testing.assert_allclose(way.positions[1] - way.positions[0], (0.2, 0.0, 0.1), atol=1e-6)
    assert robot.move_to_send(nuno.Coordinates((0.15, 0.0, 0.0)))
    assert robot.move_to_wait()
    assert robot.footprint().position[0] == pytest.approx(0.15, abs=5e-3)
    goal = robot.move_trajectory(0.05, 0.0, 0.0, 1.0, send_action=True)
    robot.wait_until(lambda: goal.is_done)
    assert goal.succeeded
    with pytest.raises(InvalidInputError, match="start_time"):
        robot.move_trajectory(0.1, 0.0, 0.0, start_time=robot.now() + 5.0)


def test_with_scikit_robot_itself(robot, other):
    """Its own model of Talos has the same joints in another order, and is taken by names in both directions."""
    robot.show_on(other)
    assert [own.name for own in other.joint_list] != list(robot.robot.joint_names)
    other.arm_left_4_joint.joint_angle(-0.9)
    sent = robot.angle_vector(other, 2.0)
    assert sent[robot.robot.joint_index("arm_left_4_joint")] == pytest.approx(-0.9)
    before = robot.potentio_vector()
    robot.wait_interpolation()
    np.testing.assert_allclose(robot.angle_vector(), before, atol=1e-3)
