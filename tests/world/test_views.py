"""What a world hands to other libraries: arrays that share their memory with it."""

import numpy as np
import pytest

import nuno

CAMERA = nuno.Camera.look_at((0.2, -0.6, 0.9), (0.0, 0.0, 0.0), 0.7, width=16, height=12)


def batch_of(count):
    """Worlds with a cloth and a box that fall."""
    world = nuno.World(device="cpu", substeps=5)
    world.add(nuno.plane(name="floor"))
    world.attach(world.add(nuno.sheet((0.2, 0.2), (2, 2), name="cloth", position=(0.0, 0.0, 0.3))))
    world.attach(world.add(nuno.box((0.1, 0.1, 0.1), name="box", position=(0.3, 0.0, 0.3))))
    return world.imagine(count)


@pytest.mark.parametrize("body", ["cloth", "box"])
@pytest.mark.parametrize("name", ["positions", "velocities"])
def test_a_view_that_was_taken_once_shows_each_new_state(body, name):
    """NumPy takes the array by DLPack without a copy; `state(copy=False)` fills it anew where it lies."""
    batch = batch_of(3)
    array = batch.state(body, copy=False)[name]
    view = np.from_dlpack(array)
    assert view.ctypes.data == array.ptr and view.shape == (*array.shape, 3) and view.dtype == np.float32
    before = view.copy()
    batch.run(0.05)
    np.testing.assert_array_equal(view, before)
    batch.state(body, copy=False)
    own = batch.find(body)
    np.testing.assert_array_equal(view, np.float32(own.vertices if name == "positions" else own.velocities))
    assert (view != before).any()
    fresh = batch.state(body)[name]
    assert fresh.ptr != array.ptr


def test_masks_depths_and_forces_have_a_world_axis_and_no_copy():
    """What cameras and contacts give is taken by DLPack too, (worlds, ...) each."""
    batch = batch_of(2)
    batch.run(0.4)
    arrays = [batch.masks(CAMERA, "cloth"), batch.depth(CAMERA), batch.ids(CAMERA), batch.contact_force("box")]
    for array, shape in zip(arrays, [(2, 12, 16)] * 3 + [(2, 3)], strict=True):
        view = np.from_dlpack(array)
        assert view.shape == shape and view.ctypes.data == array.ptr
    # a box at rest presses on the floor with its weight: 1,000 kg/m3 of water, to a substep's rest of motion
    np.testing.assert_allclose(arrays[3].numpy()[:, 2], 9.81 * batch.find("box").mass, rtol=0.02)
