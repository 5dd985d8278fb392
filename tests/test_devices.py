"""Worlds on several devices in one program: what is imagined elsewhere starts where this world is, and comes back."""

import numpy as np
import pytest

import nuno

CAMERA = nuno.Camera(
    80, 60, 100.0, 100.0, 39.5, 29.5, np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1.0]])
)


def between(here, there):
    """Return one case, marked if it takes a GPU."""
    return pytest.param(here, there, marks=[pytest.mark.cuda] if "cuda" in here + there else [])


@pytest.fixture
def two_gpus():
    """Skip where there are fewer."""
    import warp as wp

    if wp.get_cuda_device_count() < 2:
        pytest.skip("one GPU only")


def room(device):
    """Return a world in which a cloth, a soft cube and a rigid ball have begun to fall onto a table."""
    world = nuno.World(device=device)
    world.add(nuno.box((1.0, 1.0, 0.1), name="table", position=(0.0, 0.0, -0.05)))
    world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(8, 8), name="cloth", position=(0.0, 0.0, 0.1))))
    world.attach(world.add(nuno.soft_box((0.06, 0.06, 0.06), cells=(2, 2, 2), name="cube", position=(0.2, 0.0, 0.05))))
    world.attach(world.add(nuno.sphere(0.03, name="ball", position=(-0.2, 0.0, 0.05))), nuno.Rigid(mass=0.1))
    world.grip("cloth", [0], to=world.find("cloth").vertices[0])
    world.run(0.1)
    return world


def vertices(world):
    """Return the vertices of everything that moves, one array for each body."""
    return [world.find(name).vertices for name in ("cloth", "cube", "ball")]


@pytest.mark.parametrize(("here", "there"), [between("cpu", "cpu"), between("cpu", "cuda:0"), between("cuda:0", "cpu")])
def test_what_is_imagined_on_another_device_is_adopted(here, there):
    """To the bit when it is imagined, and when it is adopted; seen by the camera of that device meanwhile."""
    check_there_and_back(here, there)


@pytest.mark.cuda
@pytest.mark.parametrize(("here", "there"), [("cuda:0", "cuda:1"), ("cuda:1", "cuda:0")])
def test_what_is_imagined_on_another_gpu_is_adopted(two_gpus, here, there):
    """The same from GPU to GPU."""
    check_there_and_back(here, there)


def check_there_and_back(here, there):
    """Imagine a room there, run it, look at it and adopt one future here."""
    world = room(here)
    futures = world.imagine(3, device=there)
    for mine, copies in zip(vertices(world), vertices(futures), strict=True):
        np.testing.assert_array_equal(copies, np.stack([mine] * 3))
    futures.run(0.1)
    masks = futures.masks(CAMERA, "cloth").numpy()
    assert masks.shape == (3, 60, 80) and masks.any(axis=(1, 2)).all()
    world.adopt(futures, 1)
    for mine, copies in zip(vertices(world), vertices(futures), strict=True):
        np.testing.assert_array_equal(mine, copies[1])
    assert world.time == pytest.approx(0.2)
    world.run(0.1)
    assert all(np.isfinite(each).all() for each in vertices(world))


@pytest.mark.cuda
def test_every_gpu_of_a_kind_gives_the_same_bits(two_gpus):
    """Promise: the same input, the same bits, on whichever GPU of the same kind it runs."""
    first, second = room("cuda:0"), room("cuda:1")
    for world in (first, second):
        world.run(0.3)
    for one, other in zip(vertices(first), vertices(second), strict=True):
        np.testing.assert_array_equal(one, other)
