"""Rigid bodies that rest on each other: stacks, friction, bins, and what must not pass through what."""

import numpy as np
import pytest
import trimesh

from nuno.rigid.convex_parts import rigid_shape
from nuno.shapes.compound import Compound
from nuno.shapes.mass_properties import mass_properties
from nuno.shapes.shape import Box, Capsule, Cylinder, Sheet, Sphere, TriangleMesh
from nuno.solvers.rigid_solver import RigidSolver
from rigid_with import GRAVITY, about, drop, on_floor, places, put

CUBE = Box((0.1, 0.1, 0.1))


def test_ten_boxes_stand():
    """Promise: a stack of ten drifts under 1 mm in 5 s, from the start on."""
    solver = on_floor()
    slots = [drop(solver, CUBE, (0, 0, 0.05 + 0.1 * k)) for k in range(10)]
    start = places(solver, slots)
    solver.run(0.0, 5.0)
    assert np.abs(places(solver, slots) - start).max() < 1e-3
    assert max(np.abs(solver.velocity(slot)[0]).max() for slot in slots) < 1e-3


@pytest.mark.parametrize(
    "order", [range(10), range(9, -1, -1), (3, 7, 1, 9, 0, 5, 8, 2, 6, 4)], ids=["up", "down", "mixed"]
)
def test_ten_boxes_dropped_askew_come_to_rest(order):
    """Promise: turned at random about the vertical, 3 mm off and let fall 1 mm each, they stand, added in any order."""
    solver = on_floor()
    random = np.random.default_rng(0)
    poses = [
        ((*random.normal(0, 0.003, 2), 0.05 + 0.101 * k), about((0, 0, 1), 17 * random.normal())) for k in range(10)
    ]
    added = {k: drop(solver, CUBE, *poses[k]) for k in order}
    slots = [added[k] for k in range(10)]
    solver.run(0.0, 5.0)
    start = places(solver, slots)
    solver.run(5.0, 5.0)
    moved = places(solver, slots) - start
    # overlaps of up to 20 um are left alone, ten of them
    np.testing.assert_allclose(places(solver, slots)[:, 2], 0.05 + 0.1 * np.arange(10), atol=3e-4)
    assert np.abs(moved).max() < 1e-3  # the drift that is promised of a straight stack


def test_crossing_boards_rest():
    """Face on face that share no corner: eight boards across each other drift under 0.1 mm."""
    solver = on_floor()
    slots = [
        drop(solver, Box((0.5, 0.05, 0.02)), (0, 0, 0.01 + 0.02 * k), about((0, 0, 1), 90 * (k % 2) + 10))
        for k in range(8)
    ]
    solver.run(0.0, 1.0)
    start = places(solver, slots)
    solver.run(1.0, 3.0)
    np.testing.assert_allclose(places(solver, slots), start, atol=1e-4)
    np.testing.assert_allclose(start[:, 2], 0.01 + 0.02 * np.arange(8), atol=3e-4)  # 20 um a layer


@pytest.mark.parametrize("heavy_first", [False, True])
def test_a_heavy_box_stands_on_a_light_one(heavy_first):
    """Promise: a hundred times the mass on top, for 10 s."""
    solver = on_floor()
    boxes = [((0, 0, 0.05), 100.0), ((0, 0, 0.15), 10000.0)]
    slots = [drop(solver, CUBE, place, density=rho) for place, rho in (boxes[::-1] if heavy_first else boxes)]
    slots = slots[::-1] if heavy_first else slots
    solver.run(0.0, 10.0)
    np.testing.assert_allclose(places(solver, slots), [[0, 0, 0.05], [0, 0, 0.15]], atol=1e-3)


@pytest.mark.parametrize("ramp", ["plane", "box", "mesh"])
@pytest.mark.parametrize(("friction", "degrees"), [(0.5, 30.0), (0.2, 20.0), (0.0, 30.0), (0.9, 60.0)])
def test_a_box_slides_down_an_incline_as_coulomb_says(ramp, friction, degrees):
    """Closed form: g (sin - mu cos), within 2 % (issued tolerance)."""
    slope = np.radians(degrees)
    solver, body = on_ramp(ramp, friction, slope)
    start = solver.pose(body)[0][0]
    solver.run(0.0, 0.6)
    expected = 0.5 * GRAVITY * (np.sin(slope) - friction * np.cos(slope)) * 0.36
    assert np.linalg.norm(solver.pose(body)[0][0] - start) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("ramp", ["plane", "box", "mesh"])
@pytest.mark.parametrize(("friction", "degrees"), [(0.5, 26.0), (0.2, 11.0), (1.0, 44.0)])
def test_a_box_below_the_angle_of_friction_does_not_creep(ramp, friction, degrees):
    """Coulomb: tan < mu holds it for ever; promised: under 0.02 mm in 10 s."""
    solver, body = on_ramp(ramp, friction, np.radians(degrees))
    solver.run(0.0, 0.2)  # it may settle onto the ramp
    start = solver.pose(body)[0][0]
    solver.run(0.2, 10.0)
    assert np.abs(solver.pose(body)[0][0] - start).max() < 2e-5


