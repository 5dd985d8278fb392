"""The rigid solver as a container: bodies come and go, are saved and restored, in a batch and alone."""

import numpy as np
import pytest

from nuno.rigid.convex_parts import rigid_shape
from nuno.shapes.shape import Box, Sphere, TriangleMesh
from nuno.solvers.rigid_solver import SAVED, RigidSolver
from rigid_with import about, drop, on_floor, places, put

CUBE = Box((0.1, 0.1, 0.1))


def heap(worlds=1, count=8, *, seed=0, only=None, device="cpu"):
    """Return a solver and the slots of cubes that fall on each other; ``only`` is one world of the same batch."""
    solver = on_floor(worlds if only is None else 1, device=device)
    random = np.random.default_rng(seed)
    slots = []
    for k in range(count):
        place = random.normal(0.0, 0.03, (worlds, 3)) + np.array([0, 0, 0.2 + 0.12 * k])
        turn = random.normal(size=(worlds, 4))
        bounce = random.uniform(0.0, 0.5, worlds)
        pick = slice(None) if only is None else slice(only, only + 1)
        slots.append(drop(solver, CUBE, place[pick], turn[pick], restitution=bounce[pick]))
    return solver, slots


def state_of(solver, slots):
    """Return positions, quaternions, velocities and spins (bodies, worlds, ...), as they are kept."""
    names = ("position", "rotation", "velocity", "spin")
    return {name: np.stack([solver.save_state(slot)[name] for slot in slots]) for name in names}


def assert_same(a, b):
    """Check that two states are the same to the bit."""
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_a_world_gives_in_a_batch_what_it_gives_alone():
    """Promise: bit for bit, with contact, friction and bounces."""
    batch, slots = heap(5)
    batch.run(0.0, 1.0)
    together = state_of(batch, slots)
    for world in (0, 3, 4):
        alone, own = heap(5, only=world)
        alone.run(0.0, 1.0)
        single = state_of(alone, own)
        assert_same({name: values[:, world : world + 1] for name, values in together.items()}, single)


def test_phase_by_phase_is_the_same_as_a_run():
    """Promise: predict, contacts and finish make the substeps that run makes."""
    whole, slots = heap()
    parts, _ = heap()
    whole.run(0.0, 0.6)
    for k in range(360):
        parts.open(k / 600.0, 1.0 / 60.0 / 10)
        parts.predict()
        parts.contacts()
        parts.finish()
    assert_same(state_of(whole, slots), state_of(parts, slots))


def test_a_restored_state_goes_on_as_if_nothing_had_been():
    """Promise: bit for bit, also in a solver that is made anew, in the middle of a heap that still moves."""
    solver, slots = heap(2)
    solver.run(0.0, 0.7)
    saved = [solver.save_state(slot) for slot in slots]
    solver.run(0.7, 0.5)
    expected = state_of(solver, slots)
    for slot, state in zip(slots, saved, strict=True):
        solver.load_state(slot, state)
    solver.run(0.7, 0.5)
    assert_same(state_of(solver, slots), expected)
    other, own = heap(2)
    for slot, state in zip(own, saved, strict=True):
        other.load_state(slot, state)
    other.run(0.7, 0.5)
    assert_same(state_of(other, own), expected)


def test_a_state_of_one_world_goes_to_all_worlds_of_a_batch():
    """Promise: every imagined world begins as the one that it is imagined from, and goes on like it."""
    solver, slots = heap()
    solver.run(0.0, 0.5)
    many = on_floor(3)
    bounces = solver.rules.bounce.numpy()
    for slot in slots:
        state = solver.save_state(slot)
        drop(many, CUBE, (0, 0, 9.0 + slot), slot=slot, restitution=bounces[slot])
        many.load_state(slot, state)
    solver.run(0.5, 0.5)
    many.run(0.5, 0.5)
    one, all_of_them = state_of(solver, slots), state_of(many, slots)
    for world in range(3):
        assert_same({name: values[:, world : world + 1] for name, values in all_of_them.items()}, one)


