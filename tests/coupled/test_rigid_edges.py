"""Edges of rigid boxes, hulls and cylinders meet those of cloth and soft bodies between their vertices."""

import sys
from pathlib import Path

import numpy as np
import pytest

import nuno
from nuno.shapes import quaternion as quat
from soft_slabs import surface

sys.path.append(str(Path(__file__).parents[1]))
from pair_with import mass_of, moment, moments

CELL = 0.025  # [m], of the cloth and the cube
BORNE = 2e-4  # [m] Of the skin of 0.5 mm half is kept at edges (0.25 mm); passes of one substep leave 0.05 mm of that
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]
WEDGE = np.array([(x, y, z) for x in (-0.04, 0.04) for y, z in ((0.0, -0.0267), (0.015, 0.0133), (-0.015, 0.0133))])


def outside(rigid, body):
    """Return how far the nearest point of a body's surface is outside of all convex parts of a rigid one [m]."""
    place, turn = rigid.pose()
    points = quat.rotate(quat.inverse(turn), surface(body, 8) - place)
    least = 1.0
    for part in rigid._dynamics.parts:
        own = points
        if part.position is not None:
            own = quat.rotate(quat.inverse(part.quaternion), points - part.position)
        if part.normals is not None:
            faces = zip(part.normals, part.loops, strict=True)
            beyond = np.max([own @ n - (part.corners[loop] @ n).max() for n, loop in faces], axis=0)
        elif part.half[2] > 0.0:
            beyond = np.max(np.abs(own) - part.half, axis=1)
        else:
            beyond = np.maximum(np.hypot(own[:, 0], own[:, 1]) - part.half[0], np.abs(own[:, 2]) - part.half[1])
        least = min(least, float(beyond.min()))
    return least


def drop(world, body, speed):
    """Let a rigid body go down at a speed [m/s]."""
    dynamics = body._dynamics
    dynamics.solver.set_velocity(dynamics.slot, np.array([[0.0, 0.0, -speed]]), np.zeros((1, 3)))


def guide(world, body):
    """Keep a rigid body upright and over its place."""
    world.grip(body, to=body.position, free=(0.0, 0.0, 1.0))


def soft_cube(device="cpu", friction=0.5):
    """Return a world with a soft cube of 4 cells on the floor, and the cube."""
    world = nuno.World(device=device)
    world.add(nuno.box((1.0, 1.0, 0.1), name="floor", position=(0.0, 0.0, -0.05)))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(4, 4, 4), position=(0.0, 0.0, 0.05), name="cube"))
    world.attach(cube, nuno.Soft(youngs_modulus=5e4, damping=0.02, friction=friction))
    return world, cube


def held_cloth():
    """Return a world and a cloth of 16 x 16 cells held at its corners."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((16 * CELL, 16 * CELL), cells=(16, 16), position=(0.0, 0.0, 0.5), name="cloth"))
    world.attach(cloth, nuno.Cloth(area_density=0.2, thickness=0.003))
    for corner in (0, 16, 272, 288):
        world.grip(cloth, [corner], to=cloth.vertices[corner])
    return world, cloth


def plate(world, length=0.24, turn=0.0, height=0.128):
    """Add an upright plate of 4 mm between two rows of vertices of the cube; one of 0.24 m has no corner over it."""
    body = world.add(nuno.box((length, 0.004, 0.05), position=(0.0, 0.012, height), name="plate"))
    body.rotate(turn, "z")
    world.attach(body, nuno.Rigid(density=8000.0))
    guide(world, body)
    return body


@pytest.mark.parametrize("turn", [pytest.param(0.0, marks=pytest.mark.long), 0.3])
@pytest.mark.parametrize("speed", [pytest.param(1.0, marks=pytest.mark.long), 2.0])
def test_a_plate_on_its_edge_dents_a_soft_cube(speed, turn):
    """Geometry: it went in to its middle at 1 m/s and right through at 2 m/s; now all of the surface stays outside."""
    world, cube = soft_cube()
    body = plate(world, turn=turn)
    drop(world, body, speed)
    for _ in range(30):
        world.step()
        assert outside(body, cube) > BORNE
    assert body.position[2] > 0.1


@pytest.mark.parametrize(
    ("youngs_modulus", "density", "speed"),
    [(5e3, 8e3, 5.0), *(pytest.param(*one, marks=pytest.mark.long) for one in ((5e3, 8e3, 2.0), (5e4, 8e4, 2.0)))],
)
def test_a_plate_crushes_a_soft_cube_and_does_not_cut_it(youngs_modulus, density, speed):
    """Geometry: down to a quarter of its height and less, where elements turn inside out at its edges."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1.0, 1.0, 0.1), name="floor", position=(0.0, 0.0, -0.05)))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(4, 4, 4), position=(0.0, 0.0, 0.05), name="cube"))
    world.attach(cube, nuno.Soft(youngs_modulus=youngs_modulus))
    body = world.add(nuno.box((0.24, 0.004, 0.05), position=(0.0, 0.012, 0.128), name="plate"))
    world.attach(body, nuno.Rigid(density=density))
    guide(world, body)
    drop(world, body, speed)
    lowest = 1.0
    for _ in range(20):
        world.step()
        lowest = min(lowest, body.position[2] - 0.025)
        assert outside(body, cube) > 0.1e-3  # 0.05 mm less than where it is not crushed
    assert lowest < 0.03


