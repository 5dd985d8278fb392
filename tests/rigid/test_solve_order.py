"""The order in which manifolds are solved: what came and went in a world before decides nothing."""

import numpy as np
import pytest

import nuno


def scene(order, device):
    """Boxes askew on two boards, a ball and a cloth among them, attached in some order; where they are 0.3 s later.

    The first box is attached first in any case: what positions on the device are relative to is where it is.
    """
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    for x in (-0.1, 0.1):
        world.add(nuno.box((0.2, 0.2, 0.1), position=(x, 0.0, 0.05)))
    bodies = [world.add(nuno.box((0.1, 0.1, 0.05), position=(0.02 * k, 0.01 * k, 0.13 + 0.052 * k))) for k in range(4)]
    bodies.append(world.add(nuno.sphere(0.03, position=(0.07, 0.06, 0.3))))
    bodies.append(world.add(nuno.sheet((0.2, 0.2), cells=(5, 5), position=(0.0, 0.0, 0.11))))
    for k in (0, *order):
        world.attach(bodies[k], nuno.Cloth() if k == 5 else nuno.Rigid())
    world.run(0.3)
    return [body.vertices for body in bodies]


def check_order(device):
    """The same bodies, attached one way and the other, come to the same places to the bit."""
    for one, other in zip(scene((1, 2, 3, 4, 5), device), scene((5, 4, 3, 2, 1), device), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_order_in_which_bodies_get_dynamics_decides_nothing():
    """Rows of parts are taken as bodies come. Boxes that touch two boards at once were solved in the rows' order."""
    check_order("cpu")


@pytest.mark.cuda
def test_the_order_in_which_bodies_get_dynamics_decides_nothing_on_cuda():
    """Colours were drawn by the rows' numbers: a world of a batch that another history had laid out was 7 mm off."""
    check_order("cuda:0")


def test_what_came_and_went_before_decides_nothing():
    """A world whose box was detached and attached again after another, beside one in which nothing happened."""

    def fallen(history):
        world = nuno.World(device="cpu")
        world.add(nuno.plane())
        world.add(nuno.box((0.3, 0.2, 0.1), position=(0.0, 0.0, 0.05)))
        first, second, third = (
            world.add(nuno.box((0.1, 0.1, 0.1), position=(0.03 * k, 0.02 * k, 0.16 + 0.11 * k))) for k in range(3)
        )
        for body in (first, second, third):
            world.attach(body)
        if history:
            for body in (second, third):
                world.detach(body)
            for body in (third, second):
                world.attach(body)
        world.run(0.5)
        return [body.vertices for body in (first, second, third)]

    for one, other in zip(fallen(False), fallen(True), strict=True):
        np.testing.assert_array_equal(one, other)
