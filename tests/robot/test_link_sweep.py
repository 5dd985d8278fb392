"""Sweeps of links: when the first goes too deep into something, against closed forms."""

import numpy as np
import pytest

import nuno
from nuno.robot.coal_shapes import LinkHulls
from nuno.robot.link_sweep import DEEP, MIN_ADVANCE, Sweep, first_entry, spare_way
from nuno.robot.static_shapes import StaticShapes


@pytest.fixture(scope="module")
def hulls(still_talos):
    """Talos' links as coal has them."""
    return LinkHulls(still_talos)


@pytest.fixture
def world(still_talos):
    """A world, and bodies that stand for the links in its rules."""
    made = nuno.World(device="cpu")
    return made


def shapes_of(world, hulls, **rules):
    """The static shapes of a world, all of which all links touch."""
    link = nuno.sphere(0.01, name="link", **rules)
    made = StaticShapes(world, [link] * len(hulls.names))
    made.key()
    return made


def straight(hulls, robot, way, times):
    """A sweep of the robot in its posture, straight along (3,) [m]."""
    data = robot.update()
    axes = np.array([own.rotation for own in data.oMi])
    places = np.array([own.translation for own in data.oMi])
    count = len(times)
    moved = places + np.linspace(0.0, 1.0, count)[:, None, None] * np.asarray(way)
    return Sweep(hulls, np.asarray(times), np.repeat(axes[None], count, axis=0), moved)


def foremost(hulls, robot):
    """The greatest x of all links [m], and the link's name."""
    data = robot.update()
    best = (-np.inf, "")
    for part in robot.geometry.shapes("collision"):
        corners = nuno.shapes.quaternion.rotate(part.quaternion, np.asarray(part.shape.mesh()[0])) + part.position
        x = (corners @ data.oMi[part.joint].rotation.T + data.oMi[part.joint].translation)[:, 0].max()
        best = max(best, (float(x), part.link))
    return best


@pytest.mark.parametrize("count", [2, 7, 61])
def test_a_robot_that_slides_into_a_wall(hulls, talos, world, count):
    """At the span of time in which its foremost point is 5 mm in the wall, in however many steps it goes there."""
    x, link = foremost(hulls, talos)
    world.add(nuno.box((0.2, 4.0, 4.0), name="wall", position=(x + 0.37 + 0.1, 0.0, 1.0)))
    times = np.linspace(0.0, 1.0, count)
    found = first_entry(straight(hulls, talos, (1.0, 0.0, 0.0), times), shapes_of(world, hulls))
    k, own, obstacle, point = found
    step = 1.0 / (count - 1)
    assert k * step - MIN_ADVANCE <= 0.37 + DEEP <= (k + 1) * step + MIN_ADVANCE
    assert obstacle.body.name == "wall"
    if count > 30:  # legs are alike
        assert hulls.names[own].replace("left", "right") == link.replace("left", "right")
    if count > 30:  # else the point is where it was found to be too deep, on the way
        assert point[0] == pytest.approx(x + 0.37, abs=0.03)


def test_a_thin_plate_is_not_passed_over(hulls, talos, world):
    """One of 1 mm that a single step of 3 m goes through; one beside the way is free."""
    plate = world.add(nuno.box((0.001, 0.1, 0.1), name="plate", position=(1.5, 0.0, 1.0)))
    shapes = shapes_of(world, hulls)
    found = first_entry(straight(hulls, talos, (3.0, 0.0, 0.0), [0.0, 1.0]), shapes)
    assert found is not None and found[2].body is plate
    plate.locate((1.5, 3.0, 1.0))
    shapes.key()
    assert first_entry(straight(hulls, talos, (3.0, 0.0, 0.0), [0.0, 1.0]), shapes) is None


def test_the_sweep_finds_the_same_wherever_it_begins(hulls, talos, world):
    """To the number of the span of time: copies of a robot that are looked at later stop where it does."""
    x, _ = foremost(hulls, talos)
    world.add(nuno.box((0.2, 4.0, 4.0), name="wall", position=(x + 0.5 + 0.1, 0.0, 1.0)))
    shapes, whole = shapes_of(world, hulls), straight(hulls, talos, (1.0, 0.0, 0.0), np.linspace(0.0, 1.0, 61))
    k = first_entry(whole, shapes)[0]
    for first in (1, 10, 25, 29):
        part = Sweep(hulls, whole.times[first:], *_poses(hulls, talos, whole.times[first:]))
        assert first_entry(part, shapes)[0] + first == k


def _poses(hulls, robot, shares):
    data = robot.update()
    axes = np.repeat(np.array([own.rotation for own in data.oMi])[None], len(shares), axis=0)
    places = np.array([own.translation for own in data.oMi])
    return axes, places + shares[:, None, None] * np.array([1.0, 0.0, 0.0])


def test_floors_of_every_kind(hulls, talos, world):
    """A plane, a box and a closed mesh, sunk into from above: at the same time."""
    low = min(own.min() for own in _heights(talos))
    found = []
    box = nuno.box((4.0, 4.0, 1.0))
    for body in (nuno.plane(), box, nuno.Body(nuno.TriangleMesh(*box.shape.mesh()))):
        own = nuno.World(device="cpu")
        own.add(body)
        body.locate((0.0, 0.0, low - 0.2 - (0.0 if body.shape.kind == "plane" else 0.5)))
        sweep = straight(hulls, talos, (0.0, 0.0, -0.5), np.linspace(0.0, 1.0, 101))
        found.append(first_entry(sweep, shapes_of(own, hulls))[0])
    assert max(found) - min(found) <= 1  # a hundredth of 0.5 m
    assert 0.005 * found[0] <= 0.2 + DEEP + MIN_ADVANCE and 0.005 * (found[0] + 1) >= 0.2 + DEEP - MIN_ADVANCE


def _heights(robot):
    data = robot.update()
    for part in robot.geometry.shapes("collision"):
        corners = nuno.shapes.quaternion.rotate(part.quaternion, np.asarray(part.shape.mesh()[0])) + part.position
        yield (corners @ data.oMi[part.joint].rotation.T + data.oMi[part.joint].translation)[:, 2]


def test_spare_way_is_never_too_long(hulls, talos, world):
    """No more than the way that is left to the wall, and not much less where the wall is far."""
    x, _ = foremost(hulls, talos)
    world.add(nuno.box((0.2, 4.0, 4.0), name="wall", position=(x + 2.0 + 0.1, 0.0, 1.0)))
    shapes = shapes_of(world, hulls)
    sweep = straight(hulls, talos, (0.1, 0.0, 0.0), [0.0, 1.0])
    spare = spare_way(sweep, shapes)
    assert 1.5 < spare <= 1.9 + 1e-9