@pytest.mark.long
def test_a_plate_rests_on_its_edge():
    """Balance: edges alone bear its weight, and lie still: no corner of the plate is over the cube."""
    world, cube = soft_cube()
    body = plate(world)
    world.run(2.0)
    forces = []
    for _ in range(30):
        world.step()
        forces.append(world.contacts(body).forces[:, 2].sum())
    # the mean over half a second of a cube that rings by 1e-3 m/s: m dv / T is 0.1 % of m g, and rounding
    assert np.mean(forces) == pytest.approx(9.81 * mass_of(body), rel=0.01)
    assert outside(body, cube) > BORNE
    assert np.abs(cube.velocities).max() < 0.01


def bar(world):
    """Add a box that stands on an edge along x; return it and how far it reaches down [m]."""
    return world.add(nuno.box((0.06, 0.06, 0.06), name="box")).rotate(np.pi / 4, "x"), 0.03 * np.sqrt(2.0)


def wedge(world):
    """Add a hull of three long edges, a sharp one down; return it and how far it reaches down [m]."""
    import trimesh

    hull = trimesh.convex.convex_hull(WEDGE)
    return world.add(nuno.mesh((hull.vertices, hull.faces), name="wedge")), 0.0267


def rod(world):
    """Add a thin cylinder that lies along x; return it and how far it reaches down [m]."""
    return world.add(nuno.cylinder(0.2 * CELL, 0.06, name="rod")).rotate(np.pi / 2, "y"), 0.2 * CELL


