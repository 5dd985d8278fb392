"""Recordings side by side."""

import numpy as np
import pytest

import nuno
from nuno.viewer.side_by_side import side_by_side


def falling(seconds=0.1):
    """Return a recording of a ball that falls beside a still box on a floor."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.2, 0.2, 0.2), name="box", position=(0.4, 0, 0.1)))
    world.attach(world.add(nuno.sphere(0.1, name="ball", position=(0, 0, 0.5))))
    return nuno.Recording.of(world, seconds)


def test_the_second_stands_beside_the_first():
    """All of it is moved along x by the width and a quarter, so that nothing overlaps; the floor is drawn once."""
    one = falling()
    whole = side_by_side([one, falling()], ("left", "right"))
    assert [body.name for body in whole.bodies] == [
        "left: floor", "left: box", "left: ball", "right: box", "right: ball",
    ]  # fmt: skip
    np.testing.assert_array_equal(whole.times, one.times)
    width = 0.5 + 0.1  # from the box's far side to the ball's
    for name in ("box", "ball"):
        moved = whole[f"right: {name}"].vertices - one[name].vertices
        # a ball's triangles have a corner within a percent of its radius from its side
        assert moved[..., 0] == pytest.approx(np.full(moved.shape[:-1], 1.25 * width), abs=2e-3)
        np.testing.assert_allclose(moved[..., 1:], 0.0, atol=1e-12)


def test_recordings_that_do_not_match_are_refused():
    """There would be frames in which one of them has nothing to show."""
    with pytest.raises(nuno.InvalidInputError, match="one length"):
        side_by_side([falling(), falling(0.2)], ("a", "b"))
    with pytest.raises(nuno.InvalidInputError, match="a name for each"):
        side_by_side([falling()], ("a", "b"))