def test_only_members_move():
    """Promise: what is left out is untouched, bit for bit, and stands like a rock to those that move."""
    solver = on_floor()
    below, above, beside = (drop(solver, CUBE, place) for place in ((0, 0, 0.5), (0, 0, 0.75), (1, 0, 0.5)))
    solver.set_velocity(below, (1.0, 0, 0), (0, 2.0, 0))
    before = [solver.save_state(slot) for slot in (below, beside)]
    solver.run(0.0, 1.0, members=[above])
    for slot, state in zip((below, beside), before, strict=True):
        for name in SAVED:
            values = state[name]
            np.testing.assert_array_equal(solver.save_state(slot)[name], values, err_msg=name)
    np.testing.assert_allclose(places(solver, [above])[0], [0, 0, 0.6], atol=1e-4)  # a little more than 20 um


def test_what_touches_nothing_of_what_changed_goes_on_the_same():
    """Promise: bodies that come and go elsewhere change no bit of a heap."""
    quiet, slots = heap()
    busy, same = heap()
    visitor = drop(busy, Sphere(0.2), (5.0, 0, 1.0))
    quiet.run(0.0, 0.5)
    busy.run(0.0, 0.5)
    busy.remove(visitor)
    put(busy, Box((0.3, 0.3, 0.3)), (-5.0, 0, 0))
    quiet.run(0.5, 0.5)
    busy.run(0.5, 0.5)
    assert_same(state_of(quiet, slots), state_of(busy, same))


def test_slots_are_given_again_and_arrays_grow():
    """Adding sixty bodies and removing every other one leaves the rest as they were."""
    solver = on_floor()
    slots = [drop(solver, CUBE, (0.2 * k, 0, 0.05)) for k in range(60)]
    assert len(set(slots)) == 60
    solver.run(0.0, 0.1)
    before = places(solver, slots[1::2])
    for slot in slots[::2]:
        solver.remove(slot)
    np.testing.assert_array_equal(places(solver, slots[1::2]), before)
    again = [drop(solver, CUBE, (0.2 * k, 1.0, 0.05)) for k in range(30)]
    assert set(again) <= set(slots[::2])
    solver.run(0.1, 0.5)
    assert np.abs(places(solver, slots[1::2]) - before).max() < 1e-4  # at rest, to what is left alone
    assert all(solver.finite(k).all() for k in solver.part_rows)


def test_a_part_with_many_others_around_it_gets_longer_rows():
    """Promise: a run stops before a row is too short, and goes on with longer ones: no contact is left out."""
    solver = on_floor()
    rows = solver.manifolds.row
    for k in range(3 * rows):
        angle = 2.0 * np.pi * k / (3 * rows)
        put(solver, Sphere(0.05), (0.02 * np.cos(angle), 0.02 * np.sin(angle), 0.05))
    body = drop(solver, Sphere(0.045), (0, 0, 0.1435))
    solver.run(0.0, 1.0)
    assert solver.manifolds.row > rows
    # on a ring of centres 2 cm from its axis, within what is left alone
    assert places(solver, [body])[0, 2] == pytest.approx(0.05 + np.sqrt(0.095**2 - 0.02**2), abs=1e-4)


def test_contacts_carry_the_weight():
    """Equilibrium: what presses on a resting box sums to its weight, and to that of the box above too."""
    solver = on_floor()
    low, high = drop(solver, CUBE, (0, 0, 0.05)), drop(solver, CUBE, (0.01, 0, 0.15), about((0, 0, 1), 20))
    solver.run(0.0, 2.0)
    pressing = {other: forces.sum(axis=0) for other, _, _, forces in solver.contacts_of(low)}
    weight = 9.81  # [N], 1 kg
    # at rest to 1e-3 of gravity's speed in a substep
    np.testing.assert_allclose(pressing[0], [0, 0, 2 * weight], atol=0.02 * weight)
    np.testing.assert_allclose(pressing[high], [0, 0, -weight], atol=0.02 * weight)
    _, points, normals, _ = next(each for each in solver.contacts_of(low) if each[0] == 0)
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(normals), 1)), atol=1e-5)  # the floor's
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-4)  # what is left alone


