"""What kernels put together of a solver's arrays is what NumPy makes of them."""

import numpy as np
import pytest

import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.state.pack import places_of_worlds


@pytest.fixture(scope="module", params=[np.float32, np.float64])
def solver(request):
    """Three worlds of a small sheet as they lie on CUDA, one after the other, each somewhere else."""
    world = nuno.World()
    sheet = world.add(nuno.sheet((0.3, 0.2), (3, 2), position=(0.4, -0.3, 1.0)))
    world.attach(sheet)
    random = np.random.default_rng(0)
    places = sheet.vertices + random.uniform(-1.0, 1.0, (3, 1, 3))
    made = ClothSolver(sheet._dynamics.solver.topology, nuno.Cloth(), places, np.zeros_like(places), plan="grid")
    state = made.save_state()
    made.load_state(state | {"local": (state["local"] + random.uniform(-0.1, 0.1, places.shape)).astype(request.param)})
    assert made.doubles.count == (request.param is np.float64)
    return made


@pytest.mark.parametrize("some", [None, [[0, 5], [11, 2], [-1, 3]]])
def test_places_put_together_by_a_kernel_have_the_same_bits(solver, some):
    """A sum of two doubles is one number, wherever it is added up; -1 is the last particle in both."""
    some = None if some is None else np.array(some)
    found = places_of_worlds(solver.doubles.arrays, solver.origin, solver.particle_count, some, "cpu")
    np.testing.assert_array_equal(found, solver.positions(some))
    assert found.dtype == np.float64 and found.flags.writeable