def on_ramp(ramp, friction, slope):
    """Return a solver and the slot of a flat box on a ramp whose gravity is turned instead."""
    solver = RigidSolver(gravity=(GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)))
    if ramp == "plane":
        solver = on_floor(slope=slope, friction=friction)
    elif ramp == "box":
        put(solver, Box((8.0, 1.0, 0.2)), (0, 0, -0.1), friction=friction)
    else:
        ground = trimesh.creation.box((8.0, 1.0, 0.2)).subdivide().subdivide().subdivide()
        ground.apply_translation((0, 0, -0.1))
        shape = TriangleMesh(np.asarray(ground.vertices), np.asarray(ground.faces))
        put(solver, shape, shape.centre, friction=friction)
    return solver, drop(solver, Box((0.1, 0.1, 0.05)), (-1.0, 0.013, 0.025), about((0, 0, 1), 17), friction=friction)


def test_friction_of_a_pair_is_the_geometric_mean_and_can_be_set():
    """Promise of the interface: 0.9 on 0.4 is 0.6, which holds at 30 degrees; set to 0.5 it does not."""
    slope = np.radians(30.0)
    for pair, holds in ((None, True), (0.5, False)):
        solver = on_floor(slope=slope, friction=0.4)
        body = drop(solver, Box((0.1, 0.1, 0.05)), (0, 0, 0.025), friction=0.9)
        if pair is not None:
            solver.set_exceptions({(body, 0): pair})
        solver.run(0.0, 0.5)
        assert (abs(solver.pose(body)[0][0, 0]) < 1e-4) == holds


def test_bodies_that_ignore_each_other_pass():
    """Promise of the interface: by pair, and by groups."""
    solver = on_floor()
    first = drop(solver, CUBE, (0, 0, 0.5))
    second = drop(solver, CUBE, (1, 0, 0.5), group=2)
    third = drop(solver, CUBE, (2, 0, 0.5), collides_with=~1)
    solver.set_exceptions({(0, first): None})
    solver.run(0.0, 0.6)
    heights = places(solver, [first, second, third])[:, 2]
    assert heights[0] < -0.5 and heights[2] < -0.5
    assert heights[1] == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize(
    ("shape", "turn", "height"),
    [
        (Sphere(0.05), (0, 0), 0.05),
        (Capsule(0.03, 0.1), (90, 0), 0.03),
        (Cylinder(0.05, 0.1), (0, 0), 0.05),
        (Cylinder(0.05, 0.12), (90, 0), 0.05),
        (Box((0.1, 0.2, 0.06)), (90, 0), 0.1),
        (TriangleMesh(*(lambda m: (np.array(m.vertices), np.array(m.faces)))(trimesh.creation.box((0.1, 0.2, 0.06)))),
         (0, 90), 0.05),
    ],
    ids=["sphere", "capsule", "cylinder", "cylinder on its side", "box", "convex mesh"],
)  # fmt: skip
@pytest.mark.parametrize("ground", ["plane", "box", "mesh", "sheet", "body"])
def test_every_shape_rests_on_every_ground(shape, turn, height, ground):
    """Equilibrium: let go 1 cm up, it comes to rest at its own height; the ground's top is at 0."""
    solver = RigidSolver()
    if ground == "plane":
        solver = on_floor()
    elif ground == "box":
        put(solver, Box((1.0, 1.0, 0.1)), (0, 0, -0.05))
    elif ground == "body":
        drop(solver, Box((1.0, 1.0, 0.1)), (0, 0, -0.05))
        put(solver, Box((2.0, 2.0, 0.1)), (0, 0, -0.15))
    else:
        block = trimesh.creation.box((1.0, 1.0, 0.1)).subdivide().subdivide()
        mesh = TriangleMesh(np.array(block.vertices) - [0, 0, 0.05], np.array(block.faces))
        if ground == "mesh":
            put(solver, mesh, mesh.centre)
        else:
            vertices, faces = Sheet((1.0, 1.0), (10, 10)).mesh()
            cloth = rigid_shape(TriangleMesh(vertices, faces), moves=False, thickness=0.004)
            solver.add(cloth, position=(0, 0, -0.002))
    q = about((1, 0, 0), turn[0]) if turn[0] else about((0, 1, 0), turn[1])
    body = drop(solver, shape, (0.013, 0.021, height + 0.01), q)
    solver.run(0.0, 1.5)
    place, velocity = solver.pose(body)[0][0], solver.velocity(body)[0][0]
    # overlaps of up to 20 um are left alone, two of them on a ground that is a body itself
    assert place[2] == pytest.approx(height, abs=1e-4)
    assert abs(velocity[2]) < 1e-3