@pytest.mark.parametrize(
    "made", [pytest.param(bar, marks=pytest.mark.long), wedge, pytest.param(rod, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("speed", [1.0, pytest.param(2.0, marks=pytest.mark.long)])
def test_an_edge_falls_on_a_held_cloth(made, speed):
    """Geometry: along a row of cells, between two rows of vertices. They cut in by up to 2.2 mm, through the cloth."""
    world, cloth = held_cloth()
    body, below = made(world)
    body.locate((0.01, 0.012, 0.5 + below + 0.004))
    world.attach(body, nuno.Rigid(mass=0.1))
    guide(world, body)
    drop(world, body, speed)
    for _ in range(40):
        world.step()
        # the middle of 3 mm keeps half of 1.5 mm at edges; half of that again is what passes may leave at 2 m/s
        assert outside(body, cloth) > 0.25e-3
    assert body.position[2] > cloth.vertices[:, 2].min()


@pytest.mark.parametrize("speed", [pytest.param(1.0, marks=pytest.mark.long), 2.0])
def test_a_disc_falls_on_its_rim(speed):
    """Geometry: a rim is a polygon that is nowhere a skin's thickness, 0.5 mm, from its circle."""
    world, cube = soft_cube()
    body = world.add(nuno.cylinder(0.1, 0.004, position=(0.012, 0.012, 0.203), name="disc"))
    body.rotate(np.pi / 2, "x").rotate(np.pi / 16, "z")
    world.attach(body, nuno.Rigid(density=8000.0))
    guide(world, body)
    drop(world, body, speed)
    for _ in range(30):
        world.step()
        assert outside(body, cube) > -0.25e-3
    assert body.position[2] > 0.17


def test_each_part_of_a_compound_has_edges():
    """Geometry: two plates that cross, of which each would go in."""
    world, cube = soft_cube()
    cross = nuno.Compound((nuno.box((0.24, 0.004, 0.05)).shape, nuno.box((0.004, 0.24, 0.05)).shape))
    body = world.add(nuno.Body(cross, position=(0.012, 0.012, 0.128), name="cross"))
    world.attach(body, nuno.Rigid(density=4000.0))
    guide(world, body)
    drop(world, body, 1.0)
    for _ in range(30):
        world.step()
        assert outside(body, cube) > BORNE


def test_what_slides_along_an_edge_rubs():
    """Coulomb: a plate pressed into a cube and drawn along its edge is dragged by mu times what presses on it."""
    mu = 0.3
    world, cube = soft_cube(friction=1.0)
    world.set_friction(cube, "floor", 2.0)
    body = world.add(nuno.box((0.4, 0.004, 0.05), position=(0.0, 0.012, 0.126), name="plate"))
    world.attach(body, nuno.Rigid(density=8000.0))
    world.set_friction(body, cube, mu)
    down, along = np.array([0.0, 0.0, -0.004]), np.array([0.06, 0.0, 0.0])
    start = body.position
    keys = [start, start + down, start + down + along]
    world.grip(body, to=nuno.Path([0.0, 0.2, 0.8], keys))
    world.run(0.6)
    drags, pushes = [], []
    for _ in range(6):
        world.step()
        found = world.contacts(body)
        push = np.einsum("kx,kx->k", found.forces, found.normals)
        drags.append((found.forces - push[:, None] * found.normals)[:, 0].sum())
        pushes.append(push.sum())
    assert np.mean(pushes) > 1.0
    # all of it slides one way, but for what the cube's top still follows
    assert np.mean(drags) == pytest.approx(-mu * np.mean(pushes), rel=0.03)


@pytest.mark.parametrize("kind", ["cloth", "soft"])
def test_a_collision_at_an_edge_keeps_momentum_and_gains_no_energy(kind):
    """Invariants of an isolated system, as in `tests/physics/test_pairs.py`."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    if kind == "cloth":
        lower = world.add(nuno.sheet((0.12, 0.12), (6, 6)))
        world.attach(lower, nuno.Cloth(area_density=0.5, air_drag=0.0))
    else:
        lower = world.add(nuno.soft_box((0.08, 0.08, 0.08), (2, 2, 2), position=(0.0, 0.0, -0.04)))
        world.attach(lower, nuno.Soft(density=200.0))
    upper = world.add(nuno.box((0.2, 0.03, 0.03), position=(0.0, 0.012, 0.03))).rotate(np.pi / 4, "x")
    world.attach(upper, nuno.Rigid(mass=0.05))
    drop(world, upper, 0.5)
    linear, angular, energy = moments(lower, upper)
    size = np.linalg.norm(linear)
    world.run(0.4)
    assert not len(world.contacts(lower).forces)  # they have parted
    after, turned, left = moments(lower, upper)
    assert np.linalg.norm(moment(lower)[0]) > 0.1 * size  # they have met
    # rounding, and the lever of friction, as there
    np.testing.assert_allclose(after, linear, atol=1e-3 * size)
    np.testing.assert_allclose(turned, angular, atol=0.02 * 0.1 * size)
    assert left < 1.001 * energy


def test_edges_take_nothing_of_what_lies_on_a_face():
    """Invariant: at the rim of a box on a soft cube of the same friction vertices bear all, and it lies still."""
    world, _ = soft_cube()
    box = world.add(nuno.box((0.07, 0.07, 0.02), position=(0.005, 0.004, 0.1106), name="box"))
    world.attach(box, nuno.Rigid(mass=0.3))
    world.run(1.5)
    forces = []
    for _ in range(10):
        world.step()
        found = world.contacts(box)
        np.testing.assert_allclose(found.normals[:, 2], 1.0, atol=1e-2)
        forces.append(found.forces.sum(axis=0))
    np.testing.assert_allclose(np.mean(forces, axis=0), [0.0, 0.0, 0.3 * 9.81], atol=0.03)
    assert np.ptp(np.array(forces)[:, 2]) < 0.1 * 0.3 * 9.81


@pytest.mark.parametrize("device", DEVICES)
def test_the_same_bits_again_in_a_batch_and_from_a_saved_state(device):
    """Promise: same input, same bits; and nothing passes where all contacts are solved at once, either."""

    def start():
        world, cube = soft_cube(device)
        body = plate(world)
        drop(world, body, 1.0)
        return world, cube, body

    world, cube, body = start()
    batch = world.imagine(3)
    saved, touched = None, 0
    for frame in range(8):
        if frame == 3:
            saved = world.save()
        world.step()
        assert outside(body, cube) > BORNE
        touched += len(world.contacts(body).forces)
    assert touched
    end = [cube.vertices, body.vertices]
    batch.run(8 / 60)
    world.restore(saved)
    world.run(5 / 60)
    again = start()
    again[0].run(8 / 60)
    for k, name in enumerate(("cube", "plate")):
        np.testing.assert_array_equal(batch.find(name).vertices, np.broadcast_to(end[k], (3, *end[k].shape)))
        np.testing.assert_array_equal(world.find(name).vertices, end[k])
        np.testing.assert_array_equal(again[0].find(name).vertices, end[k])


def test_all_at_once_nothing_passes(monkeypatch):
    """As CUDA solves them, by one thread: the plate and the wedge stay outside."""
    monkeypatch.setattr("nuno.solvers.coupling.solves_at_once", lambda device: True)
    world, cube = soft_cube()
    body = plate(world, turn=0.3)
    drop(world, body, 2.0)
    for _ in range(20):
        world.step()
        assert outside(body, cube) > BORNE
    world, cloth = held_cloth()
    body, below = wedge(world)
    body.locate((0.01, 0.012, 0.5 + below + 0.004))
    world.attach(body, nuno.Rigid(mass=0.1))
    guide(world, body)
    drop(world, body, 2.0)
    for _ in range(20):
        world.step()
        assert outside(body, cloth) > 0.25e-3
