"""Grips, welds and joints of rigid bodies on MuJoCo that give way, let them slide, or bear a limited force."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

G = 9.81
SOFT = 1e-3  # [m/N] and [1/(N m)]
STEP = 1.0 / 480.0  # [s] a substep of a frame of 1/60 s
QUARTER = (np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4))


def block_in(world, name="block", place=(0.0, 0.0, 1.0), drag=6.0):
    """Return a dynamic block of 1 kg in a world."""
    return world.attach(
        world.add(nuno.box((0.1, 0.1, 0.1), name=name, position=place)), nuno.Rigid(mass=1.0, air_drag=drag)
    )


def world_of(**settings):
    """Return an empty world of MuJoCo's."""
    return nuno.World(device="cpu", engine="mujoco", **settings)


def test_a_grip_gives_way_by_its_compliance_and_turns_as_much():
    """C m g down under the weight, c M under a torque, within 1 % for the weld's own give; it bears all the weight."""
    world = world_of()
    block = block_in(world)
    grip = world.grip(block, to=block.position, compliance=SOFT)
    world.run(2.0)
    np.testing.assert_allclose(block.position, (0.0, 0.0, 1.0 - SOFT * G), atol=1e-4)
    np.testing.assert_allclose(grip.wrench[0], (0.0, 0.0, -G), atol=0.01)  # it still swings
    world.push(block, (0.0, 0.0, 0.0), torque=(0.0, 0.0, 20.0))
    world.run(1.5)
    assert 2.0 * np.arcsin(block.quaternion[3]) == pytest.approx(20.0 * SOFT, rel=0.01)
    grip.release()
    world.run(0.1)
    assert block.position[2] < 0.96  # by 49 mm, less what air takes


def test_a_free_direction_is_slid_along():
    """A slope of 30 degrees: g sin(30) t (t + h) / 2 along, nothing across, and it bears m g cos(30)."""
    world = world_of()
    block = block_in(world, drag=0.0)
    along = np.array((np.cos(np.pi / 6), 0.0, -np.sin(np.pi / 6)))
    grip = world.grip(block, to=block.position, free=along)
    world.run(0.5)
    way = block.position - (0.0, 0.0, 1.0)
    assert way @ along == pytest.approx(0.5 * G * 0.5 * 0.5 * (0.5 + 1.0 / 480.0), rel=1e-4)
    np.testing.assert_allclose(way - (way @ along) * along, 0.0, atol=1e-5)
    across = np.array((np.sin(np.pi / 6), 0.0, np.cos(np.pi / 6)))
    np.testing.assert_allclose(grip.wrench[0], -G * np.cos(np.pi / 6) * across, atol=1e-3)


@pytest.mark.parametrize("compliance", [0.0, SOFT])
def test_what_slides_is_led_and_turned_along_a_path(compliance):
    """It falls freely by g t (t + h) / 2 along z, which stays the world's z, while the path leads and turns it."""
    world = world_of()
    block = block_in(world, drag=0.0)
    path = nuno.Path([0.0, 0.5], [(0, 0, 1.0), (0.3, 0, 1.0)], [(1, 0, 0, 0), QUARTER], "minimum_jerk")
    world.grip(block, to=path, free=(0.0, 0.0, 1.0), compliance=compliance)
    world.run(0.4)
    x, y, z = block.position
    assert z == pytest.approx(1.0 - 0.5 * G * 0.4 * (0.4 + 1.0 / 480.0), abs=1e-4)
    led = path.at(0.4)
    # stiff grips keep within 0.2 mm at such a speed; a spring of 1 kN/m swings about where it is led by up to m a c, of
    # a path's 5.8 d / T^2 = 7 m/s2
    assert np.hypot(x - led[0], y) < (2e-4 if compliance == 0.0 else 2 * SOFT * 7.0)
    turned = 2.0 * np.arctan2(block.quaternion[3], block.quaternion[0])
    assert turned == pytest.approx(2.0 * np.arctan2(*path.quaternion_at(0.4)[[3, 0]]), abs=0.02)


