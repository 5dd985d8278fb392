"""Coordinates: poses, motions, and frames that follow frames."""

import numpy as np
import pytest

from nuno import BodyStateError, Coordinates, InvalidInputError

HALF = np.sqrt(0.5)
EXACT = 1e-12  # a few roundings of float64 at lengths of about 1


def test_locate_sets_the_position_in_the_world():
    """Locate puts the origin at a point and returns the frame."""
    frame = Coordinates()
    assert frame.locate((1, 2, 3)) is frame
    np.testing.assert_array_equal(frame.position, (1, 2, 3))
    np.testing.assert_array_equal(frame.quaternion, (1, 0, 0, 0))


def test_rotate_about_z_by_a_right_angle():
    """A quarter turn about z maps x to y."""
    frame = Coordinates((1, 0, 0)).rotate(np.pi / 2, "z")
    np.testing.assert_allclose(frame.quaternion, (HALF, 0, 0, HALF), atol=EXACT)
    np.testing.assert_allclose(frame.to_world([(1, 0, 0)]), [(1, 1, 0)], atol=EXACT)
    np.testing.assert_allclose(frame.rotation, [(0, -1, 0), (1, 0, 0), (0, 0, 1)], atol=EXACT)


def test_translate_in_own_axes_and_in_the_worlds():
    """After a quarter turn about z, own x is the world's y."""
    frame = Coordinates().rotate(np.pi / 2, "z")
    np.testing.assert_allclose(frame.translate((1, 0, 0)).position, (0, 1, 0), atol=EXACT)
    np.testing.assert_allclose(frame.translate((1, 0, 0), wrt="world").position, (1, 1, 0), atol=EXACT)


def test_rotate_in_own_axes_and_in_the_worlds():
    """After a quarter turn about z, own x is the world's y."""
    turned = Coordinates().rotate(np.pi / 2, "z")
    local = turned.copy_coords().rotate(0.3, "x")
    world = turned.copy_coords().rotate(0.3, (0, 2, 0), wrt="world")
    np.testing.assert_allclose(local.quaternion, world.quaternion, atol=EXACT)


def test_transform_there_and_back():
    """A motion and its inverse leave the pose."""
    motion = Coordinates((0.1, -0.4, 2.0)).rotate(1.1, (1, 2, 3))
    frame = Coordinates((3, 1, 2)).rotate(0.7, "y")
    there = frame.copy_coords().transform(motion)
    np.testing.assert_allclose(there.position, frame.to_world([motion.position])[0], atol=EXACT)
    np.testing.assert_allclose(frame.to_local(frame.to_world([(1, 2, 3)])), [(1, 2, 3)], atol=EXACT)
    world = frame.copy_coords().transform(motion, wrt="world")
    np.testing.assert_allclose(world.position, motion.to_world([frame.position])[0], atol=EXACT)


def test_children_follow():
    """A child keeps its place in the parent's frame, a grandchild too, until dissoc."""
    parent, child, grandchild = Coordinates((1, 0, 0)), Coordinates((2, 0, 0)), Coordinates((3, 0, 0))
    parent.assoc(child)
    child.assoc(grandchild)
    parent.rotate(np.pi / 2, "z")
    np.testing.assert_allclose(child.position, (1, 1, 0), atol=EXACT)
    np.testing.assert_allclose(grandchild.position, (1, 2, 0), atol=EXACT)
    child.locate((5, 5, 5))
    np.testing.assert_allclose(child.position, (5, 5, 5), atol=EXACT)
    parent.dissoc(child)
    parent.locate((0, 0, 0))
    np.testing.assert_allclose(child.position, (5, 5, 5), atol=EXACT)
    assert child.parent is None and parent.children == ()


def test_wrong_parents_are_refused():
    """No second parent, no circles, no dissoc of a stranger."""
    a, b, c = Coordinates(), Coordinates(), Coordinates()
    a.assoc(b)
    with pytest.raises(BodyStateError, match="another frame"):
        c.assoc(b)
    with pytest.raises(BodyStateError, match="itself"):
        b.assoc(a)
    with pytest.raises(BodyStateError, match="no such child"):
        c.dissoc(b)


def test_pose_by_world():
    """Positions and angles may differ by world."""
    frame = Coordinates([(0, 0, 0), (1, 0, 0)]).rotate([0.0, np.pi / 2], "z")
    moved = frame.to_world([(1, 0, 0)])
    np.testing.assert_allclose(moved, [[(1, 0, 0)], [(1, 1, 0)]], atol=EXACT)
    np.testing.assert_allclose(frame.to_local(moved), [[(1, 0, 0)]] * 2, atol=EXACT)


@pytest.mark.parametrize(
    "act",
    [
        lambda f: f.locate((0, np.nan, 0)),
        lambda f: f.locate((0, 0)),
        lambda f: f.locate("here"),
        lambda f: f.translate((1, 0, 0), wrt="hand"),
        lambda f: f.rotate(1.0, (0, 0, 0)),
        lambda f: f.rotate(np.inf, "x"),
        lambda f: f.rotate(1.0, "w"),
        lambda f: f.transform((1, 2, 3)),
        lambda f: Coordinates(quaternion=(0, 0, 0, 0)),
    ],
)
def test_bad_values_change_nothing(act):
    """A value that cannot be used raises, and the pose stays."""
    frame = Coordinates((1, 2, 3))
    with pytest.raises(InvalidInputError):
        act(frame)
    np.testing.assert_array_equal(frame.position, (1, 2, 3))
