"""Grips of rigid bodies on MuJoCo that give way, or let them slide."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

G = 9.81
SOFT = 1e-3  # [m/N] and [1/(N m)]
QUARTER = (np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4))


def block_in(world, name="block", place=(0.0, 0.0, 1.0), drag=6.0):
    """Return a dynamic block of 1 kg in a world."""
    return world.attach(
        world.add(nuno.box((0.1, 0.1, 0.1), name=name, position=place)), nuno.Rigid(mass=1.0, air_drag=drag)
    )


def world_of():
    """Return an empty world of MuJoCo's."""
    return nuno.World(device="cpu", engine="mujoco")


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
    with pytest.raises(nuno.EngineCapabilityError, match="mujoco has no sliding welds"):
        world.grip(block, to=held, free=(0.0, 0.0, 1.0))


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