def test_a_weld_gives_way_to_a_body_that_moves():
    """C m g below its place on a block that is held, within 1 %."""
    world = world_of()
    held, block = block_in(world, "held"), block_in(world, place=(0.2, 0.0, 1.0))
    world.grip(held, to=held.position)
    weld = world.weld(block, held, compliance=SOFT)
    world.run(2.0)
    np.testing.assert_allclose(block.position, (0.2, 0.0, 1.0 - SOFT * G), atol=1e-4)
    np.testing.assert_allclose(weld.wrench[0], (0.0, 0.0, -G), atol=1e-2)


def test_a_static_body_leads_and_what_was_saved_goes_on_to_the_bit():
    """Led by a body on a path, it hangs c m g below; restored, and in a batch, every bit is the same again."""
    world = world_of()
    leader = world.add(nuno.box((0.1, 0.1, 0.1), name="leader", position=(-0.3, 0.0, 1.0)))
    block = block_in(world)
    world.move(leader, nuno.Path([0.0, 1.0], [(-0.3, 0.0, 1.0), (-0.3, 0.2, 1.0)]))
    world.grip(block, to=leader, compliance=SOFT)
    world.run(0.5)
    saved, futures = world.save(), world.imagine(2)
    world.run(1.5)
    futures.run(1.5)
    np.testing.assert_allclose(block.position, (0.0, 0.2, 1.0 - SOFT * G), atol=1e-4)
    np.testing.assert_array_equal(futures.find("block").position, [block.position] * 2)
    before = block.position
    world.restore(saved)
    world.run(1.5)
    np.testing.assert_array_equal(world.find("block").position, before)


@pytest.mark.parametrize("share", [1.5, 0.5])
def test_a_limited_grip_holds_what_it_can_bear_and_lets_fall_what_it_cannot(share):
    """Above the weight it gives way by g h^2 / 20; below it falls by (1 - share) g t^2 / 2 from the second substep."""
    world = world_of()
    block = block_in(world, drag=0.0)
    grip = world.grip(block, to=block.position, max_force=share * G)
    world.run(0.5)
    # it bears all in the first substep, in which nothing is known of the load
    fallen = 0.5 * (1.0 - share) * G * (0.5 - STEP) * 0.5 if share < 1.0 else G * STEP**2 / 20.0
    assert 1.0 - block.position[2] == pytest.approx(fallen, rel=1e-3)
    np.testing.assert_allclose(grip.wrench[0], (0.0, 0.0, -min(share, 1.0) * G), rtol=1e-6, atol=1e-9)


