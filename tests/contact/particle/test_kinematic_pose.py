"""A cloth and shapes that follow paths: carried, dragged, spun and pushed along."""

import numpy as np
import pytest

import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.tables.colliders import Colliders
from nuno.tables.kinematic_motion import make_schedule
from nuno.topology.cloth_topology import ClothTopology

GRAVITY = 9.81  # [m/s2], the default of World
THICKNESS = 0.004
KINDS = ["box", "mesh", "shell", "plane"]


def plate(kind):
    """Return a plate with its upper face at z = 0."""
    if kind == "plane":
        return nuno.plane(name="plate")
    if kind == "shell":
        corners = np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
        return nuno.mesh((corners, np.array([[0, 1, 2], [0, 2, 3]])), name="plate")
    slab = nuno.box((4, 4, 0.05), name="plate", position=(0, 0, -0.025))
    return slab if kind == "box" else nuno.mesh((slab.vertices, slab.faces), name="plate")


def on_plate(kind, friction, worlds, *, size=0.1, at=0.0):
    """Return a batch of sheets that lie on plates, at x = ``at``, with a coefficient for each world."""
    world = nuno.World(device="cpu")
    world.add(plate(kind))
    world.add(nuno.sheet((size, size), cells=(4, 4), name="sheet", position=(at, 0, 0.5 * THICKNESS)))
    world = world.imagine(worlds) if worlds > 1 else world
    world.attach("sheet", nuno.Cloth(thickness=THICKNESS, air_drag=0.0, stretch_stiffness=2000.0))
    world.set_friction("plate", "sheet", friction)
    return world, world.find("plate"), world.find("sheet")


def along(times, x):
    """Return a path along x through ``x`` (worlds, k) [m], at z of the plate."""
    return np.asarray(times), np.stack([x, 0 * x, 0 * x], axis=-1)


