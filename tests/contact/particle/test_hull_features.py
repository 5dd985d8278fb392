"""Edges and corners of static and kinematic hulls do not stand through between vertices: they touch as boxes do."""

import numpy as np
import pytest

import nuno
import random_worlds
import varied_worlds
from nuno.bodies.body import Body
from nuno.shapes import quaternion as quat
from nuno.shapes.shape import Box, Hull
from random_worlds import RandomWorld, differences, state_of
from soft_slabs import assert_plans_agree, surface

THICKNESS, SIDE = 0.004, 0.1
LEFT = 1e-4  # [m] what one pass a substep leaves of a push where neighbours push too, as beside boxes


def hull(size, **where):
    """Return a hull of a box's corners as a body; arguments are those of ``nuno.box``."""
    return Body(Hull.of(Box(tuple(size)).mesh()[0]), **where)


def wedge(**where):
    """Return a wedge of 40 degrees, 0.3 m long, its edge along y at the top."""
    low = 0.1 * np.tan(np.radians(20.0))
    return Body(
        Hull.of(np.array([[x, y, z] for x, z in ((-low, 0), (low, 0), (0, 0.1)) for y in (-0.15, 0.15)])), **where
    )


def outside(points, body):
    """Return how far points are above the highest of a hull's planes; negative inside."""
    local = quat.rotate(np.asarray(body.quaternion) * [1, -1, -1, -1], points - body.position)
    return (local @ body.shape.planes[:, :3].T - body.shape.planes[:, 3]).max(axis=1)


def soft(**changed):
    """Return a soft material in which a cube of 0.1 m sinks by about 1 mm under its weight."""
    return nuno.Soft(**{"density": 1000.0, "youngs_modulus": 5e4, "poisson_ratio": 0.3, "friction": 0.5, **changed})


def test_the_edges_of_a_hull_do_not_cut_into_a_limp_cloth():
    """Geometry: every point of the surface stays half a thickness from the edges, as on a box."""
    cell = 0.04
    table = hull((0.2, 1.0, 0.2), name="table", position=(0, 0, -0.1))
    sheet = nuno.sheet((0.4, 0.4), cells=(10, 10), position=(0.3 * cell, 0, 0.5 * THICKNESS))
    world = nuno.World(device="cpu")
    world.add(table)
    world.add(sheet)
    world.attach(sheet, nuno.Cloth(thickness=THICKNESS, air_drag=2.0, bending_rigidity=1e-6, friction=1.0))
    lowest = 1.0
    for _ in range(10):
        world.run(0.1)
        lowest = min(lowest, outside(surface(sheet), table).min())
    assert lowest > 0.5 * THICKNESS / np.sqrt(2.0) - LEFT


@pytest.mark.parametrize("kind", ["corner", "wedge"])
def test_a_soft_cube_dropped_on_what_is_sharp_is_not_pierced(kind):
    """Invariant: at 0.5 m/s onto a corner, or an edge of 40 degrees, all of the surface stays outside."""
    cell = SIDE / 4
    if kind == "corner":
        sharp = hull((0.1, 0.1, 0.1)).rotate(np.arctan(np.sqrt(2.0)), "y").rotate(0.25 * np.pi, "z")
    else:
        sharp = wedge().rotate(0.3, "z")
    sharp.locate(np.asarray(sharp.position) - sharp.vertices[sharp.vertices[:, 2].argmax()] * [kind == "corner", 0, 1])
    world = nuno.World(device="cpu")
    world.add(sharp)
    cube = world.add(
        nuno.soft_box((SIDE, SIDE, SIDE), (4, 4, 4), position=(0.4 * cell, 0.3 * cell, 0.5 * SIDE + 0.001))
    )
    world.attach(cube, soft())
    start = cube._dynamics.solver.positions()
    cube._dynamics.solver.set_state(start, np.broadcast_to([0.0, 0.0, -0.5], start.shape).copy())
    lowest = 1.0
    for _ in range(30):
        world.run(1.0 / 120.0)
        lowest = min(lowest, outside(surface(cube), sharp).min())
    assert lowest > -LEFT


@pytest.mark.parametrize("ratio", [0.9, 1.3])
def test_friction_on_edges_of_hulls_is_that_of_faces(ratio):
    """Coulomb: on the edges of two tilted rails a cube stays, or slides at g (sin - mu cos)."""
    mu = 0.3
    tilt = np.arctan(ratio * mu)
    world = nuno.World(device="cpu", gravity=(9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)))
    for y in (-0.0325, 0.0325):
        world.add(hull((0.6, 0.004, 0.2), position=(0, y, -0.1), friction=mu))
    cube = world.add(nuno.soft_box((SIDE, SIDE, SIDE), (4, 4, 4), position=(0, 0, 0.5 * SIDE)))
    world.attach(cube, soft(damping=0.02, friction=mu))
    world.run(0.4)
    before, speed = cube.vertices, cube.velocities[:, 0].mean()
    world.run(0.2)
    if ratio < 1.0:
        assert np.abs(cube.vertices - before).max() < 1e-4
    else:
        gained = cube.velocities[:, 0].mean() - speed
        assert gained == pytest.approx(0.2 * 9.81 * (np.sin(tilt) - mu * np.cos(tilt)), rel=0.05)


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_a_hull_smaller_than_a_cell_takes_a_hanging_cloth_along(speed):
    """Invariant: a tip of 0.8 cells, driven 0.15 m through between four vertices, never has cloth behind it."""
    cell = 0.04
    sheet = nuno.sheet((0.4, 0.4), cells=(10, 10)).rotate(0.5 * np.pi, "y").locate((0, 0, 0))
    start = np.array([-0.05, 0.3 * cell, 0.4 * cell])
    tip = Body(Hull.of(random_worlds.BALL.vertices * 0.4 * cell / 0.05), position=start)
    world = nuno.World(device="cpu")
    world.add(sheet)
    world.add(tip)
    world.attach(sheet, nuno.Cloth(thickness=THICKNESS, air_drag=2.0, bending_rigidity=1e-6))
    x = sheet.vertices
    top = np.flatnonzero(x[:, 2] > 0.199)
    world.grip(sheet, top, to=x[top].mean(axis=0))
    world.move(tip, nuno.Path([0.0, 0.15 / speed], [start, start + np.array([0.15, 0, 0])]))
    nearest = 1.0
    for _ in range(round(36.0 / speed)):
        world.run(1.0 / 240.0)
        nearest = min(nearest, outside(surface(sheet), tip).min())
    # nothing is inside; at 2 m/s, 2.4 mm a substep, what is left of a push is much of half a thickness
    assert nearest > 0.0
    beside = np.linalg.norm((surface(sheet) - tip.position)[:, 1:], axis=1) < 0.2 * cell
    assert (surface(sheet)[beside, 0] > tip.position[0]).all()


