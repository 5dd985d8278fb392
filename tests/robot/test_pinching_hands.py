"""A hand that closes from less than wide open takes less: only what is between its fingers then."""

import numpy as np
import pytest

import nuno
from nuno.robot.hands import FINGERS

OPEN = 0.092  # [m] how far apart Talos' fingers are


@pytest.fixture
def scene():
    """Talos with a flat towel between the fingers of its left hand, across them."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    driver = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    place = driver.actual.frame_pose("left_hand")
    towel = nuno.sheet((0.2, 0.2), (40, 40), name="towel", position=place.position, quaternion=place.quaternion)
    world.attach(world.add(towel))
    for body in driver.links.bodies:
        world.ignore_contact(towel, body)
    return driver, towel, place


def held_width(driver, towel, place):
    """How wide [m] what the hand holds is along the axis on which its fingers close."""
    grips = driver.hands["left_hand"].grips
    assert [grip.body for grip in grips] == [towel]
    local = place.to_local(towel.vertices[grips[0].spec.vertices[0]])
    return np.ptp(local[:, FINGERS])


def test_open_hand_takes_all_between(scene):
    """From wide open: a strip as wide as the fingers are apart, to a cell of 5 mm on either side."""
    driver, towel, place = scene
    driver.start_grasp("larm")
    assert held_width(driver, towel, place) == pytest.approx(OPEN, abs=0.01)


def test_hand_that_is_nearly_closed_pinches(scene):
    """From a quarter open, which it came to before the towel was between the fingers: a quarter of that."""
    driver, towel, place = scene
    towel.translate((0.0, 0.0, 0.5), wrt="world")
    driver.world.detach(towel)
    driver.move_gripper("larm", 0.25)
    assert not driver.hands["left_hand"].grips
    towel.locate(place.position)
    driver.world.attach(towel)
    driver.start_grasp("larm")
    assert held_width(driver, towel, place) == pytest.approx(0.25 * OPEN, abs=0.01)


def test_closing_again_keeps_hold(scene):
    """A hand that is told to close while it holds goes on holding the same vertices (a float tells 7e-9 m)."""
    driver, towel, place = scene
    driver.start_grasp("larm")
    before, held = held_width(driver, towel, place), driver.hands["left_hand"].grips[0].spec.vertices
    driver.start_grasp("larm")
    np.testing.assert_array_equal(driver.hands["left_hand"].grips[0].spec.vertices, held)
    assert held_width(driver, towel, place) == pytest.approx(before, abs=2e-8)
