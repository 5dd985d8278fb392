"""What static bodies give a cloth or soft body over a frame: weights at rest, and the balance of momentum else."""

import numpy as np
import pytest

import nuno
from random_worlds import RandomWorld

GRAVITY = 9.81
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]
REPORTED = 1e-3
"""Of a weight's impulse in a frame: float32 moves of 1e-7 of some cm each, summed over a frame's substeps."""


def table(world, width=1.6, x=0.0, name="table", **options):
    """Add a table whose top is at z = 0."""
    return world.add(nuno.box((width, 0.6, 0.1), position=(x, 0.0, -0.05), name=name, **options))


def towel(world, height=0.0021, cells=(8, 8), **material):
    """Add a towel of 16 x 16 cm that sums up its impulses."""
    body = world.add(nuno.sheet((0.16, 0.16), cells=cells, position=(0.0, 0.0, height), name="towel"))
    world.attach(body, nuno.Cloth(**material))
    world.sum_impulses(body)
    return body


def weight(world, *bodies):
    """Return what gravity gives some bodies in a frame [N s], upwards."""
    return sum(float(body.mass) for body in bodies) * GRAVITY / world.frame_rate


def check_balance(world, body, frames):
    """Check, frame by frame, that impulses are what momentum and weight took; return them, a dict a frame."""
    found = []
    for _ in range(frames):
        before = body.momentum
        world.step()
        taken = body.momentum - before + np.array((0.0, 0.0, weight(world, body)))
        found.append(world.contacts(body).impulses)
        given = sum(found[-1].values(), start=np.zeros(3))
        np.testing.assert_allclose(given, taken, atol=REPORTED * max(weight(world, body), np.linalg.norm(taken)))
    return found


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("substeps", [None, 10])
def test_a_towel_on_a_table(device, substeps):
    """At rest the table gives m g dt, in a whole frame and in half of one; it is known once a frame was summed up.

    Air drag d takes its share of what each substep of h predicts: m g dt / (1 + d h) is left.
    """
    world = nuno.World(device=device, substeps=substeps)
    table(world)
    body = towel(world)
    assert world.contacts(body).impulses == {}
    world.run(1.0)
    told = world.contacts(body).impulses
    assert set(told) == {"table"}
    whole = weight(world, body) / (1.0 + body.material.air_drag / world.frame_rate / body.resolution.substeps)
    np.testing.assert_allclose(told["table"], (0.0, 0.0, whole), atol=REPORTED * whole)
    world.run(0.5 / world.frame_rate)
    half = 0.5 * whole
    np.testing.assert_allclose(world.contacts(body).impulses["table"], (0.0, 0.0, half), atol=REPORTED * half)
    world.sum_impulses(body, False)
    world.step()
    assert world.contacts(body).impulses == {}


@pytest.mark.parametrize("device", DEVICES)
def test_a_soft_cube_on_the_floor(device):
    """At rest the floor gives m g dt; while it comes to rest, what the balance of momentum says."""
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    cube = world.add(nuno.soft_box((0.08, 0.08, 0.08), (4, 4, 4), position=(0.0, 0.0, 0.06), name="cube"))
    world.attach(cube, nuno.Soft(density=100.0))
    world.sum_impulses(cube)
    assert max(frame["floor"][2] for frame in check_balance(world, cube, 20) if frame) > 2.0 * weight(world, cube)
    world.run(2.0)
    told = world.contacts(cube).impulses["floor"]
    np.testing.assert_allclose(told, (0.0, 0.0, weight(world, cube)), atol=REPORTED * weight(world, cube))


@pytest.mark.parametrize("device", DEVICES)
def test_a_table_that_lifts_a_towel(device):
    """A table that follows a path gives what the balance of momentum says, in every frame of a lift."""
    world = nuno.World(device=device)
    low = table(world)
    body = towel(world, air_drag=0.0)
    world.run(0.2)
    world.move(low, nuno.Path([0.2, 0.5], [(0.0, 0.0, -0.05), (0.02, 0.01, 0.05)]))
    found = check_balance(world, body, 24)
    assert max(frame["table"][2] for frame in found if frame) > 2.0 * weight(world, body)


def test_two_tables_share_a_towel():
    """Each vertex lies on one of two tables that meet in the middle of a column of cells, and presses by its mass."""
    world = nuno.World(device="cpu")
    table(world, 0.8, -0.43, "left")
    table(world, 0.8, 0.37, "right")
    body = towel(world)
    world.run(1.0)
    told = world.contacts(body).impulses
    # three of nine columns of vertices lie on the left one, of which the first has half of a column's mass
    np.testing.assert_allclose(told["left"][2], 2.5 / 8.0 * weight(world, body), rtol=0.01)
    np.testing.assert_allclose(told["right"][2], 5.5 / 8.0 * weight(world, body), rtol=0.01)