@pytest.mark.parametrize("kind", KINDS)
def test_a_conveyor_takes_a_sheet_to_its_speed(kind):
    """Coulomb: a = mu g until the sheet has the plate's speed, then no slip."""
    friction, speed = np.array([0.1, 0.3]), 0.6
    world, body, sheet = on_plate(kind, friction, 2)
    start = body.position
    world.move(body, nuno.Path([0.0, 3.0], [start, start + np.array([3.0 * speed, 0, 0])]))
    world.run(0.1)
    # a step of gravity is missing from the first push: dt / 0.1 s = 1 %
    np.testing.assert_allclose(sheet.velocities.mean(axis=1)[:, 0], friction * GRAVITY * 0.1, rtol=0.01)
    np.testing.assert_allclose(body.position, start + np.array([0.1 * speed, 0, 0]), atol=1e-12)
    world.run(0.7)
    expected = speed * 0.8 - speed**2 / (2 * friction * GRAVITY)  # what it lost until then
    np.testing.assert_allclose(sheet.vertices.mean(axis=1)[:, 0], expected, rtol=0.01)
    before = sheet.vertices[..., 0].mean(axis=1) - body.position[..., 0]
    world.run(1.0)
    # held: rounding of float32 coordinates, 3e-8 m in each of 600 substeps at the most
    np.testing.assert_allclose(sheet.vertices[..., 0].mean(axis=1) - body.position[..., 0], before, atol=2e-5)
    np.testing.assert_allclose(sheet.velocities[..., 0].mean(axis=1), speed, rtol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_sheet_rides_up_to_an_acceleration_of_mu_g(kind):
    """Coulomb: it sticks where a < mu g and slips where a > mu g, a 5 % from it; a slip is (a - mu g) t^2 / 2."""
    mu, seconds = 0.4, 0.8
    ratio = np.array([0.5, 0.95, 1.05, 1.5])
    world, body, sheet = on_plate(kind, mu, 4)
    times = np.arange(0.0, seconds + 1e-9, 1.0 / 240.0)
    start = np.atleast_2d(body.position)[0]
    way = start + along(times, 0.5 * (ratio * mu * GRAVITY)[:, None] * times**2)[1]
    world.run(0.1)
    world.move(body, nuno.Path(0.1 + times, way))
    rest = sheet.vertices[..., 0].mean(axis=1)
    world.run(seconds)
    slip = body.position[:, 0] - start[0] - (sheet.vertices[..., 0].mean(axis=1) - rest)
    expected = 0.5 * (ratio - 1.0) * mu * GRAVITY * seconds**2
    assert np.abs(slip[:2]).max() < 5e-4  # 0.04 % of the way; the first substep's push lacks a step of gravity
    # a small difference of large numbers: 1 % of what friction moves it
    np.testing.assert_allclose(slip[2:], expected[2:], atol=0.01 * 0.5 * mu * GRAVITY * seconds**2)


def test_a_sheet_on_a_turntable_stays_up_to_mu_g():
    """Closed form: it stays where w^2 r < mu g and leaves where w^2 r > mu g, 5 % from it."""
    mu, radius = 0.3, 0.2
    ratio = np.array([0.95, 1.05])
    world, body, sheet = on_plate("box", mu, 2, size=0.02, at=radius)
    # up to its speed in 2 s, smoothly, so that little friction is needed along the circle
    s = np.linspace(0.0, 1.0, 481)
    top = np.sqrt(ratio * mu * GRAVITY / radius)[:, None]
    angle = np.concatenate([top * 2.0 * (s**3 - 0.5 * s**4), top * (1.0 + s[1:])], axis=1)
    times = np.concatenate([2.0 * s, 2.0 + s[1:]])
    turns = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)], axis=-1)
    places = np.broadcast_to(np.atleast_2d(body.position)[0], (2, len(times), 3))
    world.move(body, nuno.Path(times, places, turns))
    start = sheet.vertices.mean(axis=1)
    world.run(2.0)
    held = body.to_local(sheet.vertices).mean(axis=1) - start - [0, 0, 0.025]
    world.run(1.0)
    end = body.to_local(sheet.vertices).mean(axis=1) - start - [0, 0, 0.025]
    slip = np.linalg.norm(end - held, axis=1)
    # after 2.4 turns or more; float32 at 0.2 m is 1.5e-8 m, before and after each of some ten thousands of substeps
    rounding = 2 * 1.5e-8 * sheet.resolution.substeps * np.array([120, 60])
    assert np.abs(held[0, :2]).max() < rounding[0]
    assert slip[0] < rounding.sum()
    assert slip[1] > 0.01  # it starts to move at 5 % of 2.9 m/s2, and ever faster


@pytest.mark.parametrize("kind", ["sphere", "mesh"])
def test_a_sphere_pushes_a_hanging_cloth_along(kind):
    """Invariant: driven into it at 2 m/s, it carries the cloth before it, and no vertex is ever inside."""
    radius, speed = 0.08, 2.0
    ball = nuno.sphere(radius, name="ball", position=(-0.2, 0, 0))
    if kind == "mesh":
        ball = nuno.mesh((ball.vertices, ball.faces), name="ball")
    world = nuno.World(device="cpu")
    world.add(ball)
    cloth = nuno.sheet((1.0, 0.6), cells=(33, 20)).rotate(0.5 * np.pi, "y")
    world.add(cloth)
    world.attach(cloth, nuno.Cloth(thickness=0.003, air_drag=1.0))
    start = cloth.vertices
    top = np.flatnonzero(start[:, 2] > 0.499)
    world.grip(cloth, top, to=start[top].mean(axis=0))
    world.move(ball, nuno.Path([0.0, 0.2], [(-0.2, 0, 0), (-0.2 + 0.2 * speed, 0, 0)]))
    middle = np.linalg.norm(start[:, 1:], axis=1) < 0.5 * radius
    inner = radius if kind == "sphere" else radius * np.cos(np.pi / 16)  # 32 segments around
    for _ in range(48):
        world.run(1.0 / 240.0)
        away = cloth.vertices - ball.position
        # under a step's approach of gravity and the cloth's own thickness of 1.5 mm
        assert np.linalg.norm(away, axis=1).min() > inner
        assert (away[middle, 0] > 0.0).all()
    assert cloth.vertices[middle, 0].min() > 0.2 + 0.5 * radius


