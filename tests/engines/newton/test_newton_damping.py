"""Damping of soft bodies on Newton against the closed form."""

import numpy as np
import pytest

import nuno

CELLS, EDGE, YOUNG, DENSITY = 3, 0.1, 5e4, 1000.0


def decay(damping):
    """Return at which rate [1/s] the lengthwise swing of a free cube dies away, and its angular frequency [1/s]."""
    from scipy.optimize import curve_fit

    world = nuno.World(device="cpu", engine="newton", gravity=(0.0, 0.0, 0.0))
    cube = world.add(nuno.soft_box((EDGE,) * 3, cells=(CELLS,) * 3, name="cube"))
    world.attach(cube, nuno.Soft(density=DENSITY, youngs_modulus=YOUNG, poisson_ratio=0.0, damping=damping))
    height = cube.vertices[:, 2]
    top, low = height > 0.49 * EDGE, height < -0.49 * EDGE
    velocities = np.zeros_like(cube.vertices)
    velocities[:, 2] = 0.2 * np.sin(np.pi * height / EDGE)
    world.set_velocity(cube, velocities)
    longer, times = [], np.arange(1, 121) / 240.0
    for _ in times:
        world.run(1.0 / 240.0)
        longer.append(cube.vertices[top, 2].mean() - cube.vertices[low, 2].mean() - EDGE)

    def swing(t, size, rate, frequency):
        return size * np.exp(-rate * t) * np.sin(frequency * t)

    natural = np.pi / EDGE * np.sqrt(YOUNG / DENSITY)
    found, _ = curve_fit(swing, times, np.array(longer), p0=(1e-3, 10.0, natural))
    return found[1], found[2]


@pytest.mark.slow
def test_a_swing_dies_away_by_its_time_constant():
    """The rate rises by c w^2 / 2, within 5 %: beyond what implicit steps take of themselves."""
    pytest.importorskip("newton.solvers")
    alone, _ = decay(0.0)
    damped, frequency = decay(0.001)
    assert damped - alone == pytest.approx(0.001 * frequency**2 / 2.0, rel=0.05)
