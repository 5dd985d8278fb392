"""Worlds of a batch put together from several runs of a frame."""

import numpy as np

import nuno
from nuno.solvers.mixing import copy_rigid, mix_rigid, move_particles


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


def test_a_run_that_a_world_does_not_keep_leaves_no_impulse():
    """Its rows were made longer in it: a world that goes back tells of no contact in the places beyond.

    A robot's link was told to bear 4.7 kN by a cube at the other end of the room.
    """
    world = nuno.World(device="cpu", substeps=4)
    for k in range(2):
        cube = world.add(nuno.box((0.1,) * 3, name=f"cube {k}", position=(0.3 * k, 0.0, 0.05)))
        world.attach(cube, nuno.Rigid(mass=1.0))
    batch = world.imagine(2)
    solver = batch.find("cube 0")._dynamics.solver
    kept, width = copy_rigid(solver), int(solver.manifolds.row)
    solver.make_room()
    slots = [batch.find(f"cube {k}")._dynamics.slot for k in range(2)]
    impulse, met = (solver._entries(name).copy() for name in ("impulse", "met"))
    impulse[:, solver.part_rows[slots[0]], width], met[:, solver.part_rows[slots[0]], width] = 1.0, slots[1]
    solver.manifolds.impulse.assign(impulse.reshape(-1, 3))
    solver.manifolds.met.assign(met.ravel())
    assert solver.impulses()[slots[0]][slots[1]].all()
    rows = np.zeros((2, int(solver.state.capacity)), dtype=bool)
    rows[1, slots] = True
    mix_rigid(solver, [(kept, rows)])
    assert solver.impulses()[slots[0]][slots[1]].all(axis=1).tolist() == [True, False]
    assert not solver.impulses()[slots[0]][slots[1]][1].any()
