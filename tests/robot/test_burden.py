"""Robots without dynamics: torques beyond limits and lost balance are told."""

import logging

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.robot.burden import StrainSensors
from nuno.robot.support import distance_inside

LOOK = 1.1  # [s] two looks


def make(**options):
    """Talos on a floor."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    return nuno.SimulatedRobot(nuno.Humanoid(), world, **options)


def in_the_hand(robot, mass):
    """A ball of a mass [kg] that the left hand holds."""
    hand = robot.hands["left_hand"]
    low, high = hand.volume()
    place = robot.actual.frame_pose("left_hand").to_world((0.5 * (low + high))[None])[0]
    ball = robot.world.add(nuno.sphere(0.02, name="ball", position=place))
    robot.world.attach(ball, nuno.Rigid(mass=mass))
    assert hand.close([ball]) == (ball,)
    return ball


def with_a_mass(robot, mass, place):
    """Torques (n,) [N m] at rest and the centre of mass (2,) of the model with a mass at a place (3,), feet apart.

    Legs are left out: what each foot bears is another question.
    """
    model = robot.actual.model.copy()
    joint = model.frames[robot.actual.frame_index("left_hand")].parentJoint
    placement = robot.actual.update().oMi[joint].actInv(np.asarray(place))
    model.appendBodyToJoint(joint, pin.Inertia(mass, placement, np.zeros((3, 3))), pin.SE3.Identity())
    data, q = model.createData(), robot.actual.configuration()
    torques = pin.rnea(model, data, q, np.zeros(model.nv), np.zeros(model.nv))[6:]
    return torques, pin.centerOfMass(model, data, q)[:2]


def test_sixty_kilograms_in_the_hand_are_told(caplog):
    """The joints whose torque is beyond the limit, by the inverse dynamics of a model that has the mass."""
    robot = make()
    ball = in_the_hand(robot, 60.0)
    with caplog.at_level(logging.WARNING):
        robot.sleep(2.0)
    torques, centre = with_a_mass(robot, 60.0, ball.position)
    names, limits = robot.actual.joint_names, robot.actual.effort_limits
    wanted = {name for name, own, most in zip(names, np.abs(torques), limits, strict=True)
              if own > most and not name.startswith("leg")}  # fmt: skip
    assert wanted
    state = robot.state()
    assert {name for name in state.over_torque if not name.startswith("leg")} == wanted
    outside = -distance_inside(robot.actual.support_polygon(), centre)
    assert outside > 0.01
    assert state.unbalanced.distance == pytest.approx(outside, abs=2e-3)
    assert state.unbalanced.time <= LOOK
    messages = [record.message for record in caplog.records]
    assert sum("would need more than the limit" in message for message in messages) == 1
    assert sum("would tip over" in message for message in messages) == 1


@pytest.mark.long
def test_a_kilogram_is_nothing():
    """Nor is a robot that stands, walks and moves its arms."""
    robot = make()
    in_the_hand(robot, 1.0)
    robot.go_pos(0.1, wait=False)
    robot.angle_vector({"arm_left_4_joint": -1.0}, 1.0)
    seen = set()
    for _ in range(25):
        robot.sleep(0.1)
        state = robot.state()
        seen |= {state.over_torque, state.unbalanced}
    assert seen == {(), None}


def test_a_lean_is_told_with_its_distance():
    """The centre of mass outside the soles, by how much; back over them it is no longer so."""
    robot = make()
    start = robot.angle_vector()
    ankles = {name: start[robot.actual.joint_index(name)] + 0.3 for name in ("leg_left_5_joint", "leg_right_5_joint")}
    robot.angle_vector(ankles, 1.0)
    robot.wait_interpolation()
    robot.sleep(LOOK)
    outside = -distance_inside(robot.actual.support_polygon(), robot.actual.centre_of_mass[:2])
    assert outside > 0.05
    found = robot.state().unbalanced
    assert found.distance == pytest.approx(outside, abs=2e-3) or found.distance > outside  # the most on the way
    assert found.time < 2.2
    robot.angle_vector(start, 1.0)
    robot.wait_interpolation()
    robot.sleep(LOOK)
    assert robot.state().unbalanced is None


def test_flags_are_restored():
    """With the state that they are part of."""
    robot = make()
    in_the_hand(robot, 60.0)
    robot.sleep(1.2)
    saved, over = robot.world.save(), robot.state().over_torque
    assert over
    robot.hands["left_hand"].open()
    robot.sleep(1.2)
    assert not robot.state().over_torque and robot.state().unbalanced is None
    robot.world.restore(saved)
    assert robot.state().over_torque == over


def test_a_robot_at_rest_is_looked_at_no_more(monkeypatch):
    """Without anything dynamic in its world."""
    counts = [0]
    own = StrainSensors.strain

    def counted(*arguments):
        counts[0] += 1
        return own(*arguments)

    monkeypatch.setattr(StrainSensors, "strain", counted)
    robot = make()
    robot.sleep(5.0)
    before = counts[0]
    robot.sleep(2.0)
    assert 0 < before == counts[0]


def test_a_look_finds_what_the_sensors_tell():
    """Torques and the zero moment point, of which a look needs no more, have the sensors' bits, a towel in the hand."""
    robot = make()
    place = robot.actual.frame_pose("left_hand").to_world([(0.0, 0.0, 0.03)])[0]
    towel = robot.world.add(nuno.sheet((0.1, 0.1), cells=(3, 3), position=place + np.array([0.05, 0.05, 0.0])))
    robot.world.attach(towel, nuno.Cloth.preset("towel"))
    assert robot.hands["left_hand"].close()
    robot.angle_vector({"arm_left_4_joint": -1.0}, 1.0)
    looks, reads = (StrainSensors(robot.actual, robot.links) for _ in range(2))
    for frames in (1, 1, 5, 1):  # what was noted in the frame before, and too long ago
        robot.sleep(frames / 60.0)
        told = reads.read(robot.state())
        torques, point = looks.strain(robot.state())
        assert torques.tobytes() == told.torques.tobytes() and point.tobytes() == told.zero_moment_point.tobytes()
    noting, reading = (StrainSensors(robot.actual, robot.links) for _ in range(2))
    noting.note_loads()  # in place of a whole reading, which the sensors that read have
    reading.read(robot.state())
    robot.sleep(1.0 / 60.0)
    told = reading.read(robot.state())
    torques, point = noting.strain(robot.state())
    assert torques.tobytes() == told.torques.tobytes() and point.tobytes() == told.zero_moment_point.tobytes()


def test_a_robot_at_rest_on_which_nothing_bears_is_worked_out_once(monkeypatch):
    """However often it is looked at, beside a towel that falls; anew when it moves, and when it is touched."""
    worked_out, own = [], StrainSensors._balance
    monkeypatch.setattr(StrainSensors, "_balance", lambda *given: worked_out.append(1) or own(*given))
    robot = make()
    towel = robot.world.add(nuno.sheet((0.1, 0.1), cells=(3, 3), position=(2.0, 0.0, 1.0)))
    robot.world.attach(towel, nuno.Cloth.preset("towel"))
    robot.sleep(3.0)
    assert len(worked_out) == 1
    robot.angle_vector({"arm_left_4_joint": -1.0}, 1.0)
    robot.sleep(1.0)
    assert len(worked_out) > 1
    robot.sleep(1.0)
    before = len(worked_out)
    in_the_hand(robot, 1.0)
    robot.sleep(LOOK)
    assert len(worked_out) >= before + 2
