"""Worlds of a batch put together from several runs of a frame."""

import numpy as np

import nuno
from nuno.solvers.mixing import move_particles


def test_a_world_that_is_taken_apart_has_a_float_s_digits_whatever_the_others_count_in():
    """Two sheets in floats, one beside a world whose frame was gone through again in doubles.

    What a sheet is taken apart to was rounded alone, and in the batch it was not: 1 um after the next frame in doubles.
    """
    sheet = nuno.sheet((0.2, 0.2), cells=(3, 3), name="sheet", position=(0.01, 0.02, 0.3))
    world = nuno.World(device="cpu", substeps=4)
    world.attach(world.add(sheet))
    solver, batch = sheet._dynamics.solver, world.imagine(2)
    beside = batch.find("sheet")._dynamics.solver
    beside.doubles.put(beside.local_positions().astype(np.float64))
    goal = solver.positions()[0] + 1.0 / 3.0
    for each in (solver, beside):
        move_particles(each, {0: goal})
    assert beside.doubles.count and not solver.doubles.count
    np.testing.assert_array_equal(beside.positions()[0], solver.positions()[0])
    np.testing.assert_allclose(solver.positions()[0], goal, atol=6e-8)  # half a float's step at 0.6 m