def test_a_limit_is_of_the_size_of_force_and_torque():
    """A 2 N grip takes 1 kg aslant with 2 m/s2; a torque of 0.036 N m less 0.01 spins it up."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world, drag=0.0)
    away = np.array((5.0, 4.0, 2.0))
    grip = world.grip(block, to=block.position + away, max_force=2.0)
    world.run(0.4)  # by then it goes with 0.8 m/s, below the 1 m/s by which a grip catches up
    along = away / np.linalg.norm(away)
    np.testing.assert_allclose(block.velocity, 2.0 * 0.4 * along, rtol=1e-3)
    np.testing.assert_allclose(grip.wrench[0], -2.0 * along, rtol=1e-4)
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world, drag=0.0)
    grip = world.grip(block, to=block.position, max_force=0.01)
    torque = np.array((0.02, 0.03, 0.0))
    world.push(block, (0.0, 0.0, 0.0), torque=torque, duration=0.2)
    world.run(0.2)
    size = np.linalg.norm(torque)
    spun = (1.0 - 0.01 / size) * torque / (0.01 / 6.0)
    np.testing.assert_allclose(block.angular_velocity, spun * (0.2 - STEP), rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(grip.wrench[1], 0.01 / size * torque, rtol=1e-4, atol=1e-9)


@pytest.mark.long
def test_what_was_torn_off_comes_back_as_in_nuno():
    """By 0.8 m, and back with 1 m/s and 5 m/s2 at most: within the 8 mm of the first substep, which bore all."""
    ways = {}
    for engine in ("nuno", "mujoco"):
        world = nuno.World(device="cpu", engine=engine, gravity=(0.0, 0.0, 0.0))
        block = block_in(world, drag=0.0)
        world.grip(block, to=block.position, max_force=5.0)
        world.push(block, (10.0, 0.0, 0.0), duration=0.4)
        ways[engine] = []
        for _ in range(8):
            world.run(0.2)
            ways[engine].append(block.position[0])
    np.testing.assert_allclose(ways["mujoco"], ways["nuno"], atol=10.0 * STEP * 0.4 * 1.5)
    assert max(ways["nuno"]) > 0.7 and ways["nuno"][-1] < 0.2


def test_a_limited_weld_between_two_bodies_goes_as_in_nuno():
    """One of 2 N and 2 N m between 1 and 2 kg as one is pushed with 5 N: velocities as there within 1 %."""
    found = {}
    for engine in ("nuno", "mujoco"):
        world = nuno.World(device="cpu", engine=engine, gravity=(0.0, 0.0, 0.0))
        one, two = block_in(world, "one", drag=0.0), world.add(nuno.box((0.1, 0.1, 0.1), position=(0.2, 0.0, 1.0)))
        world.attach(two, nuno.Rigid(mass=2.0))
        world.weld(one, two, max_force=2.0)
        world.push(one, (0.0, 5.0, 0.0), duration=1.0)
        world.run(0.1)
        found[engine] = np.array([one.velocity, two.velocity, one.angular_velocity, two.angular_velocity])
    np.testing.assert_allclose(found["mujoco"], found["nuno"], atol=0.01 * 0.45)
    np.testing.assert_allclose(found["mujoco"][0] + 2.0 * found["mujoco"][1], (0.0, 0.5, 0.0), atol=1e-9)


@pytest.mark.parametrize("kind", ["hinge", "slider", "ball", "fixed"])
def test_a_limited_joint_bears_its_limit_and_no_more(kind):
    """A body of 1 kg is pushed with 1 N along and 5 N across a joint of 2 N: it goes with what is left, within 2 %."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = block_in(world, drag=0.0)
    joint = {
        "hinge": lambda: nuno.hinge(block, None, point=block.position, axis=(0.0, 0.0, 1.0), max_force=2.0),
        "slider": lambda: nuno.slider(block, None, axis=(1.0, 0.0, 0.0), max_force=2.0),
        "ball": lambda: nuno.ball_joint(block, None, point=block.position, max_force=2.0),
        "fixed": lambda: nuno.fixed_joint(block, None, max_force=2.0),
    }[kind]()
    push = np.array((1.0 if kind == "slider" else 0.0, 5.0, 0.0))
    world.push(block, push, duration=0.3)
    world.run(0.3)
    # the first substeps are its own; a helper of 2 % of the mass stays behind on hinges and sliders
    np.testing.assert_allclose(block.velocity[:2], (0.3 * push[0], 0.3 * 3.0), rtol=0.035)
    np.testing.assert_allclose(joint.wrench[0], (0.0, 2.0, 0.0), atol=0.02)


def test_a_limited_hinge_swings_with_its_friction_as_in_nuno():
    """A rod of 80 g on a hinge of 50 N falls and swings against 0.01 N m: within 2 mm of Nuno's, and bears as much."""
    found = {}
    for engine in ("nuno", "mujoco"):
        world = nuno.World(device="cpu", engine=engine)
        rod = world.attach(world.add(nuno.box((0.2, 0.02, 0.02), position=(0.1, 0.0, 1.0))))
        hinge = nuno.hinge(rod, None, point=(0, 0, 1), axis=(0, 1, 0), friction=0.01, max_force=50.0)
        world.run(0.5)
        found[engine] = rod.position, hinge.wrench[0], hinge.effort
    np.testing.assert_allclose(found["mujoco"][0], found["nuno"][0], atol=2e-3)
    np.testing.assert_allclose(found["mujoco"][1], found["nuno"][1], atol=0.01)
    assert found["mujoco"][2] == pytest.approx(0.01, rel=1e-3)


