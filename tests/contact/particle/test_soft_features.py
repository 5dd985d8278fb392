"""Edges, corners, rims and small balls do not stand through between a soft body's vertices."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.mesh.tetrahedra import box_tetrahedra
from nuno.plans.soft_block_plan import FAR, FEATURES
from nuno.shapes import quaternion as quat
from nuno.solvers.soft_solver import SoftSolver
from nuno.state.cloth_state import ALL_PARTS
from nuno.tables.colliders import Colliders
from nuno.topology.soft_topology import SoftTopology
from soft_slabs import assert_plans_agree, surface

SIDE = 0.1
LEFT = 1e-4  # [m] what one pass a substep leaves of a push where neighbours push too
DEVICES = pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])


def outside_of_box(points, box):
    """Return how far points are beyond the nearest of a box's faces' planes that they are beyond; negative inside."""
    local = quat.rotate(np.asarray(box.quaternion) * [1, -1, -1, -1], points - box.position)
    return (np.abs(local) - 0.5 * np.asarray(box.shape.size)).max(axis=1)


def soft(**changed):
    """Return a soft material in which a cube of 0.1 m sinks by about 1 mm under its weight."""
    return nuno.Soft(**{"density": 1000.0, "youngs_modulus": 5e4, "poisson_ratio": 0.3, "friction": 0.5, **changed})


def cube_over(shapes, cells, position, material, speed=0.0, gravity=(0.0, 0.0, -9.81), device="cpu"):
    """Return a world with still shapes and a soft cube over them that goes down at ``speed`` [m/s], and the cube."""
    world = nuno.World(device=device, gravity=gravity)
    for shape in shapes:
        world.add(shape)
    cube = world.add(nuno.soft_box((SIDE, SIDE, SIDE), cells=(cells, cells, cells), position=position))
    world.attach(cube, material)
    solver = cube._dynamics.solver
    start = solver.positions()
    solver.set_state(start, np.broadcast_to([0.0, 0.0, -speed], start.shape).copy())
    return world, cube


def rails(friction=0.5):
    """Return two upright plates of 4 mm along x, their upper edges between the rows of vertices of a cube's cells."""
    places = [("left", -0.0325), ("right", 0.0325)]
    return [nuno.box((0.6, 0.004, 0.2), name=name, position=(0, y, -0.1), friction=friction) for name, y in places]


@DEVICES
@pytest.mark.parametrize("cells", [4, pytest.param(8, marks=pytest.mark.long)])
def test_thin_plates_bear_a_soft_cube_on_their_edges(cells, device):
    """Geometry and balance: plates between rows of vertices stay outside of all of the surface, and bear its weight."""
    plates = rails()
    world, cube = cube_over(plates, cells, (0, 0, 0.5 * SIDE + 0.005), soft(damping=0.02), device=device)
    lowest = 1.0
    for _ in range(60):
        world.run(1.0 / 60.0)
        points = surface(cube)
        lowest = min(lowest, *(outside_of_box(points, plate).min() for plate in plates))
    assert lowest > -LEFT
    # single vertices by the plates move on by what elasticity moves them in a substep, 0.03 mm
    assert np.linalg.norm(cube.velocities, axis=1).max() < 0.1
    found = world.contacts(cube)
    assert set(found.others) == {plate.name for plate in plates}
    # one substep of a cube that nearly rests
    np.testing.assert_allclose(found.forces.sum(axis=0), [0, 0, 1000.0 * SIDE**3 * 9.81], rtol=0.02, atol=0.1)


