"""Cloth, soft and rigid bodies that touch, on CUDA: the same physics as on the CPU, and the same bits again."""

import numpy as np
import pytest

import nuno

pytestmark = pytest.mark.cuda
SECONDS = 0.8


def scene(device, worlds=1):
    """A towel held at its corners with a box and a cube on it, and a stack on the table; where each ended."""
    world = nuno.World(device=device)
    world.add(nuno.box((2.0, 2.0, 0.1), name="table", position=(0.0, 0.0, -0.05)))
    towel = world.add(nuno.sheet((0.4, 0.4), cells=(12, 12), position=(0.0, 0.0, 0.5), name="towel"))
    box = world.add(nuno.box((0.08, 0.08, 0.04), position=(0.08, 0.0, 0.54), name="box"))
    cube = world.add(nuno.soft_box((0.06, 0.06, 0.06), cells=(2, 2, 2), position=(-0.08, 0.0, 0.55), name="cube"))
    stack = [
        world.add(nuno.box((0.1, 0.1, 0.1), position=(0.6, 0.0, 0.0505 + 0.1005 * k), name=f"stack{k}"))
        for k in range(3)
    ]
    world.attach(towel, nuno.Cloth(area_density=0.3))
    for corner in (0, 12, 156, 168):
        world.grip(towel, [corner], to=towel.vertices[corner])
    world.attach(box, nuno.Rigid(mass=0.1))
    world.attach(cube, nuno.Soft(density=300.0, youngs_modulus=3e4))
    for each in stack:
        world.attach(each)
    bodies = [towel, box, cube, *stack]
    if worlds > 1:
        world = world.imagine(worlds)
        bodies = [world.find(body.name) for body in bodies]
    world.run(SECONDS)
    return [np.atleast_3d(body.vertices.T).T for body in bodies]


def test_the_same_physics_as_on_the_cpu():
    """Contacts are solved all at once there and one by one here: what bounces is off by 0.3 mm, and 1 mm is allowed."""
    for here, there in zip(scene("cpu"), scene("cuda:0"), strict=True):
        np.testing.assert_allclose(there.mean(axis=1), here.mean(axis=1), atol=1e-3)


def test_the_same_bits_again_and_in_a_batch():
    """Promise: same input, same bits, in any place of a batch."""
    once, again, batch = scene("cuda:0"), scene("cuda:0"), scene("cuda:0", worlds=3)
    for first, second, many in zip(once, again, batch, strict=True):
        np.testing.assert_array_equal(second, first)
        for one in many:
            np.testing.assert_array_equal(one, first[0])
