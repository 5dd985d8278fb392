"""The quick look at whether a cloth passes through itself says what the exact test says."""

import numpy as np
import pytest

import nuno
from nuno.contact.self.crossed_faces import crossed_worlds
from nuno.mesh.crossings import crossing_faces


@pytest.mark.parametrize("worlds", [1, 3, 18])
def test_worlds_are_found_in_which_a_cloth_passes_through_itself(worlds):
    """Exact: sheets of random roughness, alone, in a vector and beyond it; some cross themselves and some do not."""
    rng = np.random.default_rng(worlds)
    world = nuno.World(device="cpu")
    world.add(nuno.sheet((0.24, 0.2), cells=(12, 10), name="sheet"))
    world = world.imagine(worlds) if worlds > 1 else world
    sheet = world.find("sheet")
    world.attach(sheet, nuno.Cloth())
    solver = sheet._dynamics.solver
    flat, found = solver.positions(), []
    for _ in range(40 // worlds):
        rough = rng.choice([0.0, 0.004, 0.008, 0.012], size=(worlds, 1, 1))
        solver.set_state(flat + rough * rng.normal(size=flat.shape), np.zeros_like(flat))
        exact = [len(crossing_faces(x, np.asarray(sheet.faces))) > 0 for x in solver.positions()]
        assert crossed_worlds(solver).tolist() == exact
        found += exact
    assert {True, False} == set(found)