@DEVICES
@pytest.mark.parametrize("speed", [1.0, 2.0])
@pytest.mark.parametrize("part", [0.1, 0.4])
def test_a_ball_smaller_than_a_cell_dents_a_soft_cube(part, speed, device):
    """Invariant: a ball driven 30 mm into a face between its vertices never has any of the surface inside of it."""
    cell = SIDE / 4
    radius = part * cell
    ball = nuno.sphere(radius, position=(0.4 * cell, 0.3 * cell, SIDE + radius + 0.005))
    world, cube = cube_over([nuno.plane(), ball], 4, (0, 0, 0.5 * SIDE), soft(), device=device)
    start, depth = np.array(ball.position), np.array([0, 0, 0.035])
    world.move(ball, nuno.Path([0.0, 0.035 / speed], [start, start - depth]))
    nearest = 1.0
    for _ in range(round(0.06 / speed * 240)):
        world.run(1.0 / 240.0)
        nearest = min(nearest, np.linalg.norm(surface(cube, 20) - ball.position, axis=1).min() - radius)
    assert nearest > -LEFT


@DEVICES
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_soft_cube_hangs_over_the_edge_of_a_table(turn, device):
    """Geometry: the edge does not cut into a soft cube, a third of which hangs over it, and friction holds it there."""
    table = nuno.box((0.4, 0.4, 0.1), position=(-0.2, 0, -0.05)).rotate(turn, "z")
    world, cube = cube_over(
        [table], 4, (-0.02, 0.003, 0.5 * SIDE), soft(youngs_modulus=2e4, damping=0.02, friction=1.0), device=device
    )
    lowest = 1.0
    for _ in range(60):
        world.run(1.0 / 60.0)
        lowest = min(lowest, outside_of_box(surface(cube), table).min())
    assert lowest > -LEFT
    before = cube.vertices
    world.run(1.0)
    assert np.abs(cube.vertices - before).mean() < 1e-4


@DEVICES
@pytest.mark.parametrize("place", [(0.4, 0.3), (0.66, 0.33)])
def test_a_soft_cube_dropped_on_a_corner_is_not_pierced(place, device):
    """Invariant: at 0.5 m/s onto a corner that points up between its vertices, all of the surface stays outside."""
    box = nuno.box((0.1, 0.1, 0.1)).rotate(np.arctan(np.sqrt(2.0)), "y").rotate(0.25 * np.pi, "z")
    corners = box.vertices
    box.locate(-corners[corners[:, 2].argmax()])
    cell = SIDE / 4
    world, cube = cube_over(
        [box], 4, (place[0] * cell, place[1] * cell, 0.5 * SIDE + 0.001), soft(), speed=0.5, device=device
    )
    lowest = 1.0
    for _ in range(30):
        world.run(1.0 / 120.0)
        lowest = min(lowest, outside_of_box(surface(cube), box).min())
    assert lowest > -LEFT


@pytest.mark.parametrize(("youngs_modulus", "speed"), [(5e4, 1.0), (5e4, 2.0), (1e4, 1.0)])
def test_a_corner_does_not_pierce_what_it_crushes(youngs_modulus, speed):
    """Geometry: elements turn inside out over the corner, and what that moves must not pass through it."""
    box = nuno.box((0.1, 0.1, 0.1)).rotate(np.arctan(np.sqrt(2.0)), "y").rotate(0.25 * np.pi, "z")
    corners = box.vertices
    box.locate(-corners[corners[:, 2].argmax()])
    cell = SIDE / 8
    material = soft(youngs_modulus=youngs_modulus)
    world, cube = cube_over([box], 8, (0.4 * cell, 0.3 * cell, 0.5 * SIDE + 0.001), material, speed=speed)
    lowest, tets, inverted = 1.0, cube._dynamics.solver.topology.tets, 0
    for _ in range(36):
        world.run(1.0 / 120.0)
        lowest = min(lowest, outside_of_box(surface(cube), box).min())
        x = cube._dynamics.solver.positions()[0]
        inverted += int((np.linalg.det(x[tets[:, 1:]] - x[tets[:, :1]]) < 0.0).sum())
    assert inverted
    # they were 0.17, 0.41 and 0.57 cells in; one pass a substep leaves 0.02 where many elements press on a few
    assert lowest > -0.05 * cell


