"""Boxes of static bodies: which points are near to them, wherever the bodies are and however they are turned."""

import numpy as np
import pytest

import nuno
from nuno.robot.static_boxes import StaticBoxes

SPAN = 1.0
"""[s] That the path takes."""


@pytest.fixture
def room():
    """Return a world with a box that moves and turns, and one far away."""
    world = nuno.World(device="cpu")
    led = world.add(nuno.box((0.4, 0.2, 0.1), name="led", position=(1.0, 0.0, 0.5)))
    world.add(nuno.box((0.1, 0.1, 0.1), name="far", position=(9.0, 0.0, 0.0)))
    turn = np.array([0.5, 0.5, -0.1, 0.7]) / np.linalg.norm([0.5, 0.5, -0.1, 0.7])
    world.move(led, nuno.Path([0.0, SPAN], [(1.0, 0.0, 0.5), (5.0, 1.0, 0.0)], [(1.0, 0.0, 0.0, 0.0), turn]))
    return world, led


def holds(boxes, k, points, margin):
    """Return whether a box holds any of points (n, 3)."""
    return boxes.hold_any(k, points.T, points.min(axis=0), points.max(axis=0), margin)


def test_a_box_holds_its_own_points_and_no_others(room):
    """Single points inside and outside, told by coordinates in the body's own frame; also after it has moved."""
    world, led = room
    boxes = StaticBoxes(world)
    random = np.random.default_rng(5)
    for k in range(3):
        assert boxes.follow() == (k == 0)  # others only the first time
        own = random.uniform(-0.3, 0.3, (200, 3))
        inside = (np.abs(own) <= np.array([0.2, 0.1, 0.05]) + 0.01).all(axis=1)
        found = [holds(boxes, 0, point[None], 0.01) for point in led.to_world(own)]
        assert found == inside.tolist() and 0 < sum(found) < 200
        assert holds(boxes, 0, led.to_world(own), 0.01)
        world.run(0.4 * SPAN)


def test_close_bodies_are_found_where_they_are_now(room):
    """By the distance of the origin; what has left is no longer close, and a third body is told of."""
    world, _ = room
    boxes = StaticBoxes(world)
    boxes.follow()
    near = np.array([1.2, 0.0, 0.5])
    assert boxes.close_to(near - 0.1, near + 0.1, 0.0) == [0]
    world.run(SPAN)
    assert not boxes.follow()
    assert boxes.close_to(near - 0.1, near + 0.1, 0.0) == []
    world.add(nuno.sphere(0.1, position=near))
    assert boxes.follow()
    assert boxes.close_to(near - 0.1, near + 0.1, 0.0) == [2]


def test_an_empty_world_has_none():
    """No bodies, no boxes, and nothing close."""
    boxes = StaticBoxes(nuno.World(device="cpu"))
    boxes.follow()
    assert boxes.close_to(np.zeros(3), np.ones(3), 1.0) == []