def test_a_floor_and_a_wall():
    """A soft cube that slides into a wall has its weight from the floor, and what stops it from the wall."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor", friction=0.0))
    world.add(nuno.box((0.1, 1.0, 1.0), position=(0.15, 0.0, 0.0), name="wall", friction=0.0))
    cube = world.add(nuno.soft_box((0.08, 0.08, 0.08), (3, 3, 3), position=(0.05, 0.0, 0.0405), name="cube"))
    world.attach(cube, nuno.Soft(density=100.0), velocity=(0.5, 0.0, 0.0))
    world.sum_impulses(cube)
    start, found = cube.momentum, check_balance(world, cube, 30)
    floor, wall = (sum(frame.get(name, np.zeros(3)) for frame in found) for name in ("floor", "wall"))
    assert wall[0] == pytest.approx(cube.momentum[0] - start[0], rel=REPORTED)
    assert wall[0] < -0.5 * start[0] and abs(wall[2]) < 1e-6
    assert floor[2] == pytest.approx(30 * weight(world, cube) + cube.momentum[2] - start[2], rel=REPORTED)
    assert abs(floor[0]) < 1e-6


@pytest.mark.parametrize("device", [*DEVICES, pytest.param("at once", marks=pytest.mark.long)])
def test_a_box_on_a_towel_on_a_table(device, monkeypatch):
    """The table bears both; what the box presses on the towel is its weight; contacts all at once as one by one."""
    if device == "at once":
        monkeypatch.setattr("nuno.solvers.coupling.solves_at_once", lambda device: True)
        device = "cpu"
    world = nuno.World(device=device)
    table(world)
    body = towel(world)
    box = world.add(nuno.box((0.1, 0.1, 0.05), position=(0.0, 0.0, 0.03), name="box"))
    world.attach(box, nuno.Rigid(mass=0.5))
    world.run(1.0)
    told = world.contacts(body).impulses
    both = weight(world, body, box)
    np.testing.assert_allclose(told["table"], (0.0, 0.0, both), atol=0.01 * both)
    np.testing.assert_allclose(told["box"], (0.0, 0.0, -weight(world, box)), atol=0.01 * both)


@pytest.mark.long
def test_worlds_in_which_a_pair_takes_other_substeps():
    """Equilibrium in every world: a box presses its weight on a towel, beside a stiff cube in one of two worlds."""
    world = nuno.World(device="cpu")
    table(world)
    world.add(nuno.sheet((0.32, 0.16), cells=(16, 8), position=(0.0, 0.0, 0.0021), name="towel"))
    world.add(nuno.box((0.1, 0.1, 0.05), position=(-0.08, 0.0, 0.03), name="box"))
    world.add(nuno.soft_box((0.06, 0.06, 0.06), (3, 3, 3), position=(0.08, 0.0, 0.036), name="cube"))
    worlds = world.imagine(2)
    body, box, cube = (worlds.find(name) for name in ("towel", "box", "cube"))
    worlds.attach(body, nuno.Cloth())
    worlds.attach(box, nuno.Rigid(mass=0.3))
    worlds.attach(cube, nuno.Soft(density=200.0, youngs_modulus=2e5, damping=0.02))
    assert cube.resolution.substeps > body.resolution.substeps
    worlds.set_pose(cube, position=(0.6, 0.0, 0.032), worlds=[0])  # on the table alone
    worlds.run(0.6)
    found = worlds.contacts(body).impulses["box"]
    weight_of_box = 0.3 * GRAVITY / worlds.frame_rate
    np.testing.assert_allclose(found, [(0.0, 0.0, -weight_of_box)] * 2, atol=0.02 * weight_of_box)


def thrown(world):
    """Throw a towel at two crossed rods and the edge of a box over a floor, fast enough for careful frames."""
    world.add(nuno.plane(name="floor"))
    world.add(
        nuno.cylinder(0.005, 0.4, position=(0.0, 0.03, 0.05), quaternion=(0.5**0.5, 0.0, 0.5**0.5, 0.0), name="rod")
    )
    world.add(
        nuno.capsule(0.004, 0.4, position=(0.03, 0.0, 0.035), quaternion=(0.5**0.5, 0.5**0.5, 0.0, 0.0), name="bar")
    )
    world.add(nuno.box((0.05, 0.05, 0.06), position=(-0.04, -0.04, 0.03), name="block"))
    body = world.add(nuno.sheet((0.16, 0.16), cells=(16, 16), position=(0.0, 0.0, 0.1), name="towel"))
    world.attach(body, nuno.Cloth(air_drag=0.0), velocity=(0.5, 0.2, -3.0))
    return ()


def test_a_towel_thrown_at_edges():
    """Where edges and triangles meet several sharp shapes, fast or not, the impulses add up to the balance."""
    world = nuno.World(device="cpu")
    thrown(world)
    body = world.find("towel")
    world.sum_impulses(body)
    found = check_balance(world, body, 30)
    assert {name for frame in found for name in frame} == {"floor", "rod", "bar", "block"}


def scenes(world):
    """Add all that runs in ways of its own: a held towel on a led table, a soft cube by a wall, a loaded towel."""
    low = table(world)
    world.move(low, nuno.Path([0.0, 0.3], [(0.0, 0.0, -0.05), (0.0, 0.0, 0.03)]))
    body = towel(world)
    grip = world.grip(body, [0, 8], to=nuno.Path([0.0, 0.3], [(-0.08, -0.08, 0.003), (-0.02, -0.08, 0.1)]))
    world.add(nuno.box((0.1, 1.0, 0.4), position=(0.75, 0.0, 0.2), name="wall"))
    cube = world.add(nuno.soft_box((0.08, 0.08, 0.08), (3, 3, 3), position=(0.655, 0.0, 0.05), name="cube"))
    world.attach(cube, nuno.Soft(density=100.0), velocity=(1.0, 0.0, 0.0))
    spread = world.add(nuno.sheet((0.16, 0.16), cells=(8, 8), position=(0.3, 0.0, 0.0021), name="spread"))
    world.attach(spread)
    box = world.add(nuno.box((0.1, 0.1, 0.05), position=(0.3, 0.0, 0.03), name="box"))
    world.attach(box, nuno.Rigid(mass=0.2))
    return (grip,)


@pytest.mark.long
@pytest.mark.parametrize("build", [pytest.param(scenes, marks=pytest.mark.slow), thrown])
@pytest.mark.parametrize("device", DEVICES)
def test_asking_changes_no_bit(device, build):
    """Bodies that sum up go on, step by step or in one run, as they do without; so do those around them."""
    ended, borne = [], []
    for asked in (False, True):
        world = nuno.World(device=device)
        grips = build(world)
        for body in world.bodies:
            world.sum_impulses(body, asked)
        world.run(0.1)
        world.step()
        world.run(0.2)
        ended.append(np.concatenate([body.vertices for body in world.bodies if body.is_dynamic]))
        borne.append([grip.wrench for grip in grips])
    np.testing.assert_array_equal(*ended)
    np.testing.assert_array_equal(*borne)


@pytest.mark.parametrize("seed", range(6))
def test_asking_changes_no_bit_of_random_worlds(seed):
    """Whatever happens to a world, and whenever it is asked for."""
    ended = []
    for asked in (False, True):
        scene = RandomWorld(seed)
        for _ in range(6):
            for body in scene.world.bodies:
                scene.world.sum_impulses(body, asked)
            scene.happen(2)
        scene.world.run(0.1)
        ended.append(np.concatenate([body.vertices for body in scene.world.bodies]))
    np.testing.assert_array_equal(*ended)


def test_nothing_is_near():
    """A towel that is thrown where there is nothing, fast enough for careful frames, is given nothing."""
    world = nuno.World(device="cpu")
    table(world, x=50.0)
    body = world.add(nuno.sheet((0.16, 0.16), cells=(8, 8), name="towel"))
    world.attach(body, nuno.Cloth(), velocity=(9.0, 0.0, 0.0), angular_velocity=(0.0, 80.0, 0.0))
    world.sum_impulses(body)
    world.run(0.1)
    assert world.contacts(body).impulses == {}


@pytest.mark.parametrize("build", [pytest.param(scenes, marks=pytest.mark.slow), thrown])
def test_copies_sum_up_too(build, tmp_path):
    """Futures, restored worlds and files tell, after a frame, what the world does, to the bit; and nothing before."""
    world = nuno.World(device="cpu")
    build(world)
    names = [body.name for body in world.bodies if body.is_dynamic]
    for name in names:
        world.sum_impulses(name)
    world.run(0.05)
    path = tmp_path / "world.npz"
    saved, futures, other, read = world.save(path), world.imagine(3), nuno.World(device="cpu"), nuno.World(device="cpu")
    other.restore(saved)
    read.restore(path)
    world.run(0.15)
    told = {name: world.contacts(name).impulses for name in names}
    assert all(told.values())
    for copy in (other, read, futures):
        assert all(copy.contacts(name).impulses == {} for name in names)
        copy.run(0.15)
        for name in names:
            found = copy.contacts(name).impulses
            assert set(found) == set(told[name])
            for key, impulse in told[name].items():
                np.testing.assert_array_equal(found[key], np.broadcast_to(impulse, found[key].shape))
    world.restore(saved)
    assert all(world.contacts(name).impulses == {} for name in names)
    world.adopt(futures, 1)
    world.step()
    assert all(world.contacts(name).impulses for name in names)


@pytest.mark.long
def test_worlds_of_a_batch_have_their_own():
    """Each world of a batch is told the weight of its own towel, and of the box on it."""
    world = nuno.World(device="cpu")
    table(world)
    body = towel(world)
    futures = world.imagine(3)
    futures.set_material(body, nuno.Cloth(area_density=[0.1, 0.2, 0.4]))
    futures.run(1.0)
    whole = np.array([0.1, 0.2, 0.4]) * 0.16**2 * GRAVITY / 60.0
    np.testing.assert_allclose(futures.contacts("towel").impulses["table"][:, 2], whole, rtol=0.01)
    box = futures.add(nuno.box((0.1, 0.1, 0.05), position=(0.0, 0.0, 0.03), name="box"))
    futures.attach(box, nuno.Rigid(mass=[0.1, 0.2, 0.4]))
    futures.run(0.5)
    whole += np.array([0.1, 0.2, 0.4]) * GRAVITY / 60.0
    np.testing.assert_allclose(futures.contacts("towel").impulses["table"][:, 2], whole, rtol=0.01)
