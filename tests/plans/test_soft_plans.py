"""The launch plans of soft bodies: whichever runs one, the same phases in the same order give the same bits."""

import numpy as np
import pytest

import nuno
from nuno.joints.grip import GripSpec
from nuno.mesh.tetrahedra import box_tetrahedra
from nuno.solvers.soft_solver import SoftSolver
from nuno.solvers.soft_substeps import soft_substeps
from nuno.state.cloth_state import COMPLIANT_GRIPS, MOTION, SELF_CONTACT, SHAPES, VELOCITIES
from nuno.tables.colliders import Colliders
from nuno.topology.soft_topology import SoftTopology

BODY = SoftTopology.of(*box_tetrahedra((0.12, 0.1, 0.08), (4, 3, 3)))  # no colour is a multiple of a vector's length


def holed():
    """The same block without some of its elements, so that clusters are of all sizes."""
    tets = BODY.tets[np.random.default_rng(2).random(BODY.element_count) < 0.6]
    used, corners = np.unique(tets, return_inverse=True)
    return SoftTopology.of(BODY.rest[used], corners.reshape(tets.shape))


HOLED = holed()


def grip(positions, vertices, compliance=0.0):
    """Vertices that go round."""
    held = np.tile(vertices, (len(positions), 1))
    start = positions[np.arange(len(positions))[:, None], held]
    path = start[:, :, None] + [[0, 0, 0], [0.03, 0.02, 0.05], [0.05, 0.05, -0.02]]
    return GripSpec(held, None, None, np.array([0.0, 0.1, 0.2]), path, "minimum_jerk", compliance)


def solver(plan, worlds=1, different=False, device="cpu", body=BODY):
    """A block over a ball and a table, held at a corner and by a spring, pushed, moduli by element, and wrinkled."""
    random = np.random.default_rng(1)
    x = body.rest + random.normal(scale=0.01, size=body.rest.shape) + [0.0, 0.0, 0.07]
    positions = np.repeat(x[None], worlds, axis=0)
    if different:
        positions[1:] += random.normal(scale=0.005, size=positions[1:].shape)
    young = np.linspace(2e4, 2e5, body.element_count)
    material = nuno.Soft(density=500.0, youngs_modulus=young, poisson_ratio=0.4, damping=0.003)
    made = SoftSolver(body, material, positions, np.zeros_like(positions), substeps=16, plan=plan, device=device)
    shapes = [nuno.box((1, 1, 0.02), position=(0, 0, -0.01)), nuno.sphere(0.03, position=(0.05, 0, 0.02))]
    made.set_colliders(Colliders.from_bodies(shapes, worlds, device))
    made.set_grips([grip(positions, [0]), grip(positions, [40], 1e-3)])
    made.set_forces(np.full(positions.shape, 1e-3))
    return made


def outcome(made, seconds=0.25):
    """Positions and velocities of the first world."""
    made.run(0.0, seconds)
    return made.local_positions()[0], made.velocities()[0]


@pytest.mark.long
@pytest.mark.parametrize("body", [BODY, HOLED], ids=["whole", "holed"])
def test_all_plans_give_the_same_bits(body):
    """Promise: one source, four plans, no bit of difference, alone or beside others; some is inside out."""
    made = solver("fused", body=body)
    first = made.positions()[0][body.tets]
    assert (np.linalg.det(np.swapaxes(first[:, 1:] - first[:, :1], 1, 2)) < 0).any()
    expected = outcome(made)
    for plan in ("vector", "grid"):
        np.testing.assert_array_equal(outcome(solver(plan, body=body)), expected)
    for worlds in (3, 18):
        np.testing.assert_array_equal(outcome(solver("auto", worlds, different=True, body=body)), expected)


@pytest.mark.parametrize(
    "plan", ["vector", pytest.param("fused", marks=pytest.mark.long), pytest.param("grid", marks=pytest.mark.long)]
)
def test_steps_by_parts_are_the_run(plan):
    """Promise: who steps the parts of each substep of a frame from outside gets the bits of the run."""
    whole, parts = solver(plan), solver(plan)
    whole.run(0.0, 1 / 60)
    parts.open(0.0, 1 / 60 / 16, 16)
    for substep in range(16):
        for part in (MOTION, COMPLIANT_GRIPS | SELF_CONTACT, SHAPES, VELOCITIES):
            parts.step_parts(substep, part)
    np.testing.assert_array_equal(parts.local_positions(), whole.local_positions())
    np.testing.assert_array_equal(parts.velocities(), whole.velocities())


@pytest.mark.parametrize("worlds", [1, 3])
def test_a_saved_state_goes_on_alike(worlds):
    """Promise: save, go on, load, go on: the same bits."""
    made = solver("auto", worlds, different=True)
    made.run(0.0, 0.1)
    saved = made.save_state()
    made.run(0.1, 0.1)
    expected = made.save_state()
    made.load_state(saved)
    made.run(0.1, 0.1)
    for name, value in made.save_state().items():
        np.testing.assert_array_equal(value, expected[name], err_msg=name)


def test_stiffer_lighter_and_finer_bodies_take_more_substeps():
    """The rule of ``soft_substeps``: as many as a wave's speed over a cell's height, within bounds."""
    frame = 1 / 60
    coarse, fine = (SoftTopology.of(*box_tetrahedra((0.2, 0.2, 0.2), (n, n, n))) for n in (5, 10))
    assert soft_substeps(fine, frame, 10.0) == pytest.approx(2 * soft_substeps(coarse, frame, 10.0), abs=1)
    assert soft_substeps(fine, frame, 20.0) == pytest.approx(2 * soft_substeps(fine, frame, 10.0), abs=1)
    assert (soft_substeps(coarse, frame, 0.01), soft_substeps(fine, frame, 1e4)) == (10, 240)


