"""Grips that hold against contacts or each other: what they bear, that nothing explodes, and that it is said."""

import logging

import numpy as np
import pytest

import nuno
from few_variants import few
from pair_with import moment

G = 9.81


def cube_in_fingers(ignore=True):
    """A 1 kg cube gripped by one of two static fingers that cut into it by 1 mm: world, finger, cube and grip."""
    world = nuno.World(device="cpu")
    one, other = (world.add(nuno.box((0.01, 0.05, 0.05), position=(x, 0.0, 0.5))) for x in (-0.029, 0.029))
    one.assoc(other)
    cube = world.add(nuno.box((0.05, 0.05, 0.05), position=(0.0, 0.0, 0.5)))
    world.attach(cube, nuno.Rigid(mass=1.0))
    return world, one, cube, world.grip(cube, to=one, ignore=(one, other) if ignore else ())


def lift(world, finger, cube, grip, frames=30):
    """Raise the finger by 0.2 m: each frame's force on the cube, and what its motion took, (frames, 3) each."""
    rise = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.2)])
    times = world.time + np.array((0.0, frames / world.frame_rate))
    world.move(finger, nuno.Path(times, finger.position + rise, interpolation="minimum_jerk"))
    read, taken = [], []
    before = moment(cube)[0]
    for _ in range(frames):
        world.step()
        now = moment(cube)[0]
        read.append(world.contacts(cube).forces.sum(axis=0) - grip.wrench[0])
        taken.append((now - before) * world.frame_rate + (0.0, 0.0, G))
        before = now
    return np.array(read), np.array(taken)


def test_what_acts_on_a_gripped_body_is_what_its_motion_takes():
    """Newton: within 1 % in every frame of a hand that touches what it holds; such a grip read up to 19 kN."""
    read, taken = lift(*cube_in_fingers())
    np.testing.assert_allclose(read, taken, atol=0.01 * G)
    assert np.ptp(taken[:, 2]) > 5.0  # 0.2 m in 0.5 s by minimum jerk: up to 4.6 m/s2 both ways


def test_a_held_body_touches_what_it_is_told_to():
    """Promise of the interface: with nothing ignored the fingers push; both push alike, so that it stays between."""
    world, _, cube, grip = cube_in_fingers(ignore=False)
    world.run(0.1)
    assert set(world.contacts(cube).others) == {"box", "box_1"}
    grip.release()
    world.run(0.1)
    assert np.isfinite(cube.vertices).all()


def test_a_body_that_was_let_go_touches_its_holder_again():
    """The exception ends with the grip: a box gripped inside a table's top comes out of it when it is released."""
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((1.0, 1.0, 0.1), position=(0.0, 0.0, -0.05)))
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.03)))
    world.attach(box, nuno.Rigid())
    grip = world.grip(box, to=table)
    world.run(0.2)
    assert box.position[2] == pytest.approx(0.03, abs=1e-6)
    assert not len(world.contacts(box).points)
    grip.release()
    world.run(0.5)
    assert box.position[2] == pytest.approx(0.05, abs=5e-4)