def crowded(count):
    """Return worlds with hulls, still and moving, of few faces and of many, where a soft slab and a cloth fall."""
    world = nuno.World(device="cpu", substeps=16)
    world.add(hull((0.2, 1.0, 0.2), name="table", position=(0, 0, -0.1)))
    points = np.random.default_rng(2).normal(size=(60, 3))
    points *= 0.04 / np.linalg.norm(points, axis=1)[:, None]
    world.add(Body(Hull.of(points), name="ball", position=(0.07, 0, 0.0)))
    world.add(wedge(name="wedge", position=(-0.05, 0, -0.06)))
    world.add(nuno.soft_box((0.2, 0.2, 0.06), cells=(6, 6, 2), name="slab", position=(0.0, 0, 0.09)))
    world.add(nuno.sheet((0.2, 0.2), cells=(8, 8), name="sheet", position=(0.0, 0.3, 0.02)))
    return world.imagine(count) if count > 1 else world


@pytest.mark.long
def test_a_world_of_a_batch_meets_hulls_as_alone():
    """Promise: bit for bit, in 18 worlds (more than the lanes of a vector), of which some meet no edge."""
    shift = np.linspace(0.0, 0.6, 18)

    def run(which):
        world = crowded(18 if which is None else 1)
        chosen = slice(None) if which is None else which
        world.find("table").locate(np.stack([shift, 0 * shift, -0.1 + 0 * shift], axis=1)[chosen])
        goal = np.stack([0.15 - shift, 0.2 + 0 * shift, 0 * shift], axis=1)
        places = np.stack([np.broadcast_to([0.15, 0, -0.05], goal.shape), goal], axis=1)
        world.move("ball", nuno.Path([0.0, 0.4], places[chosen]))
        world.attach("slab", soft(youngs_modulus=2e4))
        world.attach("sheet", nuno.Cloth(thickness=THICKNESS))
        world.run(0.3)
        assert world.find("slab")._dynamics.solver.state.feature_shapes.numpy()[0] > 0
        return np.concatenate([world.find(name).vertices for name in ("slab", "sheet")], axis=-2)

    batch = run(None)
    for k in (0, 1, 16, 17):
        np.testing.assert_array_equal(batch[k], run(k))


@pytest.mark.long
@pytest.mark.parametrize("substeps", [20, pytest.param(40, marks=pytest.mark.slow)])
def test_all_plans_meet_hulls_alike(substeps):
    """One source: sixteen particles at a time and one by one give the same bits, with floats and with doubles."""
    world = crowded(1)
    shapes = [world.find(name) for name in ("table", "ball", "wedge")]
    assert_plans_agree(shapes, soft(), substeps)


def test_what_is_saved_while_a_hull_is_touched_goes_on_alike():
    """Promise: restored in another world and imagined, it has the same bits a while later."""
    world = crowded(1)
    world.attach("slab", soft(youngs_modulus=2e4))
    start = np.array([0.07, 0.0, 0.0])
    world.move("ball", nuno.Path([0.0, 0.5], [start, start + np.array([-0.1, 0.05, 0.01])]))
    world.run(0.21)
    other = nuno.World(device="cpu")
    other.restore(world.save())
    futures = world.imagine(2)
    for each in (world, other, futures):
        each.run(0.11)
    np.testing.assert_array_equal(other.find("slab").vertices, world.find("slab").vertices)
    np.testing.assert_array_equal(futures.find("slab").vertices[1], world.find("slab").vertices)


@pytest.mark.long
def test_random_worlds_of_hulls_are_copied_and_varied_to_the_bit(monkeypatch):
    """Promise: in worlds that random operations make, with hulls for all boxes, copies and differing worlds agree."""
    monkeypatch.setattr(nuno, "box", hull, raising=False)
    wrong = []
    for seed in range(3000, 3010):
        world = RandomWorld(seed).happen(12).world
        saved, other = world.save(), nuno.World(device="cpu")
        other.restore(saved)
        variation = varied_worlds.Variation(7000 + seed, world, 3)
        try:
            variation.happen(3)
            variation.do(varied_worlds.run)
            for k, single in enumerate(variation.singles):
                wrong += [
                    f"{seed}, {k}: {each}" for each in differences(state_of(variation.batch, k), state_of(single))
                ]
            for each in (world, other):
                each.run(0.1)
            wrong += [f"{seed}: {each}" for each in differences(state_of(other), state_of(world))]
        except nuno.SimulationDiverged:
            continue
    assert not wrong, "\n".join(wrong[:8])
