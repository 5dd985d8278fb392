"""Masks of several bodies at once."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.errors import UnknownNameError

CAMERA = nuno.Camera.look_at((0.1, -0.6, 1.0), (0.0, 0.0, 0.0), 0.7, width=48, height=36)


def room():
    """A floor, a table and a cup that is before it, in part."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.4, 0.4, 0.02), name="table", position=(0, 0, 0.05)))
    cup = world.add(nuno.cylinder(0.04, 0.1, name="cup", position=(0.1, -0.1, 0.111)))
    world.attach(cup)
    return world


@pytest.mark.parametrize("count", [1, 3])
def test_every_body_has_the_mask_that_it_has_alone(count):
    """One drawing of all gives each body's mask to the pixel, from the world and from a picture, in a batch too."""
    world = room()
    if count > 1:
        world = world.imagine(count)
        world.set_pose("cup", np.linspace((0.1, -0.1, 0.111), (0.1, 0.1, 0.111), count))
    masks = world.segment(CAMERA)
    assert list(masks) == ["floor", "table", "cup"]
    assert world.segment(CAMERA, "cup").keys() == {"cup"}
    pictured = nuno.take_picture(world, CAMERA).masks("cup", world.find("table"))
    shape = (36, 48) if count == 1 else (count, 36, 48)
    for name, mask in masks.items():
        assert isinstance(mask, wp.array) and mask.shape == shape and mask.numpy().dtype == bool
        np.testing.assert_array_equal(mask.numpy(), world.masks(CAMERA, name).numpy())
        np.testing.assert_array_equal(np.from_dlpack(mask), mask.numpy())
    for name, mask in pictured.items():
        np.testing.assert_array_equal(mask.numpy(), masks[name].numpy())
    assert masks["cup"].numpy().any() and (masks["table"].numpy() ^ masks["floor"].numpy()).any()


def test_no_such_body():
    """A name that is not there is named."""
    world = room()
    with pytest.raises(UnknownNameError, match="cat"):
        world.segment(CAMERA, "cup", "cat")
    with pytest.raises(UnknownNameError, match="cat"):
        nuno.take_picture(world, CAMERA).masks("cat")