def test_a_topology_says_what_is_wrong():
    """Promise: named errors for what is no body."""
    x, tets = box_tetrahedra((1.0, 1.0, 1.0), (1, 1, 1))
    for vertices, elements, fraction, said in (
        (x, tets[:0], None, "tetrahedra"),
        (x, tets + 1, None, "vertices"),
        (np.concatenate([x, x[:1]]), tets, None, "belong to no"),
        (x * [1, 1, 0], tets, None, "flat"),
        (x, tets, np.zeros(len(tets)), "fraction"),
    ):
        with pytest.raises(nuno.MeshError, match=said):
            SoftTopology.of(vertices, elements, fraction)


def test_fractions_scale_mass_and_stiffness():
    """Invariant: a body half filled weighs half, and moves like the whole one."""
    half = SoftTopology.of(BODY.rest, BODY.tets, np.full(BODY.element_count, 0.5))
    made = []
    for body in (BODY, half):
        x = body.rest[None] * [1.1, 1.0, 0.9]
        each = SoftSolver(body, nuno.Soft(damping=0.002), x, np.zeros_like(x), gravity=(0, 0, 0))
        each.run(0.0, 0.1)
        made.append(each)
    assert made[1].mass.sum() == pytest.approx(0.5 * made[0].mass.sum())
    # powers of two: every product is the same but for its exponent
    np.testing.assert_array_equal(made[0].local_positions(), made[1].local_positions())


@pytest.mark.cuda
@pytest.mark.parametrize("body", [BODY, HOLED], ids=["whole", "holed"])
def test_cuda_repeats_bit_for_bit_and_world_by_world(body):
    """Promise: same input, same bits, in any place of a batch; some of the body starts inside out."""
    alone = outcome(solver("auto", device="cuda:0", body=body))
    for worlds in (1, 5, 300):
        again = solver("auto", worlds, device="cuda:0", body=body)
        np.testing.assert_array_equal(outcome(again), alone)
        np.testing.assert_array_equal(again.local_positions()[-1], alone[0])


@pytest.mark.cuda
@pytest.mark.parametrize(("cells", "worlds"), [(4, 1), (12, 1), (12, 150)], ids=["all", "a part", "a part of many"])
def test_shared_memory_changes_no_bit(cells, worlds):
    """Promise: where the positions lie while they are worked on is of no account, whether all or some of it fits."""
    body = SoftTopology.of(*box_tetrahedra((0.03 * cells,) * 3, (cells,) * 3))
    found = []
    for shared in (False, True):
        made = solver("auto", worlds, device="cuda:0", body=body)
        made.shared_memory = shared
        found.append(outcome(made))
    np.testing.assert_array_equal(found[0], found[1])
    assert np.isfinite(found[0]).all()


@pytest.mark.cuda
@pytest.mark.parametrize("substeps", [16, 30])
@pytest.mark.parametrize("worlds", [1, 5, 140])
def test_block_groups_change_no_bit(worlds, substeps):
    """Promise: how many multiprocessors share a world is of no account, with floats (16 substeps) and doubles."""
    body = SoftTopology.of(*box_tetrahedra((0.36,) * 3, (12,) * 3))
    found = []
    for plan in ("fused", "grid"):
        made = solver(plan, worlds, device="cuda:0", body=body)
        made.substeps = substeps
        made.run(0.0, 0.15)
        found.append((made.local_positions(), made.velocities()))
    np.testing.assert_array_equal(found[0], found[1])
    assert np.isfinite(found[0]).all()


@pytest.mark.cuda
def test_a_large_body_takes_all_multiprocessors():
    """Promise: one world is not left to one of them, a world each of many is."""
    body = SoftTopology.of(*box_tetrahedra((0.4,) * 3, (16,) * 3))
    assert solver("auto", device="cuda:0", body=body).plan == "grid"
    assert solver("auto", 300, device="cuda:0", body=body).plan == "fused"
    assert solver("auto", device="cuda:0").plan == "fused"


@pytest.mark.cuda
@pytest.mark.parametrize("body", [BODY, HOLED], ids=["whole", "holed"])
def test_cuda_moves_a_body_as_the_cpu_does(body):
    """Both devices project the same elements in the same order: a swinging block differs by rounding alone.

    1e-4 m after 120 substeps, of a path of 0.1 m.
    """
    here, there = (swinging(device, body).positions() for device in ("cpu", "cuda:0"))
    np.testing.assert_allclose(there, here, atol=1e-4)
    assert np.abs(here - swinging("cpu", body, 0.0).positions()).max() > 0.1


def swinging(device, body, seconds=0.25):
    """Return a block that is held at two corners, after so many seconds."""
    x = body.rest[None] + [0.0, 0.0, 0.5]
    material = nuno.Soft(density=500.0, youngs_modulus=5e4, damping=0.003)
    made = SoftSolver(body, material, x, np.zeros_like(x), substeps=8, device=device)
    made.set_grips([GripSpec(np.array([[0, 1]]), None, None, np.array([0.0]), x[:, [0, 1], None], "linear", 0.0)])
    if seconds:
        made.run(0.0, seconds)
    return made
