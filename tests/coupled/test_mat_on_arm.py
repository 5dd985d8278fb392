"""A soft mat across an arm that is narrower than three of its cells: on what moves it lies as on what stands.

The arm is a box, as a box and as a hull of the same eight corners. Where faces of the mat feel its edges the mat's
middle stays where that of the box alone is; where only vertices do, faces sink in between them.
"""

from itertools import product

import numpy as np
import pytest

import nuno
from nuno.shapes.shape import Hull
from nuno.tasks.simple_hull import simple_hull

ARM = (0.3, 0.07, 0.07)
KEPT = 5e-4
"""[m] Moving bodies keep the mat off by half of its contact distance, 0.2 mm here; what sinks in does so by 14 mm."""


def arm(kind):
    """Return the arm as a body."""
    if kind == "box":
        return nuno.box(ARM, friction=0.5)
    corners = np.array(list(product(*((-0.5 * side, 0.5 * side) for side in ARM))))
    shape, apart = simple_hull(corners, 1e-3)
    assert isinstance(shape, Hull) and apart < 1e-9
    return nuno.Body(shape, friction=0.5)


def height(kind, dynamic):
    """Return how high the mat's middle is after 0.6 s [m]: 33 mm cells, soft as foam, let down with much air drag."""
    world = nuno.World(device="cpu")
    own = world.add(arm(kind))
    if dynamic:
        world.attach(own, nuno.Rigid(mass=5.0, friction=0.5))
        nuno.fixed_joint(own, None)
    mat = world.add(nuno.soft_box((0.1, 0.3, 0.02), cells=(3, 9, 2), position=(0.0, 0.0, 0.5 * ARM[2] + 0.012)))
    world.ignore_contact(mat, mat)
    world.attach(
        mat, nuno.Soft(density=60.0, youngs_modulus=5e3, poisson_ratio=0.25, friction=0.5, air_drag=6.0)
    )  # fmt: skip
    world.run(0.6)
    return float(mat.vertices[:, 2].mean())


@pytest.fixture(scope="module")
def on_box():
    """The height on a static box."""
    return height("box", False)


@pytest.mark.parametrize("kind", ["box", "hull"])
def test_on_what_moves_it_lies_as_on_a_box(kind, on_box):
    """On a dynamic box and a dynamic hull that are held, the mat is as high as on a static box."""
    assert height(kind, True) == pytest.approx(on_box, abs=KEPT)


def test_on_a_static_hull_it_lies_as_on_a_box(on_box):
    """A static hull of the same corners bears the mat as the box does."""
    assert height("hull", False) == pytest.approx(on_box, abs=KEPT)
