"""The launch plans: whichever runs a cloth, the same phases in the same order give the same bits."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.constraints.bending import bend_line, bend_twist
from nuno.constraints.damping import damp_line, damp_twist
from nuno.constraints.membrane import shear_cell, stretch_triangle
from nuno.numbers.lanes import LANES, lane, lane_int
from nuno.solvers.cloth_solver import ClothSolver
from nuno.solvers.cloth_substeps import default_substeps
from nuno.state.cloth_state import StateFloat, StateLanes
from nuno.tables.colliders import Colliders
from nuno.topology.cloth_topology import ClothTopology

CELLS = (13, 9)  # no multiple of a vector's length, so that every group has an end


def topology(kind, cells=CELLS):
    """A sheet of cells of 3 cm, or the same rectangle as a triangle mesh."""
    sheet = ClothTopology.sheet(cells, (0.03 * cells[0], 0.03 * cells[1]))
    return sheet if kind == "sheet" else ClothTopology.mesh(sheet.rest[:, :2], sheet.faces)


class Grip:
    """Two corners that go round, with a spring at one more point."""

    def __init__(self, positions, rigid=True):
        worlds = len(positions)
        self.vertices = np.tile([0, CELLS[0]] if rigid else [60], (worlds, 1))
        start = positions[np.arange(worlds)[:, None], self.vertices]
        self.corners = self.barycentric = None
        self.times = [0.0, 0.2, 0.4]
        self.positions = start[:, :, None] + [[0, 0, 0], [0.05, 0.05, 0.1], [0.1, 0.1, -0.02]]
        self.interpolation, self.compliance = "minimum_jerk", 0.0 if rigid else 1e-3


COARSE, DOUBLES = 12, 36  # substeps a frame, with coordinates as floats and as doubles


def solver(
    kind, plan, worlds=1, *, self_contact=False, device="cpu", damping=0.001, cells=CELLS, substeps=COARSE,
    stretch=1000.0,
):  # fmt: skip
    """A cloth over a ball and a table, held at two corners and pushed, its rest shape wrinkled."""
    cloth = topology(kind, cells)
    wrinkles = np.random.default_rng(1).normal(scale=0.003, size=cloth.rest.shape)
    positions = np.repeat((cloth.rest + wrinkles + [0, 0, 0.1])[None], worlds, axis=0)
    made = ClothSolver(
        cloth, nuno.Cloth(damping=damping, thickness=0.004, stretch_stiffness=stretch), positions,
        np.zeros_like(positions), device=device, substeps=substeps, self_contact=self_contact, plan=plan,
    )  # fmt: skip
    shapes = [nuno.box((1, 1, 0.02), position=(0, 0, -0.01)), nuno.sphere(0.04, position=(0.05, 0, 0.03))]
    made.set_colliders(Colliders.from_bodies(shapes, worlds, device))
    made.set_grips([Grip(positions), Grip(positions, rigid=False)])
    made.set_forces(np.full(positions.shape, 1e-4))
    return made


def outcome(made, seconds=0.5):
    """Positions and velocities of the first world."""
    made.run(0.0, seconds)
    return made.local_positions()[0], made.velocities()[0]


@pytest.mark.parametrize(
    ("substeps", "plan"),
    [
        (COARSE, "lanes"), (DOUBLES, "lanes"), pytest.param(COARSE, "scalar", marks=pytest.mark.long),
        pytest.param(DOUBLES, "scalar", marks=pytest.mark.slow),  # in doubles the grid plan has the same source
    ],
)  # fmt: skip
@pytest.mark.parametrize("self_contact", [False, True])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_scalar_vector_and_lanes_give_the_same_bits(kind, self_contact, substeps, plan):
    """Promise: one source, three layouts, no bit of difference. The scalar one is that of no program on the CPU."""
    expected = outcome(solver(kind, "vector", self_contact=self_contact, substeps=substeps))
    assert expected[0].dtype == (np.float32 if substeps == COARSE else np.float64)
    worlds = 3 if plan == "lanes" else 1
    found = outcome(solver(kind, "fused", worlds, self_contact=self_contact, substeps=substeps))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.long
@pytest.mark.parametrize(("worlds", "substeps"), [(1, COARSE), (3, COARSE), (3, DOUBLES)])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_the_grid_plan_gives_the_bits_of_the_fused_one(kind, worlds, substeps):
    """Promise: without self-contact, whose sums are in fixed point, the colours' order is all that counts."""
    expected = outcome(solver(kind, "fused", worlds, substeps=substeps))
    np.testing.assert_array_equal(outcome(solver(kind, "grid", worlds, substeps=substeps)), expected)