@pytest.mark.parametrize("depth", [5e-4, 5e-3, 0.1])
def test_a_grip_into_the_floor_bears_its_limit_and_no_more(depth, caplog):
    """Statics: at rest at the floor's surface, pressed on it by the limit; it read 111 kN 0.5 mm too low."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.05)))
    world.attach(box, nuno.Rigid(mass=1.0))
    grip = world.grip(box, to=(0.0, 0.0, 0.05 - depth))
    fastest = 0.0
    with caplog.at_level(logging.WARNING):
        for _ in range(60):
            world.step()
            fastest = max(fastest, np.abs(box.velocities).max())
    assert fastest < 0.05
    assert box.position[2] == pytest.approx(0.05, abs=2e-5)  # what a contact leaves alone
    force, _ = grip.wrench
    np.testing.assert_allclose(force, (0.0, 0.0, grip.max_force), rtol=1e-3, atol=10.0)
    np.testing.assert_allclose(world.contacts(box).forces.sum(axis=0)[2], grip.max_force + G, rtol=1e-3)
    said = [record.getMessage() for record in caplog.records if "is not met" in record.getMessage()]
    assert len(said) == 1 and "'box'" in said[0] and "max_force" in said[0]


def test_a_limit_of_ones_own_is_kept():
    """Statics: a grip of 20 N lifts 1 kg and not 3 kg, which stays on the floor with what is left of its weight."""
    for mass in (1.0, 3.0):
        world = nuno.World(device="cpu")
        world.add(nuno.plane())
        box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.05)))
        world.attach(box, nuno.Rigid(mass=mass))
        grip = world.grip(box, to=(0.0, 0.0, 0.1), max_force=20.0)
        world.run(2.0)
        lifts = mass * G < 20.0
        assert box.position[2] == pytest.approx(0.1 if lifts else 0.05, abs=1e-4)
        assert grip.wrench[0][2] == pytest.approx(-mass * G if lifts else 20.0 * -1.0, rel=0.01) or not lifts
        if not lifts:
            assert world.contacts(box).forces.sum(axis=0)[2] == pytest.approx(mass * G - 20.0, rel=0.01)


@pytest.mark.parametrize("held", ["grip", "fixed joint"])
@pytest.mark.parametrize("count", few([1, 3], 3))
def test_what_stands_on_a_held_plate_stands(held, count):
    """Statics: boxes of 1 kg on a held plate of 0.5 kg rest as on a table, by its edge; one walked at 55 mm/s."""
    world = nuno.World(device="cpu")
    plate = world.add(nuno.box((0.4, 0.3, 0.02), position=(0.0, 0.0, 0.5)))
    world.attach(plate, nuno.Rigid(mass=0.5))
    hold = world.grip(plate, to=plate.position) if held == "grip" else nuno.fixed_joint(plate, None)
    boxes = [world.add(nuno.box((0.1, 0.1, 0.1), position=(0.12, 0.0, 0.561 + 0.1 * k))) for k in range(count)]
    for box in boxes:
        world.attach(box, nuno.Rigid(mass=1.0))
    world.run(1.0)
    for _ in range(30):
        world.step()
        assert max(np.abs(box.velocities).max() for box in boxes) < 1e-4
    for k, box in enumerate(boxes):
        np.testing.assert_allclose(box.position, (0.12, 0.0, 0.56 + 0.1 * k), atol=1e-4)
    force, torque = hold.wrench
    np.testing.assert_allclose(force, (0.0, 0.0, -(count + 0.5) * G), atol=1e-3)
    np.testing.assert_allclose(torque, (0.0, count * G * 0.12, 0.0), atol=1e-3)


@pytest.mark.parametrize("compliance", [0.0, pytest.param(1e-3, marks=pytest.mark.long)])
def test_contradicting_holds_stay_slow(compliance, caplog):
    """Two holds of one body in another's frame at places 0.1 m apart: it went off at 15 km/s."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    box = world.add(nuno.box((0.08, 0.06, 0.05), position=(0.0, 0.0, 1.0)))
    drum = world.add(nuno.cylinder(0.03, 0.08, position=(0.12, 0.0, 1.0)))
    world.attach(box, nuno.Rigid())
    world.attach(drum, nuno.Rigid(density=50.0))
    world.grip(box, to=drum, compliance=compliance)
    drum.locate((0.2, 0.05, 1.03))
    world.grip(box, to=drum, compliance=compliance)
    world.push(box, (0.5, 0.3, 0.2), torque=(0.005, 0.01, 0.0), duration=0.1)
    speeds = []
    with caplog.at_level(logging.WARNING):
        for _ in range(180):
            world.step()
            speeds.append(max(np.abs(body.velocities).max() for body in (box, drum)))
    # stiff ones mend at 1 m/s and 1 rad/s each, beside the push's 0.23 m/s; springs of 1e-3 m/N that are stretched by
    # 50 mm give the drum (0.011 kg) 15 m/s
    assert max(speeds) < (4.0 if compliance == 0.0 else 20.0)
    assert max(speeds[120:]) < 1.5 * max(speeds[60:120])
    if compliance == 0.0:
        assert any("is not met" in record.getMessage() for record in caplog.records)


