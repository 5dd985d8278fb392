"""What a robot carries, from the forces on its joints."""

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.robot.carried import carried_by, smoothed

G = 9.81


@pytest.fixture(scope="module")
def talos():
    """A standing Talos."""
    return nuno.Humanoid("talos")


def hung(robot, masses):
    """Forces of masses [kg] that hang from frames."""
    found = np.zeros((robot.model.njoints, 6))
    data = robot.update()
    for frame, mass in masses.items():
        index = robot.frame_index(frame)
        joint = robot.model.frames[index].parentJoint
        point = robot.frame_pose(frame).position
        force = np.array([0.0, 0.0, -mass * G])
        found[joint] += data.oMi[joint].actInv(pin.Force(force, np.cross(point, force))).vector
    return found


def test_two_masses_in_the_hands(talos):
    """3 kg and 2 kg: their sum, in their centre of mass along the ground."""
    forces = hung(talos, {"left_hand": 3.0, "right_hand": 2.0})
    load = carried_by(talos, talos.model.createData(), talos.configuration(), forces, G)
    hands = [np.array(talos.frame_pose(hand).position) for hand in ("left_hand", "right_hand")]
    assert load.mass == pytest.approx(5.0)
    np.testing.assert_allclose(load.place[:2], (0.6 * hands[0] + 0.4 * hands[1])[:2], atol=1e-9)
    mass, place = load.seen_from(talos)
    base = pin.XYZQUATToSE3(talos.configuration()[:7])
    assert mass == load.mass
    np.testing.assert_allclose(base.act(place), load.place, atol=1e-12)


def test_nothing_is_no_load(talos):
    """No forces, and a force that lifts."""
    data, q = talos.model.createData(), talos.configuration()
    assert carried_by(talos, data, q, None, G) is None
    assert carried_by(talos, data, q, hung(talos, {"left_hand": -3.0}), G) is None


def test_a_force_becomes_a_load_in_a_tenth_of_a_second():
    """1 - 1/e of it after that; forgotten likewise."""
    force, now = np.zeros((3, 6)), None
    force[1, 2] = -20.0
    for _ in range(10):
        now = smoothed(now, force, 0.01)
    np.testing.assert_allclose(now, (1 - np.exp(-1.0)) * force)
    for _ in range(200):
        now = smoothed(now, None, 0.01)
    assert now is None