@DEVICES
@pytest.mark.parametrize("radius", [0.015, 0.03])
def test_the_rim_of_a_can_does_not_cut_into_a_soft_cube(radius, device):
    """Geometry: the surface stays outside of a can that a cube falls on, slimmer than a cell or not."""
    can = nuno.cylinder(radius, 0.1, position=(0, 0, -0.05))
    world, cube = cube_over([can], 4, (0.01, 0.007, 0.5 * SIDE + 0.001), soft(), device=device)
    for _ in range(30):
        world.run(1.0 / 60.0)
        x = surface(cube)
        assert np.maximum(np.hypot(x[:, 0], x[:, 1]) - radius, np.abs(x[:, 2] + 0.05) - 0.05).min() > -LEFT


@DEVICES
@pytest.mark.parametrize("ratio", [0.9, 1.3])
def test_friction_on_edges_is_that_of_faces(ratio, device):
    """Coulomb: on the edges of two tilted rails a cube stays, or slides at g (sin - mu cos)."""
    mu = 0.3
    tilt = np.arctan(ratio * mu)
    gravity = (9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt))
    world, cube = cube_over(
        rails(mu), 4, (0, 0, 0.5 * SIDE), soft(damping=0.02, friction=mu), gravity=gravity, device=device
    )
    world.run(0.4)
    before, speed = cube.vertices, cube.velocities[:, 0].mean()
    world.run(0.2)
    if ratio < 1.0:
        assert np.abs(cube.vertices - before).max() < 1e-4
    else:
        gained = cube.velocities[:, 0].mean() - speed
        assert gained == pytest.approx(0.2 * 9.81 * (np.sin(tilt) - mu * np.cos(tilt)), rel=0.05)


def crowded(count, substeps=None, device="cpu"):
    """Return worlds with sharp shapes, still and moving, of all kinds, where a soft slab falls."""
    world = nuno.World(device=device, substeps=substeps)
    world.add(nuno.box((0.2, 1.0, 0.2), name="table", position=(0, 0, -0.1)))
    world.add(nuno.sphere(0.008, name="ball", position=(0.07, 0, 0.0)))
    world.add(nuno.cylinder(0.02, 0.1, name="can", position=(0.0, 0.05, 0.0)))
    world.add(nuno.capsule(0.01, 0.1, name="finger", position=(-0.05, -0.05, 0.0)))
    world.add(nuno.soft_box((0.2, 0.2, 0.06), cells=(6, 6, 2), name="slab", position=(0.0, 0, 0.09)))
    return world.imagine(count) if count > 1 else world


@DEVICES
@pytest.mark.parametrize("substeps", [16, pytest.param(30, marks=pytest.mark.long)])
def test_a_world_of_a_batch_meets_edges_as_alone(substeps, device):
    """Promise: bit for bit, in 18 worlds (more than the lanes of a vector), of which some meet no edge."""
    shift = np.linspace(0.0, 0.6, 18)

    def run(which):
        world = crowded(18 if which is None else 1, substeps, device)
        chosen = slice(None) if which is None else which
        world.find("table").locate(np.stack([shift, 0 * shift, -0.1 + 0 * shift], axis=1)[chosen])
        goal = np.stack([0.15 - shift, 0 * shift, 0 * shift], axis=1)
        places = np.stack([np.broadcast_to([0.15, 0, -0.05], goal.shape), goal], axis=1)
        world.move("ball", nuno.Path([0.0, 0.4], places[chosen]))
        world.attach("slab", soft(youngs_modulus=2e4))
        world.run(0.3)
        return world.find("slab").vertices

    batch = run(None)
    for k in (0, 1, 16, 17):
        np.testing.assert_array_equal(batch[k], run(k))


