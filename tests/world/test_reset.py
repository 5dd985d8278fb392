"""Reset: some worlds of a batch become what was saved, and the others keep every bit."""

import numpy as np
import pytest

import nuno
from nuno import BodyStateError, InvalidInputError


def scene():
    """A cloth held at a corner, a box that falls and a ledge that moves, in a world; and the grip."""
    world = nuno.World(device="cpu", substeps=5)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.1, 0.1, 0.02), name="ledge", position=(0.4, 0.0, 0.05)))
    cloth = world.attach(world.add(nuno.sheet((0.2, 0.2), (4, 4), name="cloth", position=(0.0, 0.0, 0.1))))
    world.attach(world.add(nuno.box((0.05, 0.05, 0.05), name="box", position=(0.4, 0.0, 0.1))))
    return world, world.grip(cloth, [0], to=(-0.1, -0.1, 0.12))


def seen(world, k=None):
    """Positions and velocities of all bodies of a world, or of world k of a batch."""
    arrays = [a for body in world.bodies for a in (body.vertices, body.velocities)]
    return [a if k is None else a[k] for a in arrays]


def assert_same(found, expected):
    """Check that all arrays are equal, to the bit."""
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def assert_same_alone(batch, world, sources, seconds):
    """Check that worlds of a batch are what ``world`` is after so long from each one's snapshot [s]."""
    for k, source in sources.items():
        world.restore(source)
        world.run(seconds)
        assert_same(seen(batch, k), seen(world))


def test_worlds_that_are_reset_are_the_saved_world_alone():
    """They are what restore makes of the snapshot, now and later; the others are as if nothing had happened."""
    world, _ = scene()
    start = world.save()
    batch = world.imagine(4)
    batch.run(0.1)
    middle = batch.save()
    batch.reset([1, 3], start)
    batch.run(0.1)
    world.restore(start.at(middle.time))
    world.run(0.1)
    for k in (1, 3):
        assert_same(seen(batch, k), seen(world))
    world.restore(middle.pick(0))
    world.run(0.1)
    for k in (0, 2):
        assert_same(seen(batch, k), seen(world))


def test_each_world_has_a_clock():
    """It goes back where a world is reset, and time goes on; snapshots and copies keep it."""
    world, _ = scene()
    start = world.save()
    batch = world.imagine(3)
    batch.run(0.1)
    batch.reset(1, start)
    batch.run(0.05)
    np.testing.assert_allclose(batch.clock, [0.15, 0.05, 0.15], atol=1e-12)
    assert batch.time == pytest.approx(0.15) and world.clock == 0.0
    again = batch.imagine(2, world=1)
    np.testing.assert_allclose(again.clock, [0.05, 0.05], atol=1e-12)
    batch.restore(batch.save())
    np.testing.assert_allclose(batch.clock, [0.15, 0.05, 0.15], atol=1e-12)


def test_the_clocks_are_in_files(tmp_path):
    """A batch that was saved to a file has each world's clock."""
    world, _ = scene()
    batch = world.imagine(2)
    batch.run(0.05)
    batch.reset([0], world.save())
    batch.save(tmp_path / "batch.npz")
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "batch.npz")
    np.testing.assert_array_equal(other.clock, batch.clock)


def test_each_world_takes_its_own_part_of_a_batch_that_was_saved():
    """A mask names the worlds; a snapshot of the batch gives each what it was itself."""
    world, _ = scene()
    batch = world.imagine(3)
    batch.set_velocity("box", [(0.1 * k, 0.0, 0.0) for k in range(3)])
    saved, before = batch.save(), [seen(batch, k) for k in range(3)]
    batch.run(0.05)
    batch.reset(np.array([True, False, True]), saved)
    for k in (0, 2):
        assert_same(seen(batch, k), before[k])