def test_two_stiff_grips_on_a_vertex_are_told(caplog):
    """They read 17 kN either way without a word; on other vertices, or with a compliance, nothing is said."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.0, 0.0, 0.5)))
    world.attach(towel)
    with caplog.at_level(logging.WARNING):
        for vertices, compliance in (([0, 1], 0.0), ([2], 0.0), ([1], 1e-3)):
            world.grip(towel, vertices, to=towel.vertices[vertices].mean(axis=0), compliance=compliance)
        assert not caplog.records
        world.grip(towel, [1, 3], to=towel.vertices[[1, 3]].mean(axis=0))
    (record,) = caplog.records
    assert "[1]" in record.getMessage() and "'sheet'" in record.getMessage() and "compliance" in record.getMessage()


def test_a_grip_that_leads_far_at_once_is_told(caplog):
    """More than an edge at once is a blow (50 mm put 7 J into 5 g of sheet); less, later or softly nothing is said."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.0, 0.0, 0.5)))
    world.attach(towel)
    place, up = towel.vertices[0], np.array((0.0, 0.0, 0.1))
    with caplog.at_level(logging.WARNING):
        world.grip(towel, [0], to=place + 0.4 * up).release()
        world.grip(towel, [0], to=place + up, compliance=1e-3).release()
        world.grip(towel, [0], to=nuno.Path([0.0, 1.0], [place, place + up])).release()
        assert not caplog.records
        world.grip(towel, [0], to=nuno.Path([0.0, 1.0], [place + 0.6 * up, place]))
    (record,) = caplog.records
    assert "0.06 m" in record.getMessage() and "'sheet'" in record.getMessage()


def test_a_limit_that_cannot_be_is_refused():
    """Bad input: nothing changes, and the message says what is valid."""
    world = nuno.World(device="cpu")
    box = world.add(nuno.box((0.1, 0.1, 0.1)))
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.0, 0.0, 1.0)))
    world.attach(box)
    world.attach(towel)
    for limit in (0.0, -1.0, np.nan, (1.0, 2.0)):
        with pytest.raises(nuno.InvalidInputError, match="max_force"):
            world.grip(box, to=(0.0, 0.0, 0.0), max_force=limit)
        with pytest.raises(nuno.InvalidInputError, match="max_force"):
            world.grip(towel, [0], to=(0.0, 0.0, 1.0), max_force=limit)
    with pytest.raises(nuno.InvalidInputError, match="ignore"):
        world.grip(towel, [0], to=box, ignore=[box])
    assert not box._dynamics.grips and not towel._dynamics.grips


def test_a_led_hold_survives_files_and_batches(tmp_path):
    """Snapshots while the holder moves: bit for bit, from memory, from a file in an empty world, and imagined."""
    world, finger, cube, grip = cube_in_fingers()
    times, rise = world.time + np.array((0.0, 0.2)), np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.2)])
    world.move(finger, nuno.Path(times, finger.position + rise, interpolation="minimum_jerk"))
    for _ in range(4):
        world.step()
    saved = world.save(tmp_path / "held.npz")
    futures, empty = world.imagine(2), nuno.World(device="cpu")
    empty.restore(tmp_path / "held.npz")
    held = empty.find(cube.name)._dynamics.grips[0]
    assert held.max_force == grip.max_force == pytest.approx(1e4)
    assert held.ignored == grip.ignored
    for _ in range(4):
        world.step()
    expected, borne = cube.vertices, grip.wrench[0]
    for other in (empty, futures, world):
        if other is world:
            world.restore(saved)
        for _ in range(4):
            other.step()
        own = other.find(cube.name)
        for vertices in own.vertices.reshape(-1, 8, 3):
            np.testing.assert_array_equal(vertices, expected)
        for force in own._dynamics.grips[0].wrench[0].reshape(-1, 3):
            np.testing.assert_array_equal(force, borne)


def towel(world, **options):
    """Add a towel of 0.2 m, 8 g, at 1 m."""
    body = world.add(nuno.sheet((0.2, 0.2), (8, 8), position=(0.0, 0.0, 1.0), **options))
    world.attach(body, nuno.Cloth(area_density=0.2, damping=2.0))
    return body


def corners(body):
    """The vertices nearest to the corners at low x and at high x, low y."""
    x, y = body.vertices[:, 0], body.vertices[:, 1]
    return int(np.argmin(x + y)), int(np.argmin(y - x))


def test_a_corner_slips_behind_what_pulls_it_at_its_limit(caplog):
    """A corner drawn at 5 N while three hold: the wrench reads 5 N at most, the corner stays behind, told once."""
    world = nuno.World(device="cpu")
    body = towel(world)
    one, other = corners(body)
    world.grip(body, [other], to=body.vertices[other])
    start = body.vertices[one]
    path = nuno.Path([0.0, 0.5], [start, start - (0.3, 0.0, 0.0)])
    grip = world.grip(body, [one], to=path, max_force=5.0)
    assert grip.max_force == 5.0 and grip.is_tie
    most = 0.0
    with caplog.at_level(logging.WARNING):
        for _ in range(120):
            world.step()
            most = max(most, np.linalg.norm(grip.wrench[0]))
    assert most < 5.0 * 1.001
    assert np.linalg.norm(grip.wrench[0]) == pytest.approx(5.0, rel=0.01)
    # it turns about the held corner and stretches by some 50 mm, and is led by 0.3 m
    assert np.linalg.norm(body.vertices[one] - path.at(2.0)) > 0.15
    said = [record.getMessage() for record in caplog.records if "is not met" in record.getMessage()]
    assert len(said) == 1 and "'sheet'" in said[0] and "max_force" in said[0]