def test_what_follows_a_moved_body_moves_and_carries():
    """Promise of the interface: bodies that follow a moved body by ``assoc`` carry cloth as it does."""
    world, body, sheet = on_plate("box", 0.8, 1)
    cart = world.add(nuno.box((0.1, 0.1, 0.1), name="cart", position=(0, 0, -1.0)))
    cart.assoc(body)
    start = body.position
    world.run(0.1)
    path = nuno.Path([0.1, 1.1], [cart.position, cart.position + np.array([0, 0.5, 0.2])], interpolation="minimum_jerk")
    world.move(cart, path)
    world.run(1.1)
    np.testing.assert_allclose(body.position, start + np.array([0, 0.5, 0.2]), atol=1e-12)
    # at most 2.9 m/s2, well below mu g
    np.testing.assert_allclose(sheet.vertices.mean(axis=0), [0, 0.5, 0.2 + 0.5 * THICKNESS], atol=5e-5)


def test_a_grip_led_by_a_moved_body_is_where_the_body_is():
    """Promise of the interface: gripped points keep their places in a moving body's frame, at every instant."""
    world, body, sheet = on_plate("box", 0.3, 1)
    vertices = np.array([0, 12])
    world.grip(sheet, vertices, to=body)
    local = body.to_local(sheet.vertices[vertices])
    turn = [np.cos(0.6), 0, 0, np.sin(0.6)]
    path = nuno.Path([0.0, 0.5], [body.position, [0.5, 0.1, 0.1]], [(1, 0, 0, 0), turn], "minimum_jerk")
    world.move(body, path)
    for seconds in (0.1, 0.213, 0.3):
        world.run(seconds)
        # straight lines between keys half a frame apart: a T^2 / 32 = 0.1 mm; float32
        np.testing.assert_allclose(body.to_local(sheet.vertices[vertices]), local, atol=1e-6)


def test_a_moving_hand_feels_weight_and_inertia():
    """Newton: a hand that rises at a bears m (g + a), whether its frames are run one by one or at once."""
    times, rise = np.linspace(0.0, 1.0, 601), 3.0
    for pieces in (1, 30):
        world = nuno.World(device="cpu")
        hand = world.add(nuno.box((0.05, 0.05, 0.05), position=(0, 0, 1)))
        cloth = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0, 0, 0.5)))
        world.attach(cloth, nuno.Cloth(area_density=0.25, air_drag=0.0))
        grip = world.grip(cloth, np.arange(25), to=hand)
        way = np.stack([0 * times, 0 * times, 1.0 + 0.5 * rise * times**2], axis=1)
        world.move(hand, nuno.Path(times, way))
        for _ in range(pieces):
            world.run(0.5 / pieces)
        force, _ = grip.wrench
        # every vertex is held: no cloth in between that could swing
        np.testing.assert_allclose(force, [0, 0, -0.25 * 0.04 * (GRAVITY + rise)], atol=1e-6)


def test_a_jump_moves_nothing():
    """Promise of the interface: a body that is located elsewhere between steps drags nothing along."""
    world, body, sheet = on_plate("box", 0.8, 1)
    world.run(0.1)
    before = sheet.vertices
    body.translate((0.2, 0, 0))
    world.run(0.1)
    np.testing.assert_allclose(sheet.vertices, before, atol=1e-5)
    start = body.position
    world.move(body, nuno.Path([0.0, 10.0], [start + np.array([0.1, 0, 0])] * 2))
    world.run(0.1)
    np.testing.assert_allclose(sheet.vertices, before, atol=1e-5)
    np.testing.assert_allclose(body.position, start + np.array([0.1, 0, 0]))