def test_a_world_of_a_batch_is_imagined_and_adopted():
    """A batch's world has futures, of which it becomes one; they are what it does itself, to the bit."""
    world, _ = scene()
    batch = world.imagine(3)
    batch.set_velocity("box", [(0.1 * k, 0.0, 0.0) for k in range(3)])
    futures = batch.imagine(2, world=2)
    futures.run(0.05)
    batch.run(0.05)
    expected = seen(batch, 2)
    assert_same(seen(futures, 1), expected)
    batch.adopt(futures, 1, world=0)
    assert_same(seen(batch, 0), expected)
    assert_same(seen(batch, 2), expected)


def test_what_others_bear_is_told_after_a_reset():
    """What grips of the other worlds bore in the last frame, and what touches there, is as before."""
    world, grip = scene()
    start = world.save()
    batch = world.imagine(3)
    batch.run(0.3)
    own = next(g for g in batch.find("cloth")._dynamics.grips if g.key == grip.key)
    force, contacts = own.wrench[0], batch.contacts("box")
    batch.reset([1], start)
    np.testing.assert_array_equal(own.wrench[0][[0, 2]], force[[0, 2]])
    # nothing but the held vertex's own weight, a 64th of the cloth's: half the area of a cell of a corner
    assert np.abs(own.wrench[0][1]).max() < 9.81 * 0.2 * 0.2**2 / 64 * 1.01
    left, kept = batch.contacts("box"), contacts.worlds != 1
    np.testing.assert_array_equal(left.forces[left.worlds != 1], contacts.forces[kept])
    assert len(contacts) and not (left.worlds == 1).any()


def test_a_grip_that_was_let_go_is_back_where_the_world_is_reset():
    """Gripped since: let go there; released since: held there alone. Each world is what it is alone."""
    world, grip = scene()
    start = world.save()
    batch = world.imagine(3)
    next(g for g in batch.find("cloth")._dynamics.grips if g.key == grip.key).release()
    batch.grip("cloth", [24], to=(0.1, 0.1, 0.13))
    batch.run(0.05)
    middle = batch.save()
    batch.reset([1], start)
    batch.run(0.1)
    assert_same_alone(batch, world, {0: middle.pick(0), 1: start.at(middle.time), 2: middle.pick(2)}, 0.1)


def test_a_path_that_has_ended_is_no_obstacle():
    """Worlds go on along new paths, while one comes back to where its old one is under way."""
    world, grip = scene()
    grip.release()
    world.grip("cloth", [0], to=nuno.Path([0.0, 0.2], [(-0.1, -0.1, 0.1), (-0.1, -0.1, 0.2)]))
    world.move("ledge", nuno.Path([0.0, 0.2], [(0.4, 0.0, 0.05), (0.5, 0.0, 0.05)]))
    world.run(0.1)
    start = world.save()
    batch = world.imagine(2)
    batch.run(0.2)
    middle = batch.save()
    batch.reset([1], start)
    batch.run(0.15)
    assert_same_alone(batch, world, {0: middle.pick(0), 1: start.at(middle.time)}, 0.15)


def test_what_stands_in_a_world_that_is_reset_keeps_its_turn():
    """Of a box that tumbled, to the bit, while it follows a path in another world, and in that world adopted.

    What comes out of the dynamics has a turn of float32, whose length is 1 within 6e-8: made a part of a path, it was
    scaled to it.
    """
    world = nuno.World(device="cpu")
    box = world.add(nuno.box((0.1, 0.2, 0.05), position=(0.0, 0.0, 1.0)))
    world.attach(box, angular_velocity=(1.0, 2.0, 3.0))
    world.run(0.3)
    world.detach(box)
    turn = box.quaternion
    assert np.linalg.norm(turn) != 1.0
    batch = world.imagine(2)
    start = batch.save()
    path = nuno.Path([world.time, world.time + 0.2], np.stack([box.position, (0.0, 0.0, 2.0)]), np.stack([turn, turn]))
    batch.move(box, path)
    batch.run(0.05)
    batch.reset([1], start)
    batch.run(0.05)
    np.testing.assert_array_equal(batch.find(box.name).quaternion[1], turn)
    world.adopt(batch, 1)
    world.run(0.05)
    np.testing.assert_array_equal(box.quaternion, turn)