@pytest.mark.long
def test_a_limit_that_is_not_reached_changes_nothing():
    """Statics: a towel's corner bears its weight and is where it is led, with the limit and without."""
    found = []
    for limit in (None, 5.0):
        world = nuno.World(device="cpu")
        body = towel(world)
        one, _ = corners(body)
        x, y, z = body.vertices[one]
        path = nuno.Path([0.0, 0.5], [(x, y, z), (x, y + 0.05, z + 0.1)], interpolation="minimum_jerk")
        grip = world.grip(body, [one], to=path, max_force=limit)
        world.run(0.3)
        # what a stiff grip leaves in a pass, and a tenth of a frame's curve
        np.testing.assert_allclose(body.vertices[one], path.at(0.3), atol=2e-4)
        world.run(4.0)
        found.append(grip.wrench[0])
        np.testing.assert_allclose(body.vertices[one], path.at(1.0), atol=2e-5)
    weight = 0.2 * 0.04 * G
    # the towel swings a little still, and the two not alike
    np.testing.assert_allclose(found, [(0.0, 0.0, -weight)] * 2, atol=0.1 * weight)


def test_two_limited_grips_that_contradict_each_other_share_a_stiff_sheet(caplog):
    """Two vertices led 1 m apart, 5 N each: the sheet stays between, in equilibrium, under 1 m/s, both told by name."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    body = world.add(nuno.sheet((0.2, 0.2), (8, 8), position=(0.0, 0.0, 1.0)))
    world.attach(body, nuno.Cloth(stretch_stiffness=2000.0, damping=2.0))
    one, other = corners(body)
    grips = [
        world.grip(body, [k], to=body.vertices[k] + (side * 0.4, 0.0, 0.0), max_force=5.0)
        for k, side in ((one, -1.0), (other, 1.0))
    ]
    with caplog.at_level(logging.WARNING):
        world.run(2.0)
    assert np.linalg.norm(body.velocities, axis=-1).max() < 1.0
    forces = np.array([grip.wrench[0] for grip in grips])
    assert np.linalg.norm(forces, axis=-1).max() < 5.0 * 1.001
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=0.1)
    np.testing.assert_allclose(body.position[:2], 0.0, atol=5e-3)
    said = [record.getMessage() for record in caplog.records if "is not met" in record.getMessage()]
    assert len(said) == 2


@pytest.mark.long
def test_a_limit_goes_with_a_leader_and_with_copies(tmp_path):
    """Led by a static body that moves: futures, a restored world and one from a file bear what the world does."""
    world = nuno.World(device="cpu")
    body, hand = towel(world), world.add(nuno.box((0.02, 0.02, 0.02), position=(-0.1, -0.1, 1.1)))
    one, other = corners(body)
    world.grip(body, [other], to=body.vertices[other])
    grip = world.grip(body, [one], to=hand, max_force=3.0)
    world.move(hand, nuno.Path([0.0, 0.5], [hand.position, hand.position - (0.2, 0.0, 0.0)]))
    world.run(0.25)
    world.save(tmp_path / "towel.npz")
    futures, saved, key = world.imagine(2), world.save(), body.key
    world.run(0.25)
    end, force = body.vertices.copy(), grip.wrench[0]
    assert np.linalg.norm(force) == pytest.approx(3.0, rel=0.01)
    futures.run(0.25)
    copy = next(own for own in futures.bodies if own.key == key)
    np.testing.assert_array_equal(copy.vertices, np.stack([end, end]))
    world.restore(saved)
    world.run(0.25)
    np.testing.assert_array_equal(body.vertices, end)
    read = nuno.World(device="cpu")
    read.restore(tmp_path / "towel.npz")
    read.run(0.25)
    np.testing.assert_array_equal(next(own for own in read.bodies if own.key == key).vertices, end)
    # the leader becomes a dynamic body, and the limit stays
    world.move(hand, None)
    world.attach(hand, nuno.Rigid(mass=1.0))
    assert grip.active and grip.max_force == 3.0
    world.run(0.1)