def test_poses_are_float64_about_an_origin_of_their_own():
    """A hundred metres from zero a box rests as near it does: positions are kept relative to the origin."""
    solver = RigidSolver(origin=(100.0, 200.0, 0.0))
    put(solver, Box((1.0, 1.0, 0.1)), (100.0, 200.0, -0.05))
    body = drop(solver, CUBE, (100.1, 200.2, 0.06))
    solver.run(0.0, 1.0)
    # a step of a float is 8e-6 at 100 m, and 1e-8 at the 0.2 m from the origin
    np.testing.assert_allclose(solver.pose(body)[0][0], [100.1, 200.2, 0.05], atol=3e-5)
    assert solver.pose(body)[0].dtype == np.float64


def test_a_static_mesh_may_be_deformed():
    """A sheet that is moved up takes what lay on it to its new height."""
    solver = RigidSolver()
    vertices = np.array([[x, y, 0.0] for x in (-0.5, 0, 0.5) for y in (-0.5, 0, 0.5)])
    cells = [(3 * i + j, 3 * i + j + 3, 3 * i + j + 4, 3 * i + j + 1) for i in (0, 1) for j in (0, 1)]
    faces = np.array([t for a, b, c, d in cells for t in ((a, b, c), (a, c, d))])
    sheet = solver.add(rigid_shape(TriangleMesh(vertices, faces), moves=False, thickness=0.01), position=(0, 0, 0))
    body = drop(solver, CUBE, (0.1, 0.1, 0.06))
    solver.run(0.0, 1.0)
    assert solver.pose(body)[0][0, 2] == pytest.approx(0.055, abs=1e-4)
    solver.set_vertices(sheet, vertices + np.array([0, 0, 0.003]))
    solver.run(1.0, 1.0)
    assert solver.pose(body)[0][0, 2] == pytest.approx(0.058, abs=1e-4)


@pytest.mark.cuda
def test_cuda_gives_the_same_bits_every_time_and_in_a_batch():
    """Promise: rounds of contacts, not races."""
    runs = []
    for _ in range(2):
        solver, slots = heap(4, device="cuda:0")
        solver.run(0.0, 1.0)
        runs.append(state_of(solver, slots))
    assert_same(*runs)
    alone, own = heap(4, only=2, device="cuda:0")
    alone.run(0.0, 1.0)
    assert_same({name: values[:, 2:3] for name, values in runs[0].items()}, state_of(alone, own))


@pytest.mark.cuda
def test_block_groups_change_no_bit():
    """Promise: a world of many parts goes to a block group, with the bits of a block."""
    runs = []
    for crowded in (False, True):
        random = np.random.default_rng(5)
        solver = on_floor(device="cuda:0")
        lattice = np.stack(np.meshgrid(*(0.12 * np.arange(k) for k in (8, 6, 7))), axis=-1).reshape(-1, 3)
        lattice += random.uniform((-0.008, -0.008, 0.052), (0.008, 0.008, 0.068), lattice.shape)
        slots = [drop(solver, CUBE, place) for place in lattice]
        solver._crowded = crowded
        assert (solver._blocks_of_group() > 1) is not crowded
        solver.run(0.0, 0.6)
        assert solver.contact_count()[0] > 1000
        runs.append(state_of(solver, slots))
    assert_same(*runs)


@pytest.mark.cuda
def test_cuda_stacks_and_heaps_as_the_cpu_does():
    """Ten boxes stand within 1 mm; a heap comes to rest where nothing overlaps."""
    solver = on_floor(device="cuda:0")
    slots = [drop(solver, CUBE, (0, 0, 0.05 + 0.1 * k)) for k in range(10)]
    solver.run(0.0, 5.0)
    assert np.abs(places(solver, slots) - [[0, 0, 0.05 + 0.1 * k] for k in range(10)]).max() < 1e-3
    solver, slots = heap(2, device="cuda:0")
    solver.run(0.0, 4.0)
    assert all(solver.finite(k).all() for k in solver.part_rows) and solver.deepest() < 1e-3
    assert max(np.abs(solver.velocity(slot)[0]).max() for slot in slots) < 0.05
