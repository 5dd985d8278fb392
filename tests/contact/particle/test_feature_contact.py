"""Edges, corners and small balls do not stand through between a cloth's vertices."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.contact.particle.feature_lists import SETS
from nuno.contact.particle.feature_queue import ROOM
from nuno.shapes import quaternion as quat
from nuno.solvers.cloth_solver import ClothSolver
from nuno.tables.colliders import Colliders
from nuno.topology.cloth_topology import ClothTopology
from soft_slabs import surface

THICKNESS = 0.004
LEFT = 1e-4  # [m] what one pass a substep leaves of a push where neighbours push too
ROUNDED = 0.5 * THICKNESS / np.sqrt(2.0)  # half a thickness from a right edge is so far from one of its faces
DEVICES = pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])


def outside_of_box(points, box):
    """Return how far points are beyond the nearest of a box's faces' planes that they are beyond; negative inside."""
    local = quat.rotate(np.asarray(box.quaternion) * [1, -1, -1, -1], points - box.position)
    return (np.abs(local) - 0.5 * np.asarray(box.shape.size)).max(axis=1)


def limp(**changed):
    """Return a limp cloth's material."""
    return nuno.Cloth(**{"thickness": THICKNESS, "air_drag": 2.0, "bending_rigidity": 1e-6, **changed})


@DEVICES
@pytest.mark.parametrize("cell", [pytest.param(0.01, marks=pytest.mark.long), 0.02, 0.04])
def test_the_edges_of_a_box_do_not_cut_into_a_limp_cloth(cell, device):
    """Geometry: every point of the surface stays half a thickness from the edges, not the vertices alone."""
    count = round(0.4 / cell)
    table = nuno.box((0.2, 1.0, 0.2), position=(0, 0, -0.1))
    sheet = nuno.sheet((0.4, 0.4), cells=(count, count), position=(0.3 * cell, 0, 0.5 * THICKNESS))
    world = nuno.World(device=device)
    world.add(table)
    world.add(sheet)
    world.attach(sheet, limp(friction=1.0))
    lowest = 1.0
    for _ in range(10):
        world.run(0.1)
        lowest = min(lowest, outside_of_box(surface(sheet), table).min())
    assert lowest > ROUNDED - LEFT
    before = sheet.vertices
    world.run(3.0)
    assert np.linalg.norm(sheet.velocities, axis=1).max() < 0.02  # what hangs swings out, at 2 1/s
    on_top = before[:, 2] > 0.0
    assert np.abs(sheet.vertices - before)[on_top].max() < 5e-4  # and holds by friction, with a half hanging down


@DEVICES
@pytest.mark.parametrize("speed", [0.5, 2.0])
@pytest.mark.parametrize("kind", ["sphere", "capsule"])
def test_a_fingertip_smaller_than_a_cell_takes_a_hanging_cloth_along(kind, speed, device):
    """Invariant: a tip of 0.4 cells, driven 0.15 m through between four vertices, never has cloth behind it."""
    cell = 0.04
    radius = 0.4 * cell
    sheet = nuno.sheet((0.4, 0.4), cells=(10, 10)).rotate(0.5 * np.pi, "y").locate((0, 0, 0))
    at = np.array([-0.05, 0.3 * cell, 0.4 * cell])
    length = 0.1 if kind == "capsule" else 0.0
    tip = nuno.sphere(radius) if kind == "sphere" else nuno.capsule(radius, length).rotate(0.5 * np.pi, "y")
    start = at - np.array([0.5 * length, 0, 0])
    tip.locate(start)
    world = nuno.World(device=device)
    world.add(sheet)
    world.add(tip)
    world.attach(sheet, limp())
    x = sheet.vertices
    top = np.flatnonzero(x[:, 2] > 0.199)
    world.grip(sheet, top, to=x[top].mean(axis=0))
    world.move(tip, nuno.Path([0.0, 0.15 / speed], [start, start + np.array([0.15, 0, 0])]))
    nearest = 1.0
    for _ in range(round(36.0 / speed)):
        world.run(1.0 / 240.0)
        offset = surface(sheet) - tip.position
        offset[:, 0] -= np.clip(offset[:, 0], -0.5 * length, 0.5 * length)
        nearest = min(nearest, np.linalg.norm(offset, axis=1).min() - radius)
    assert nearest > 0.5 * THICKNESS - 10 * LEFT  # flat out at 2 m/s: 2.4 mm a substep
    beside = np.linalg.norm((surface(sheet) - tip.position)[:, 1:], axis=1) < 0.5 * radius
    assert (surface(sheet)[beside, 0] > tip.position[0]).all()