@pytest.mark.long
@pytest.mark.parametrize("substeps", [20, pytest.param(40, marks=pytest.mark.slow)])
def test_all_plans_meet_edges_alike(substeps):
    """One source: sixteen particles at a time and one by one give the same bits, with floats and with doubles."""
    world = crowded(1)
    shapes = [world.find(name) for name in ("table", "ball", "can", "finger")]
    assert_plans_agree(shapes, soft(), substeps)


@pytest.mark.long
def test_the_kernels_of_cuda_take_turns():
    """One source: those without sharp shapes stop at the frame in which some are near, and the others do the rest."""
    substeps = 20  # at which coordinates are floats: the kernels for doubles ask for shared memory, CUDA's alone
    topology = SoftTopology.of(*box_tetrahedra((0.1, 0.1, 0.1), (4, 4, 4)))
    start = topology.rest[None] + np.array([0.0, 0.0, 0.15])
    solver, other = (
        SoftSolver(topology, soft(), start, 0 * start, substeps=substeps, plan="fused") for _ in range(2)
    )  # fmt: skip
    colliders = Colliders.from_bodies(rails())
    for made in (solver, other):
        made.set_colliders(colliders)
    other.run(0.0, 0.4)
    run = solver.settings(0.0, 1.0 / 60.0 / substeps, substeps)
    solver._reset_clock()
    gone = []
    for kernels, sides in ((FAR, solver._far_surface), (FEATURES, solver._surface)):
        inputs = [solver.state, solver.device_topology, sides, solver._size, run, solver.shapes, 24 * substeps, 1]
        wp.launch(kernels["blocks"], dim=1, inputs=inputs, device="cpu", block_dim=1)
        gone.append(int(solver.state.reached.numpy()[0]))
    assert 0 < gone[0] < gone[1] == 24 * substeps
    assert gone[0] % substeps == 0
    np.testing.assert_array_equal(solver.positions(), other.positions())
    # one substep by itself is done by those that know of sharp shapes, whatever was done before
    for made in (solver, other):
        made.open(0.4, 1.0 / 60.0 / substeps, substeps)
    other.step_parts(0, ALL_PARTS)
    run = solver.opened
    inputs = [solver.state, solver.device_topology, solver._surface, solver._size, run, solver.shapes, 1, 1]
    wp.launch(FEATURES["blocks"], dim=1, inputs=inputs, device="cpu", block_dim=1)
    np.testing.assert_array_equal(solver.positions(), other.positions())


def test_a_soft_body_far_from_the_rim_of_its_table_asks_for_nothing():
    """Promise: where no edge is in reach nothing is listed, and the bits are those of a table without end."""

    def run(side):
        table = nuno.box((side, side, 0.04), position=(0, 0, -0.02))
        world, cube = cube_over([table], 3, (0, 0, 0.06), soft())
        world.run(0.3)
        return cube

    near, far = run(0.5), run(8.0)
    np.testing.assert_array_equal(near.vertices, far.vertices)
    assert near._dynamics.solver.state.feature_shapes.numpy()[0] == 0
    assert run(0.14)._dynamics.solver.state.feature_shapes.numpy()[0] == 1


def test_small_shapes_alone_are_sharp():
    """Rule: boxes and cylinders have edges, balls are sharp under three cells; the rest needs no second launch."""
    _, cube = cube_over([nuno.plane()], 4, (0, 0, 0.1), soft())
    solver = cube._dynamics.solver
    cell = SIDE / 4
    for shape, sharp in (
        (nuno.plane(), False), (nuno.sphere(3.1 * cell), False), (nuno.sphere(2.9 * cell), True),
        (nuno.capsule(2.9 * cell, 1.0), True), (nuno.cylinder(1.0, 1.0), True), (nuno.box((1, 1, 1)), True),
        (nuno.Body(nuno.Hull.of(nuno.box((1, 1, 1)).vertices)), True),
    ):  # fmt: skip
        solver.set_colliders(Colliders.from_bodies([nuno.plane(), shape]))
        assert solver._has_features == sharp
    solver.set_colliders(None)
    assert not solver._has_features