def test_a_compound_stands_where_its_parts_alone_would_fall():
    """A table of a plate and four legs stands on its legs, and carries a box beside its middle."""
    legs = [(Box((0.04, 0.04, 0.3)), (x, y, 0.15)) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
    table = Compound(((Box((0.5, 0.5, 0.02)), (0, 0, 0.31)), *legs))
    centre = mass_properties(table).centre
    solver = on_floor()
    slots = [drop(solver, table, centre + np.array([0, 0, 0.01])), drop(solver, CUBE, (0.15, 0.1, 0.4))]
    solver.run(0.0, 2.0)
    np.testing.assert_allclose(places(solver, slots), [centre, [0.15, 0.1, 0.37]], atol=1e-3)  # a fall of 3 cm


def test_nothing_tunnels():
    """Promise: 2 cm boxes at 10 m/s, spinning, in any phase of a step, stop at a 1 cm plate of any kind."""
    worlds = 24
    random = np.random.default_rng(0)
    small = Box((0.02, 0.02, 0.02))
    weighed = mass_properties(small)
    plate = trimesh.creation.box((4.0, 4.0, 0.01)).subdivide()
    mesh = TriangleMesh(np.array(plate.vertices) - [0, 0, 0.005], np.array(plate.faces))
    sheet = TriangleMesh(*Sheet((4.0, 4.0), (20, 20)).mesh())
    for ground, thickness in ((Box((4.0, 4.0, 0.01)), 0.0), (mesh, 0.0), (sheet, 0.004)):
        solver = RigidSolver(worlds)
        where = (0, 0, -0.005) if isinstance(ground, Box) else ground.centre
        solver.add(rigid_shape(ground, moves=False, thickness=thickness), position=where)
        start = np.column_stack([random.uniform(-0.3, 0.3, (worlds, 2)), np.linspace(0.1, 0.12, worlds)])
        body = solver.add(
            rigid_shape(small), position=start, quaternion=random.normal(size=(worlds, 4)),
            mass=1000 * weighed.volume, inertia=1000 * weighed.inertia, velocity=(0, 0, -10.0),
            angular_velocity=30.0 * random.normal(size=(worlds, 3)),
        )  # fmt: skip
        lowest = np.inf
        for _ in range(12):
            solver.run(0.0, 1.0 / 60.0)
            lowest = min(lowest, solver.pose(body)[0][:, 2].min())
        # never more than a millimetre into it: the middle of a cube of 2 cm is 1 cm above the face that it lies on
        assert lowest > 0.009


def test_a_moving_wall_pushes_and_a_moving_floor_carries():
    """A kinematic body moves as told, and takes others along: a conveyor at 0.2 m/s, by friction."""
    solver = RigidSolver()
    belt = put(solver, Box((4.0, 0.4, 0.1)), (0, 0, -0.05))
    box = drop(solver, CUBE, (0, 0, 0.05))
    solver.set_velocity(belt, (0.2, 0, 0), (0, 0, 0))
    solver.run(0.0, 2.0)
    np.testing.assert_allclose(solver.pose(belt)[0][0], [0.4, 0, -0.05], atol=1e-5)  # float32 sums
    # it slips until mu g t = 0.2 m/s, 0.04 s, and stays 4 mm behind
    np.testing.assert_allclose(solver.velocity(box)[0][0], [0.2, 0, 0], atol=1e-4)
    assert solver.pose(box)[0][0, 0] == pytest.approx(0.4 - 0.2 * 0.2 / (2 * 0.5 * GRAVITY), abs=5e-4)


def test_boxes_rain_into_a_bin_and_stay():
    """Promise: none of twenty leaves, and they come to rest without overlapping."""
    solver = on_floor()
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        size = (0.02, 0.3, 0.3) if x else (0.3, 0.02, 0.3)
        put(solver, Box(size), (0.16 * x, 0.16 * y, 0.15))
    random = np.random.default_rng(3)
    slots = []
    for k in range(20):
        turn = random.normal(size=4)
        place = (*random.uniform(-0.08, 0.08, 2), 0.1 + 0.12 * k)
        slots.append(drop(solver, Box((0.06, 0.06, 0.06)), place, turn / np.linalg.norm(turn)))
    solver.run(0.0, 4.0)
    x = places(solver, slots)
    assert np.abs(x[:, :2]).max() < 0.15 and x[:, 2].min() > 0.0 and x[:, 2].max() < 0.4
    assert max(np.abs(solver.velocity(slot)[0]).max() for slot in slots) < 0.05
    assert solver.deepest() < 1e-3


def test_bodies_that_overlap_at_first_part_slowly():
    """Promise: a bad start is no explosion; what overlaps by 4 cm parts at under 1 m/s and comes to rest on top."""
    solver = on_floor()
    slots = [drop(solver, CUBE, (0, 0, 0.04)), drop(solver, CUBE, (0.01, 0.02, 0.1), about((1, 2, 3), 10))]
    fastest = 0.0
    for _ in range(60):
        solver.run(0.0, 1.0 / 60.0)
        fastest = max(fastest, *(np.abs(solver.velocity(slot)[0]).max() for slot in slots))
    assert fastest < 1.0
    np.testing.assert_allclose(places(solver, slots)[:, 2], [0.05, 0.15], atol=2e-3)