@DEVICES
@pytest.mark.parametrize("cell", [0.02, 0.04])
@pytest.mark.parametrize("place", [(0.3, 0.4), (0.66, 0.33)])
def test_a_cloth_dropped_on_the_corner_of_a_box_is_not_pierced(cell, place, device):
    """Invariant: at 1 m/s onto a corner that points up between its vertices, all of the surface stays outside."""
    cube = nuno.box((0.1, 0.1, 0.1)).rotate(np.arctan(np.sqrt(2.0)), "y").rotate(0.25 * np.pi, "z")
    corners = cube.vertices
    cube.locate(-corners[corners[:, 2].argmax()])
    count = round(0.4 / cell)
    sheet = nuno.sheet((0.4, 0.4), cells=(count, count), position=(place[0] * cell, place[1] * cell, 0.02))
    world = nuno.World(device=device)
    world.add(sheet)
    world.add(cube)
    world.attach(sheet, nuno.Cloth(thickness=THICKNESS, air_drag=2.0))
    solver = sheet._dynamics.solver
    start = solver.positions()
    solver.set_state(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape).copy())
    lowest = 1.0
    for _ in range(60):
        world.run(1.0 / 120.0)
        lowest = min(lowest, outside_of_box(surface(sheet), cube).min())
    # of a corner, which three faces make: half a thickness away is a third root of three of it from one of them
    assert lowest > 0.5 * THICKNESS / np.sqrt(3.0) - LEFT


@DEVICES
@pytest.mark.parametrize("radius", [0.015, 0.1])
def test_the_rim_of_a_can_does_not_cut_into_a_cloth(radius, device):
    """Geometry: the surface stays outside of the rim of a can, slim or wide, whose sides curve less than cells."""
    can = nuno.cylinder(radius, 0.1, position=(0, 0, -0.05))
    sheet = nuno.sheet((0.4, 0.4), cells=(10, 10), position=(0.012, 0.008, 0.5 * THICKNESS))
    world = nuno.World(device=device)
    world.add(sheet)
    world.add(can)
    world.attach(sheet, limp(friction=1.0))
    for _ in range(10):
        world.run(0.05)
        x = surface(sheet)
        beyond = np.maximum(np.hypot(x[:, 0], x[:, 1]) - radius, x[:, 2])
        near = x[:, 2] > -0.01  # farther down a wide can's side is the vertices'
        # less the sagitta of a cell on the wide round side
        assert beyond[near].min() > ROUNDED - LEFT - 0.04**2 / (8.0 * 0.1)


@DEVICES
def test_what_a_cloth_over_edges_bears_is_its_weight(device):
    """Balance: the forces of beams that a cloth hangs over, on its edges between vertices, add up to its weight."""
    sheet = nuno.sheet((0.4, 0.4), cells=(10, 10), position=(0.004, 0, 0.017))
    world = nuno.World(device=device)
    for x in (-0.08, 0.08):
        world.add(nuno.box((0.03, 1.0, 0.03), name=f"beam {x}", position=(x, 0, 0)))
    world.add(sheet)
    world.attach(sheet, limp(friction=1.0, air_drag=8.0, area_density=0.25))
    world.run(3.0)
    found = world.contacts(sheet)
    assert set(found.others) == {"beam -0.08", "beam 0.08"}
    force = found.forces.sum(axis=0)
    # one substep of a cloth that nearly rests
    np.testing.assert_allclose(force, [0, 0, 0.25 * 0.16 * 9.81], rtol=0.03, atol=0.02)


def crowded(count, device="cpu"):
    """Return worlds with sharp shapes, still and moving, of all kinds, where a cloth falls."""
    world = nuno.World(device=device)
    world.add(nuno.box((0.2, 1.0, 0.2), name="table", position=(0, 0, -0.1)))
    world.add(nuno.sphere(0.008, name="ball", position=(0.15, 0, -0.05)))
    world.add(nuno.cylinder(0.02, 0.1, name="can", position=(0.0, 0.1, 0.03)))
    world.add(nuno.capsule(0.01, 0.1, name="finger", position=(-0.05, -0.1, 0.03)))
    world.add(nuno.sheet((0.4, 0.4), cells=(14, 14), name="cloth", position=(0.0, 0, 0.1)))
    return world.imagine(count) if count > 1 else world


def shifted(count, which, device):
    """Return where the cloth is after 0.5 s in all of ``count`` worlds, or in one alone; some of them meet no edge."""
    shift = np.linspace(0.0, 0.6, count)
    world = crowded(count if which is None else 1, device)
    chosen = slice(None) if which is None else which
    world.find("table").locate(np.stack([shift, 0 * shift, -0.1 + 0 * shift], axis=1)[chosen])
    goal = np.stack([0.15 - shift, 0 * shift, 0 * shift], axis=1)
    places = np.stack([np.broadcast_to([0.15, 0, -0.05], goal.shape), goal], axis=1)
    world.move("ball", nuno.Path([0.0, 0.4], places[chosen]))
    world.attach("cloth", nuno.Cloth(thickness=THICKNESS, air_drag=2.0))
    world.run(0.5)
    return world.find("cloth").vertices


@DEVICES
def test_a_world_of_a_batch_meets_edges_as_alone(device):
    """Promise: bit for bit, in 18 worlds: more than the lanes of a vector."""
    batch = shifted(18, None, device)
    for k in (0, 1, 16, 17):
        np.testing.assert_array_equal(batch[k], shifted(18, k, device))