def test_a_rigid_body_is_led_from_where_its_leader_is_in_each_world():
    """A ledge that leads a box goes back to where it was before it had led: so does the box, in that world alone."""
    world, _ = scene()
    world.grip("box", to=world.find("ledge"))
    world.move("ledge", nuno.Path([0.0, 0.04], [(0.4, 0.0, 0.05), (0.4, 0.1, 0.05)]))
    start = world.save()
    batch = world.imagine(2)
    batch.run(0.05)
    middle = batch.save()
    batch.reset([1], start)
    batch.run(0.05)
    assert_same_alone(batch, world, {0: middle.pick(0), 1: start.at(middle.time)}, 0.05)


def test_what_cannot_be_reset_is_named_and_changes_nothing():
    """Other bodies, dynamics, materials, rules or paths; worlds that there are not; snapshots that do not fit."""
    world, _ = scene()
    start = world.save()
    batch = world.imagine(3)
    batch.run(0.05)
    wrong = [
        (lambda b: b.add(nuno.sphere(0.1)), "bodies"),
        (lambda b: b.detach("box"), "static in one"),
        (lambda b: b.set_material("cloth", nuno.Cloth(area_density=0.3)), "material"),
        (lambda b: b.ignore_contact("box", "ledge"), "rules"),
        (lambda b: b.set_friction("box", "ledge", 0.1), "friction"),
    ]
    saved = batch.save()
    for change, message in wrong:
        batch.restore(saved)
        change(batch)
        before = seen(batch, 0)
        with pytest.raises(BodyStateError, match=message):
            batch.reset([0], start)
        assert_same(seen(batch, 0), before)
    batch.restore(saved)
    for worlds in ([3], [-1], [0, 0], [0.5], np.ones(2, dtype=bool)):
        with pytest.raises(InvalidInputError, match=r"worlds|whole"):
            batch.reset(worlds, start)
    with pytest.raises(InvalidInputError, match="one world or of 3"):
        batch.reset([0], batch.imagine(2, world=0).save())
    with pytest.raises(InvalidInputError, match="what save returned"):
        batch.reset([0], "start")
    with pytest.raises(BodyStateError, match=r"world=k"):
        batch.imagine(2)
    with pytest.raises(InvalidInputError, match=r"world must be"):
        batch.imagine(2, world=3)
    batch.reset([], start)
    batch.move("ledge", nuno.Path(batch.time + np.array([0.0, 1.0]), [(0.4, 0.0, 0.05), (0.5, 0.0, 0.05)]))
    moving = batch.save()
    batch.run(0.05)
    with pytest.raises(BodyStateError, match="under way"):
        batch.reset([0], moving)
    batch.restore(saved)
    batch.push("box", (1.0, 0.0, 0.0), duration=0.01)
    with pytest.raises(BodyStateError, match="within a frame"):
        batch.reset([0], start)


def test_pushes_are_each_worlds_own():
    """One that goes on for ever or for whole frames acts in the worlds that have it, and in no other."""
    world, _ = scene()
    world.push("box", (0.3, 0.0, 0.0))
    world.push("box", (0.0, 0.2, 0.0), duration=0.1)
    start = world.save()
    batch = world.imagine(2)
    batch.run(0.05)
    batch.push("box", (-0.3, 0.0, 0.0))
    batch.push("cloth", (0.0, 0.0, 0.1), duration=0.05)
    middle = batch.save()
    batch.reset([1], start)
    batch.run(0.15)
    assert_same_alone(batch, world, {0: middle.pick(0), 1: start.at(middle.time)}, 0.15)


def test_a_snapshot_at_another_time_leads_there():
    """What is under way ends as much later as the clock reads."""
    world, _ = scene()
    world.move("ledge", nuno.Path([0.0, 0.1], [(0.4, 0.0, 0.05), (0.5, 0.0, 0.05)]))
    world.restore(world.save().at(2.0))
    assert world.time == 2.0 and world.clock == 0.0
    world.run(0.05)
    np.testing.assert_allclose(world.find("ledge").position, (0.45, 0.0, 0.05), atol=1e-9)
