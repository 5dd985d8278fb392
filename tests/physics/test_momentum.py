"""A free cloth keeps its momentum, whatever it does inside."""

import numpy as np
import pytest
from world_with import masses

import nuno
from nuno.scene.cloth import ClothTopology
from nuno.solver.cloth_solver import ClothSolver

SIZE, CELLS, DENSITY = (0.3, 0.3), (15, 15), 0.2


def thrown(self_contact, worlds=1, crumple=0.0, seed=1):
    """A cloth in weightlessness that turns, drifts and waves, in the solver itself: World always has self-contact."""
    topology = ClothTopology.sheet(CELLS, SIZE)
    x = np.repeat(topology.rest[None], worlds, axis=0)
    random = np.random.default_rng(seed)
    wave = random.normal(size=(worlds, 3, 3))
    v = np.sin(x @ (20 * wave)) * 0.5 + np.cross(random.normal(size=(worlds, 1, 3)) * 3, x) + [0.4, -0.2, 0.1]
    x[..., 2] += 0.01 * np.sin(30 * x[..., 0])
    # towards the middle: it crumples
    v = v - crumple * x * [1, 1, 0]
    material = nuno.Cloth(area_density=DENSITY, air_drag=0.0, damping=0.0, thickness=0.004)
    solver = ClothSolver(topology, material, x, v, gravity=(0, 0, 0), substeps=30, self_contact=self_contact)
    return solver, masses(SIZE, CELLS, DENSITY)


def angular(x, v, m):
    """Return angular momentum about the centre of mass (worlds, 3) [kg m2/s]."""
    centre = np.einsum("n,wnx->wx", m, x)[:, None] / m.sum()
    return np.einsum("n,wnx->wx", m, np.cross(x - centre, v))


@pytest.mark.parametrize("self_contact", [False, True])
@pytest.mark.parametrize("worlds", [1, 3])
def test_linear_momentum_is_kept(self_contact, worlds):
    """Invariant of an isolated system, in stretch, shear, bending and contact with itself, friction included."""
    solver, m = thrown(self_contact, worlds, crumple=8.0)
    before = np.einsum("n,wnx->wx", m, solver.velocities())
    solver.run(0.0, 0.5)
    after = np.einsum("n,wnx->wx", m, solver.velocities())
    if self_contact:
        assert solver.pair_counts.sum() > 0  # it did touch itself
    # rounding of coordinates, 1e-8 m in 5.6e-4 s, makes 2e-5 m/s a vertex and substep; 900 substeps of 256 vertices
    # at random leave 2e-5 * sqrt(900 / 256) = 4e-5 m/s of the mean velocity; three times that
    np.testing.assert_allclose(after / m.sum(), before / m.sum(), atol=1.2e-4)


@pytest.mark.parametrize("self_contact", [False, True])
def test_angular_momentum_is_nearly_kept(self_contact):
    """Invariant of an isolated system, up to the scheme's order: a substep's rotation turns forces by omega dt."""
    solver, m = thrown(self_contact, crumple=8.0 if self_contact else 0.0)
    before = angular(solver.positions(), solver.velocities(), m)
    solver.run(0.0, 0.5)
    after = angular(solver.positions(), solver.velocities(), m)
    # first order in dt: omega dt of about 3 * 5.6e-4 times the number of radians turned, 1.5, and as much again for waves
    assert np.linalg.norm(after - before) < 0.02 * np.linalg.norm(before)


def test_a_rigid_spin_lasts():
    """Invariant: a stiff sheet that spins about its normal keeps its rate; the implicit pass may only slow it."""
    topology = ClothTopology.sheet(CELLS, SIZE)
    x = topology.rest[None]
    v = np.cross([0.0, 0, 2 * np.pi], x)
    material = nuno.Cloth(area_density=DENSITY, air_drag=0.0, damping=0.0)
    solver = ClothSolver(topology, material, x, v, gravity=(0, 0, 0), substeps=30)
    m = masses(SIZE, CELLS, DENSITY)
    before = angular(x, v, m)[0, 2]
    solver.run(0.0, 1.0)
    after = angular(solver.positions(), solver.velocities(), m)[0, 2]
    assert after / before == pytest.approx(1.0, abs=0.02)  # one turn of 2 pi, omega dt = 3.5e-3
    assert after / before < 1.001
