"""Cloth, soft and rigid bodies that touch, as CUDA does it: the same physics as on the CPU, and the same bits again."""

import numpy as np
import pytest

import nuno

INSTANTS = (0.4, 0.8)
"""[s] By the first all bodies have bounced; until the second the cube rolls on, and a difference grows forty times."""
WITHIN = (0.1e-3, 1.5e-3)
"""[m] The cube is 0.03 and 0.6 mm from where thousands of passes over contacts bring it, one by one, and 0.01 and
0.6 mm all at once, and the two may lie on either side of it: 1.26 mm apart. A box that starts 0.01 mm elsewhere makes
0.01 and 0.18 mm on the CPU."""


def scene(device, worlds=1):
    """A towel held at its corners with a box and a cube on it, and a stack on the table; where each was when."""
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
    found, time = [], 0.0
    for instant in INSTANTS:
        world.run(instant - time)
        time = instant
        found.append([np.atleast_3d(body.vertices.T).T for body in bodies])
    return found


@pytest.mark.long
@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_the_same_physics_all_at_once(device, monkeypatch):
    """Contacts are solved one by one on the CPU and all at once on CUDA, which one thread can do on the CPU, too."""
    expected = scene("cpu")
    monkeypatch.setattr("nuno.solvers.coupling.solves_at_once", lambda device: True)
    for within, here, there in zip(WITHIN, expected, scene(device), strict=True):
        for one, other in zip(here, there, strict=True):
            np.testing.assert_allclose(other.mean(axis=1), one.mean(axis=1), atol=within)


@pytest.mark.cuda
def test_the_same_bits_again_and_in_a_batch():
    """Promise: same input, same bits, in any place of a batch."""
    for found in zip(scene("cuda:0"), scene("cuda:0"), scene("cuda:0", worlds=3), strict=True):
        for first, second, many in zip(*found, strict=True):
            np.testing.assert_array_equal(second, first)
            for one in many:
                np.testing.assert_array_equal(one, first[0])