@pytest.mark.cuda
def test_a_world_of_a_batch_meets_edges_as_alone_on_cuda():
    """Promise: the same where blocks have half the threads, and so room for fewer elements at a time."""
    count = wp.get_device("cuda:0").sm_count + 1
    batch = shifted(count, None, "cuda:0")
    for k in (0, 1, count // 2, count - 1):
        np.testing.assert_array_equal(batch[k], shifted(count, k, "cuda:0"))


@pytest.mark.long
def test_all_plans_meet_edges_alike():
    """One source: sixteen particles at a time, one by one, and groups of blocks give the same bits."""
    world = crowded(1)
    shapes = [world.find(name) for name in ("table", "ball", "can", "finger")]
    topology = ClothTopology.sheet((12, 12), (0.4, 0.4))
    start = topology.rest[None] + np.array([0.02, 0.01, 0.09])
    ends = []
    for plan in ("vector", "fused", "grid"):
        solver = ClothSolver(
            topology, nuno.Cloth(thickness=THICKNESS), start, 0 * start, substeps=20, plan=plan, self_contact=False
        )
        solver.set_colliders(Colliders.from_bodies(shapes))
        solver.run(0.0, 0.4)
        ends.append(solver.positions())
    assert np.ptp(ends[0][0, :, 2]) > 0.05
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])


@DEVICES
def test_a_cloth_far_from_the_rim_of_its_table_asks_for_nothing(device):
    """Promise: where no edge is in reach nothing is listed, and the bits are those of a table without end."""

    def run(side):
        world = nuno.World(device=device)
        world.add(nuno.box((side, side, 0.04), position=(0, 0, -0.02)))
        world.add(nuno.sheet((0.3, 0.3), cells=(8, 8), name="cloth", position=(0, 0, 0.03)).rotate(0.3, "x"))
        body = world.find("cloth")
        world.attach(body, nuno.Cloth(thickness=THICKNESS))
        world.run(0.3)
        return body

    near, far = run(0.6), run(8.0)
    np.testing.assert_array_equal(near.vertices, far.vertices)
    assert near._dynamics.solver.state.feature_shapes.numpy()[0] == 0
    assert run(0.36)._dynamics.solver.state.feature_shapes.numpy()[0] == 1


def active_at_edged_shapes(body):
    """Return the elements (k,) that a cloth's last substep looked at, edges before triangles, and how many it lists."""
    solver = body._dynamics.solver
    starts = solver._surface.feature_colour.numpy()
    counts, wake = solver.state.feature_shapes.numpy()[1:], solver.state.feature_due.numpy()
    places = np.concatenate([np.arange(a, a + k) for a, k in zip(starts[:-1], counts, strict=False)])
    listed = solver.state.feature_list.numpy()[places]
    # above its number an element has the sets of shapes that it may touch
    elements = np.maximum(listed, -1 - listed) & ((1 << SETS) - 1)
    return elements[wake[2 + places] <= wake[0]], len(places)


def test_of_a_cloth_over_a_bar_only_edges_beside_it_are_looked_at():
    """Promise: what is farther than a substep's reach sleeps, and triangles do away from the bar's ends."""
    world = nuno.World()
    world.add(nuno.capsule(0.02, 0.6, position=(0.0, 0.0, 0.05)).rotate(0.5 * np.pi, "x"))
    cloth = world.add(nuno.sheet((0.4, 0.4), cells=(20, 20), position=(0.0, 0.0, 0.08)))
    world.attach(cloth, nuno.Cloth(thickness=THICKNESS))
    world.run(0.3)
    active, listed = active_at_edged_shapes(cloth)
    sides = cloth._dynamics.solver._surface.side.numpy()
    assert 0 < len(active) < 0.5 * listed
    assert active.max() < len(sides)
    ends = cloth.vertices[sides[active]]
    away = np.linalg.norm((ends - (0.0, 0.0, 0.05))[:, :, [0, 2]], axis=2).min(axis=1) - 0.02
    # the ends of a cell's diagonal whose middle is in reach of the bar are higher by its half squared over two radii
    reach = 0.5 * THICKNESS + 3.0 / 60.0 / cloth._dynamics.solver.substeps
    assert away.max() < reach + 0.5 * 0.02**2 / (2.0 * 0.02)


@pytest.mark.long
@DEVICES
def test_more_edges_may_touch_than_there_is_room_for_in_a_queue(device):
    """Geometry: the cloth's edges stay half a thickness from all of four bars, more than are queued at once on CUDA."""
    world = nuno.World(device=device)
    places = np.array([-0.18, -0.06, 0.06, 0.18])
    for x in places:
        world.add(nuno.capsule(0.02, 0.6, position=(x, 0.0, 0.05)).rotate(0.5 * np.pi, "x"))
    cloth = world.add(nuno.sheet((0.5, 0.5), cells=(70, 70), position=(0.0, 0.0, 0.08)))
    world.attach(cloth, nuno.Cloth(thickness=0.003))
    world.run(0.2)
    assert len(active_at_edged_shapes(cloth)[0]) > ROOM
    points = surface(cloth, 4)
    away = np.hypot(points[:, 0, None] - places, points[:, 2, None] - 0.05).min(axis=1) - 0.02
    assert away.min() > 0.0015 - LEFT
    assert away.min() < 0.0015 + LEFT