def test_a_sliding_weld_slides_along_the_world_s_direction():
    """It falls freely beside what holds it; of two free bodies momentum stays, and energy to 0.1 %, as in Nuno's."""
    world = world_of()
    holder, block = block_in(world, "holder"), block_in(world, place=(0.3, 0.0, 1.0), drag=0.0)
    world.grip(holder, to=holder.position)
    world.grip(block, to=holder, free=(0.0, 0.0, 1.0))
    world.run(0.3)
    np.testing.assert_allclose(block.position, (0.3, 0.0, 1.0 - 0.5 * G * 0.3 * (0.3 + STEP)), atol=1e-5)
    places = {}
    for engine in ("nuno", "mujoco"):
        world = nuno.World(device="cpu", engine=engine, gravity=(0.0, 0.0, 0.0))
        holder, block = block_in(world, "holder", drag=0.0), block_in(world, place=(0.3, 0.0, 1.0), drag=0.0)
        world.grip(block, to=holder, free=(1.0, 0.0, 0.0))
        world.set_velocity(block, (0.5, 0.6, 0.0))
        world.run(0.1)  # what was not along the free direction has gone by then
        energy = kinetic_energy(holder, block)
        world.run(0.3)
        places[engine] = np.array([holder.position, block.position])
        assert kinetic_energy(holder, block) == pytest.approx(energy, rel=1e-3)
    np.testing.assert_allclose(holder.velocity + block.velocity, (0.5, 0.6, 0.0), atol=1e-9)
    np.testing.assert_allclose(places["mujoco"], places["nuno"], atol=3e-4)


def kinetic_energy(*blocks):
    """Return that of blocks of 1 kg [J]."""
    return sum(0.5 * (b.velocity @ b.velocity + 0.01 / 6.0 * b.angular_velocity @ b.angular_velocity) for b in blocks)


def limited_pair(engine):
    """Return a world with two blocks: one by a limited sliding grip, the other by a limited, compliant weld to it."""
    world = nuno.World(device="cpu", engine=engine)
    first, second = block_in(world, "first", drag=0.0), block_in(world, "second", (0.2, 0.0, 1.0), drag=0.0)
    path = nuno.Path([0.0, 0.5], [(0.0, 0.0, 1.0), (0.2, 0.1, 1.1)], None, "minimum_jerk")
    world.grip(first, to=path, free=(0.0, 1.0, 0.0), max_force=40.0)
    world.weld(second, first, compliance=1e-4, max_force=15.0)
    return world


def test_limited_kinds_together_in_a_batch_restored_and_back_in_nuno():
    """To the same bits alone, in a batch of three and from a snapshot in mid-frame; imagined from Nuno and adopted."""
    world = limited_pair("nuno")
    world.run(0.1)
    alone, futures = world.imagine(1, engine="mujoco"), world.imagine(3, engine="mujoco")
    for each in (alone, futures):
        each.run(0.155)  # frames that are cut short, too
    saved = alone.save()
    for each in (alone, futures):
        each.run(0.2)
    places = alone.find("second").vertices
    np.testing.assert_array_equal(futures.find("second").vertices, [places] * 3)
    alone.restore(saved)
    alone.run(0.2)
    np.testing.assert_array_equal(alone.find("second").vertices, places)
    world.run(0.355)
    # both give way under the weights as Nuno's: 1 mm of 20 cm
    np.testing.assert_allclose(world.find("second").vertices, places, atol=1e-3)
    world.adopt(futures, 2)
    world.run(0.1)
    assert world.find("second").is_dynamic and world.engine.name == "nuno"
