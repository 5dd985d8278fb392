"""A cloth in the air: gravity, drag and pushes, against closed forms."""

import numpy as np
import pytest
from world_with import GRAVITY, attached, masses

import nuno

SIZE, CELLS = (0.3, 0.2), (6, 4)


def flying(worlds=1, substeps=10, gravity=(0, 0, -GRAVITY), **material):
    """A sheet in mid-air, 1 m up, no drag and no damping unless asked for."""
    material = {"air_drag": 0.0, "damping": 0.0, **material}
    sheet = nuno.sheet(SIZE, cells=CELLS, position=(0, 0, 1))
    return attached(sheet, nuno.Cloth(**material), worlds=worlds, substeps=substeps, gravity=gravity)


@pytest.mark.parametrize("substeps", [1, 10, 40])
def test_free_fall_is_half_g_t_squared(substeps):
    """Closed form g t^2 / 2, plus g t dt / 2 for an Euler step whose velocity is updated first."""
    world, body = flying(substeps=substeps)
    start = body.vertices
    world.run(0.5)
    dt = 1 / (60 * substeps)
    fallen = start[:, 2] - body.vertices[:, 2]
    # float32: 0.5 / dt sums of coordinates up to 1.2 m, each rounded by at most 6e-8 m
    np.testing.assert_allclose(fallen, 0.5 * GRAVITY * 0.5 * (0.5 + dt), atol=6e-8 * 0.5 / dt)
    # the velocity is a sum of as many equal terms, rounded by at most 2.4e-7 m/s each
    np.testing.assert_allclose(body.velocities[:, 2], -GRAVITY * 0.5, atol=2.4e-7 * 0.5 / dt)
    np.testing.assert_allclose(body.vertices[:, :2], start[:, :2], atol=1e-6)


def test_free_fall_in_a_tilted_gravity():
    """Closed form g t^2 / 2 along any gravity vector."""
    world, body = flying(gravity=(1.0, -2.0, 3.0), substeps=20)
    start = body.vertices
    world.run(0.4)
    moved = (body.vertices - start).mean(axis=0)
    expected = 0.5 * np.array([1.0, -2.0, 3.0]) * 0.4 * (0.4 + 1 / 1200)
    # ten roundings of 1.5e-8 m a substep walk at random: 5e-8 * 480^1.5 / sqrt(3) for a vertex, / sqrt(35)
    # for the mean
    np.testing.assert_allclose(moved, expected, atol=5e-5)


def test_a_fall_through_still_air_ends_at_g_over_drag():
    """Closed form g / c (1 - exp(-c t)); the implicit step's terminal velocity is exactly g / c."""
    drag = np.array([1.0, 4.0, 10.0])
    world, body = flying(worlds=3, air_drag=drag)
    world.run(0.3)
    # the implicit step is of first order: relative error of the exponent c dt / 2, at most 10 / 600 / 2
    expected = GRAVITY / drag * (1 - np.exp(-drag * 0.3))
    np.testing.assert_allclose(-body.velocities[..., 2].mean(axis=1), expected, rtol=0.009)
    world.run(2.7)
    # after 3 s exp(-c t) is 5 % of g / c at c = 1; beyond that only float32 is left
    expected = GRAVITY / drag * (1 - (1 + drag / 600) ** -1800)
    np.testing.assert_allclose(-body.velocities[..., 2].mean(axis=1), expected, rtol=1e-4)


def test_a_speed_in_still_air_decays_exponentially():
    """Closed form v exp(-c t), as the implicit step has it, v (1 + c dt)^-n."""
    world, body = flying(gravity=(0, 0, 0), air_drag=2.0)
    world.push(body, (0.05, 0, 0), duration=0.1)
    world.run(0.1)
    before = body.velocities[:, 0]
    world.run(0.5)
    # float32: coordinates are rounded to 1e-8 m, which is 6e-6 m/s a substep; 300 such at random are 1e-4 m/s
    np.testing.assert_allclose(body.velocities[:, 0], before * (1 + 2 / 600) ** -300, atol=1e-4)
    np.testing.assert_allclose(body.velocities[:, 0], before * np.exp(-1.0), rtol=0.003)  # and c^2 t dt / 2 = 0.0017


def test_a_push_gives_force_over_mass():
    """Newton's second law: F = m a, the mass being area density x area, in each world its own."""
    force, density = np.array([[0.01, 0, 0], [0, 0.02, 0], [0, 0, -0.03]]), np.array([0.1, 0.2, 0.4])
    world, body = flying(worlds=3, gravity=(0, 0, 0), area_density=density)
    world.push(body, force, duration=0.25)
    world.run(0.5)
    mass = density * SIZE[0] * SIZE[1]
    mean = np.einsum("n,wnx->wx", masses(SIZE, CELLS, 1.0) / (SIZE[0] * SIZE[1]), body.velocities)
    np.testing.assert_allclose(mean, force * 0.25 / mass[:, None], atol=1e-4)  # float32, as above


def test_a_push_on_a_vertex_moves_the_whole_by_its_mass():
    """Newton's second law for the centre of mass: internal forces cancel."""
    world, body = flying(gravity=(0, 0, 0))
    force = np.zeros((len(body.vertices), 3))
    force[0] = (0.002, 0.001, 0.003)
    world.push(body, force)
    world.run(0.3)
    m = masses(SIZE, CELLS, 0.2)
    # 180 substeps of about 150 constraints, each rounding 1e-7 of what it moves: a few 1e-4 of the momentum
    np.testing.assert_allclose(m @ body.velocities, force[0] * 0.3, rtol=2e-3)