@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_a_world_of_a_batch_moves_as_alone(kind):
    """Promise: bit for bit, with a path of its own in each of 18 worlds (more than the lanes of a vector)."""
    shift = np.linspace(0.1, 0.5, 18)

    def run(which):
        world, body, sheet = on_plate(kind, 0.3, 18 if which is None else 1)
        start = np.atleast_2d(body.position)[0]
        goal = start + np.stack([shift, 0 * shift, 0.1 * shift], axis=-1)
        turn = np.stack([np.cos(shift), 0 * shift, 0 * shift, np.sin(shift)], axis=-1)
        places = np.stack([np.broadcast_to(start, goal.shape), goal], axis=1)
        turns = np.stack([np.broadcast_to([1.0, 0, 0, 0], turn.shape), turn], axis=1)
        chosen = slice(None) if which is None else which
        world.move(body, nuno.Path([0.0, 0.3], places[chosen], turns[chosen], "minimum_jerk"))
        world.run(0.35)
        return sheet.vertices, body.position

    batch, places = run(None)
    for k in (0, 16, 17):
        alone, place = run(k)
        np.testing.assert_array_equal(batch[k], alone)
        np.testing.assert_array_equal(places[k], place)


@pytest.mark.long
def test_all_plans_see_a_shape_move_alike():
    """One source: sixteen particles at a time, one by one, and groups of blocks give the same bits."""
    world = nuno.World(device="cpu")
    tray = world.add(nuno.box((0.3, 0.3, 0.02), name="tray", position=(0, 0, -0.0125)))
    other = world.add(nuno.mesh((tray.vertices + np.array([0.3, 0, 0]), tray.faces), name="other"))
    turn = [(1, 0, 0, 0), (np.cos(0.2), 0, 0, np.sin(0.2))]
    goals = tray.position + np.array([0.1, 0, 0.02]), other.position + np.array([-0.1, 0, 0.02])
    world.move(tray, nuno.Path([0.0, 0.2], [tray.position, goals[0]], turn, "minimum_jerk"))
    world.move(other, nuno.Path([0.0, 0.2], [other.position, goals[1]]))
    topology = ClothTopology.sheet((12, 12), (0.4, 0.4))
    start = topology.rest[None] + np.array([0.1, 0, 0.001])
    ends = []
    for plan in ("vector", "fused", "grid"):
        solver = ClothSolver(
            topology, nuno.Cloth(thickness=THICKNESS), start, 0 * start, substeps=20, plan=plan, self_contact=False
        )
        colliders = Colliders.from_bodies([tray, other])
        solver.set_colliders(colliders)
        colliders.follow(make_schedule([tray, other], 0.0, 0.225, 1.0 / 60.0))
        solver.run(0.0, 0.225)
        ends.append(solver.positions())
    assert np.linalg.norm(ends[0] - start, axis=-1).max() > 0.02
    np.testing.assert_array_equal(ends[1], ends[0])
    np.testing.assert_array_equal(ends[2], ends[0])


def test_a_span_gone_through_in_pieces_ends_alike():
    """Promise: which frames are run at once changes no bit, also where a shape moves and turns."""

    def after(pieces):
        world, body, sheet = on_plate("box", 0.3, 1)
        goal = body.position + np.array([0.4, 0.1, 0.05])
        turns = [(1, 0, 0, 0), (np.cos(0.3), 0, 0, np.sin(0.3))]
        world.move(body, nuno.Path([0.0, 0.5], [body.position, goal], turns, "minimum_jerk"))
        for _ in range(pieces):
            world.run(0.5 / pieces)
        return sheet.vertices

    whole = after(1)
    np.testing.assert_array_equal(after(6), whole)
    np.testing.assert_array_equal(after(30), whole)


def test_a_conveyor_takes_a_soft_body_to_its_speed():
    """Coulomb, as for a sheet: a = mu g, then the plate's speed."""
    world = nuno.World(device="cpu")
    world.add(plate("box"))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (3, 3, 3), name="cube", position=(0, 0, 0.05)))
    world.attach(cube, nuno.Soft(youngs_modulus=2e5))
    world.set_friction("plate", cube, 0.3)
    body = world.find("plate")
    world.run(0.3)  # it settles under its weight
    world.move(body, nuno.Path([0.3, 2.3], [body.position, body.position + np.array([1.0, 0, 0])]))
    world.run(0.1)
    # it shears, and swings by a few per cent about that
    np.testing.assert_allclose(cube.velocities.mean(axis=0)[0], 0.3 * GRAVITY * 0.1, rtol=0.05)
    world.run(0.6)
    np.testing.assert_allclose(cube.velocities.mean(axis=0)[0], 0.5, rtol=0.01)
