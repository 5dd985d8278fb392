"""A free cloth keeps its momentum, whatever it does inside."""

import numpy as np
import pytest
from world_with import masses

import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.topology.cloth_topology import ClothTopology

SIZE, CELLS, DENSITY = (0.3, 0.3), (15, 15), 0.2


def thrown(self_contact, worlds=1, folded=False, friction=0.5, substeps=30, seed=1):
    """A weightless cloth that turns, drifts and waves, in the solver itself: World always has self-contact.

    Folded, its halves lie 8 mm apart and press together.
    """
    topology = ClothTopology.sheet(CELLS, SIZE)
    x = np.repeat(topology.rest[None], worlds, axis=0)
    random = np.random.default_rng(seed)
    wave = random.normal(size=(worlds, 3, 3))
    v = np.sin(x @ (20 * wave)) * 0.5 + np.cross(random.normal(size=(worlds, 1, 3)) * 3, x) + [0.4, -0.2, 0.1]
    x[..., 2] += 0.01 * np.sin(30 * x[..., 0])
    if folded:
        side = np.tanh(topology.rest[:, 0] / 0.01)
        x = np.stack([np.abs(x[..., 0]), x[..., 1], x[..., 2] + 0.004 * side], axis=-1)
        v = v * 0.3
        v[..., 2] -= 0.5 * side
    material = nuno.Cloth(area_density=DENSITY, air_drag=0.0, damping=0.0, thickness=0.004, friction=friction)
    solver = ClothSolver(topology, material, x, v, gravity=(0, 0, 0), substeps=substeps, self_contact=self_contact)
    return solver, masses(SIZE, CELLS, DENSITY)


def angular(x, v, m):
    """Return angular momentum about the centre of mass (worlds, 3) [kg m2/s]."""
    centre = np.einsum("n,wnx->wx", m, x)[:, None] / m.sum()
    return np.einsum("n,wnx->wx", m, np.cross(x - centre, v))


@pytest.mark.parametrize("self_contact", [False, True])
@pytest.mark.parametrize("worlds", [1, 3])
def test_linear_momentum_is_kept(self_contact, worlds):
    """Invariant of an isolated system, in stretch, shear, bending, self-contact and friction."""
    solver, m = thrown(self_contact, worlds, folded=True)
    before = np.einsum("n,wnx->wx", m, solver.velocities())
    solver.run(0.0, 0.5)
    after = np.einsum("n,wnx->wx", m, solver.velocities())
    if self_contact:
        assert solver.pair_counts.sum() > 0  # it did touch itself
    # coordinates are rounded to 1.5e-8 m ten times a substep of 5.6e-4 s, 5e-5 m/s a vertex; over 900
    # substeps and 256 vertices at random that is 5e-5 * 30 / 16 = 1e-4 m/s of the mean velocity; three times
    # that
    np.testing.assert_allclose(after / m.sum(), before / m.sum(), atol=3e-4)


@pytest.mark.parametrize(
    ("self_contact", "friction", "tolerance"), [(False, 0.5, 0.02), (True, 0.0, 0.02), (True, 0.5, 0.05)]
)
def test_angular_momentum_is_nearly_kept(self_contact, friction, tolerance):
    """Invariant of an isolated system, but for omega dt, by which a substep's rotation turns forces."""
    solver, m = thrown(self_contact, folded=self_contact, friction=friction, substeps=90)
    before = angular(solver.positions(), solver.velocities(), m)
    solver.run(0.0, 0.5)
    after = angular(solver.positions(), solver.velocities(), m)
    # first order in dt: omega dt is about 3 * 5.6e-4 for the spin and ten times that for waves. Friction between layers
    # acts at both middle surfaces, a thickness apart, and that lever takes some more
    assert np.linalg.norm(after - before) < tolerance * np.linalg.norm(before)


def test_a_rigid_spin_lasts():
    """Known error of a position-based step: a spin decays by omega^2 dt, velocities being chords."""
    topology = ClothTopology.sheet(CELLS, SIZE)
    x = topology.rest[None]
    v = np.cross([0.0, 0, 2 * np.pi], x)
    material = nuno.Cloth(area_density=DENSITY, air_drag=0.0, damping=0.0)
    solver = ClothSolver(topology, material, x, v, gravity=(0, 0, 0), substeps=30)
    m = masses(SIZE, CELLS, DENSITY)
    before = angular(x, v, m)[0, 2]
    solver.run(0.0, 1.0)
    after = angular(solver.positions(), solver.velocities(), m)[0, 2]
    # d omega / dt = -omega^3 dt has the solution omega = omega0 / sqrt(1 + 2 omega0^2 dt t); the sheet also
    # stretches by rho omega^2 L^2 / (8 Et), 0.01 %
    expected = 1 / np.sqrt(1 + 2 * (2 * np.pi) ** 2 / 1800)
    assert after / before == pytest.approx(expected, abs=2e-3)