SINGLE = (("fused", 1),)
SEVERAL = (("fused", 3), ("grid", 1), ("grid", 3))


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "stretch", "plans"),
    [
        ("mesh", 1000.0, SEVERAL + SINGLE), ("mesh", 4000.0, SEVERAL + SINGLE),
        # in doubles
        ("sheet", 1000.0, SEVERAL), ("sheet", 4000.0, SEVERAL),
        *(pytest.param("sheet", stretch, SINGLE, marks=pytest.mark.slow) for stretch in (1000.0, 4000.0)),
    ],
)  # fmt: skip
def test_sweeps_give_the_same_bits_in_all_plans(kind, stretch, plans):
    """Promise: a substep that goes through shear and stretch several times does so alike in every plan."""
    made = solver(kind, "vector", substeps=None, stretch=stretch)
    assert made.sweeps > 1
    expected = outcome(made)
    for plan, worlds in plans:
        found = outcome(solver(kind, plan, worlds, substeps=None, stretch=stretch))
        np.testing.assert_array_equal(found, expected, err_msg=f"{plan}, {worlds} worlds")


@pytest.mark.parametrize(
    ("substeps", "plan"),
    [
        (None, "lanes"), pytest.param(DOUBLES, "lanes", marks=pytest.mark.long),
        pytest.param(None, "scalar", marks=pytest.mark.long), pytest.param(DOUBLES, "scalar", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_taut_lines_have_the_same_bits_in_all_plans(substeps, plan):
    """Promise: forces that turn with taut edges do so alike; a world of slack lines beside keeps its own."""

    def made(kind, worlds, strain):
        cloth = solver("sheet", kind, worlds, substeps=substeps)
        x = cloth.positions() * np.stack([1.0 + strain, np.ones_like(strain), np.ones_like(strain)], axis=-1)
        cloth.set_state(x, np.zeros_like(x))
        return cloth

    def taut(cloth):  # the largest (omega dt)^2 along warp
        return 4.0 * 1000.0 * 0.25 / (0.2 * (0.03 * 60.0 * cloth.substeps) ** 2)

    expected = outcome(made("vector", 1, np.array(0.25)), 0.1)
    slack = outcome(made("vector", 1, np.array(0.0)), 0.1)
    strain = np.array([[0.25], [0.0], [0.0]])
    several = made("fused", 3, strain) if plan == "lanes" else made("fused", 1, strain[0])
    assert 1.0 < taut(several) < 4.0  # beyond the onset in the first substeps
    np.testing.assert_array_equal(outcome(several, 0.1), expected)
    if plan == "lanes":
        for world in (1, 2):
            np.testing.assert_array_equal(several.local_positions()[world], slack[0])


@pytest.mark.long
@pytest.mark.parametrize("worlds", [1, 3])
def test_the_grid_plan_lists_the_pairs_of_the_fused_one(worlds, monkeypatch):
    """Invariant: the listing by many threads finds as many pairs of edges; none touches yet, so that all else is equal.

    The test of a vertex and a triangle lets pairs through that are not near, more or fewer by how they are looked for.
    """
    monkeypatch.setattr("nuno.solvers.cloth_solver.LIST_MARGIN", 0.35)  # the fused plan's
    made = [solver("sheet", plan, worlds, self_contact=True) for plan in ("fused", "grid")]
    for each in made:
        each.run(0.0, 1.0 / 60.0 / 12.0)
    assert made[0].pair_counts.min() > 0
    np.testing.assert_array_equal(made[0].pair_counts[:, 1], made[1].pair_counts[:, 1])
    np.testing.assert_allclose(made[0].pair_counts[:, 0], made[1].pair_counts[:, 0], rtol=0.5)


@pytest.mark.long
def test_pairs_of_blocks_that_were_not_noted_are_found(monkeypatch):
    """Promise: where there is no room to note all near pairs of blocks, all are gone through, and as many listed."""
    counts = []
    for room in (24, 0.1):
        monkeypatch.setattr("nuno.contact.self.group_search.ROOM", room)
        made = solver("sheet", "grid", 2, self_contact=True)
        made.run(0.0, 1.0 / 60.0 / 12.0)
        counts.append(made.pair_counts)
    assert counts[0].min() > 0
    np.testing.assert_array_equal(*counts)


@pytest.mark.long
def test_the_grid_plan_keeps_layers_apart():
    """A sheet folded onto itself rests as two layers, at most 10 % of the thickness nearer than in the fused plan.

    Contacts that share a particle are averaged instead of taken one after the other, so the bits differ.
    """
    gaps = []
    for plan in ("fused", "grid"):
        cloth = ClothTopology.sheet((12, 6), (0.24, 0.12))
        x = cloth.rest.copy()
        over = x[:, 0] > 0
        x[:, 2] = np.where(over, 0.01, 0.002)
        x[over, 0] *= -1
        made = ClothSolver(
            cloth, nuno.Cloth(thickness=0.004, air_drag=5.0), x[None], np.zeros((1, *x.shape)), substeps=20, plan=plan
        )
        made.set_colliders(Colliders.from_bodies([nuno.plane()], 1, "cpu"))
        made.run(0.0, 0.5)
        z = made.positions()[0, :, 2]
        gaps.append(z[over & (x[:, 0] < -0.03)].min() - z[~over].min())
    assert gaps[1] > gaps[0] - 0.0004


@pytest.mark.parametrize("plan", ["fused", pytest.param("grid", marks=pytest.mark.long)])
def test_each_world_of_a_batch_touches_itself_as_it_does_alone(plan):
    """Promise: same bits in any place of a batch, self-contact included; the cloth hangs from two corners and folds."""
    alone = solver("sheet", "vector" if plan == "fused" else plan, self_contact=True)
    expected, _ = outcome(alone)
    assert alone.pair_counts.min() > 0
    many = solver("sheet", plan, 4, self_contact=True)
    outcome(many)
    for found in many.local_positions():
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("plan", ["vector", pytest.param("grid", marks=pytest.mark.long)])
def test_a_run_in_pieces_is_the_run_in_one(plan):
    """Invariant: whole frames one at a time, under settings made anew, change no bit in any plan."""
    whole, pieces = solver("sheet", plan), solver("sheet", plan)
    whole.run(0.0, 0.1)
    for k in range(6):
        pieces.run(k / 60.0, 1.0 / 60.0)
    np.testing.assert_array_equal(pieces.local_positions(), whole.local_positions())


def test_more_rigid_and_finer_cloth_takes_more_substeps():
    """The rule of ``default_substeps``: dt in proportion to h in plane, to h^2 in bending."""
    coarse, fine = (ClothTopology.sheet((n, n), (1.0, 1.0)) for n in (16, 32))
    frame = 1.0 / 60.0
    assert default_substeps(fine, 9.81, frame) == pytest.approx(2 * default_substeps(coarse, 9.81, frame), abs=1)
    stiff = [default_substeps(t, 9.81, frame, 0.2, b) for t, b in ((coarse, 5.0), (fine, 5.0 / 16))]
    assert stiff[1] == pytest.approx(stiff[0], abs=1) and stiff[0] > default_substeps(coarse, 9.81, frame)


# One constraint at a time: as floats, as sixteen worlds, and as sixteen elements of one world.

SIZE = 64


@wp.kernel(enable_backward=False)
def project_floats(t: StateFloat, which: int, tables: StateFloat):
    """Sixteen elements one after the other."""
    for k in range(LANES):
        a, b, c, d = 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3
        alpha = tables.x[k]
        if which == 0:
            bend_line(t, a, b, c, alpha)
            damp_line(t, a, b, c, alpha, tables.y[k])
        elif which == 1:
            bend_twist(t, a, b, c, d, alpha)
            damp_twist(t, a, b, c, d, alpha, tables.y[k])
        elif which == 2:
            shear_cell(t, a, b, c, d, 0.7, alpha, 0.0, 0.4, 0.5)
        else:
            stretch_triangle(t, a, b, c, -1.3, 0.6, 0.7, alpha, 0.0, 0.4, 0.5)


@wp.kernel(enable_backward=False)
def project_elements(t: StateFloat, which: int, index: wp.array(dtype=lane_int), alphas: wp.array(dtype=lane)):
    """The same sixteen at once."""
    a, b, c, d = index[0], index[1], index[2], index[3]
    alpha = alphas[0]
    gamma = alphas[1]
    if which == 0:
        bend_line(t, a, b, c, alpha)
        damp_line(t, a, b, c, alpha, gamma)
    elif which == 1:
        bend_twist(t, a, b, c, d, alpha)
        damp_twist(t, a, b, c, d, alpha, gamma)
    elif which == 2:
        shear_cell(t, a, b, c, d, lane(0.7), alpha, lane(0.0), 0.4, 0.5)
    else:
        stretch_triangle(t, a, b, c, lane(-1.3), lane(0.6), lane(0.7), alpha, lane(0.0), 0.4, 0.5)


@wp.kernel(enable_backward=False)
def project_worlds(t: StateLanes, which: int, alphas: wp.array(dtype=lane)):
    """One element of sixteen worlds."""
    alpha = alphas[0]
    gamma = alphas[1]
    if which == 0:
        bend_line(t, 0, 1, 2, alpha)
        damp_line(t, 0, 1, 2, alpha, gamma)
    elif which == 1:
        bend_twist(t, 0, 1, 2, 3, alpha)
        damp_twist(t, 0, 1, 2, 3, alpha, gamma)
    elif which == 2:
        shear_cell(t, 0, 1, 2, 3, 0.7, alpha, lane(0.0), 0.4, 0.5)
    else:
        stretch_triangle(t, 0, 1, 2, -1.3, 0.6, 0.7, alpha, lane(0.0), 0.4, 0.5)


def filled(kind, values, dtype):
    """A state whose positions and inverse masses are set."""
    t = kind()
    for name, column in values.items():
        setattr(t, name, wp.array(column, dtype=dtype, device="cpu"))
    return t


@pytest.mark.long
@pytest.mark.parametrize("which", range(4), ids=["line", "twist", "cell", "triangle"])
def test_a_constraint_gives_the_same_bits_in_all_three_layouts(which):
    """Promise: float, sixteen worlds and sixteen elements are one function."""
    random = np.random.default_rng(which)
    values = {name: random.normal(size=SIZE).astype(np.float32) for name in ("x", "y", "z", "vx", "vy", "vz")}
    values["w"] = random.uniform(0.5, 2.0, SIZE).astype(np.float32)
    alphas = random.uniform(0.1, 1.0, (2, LANES)).astype(np.float32)
    floats, elements = (filled(StateFloat, values, float) for _ in range(2))
    tables = filled(StateFloat, {"x": alphas[0], "y": alphas[1]}, float)
    worlds = filled(StateLanes, {n: v.reshape(LANES, 4).T.copy() for n, v in values.items()}, lane)
    wide = wp.array(alphas, dtype=lane, device="cpu")
    index = wp.array(np.arange(SIZE, dtype=np.int32).reshape(LANES, 4).T.copy(), dtype=lane_int, device="cpu")
    wp.launch(project_floats, dim=1, inputs=[floats, which, tables], device="cpu")
    wp.launch(project_elements, dim=1, inputs=[elements, which, index, wide], device="cpu")
    wp.launch(project_worlds, dim=1, inputs=[worlds, which, wide], device="cpu")
    bends = which < 2
    for name in ("x", "y", "z", *(("vx", "vy", "vz") if bends else ())):
        expected = getattr(floats, name).numpy()
        assert (expected != values[name]).sum() > LANES  # it did something
        np.testing.assert_array_equal(getattr(elements, name).numpy(), expected)
        np.testing.assert_array_equal(getattr(worlds, name).numpy().T.ravel(), expected)


@pytest.mark.cuda
@pytest.mark.parametrize("plan", ["fused", "grid"])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_cuda_moves_a_cloth_like_the_cpu(kind, plan):
    """The same phases; fused multiply-adds round otherwise, and a swinging cloth makes 1e-7 m grow to millimetres."""
    expected, _ = outcome(solver(kind, "fused"), 0.2)
    found, _ = outcome(solver(kind, plan, device="cuda:0"), 0.2)
    np.testing.assert_allclose(found, expected, atol=2e-3)


def patchwork(cells, device, shares=(0.0, 1.0)):
    """Positions of a wrinkled sheet after three frames, of which every cell has a material of its own."""
    cloth = ClothTopology.sheet(cells, (0.03 * cells[0], 0.03 * cells[1]))
    random = np.random.default_rng(2)
    wrinkles = random.normal(scale=0.003, size=cloth.rest.shape)
    cell = random.uniform(*shares, (1, cloth.element_count))
    material = nuno.Cloth(
        bending_rigidity=1e-5 * 100**cell, stretch_stiffness=100 + 900 * cell, shear_stiffness=10 + 90 * cell,
        damping=0.001,
    )  # fmt: skip
    made = ClothSolver(
        cloth, material, (cloth.rest + wrinkles)[None], np.zeros((1, *cloth.rest.shape)), device=device, substeps=12,
        self_contact=False, plan="fused",
    )  # fmt: skip
    return outcome(made, 0.05)[0]


@pytest.mark.cuda
@pytest.mark.parametrize("cells", [(1, 2), (1, 3), (13, 9), (70, 6), (6, 70), (4, 200), (3, 260)])
def test_cuda_tells_cells_apart_in_sheets_of_any_shape(cells):
    """Beside the CPU: what strips, lines and grid lines a warp has threads for, and what it has not.

    10 um: rounding; one material everywhere makes 0.9 (2 and 3 cells) to 7 mm.
    """
    expected = patchwork(cells, "cpu")
    assert np.abs(patchwork(cells, "cpu", (0.5, 0.5)) - expected).max() > 5e-4
    np.testing.assert_allclose(patchwork(cells, "cuda:0"), expected, atol=1e-5)


@pytest.mark.cuda
@pytest.mark.parametrize("plan", ["fused", "grid"])
def test_cuda_repeats_bit_for_bit_and_world_by_world(plan):
    """Promise: same input, same bits, in any place of a batch, self-contact included.

    Many worlds run with fewer threads, or fewer blocks, each than few do; of 150 a block group takes several in turn,
    and so does a block of 150 and of 1,000, but not of 300, on a device with 132 multiprocessors.
    """
    alone = outcome(solver("sheet", plan, device="cuda:0", self_contact=True))
    for worlds in (1, 5, *{"fused": (150, 300, 1000), "grid": (150,)}[plan]):
        again = solver("sheet", plan, worlds, device="cuda:0", self_contact=True)
        np.testing.assert_array_equal(outcome(again), alone)
        np.testing.assert_array_equal(again.local_positions(), np.broadcast_to(alone[0], again.local_positions().shape))


@pytest.mark.cuda
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_block_groups_have_the_bits_of_blocks(kind):
    """Promise: same bits of a cloth in any batch, by block groups where worlds are few, by blocks where many."""
    found = []
    for worlds, plan in ((1, "grid"), (5, "grid"), (140, "fused")):
        made = solver(kind, "auto", worlds, device="cuda:0", self_contact=True, cells=(47, 43), substeps=DOUBLES)
        assert made.plan == plan
        found.append(outcome(made))
        assert made.pair_counts.sum(axis=1).min() > 0
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@pytest.mark.cuda
@pytest.mark.parametrize("cells", [CELLS, (44, 33)], ids=["all", "a part"])
def test_shared_memory_changes_no_bit(cells):
    """Promise: where the positions lie while they are worked on is of no account, whether all or some of it fits."""
    found = []
    for shared in (False, True):
        made = solver("sheet", "fused", device="cuda:0", self_contact=True, cells=cells)
        made.shared_memory = shared
        found.append(outcome(made))
    np.testing.assert_array_equal(found[0], found[1])
