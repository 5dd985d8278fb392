"""A rigid bar on a hinge: two points of a small held cloth, welded to it, leave it one way to turn."""

import numpy as np
import pytest
from scipy.special import ellipk
from world_with import GRAVITY

import nuno

SIZE, MASS = (0.04, 0.06, 0.3), 0.5  # [m], [kg]


def swinging(arm, angle):
    """Return a world, a bar that hangs by a line ``arm`` [m] above its centre, ``angle`` [rad] aside, and its weld."""
    world = nuno.World(device="cpu", substeps=40)
    hinge = world.add(nuno.sheet((0.02, 0.04), (1, 1), position=(0.01, 0.0, 1.0)))
    # heavy: a held vertex gives way as if it had 500 times its mass
    world.attach(hinge, nuno.Cloth(area_density=10.0))
    world.grip(hinge, np.arange(4), to=(0.01, 0.0, 1.0))
    centre = (-arm * np.sin(angle), 0.0, 1.0 - arm * np.cos(angle))
    bar = world.add(nuno.box(SIZE, position=centre).rotate(angle, "y"))
    world.attach(bar, nuno.Rigid(mass=MASS))
    world.ignore_contact(hinge, bar)
    return world, bar, world.weld(hinge, bar, [0, 2])


@pytest.mark.parametrize(
    ("arm", "angle"),
    [pytest.param(0.05, 0.1, marks=pytest.mark.long), pytest.param(0.12, 0.1, marks=pytest.mark.long), (0.12, 1.2)],
)
def test_a_physical_pendulum_swings_in_its_period(arm, angle):
    """Closed form T = 4 sqrt(I / (m g d)) K(sin(angle / 2)), I about the pivot; 2 pi for 4 K where swings are small."""
    inertia = MASS * ((SIZE[0] ** 2 + SIZE[2] ** 2) / 12 + arm**2)
    expected = 4.0 * np.sqrt(inertia / (MASS * GRAVITY * arm)) * ellipk(np.sin(0.5 * angle) ** 2)
    world, bar, _ = swinging(arm, angle)
    aside = []
    for _ in range(120):
        world.step()
        aside.append(bar.position[0])
    aside = np.array(aside)
    k = np.flatnonzero(aside[:-1] * aside[1:] < 0.0)
    passes = (k + aside[k] / (aside[k] - aside[k + 1])) / world.frame_rate
    # velocities are chords, which takes 1 % of the swing of 1.2 rad in a second, and that 0.2 % of the period
    assert 2.0 * np.diff(passes).mean() == pytest.approx(expected, rel=3e-3)
    assert np.abs(aside).max() < 1.001 * arm * np.sin(angle)


def test_a_hanging_bar_pulls_by_its_weight():
    """Equilibrium: the weld bears the weight, and the bar stays where it hung."""
    world, bar, weld = swinging(0.1, 0.0)
    start = bar.position
    world.run(1.0)
    force, torque = weld.wrench
    np.testing.assert_allclose(force, (0.0, 0.0, MASS * GRAVITY), atol=1e-3 * MASS * GRAVITY)
    np.testing.assert_allclose(torque, 0.0, atol=1e-4)
    np.testing.assert_allclose(bar.position, start, atol=1e-5)
