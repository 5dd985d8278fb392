"""What stands on hinged and sliding bodies is at rest, and their joints stay closed, as statics says."""

import numpy as np
import pytest

import nuno

G = 9.81
Y = (0.0, 1.0, 0.0)


def gap(joint):
    """How far a joint's two places are apart [m], in the directions that it keeps."""
    own, other = joint._poses()
    apart = (own[0] - other[0])[0]
    return np.linalg.norm(apart[1:] if joint.kind == "slider" else apart)


def box_on(world, x, y=0.0, z=1.06, mass=1.0):
    """Add a box of 10 cm."""
    body = world.add(nuno.box((0.1, 0.1, 0.1), position=(x, y, z)))
    world.attach(body, nuno.Rigid(mass=mass))
    return body


def board(world, mass, length=0.4):
    """Add a board whose edge is at x = 0, its top 1 cm above 1 m."""
    body = world.add(nuno.box((length, 0.3, 0.02), position=(0.5 * length, 0.0, 1.0)))
    world.attach(body, nuno.Rigid(mass=mass))
    return body


def hinged(world, body, **options):
    """A hinge along y at x = 0."""
    return nuno.hinge(body, None, point=(0.0, 0.0, 1.0), axis=Y, **options)


def check_rest(world, bodies, joint, seconds=2.0):
    """After some seconds nothing goes faster than 1 mm/s, nor comes 0.01 mm away in half a second; the joint is closed.

    0.001 mm is what one pass leaves at 1 m from the origin, in floats, several times over.
    """
    world.run(seconds)
    start = [body.position.copy() for body in bodies]
    for _ in range(30):
        world.step()
        assert gap(joint) < 1e-6
        assert max(np.linalg.norm(body.velocities, axis=-1).max() for body in bodies) < 1e-3
    assert max(np.linalg.norm(b.position - a) for a, b in zip(start, bodies, strict=True)) < 1e-5


@pytest.mark.parametrize(
    ("mass", "x", "drop"),
    [(0.05, 0.2, 0.0), pytest.param(0.05, 0.33, 0.0, marks=pytest.mark.long), (0.5, 0.2, 0.0), (0.05, 0.2, 0.05)],
)
def test_a_kilogram_rests_on_a_light_flap_at_its_stop(mass, x, drop):
    """1 kg on a flap of 50 g at its stop, put there or dropped: at rest; the hinge bears the weight, the stop M g x."""
    world = nuno.World(device="cpu")
    flap = board(world, mass)
    joint = hinged(world, flap, limits=(-1.0, 0.0))
    box = box_on(world, x, z=1.06 + drop)
    check_rest(world, [flap, box], joint)
    # the box may have come a millimetre away as it fell
    assert joint.wrench[0][2] == pytest.approx(-(1.0 + mass) * G, rel=2e-3)
    assert joint.effort == pytest.approx(-(box.position[0] + 0.2 * mass) * G, rel=5e-3)


def test_five_kilograms_rest_on_a_flap_of_20_grams():
    """250 times the flap's mass, at its stop (28 passes: 52 mm/s): at rest; hinge and stop bear it."""
    world = nuno.World(device="cpu")
    flap = board(world, 0.02)
    joint = hinged(world, flap, limits=(-1.0, 0.0))
    box = box_on(world, 0.2, mass=5.0)
    check_rest(world, [flap, box], joint)
    assert joint.wrench[0][2] == pytest.approx(-5.02 * G, rel=2e-3)
    assert joint.effort == pytest.approx(-(5.0 * box.position[0] + 0.2 * 0.02) * G, rel=5e-3)


@pytest.mark.parametrize(("mass", "load"), [(0.05, 1.0), (0.02, 5.0)])
def test_a_load_rests_on_the_outer_of_two_leaves(mass, load):
    """Each hinge bears what is beyond it, at rest (28 passes: 6 mm/s of 1 kg)."""
    world = nuno.World(device="cpu")
    inner, outer = board(world, mass, 0.2), board(world, mass, 0.2)
    outer.translate((0.2, 0.0, 0.0))
    first = hinged(world, inner, limits=(-1.0, 0.0))
    second = nuno.hinge(outer, inner, point=(0.2, 0.0, 1.0), axis=Y, limits=(-1.0, 0.0))
    box = box_on(world, 0.3, mass=load)
    check_rest(world, [inner, outer, box], second)
    assert gap(first) < 1e-6
    for joint, x, beyond in ((first, 0.0, 2 * mass), (second, 0.2, mass)):
        assert joint.wrench[0][2] == pytest.approx(-(load + beyond) * G, rel=2e-3)
        moment = load * (box.position[0] - x) + (0.3 - x) * mass + (beyond - mass) * 0.1
        assert joint.effort == pytest.approx(-moment * G, rel=5e-3)


def test_a_table_on_motors_rests_on_its_feet():
    """20 kg on four legs of three driven links each, feet of 100 g on a floor (28 passes: 90 mm/s)."""
    world = nuno.World(device="cpu")
    floor = world.add(nuno.box((2.0, 2.0, 0.1), position=(0.0, 0.0, -0.05)))
    trunk = world.add(nuno.box((0.4, 0.25, 0.1), position=(0.0, 0.0, 0.45)))
    world.attach(trunk, nuno.Rigid(mass=20.0))
    feet = []
    for x in (-0.15, 0.15):
        for y in (-0.1, 0.1):
            before = trunk
            for size, z, mass, stiffness in (
                ((0.05, 0.04, 0.2), 0.3, 1.0, 2e3),
                ((0.04, 0.04, 0.195), 0.1025, 0.5, 2e3),
                ((0.1, 0.06, 0.01), 0.0052, 0.1, 200.0),
            ):
                link = world.add(nuno.box(size, position=(x, y, z)))
                world.attach(link, nuno.Rigid(mass=mass))
                motor = nuno.Motor(position=0.0, stiffness=stiffness, damping=0.01 * stiffness, max_effort=80.0)
                nuno.hinge(link, before, point=(x, y, z + 0.5 * size[2]), axis=Y, motor=motor)
                before = link
            feet.append(before)
    world.run(1.0)
    start = trunk.position.copy()
    for _ in range(30):
        world.step()
        assert np.linalg.norm(trunk.velocities, axis=-1).max() < 1e-3
    assert np.linalg.norm(trunk.position - start) < 1e-5
    borne = sum(world.contacts(foot).impulses[floor.name][2] for foot in feet) * world.frame_rate
    assert borne == pytest.approx((20.0 + 4 * 1.6) * G, rel=5e-3)


def test_a_kilogram_rests_on_a_lid_on_a_tables_edge():
    """A lid of 50 g on a hinge and on a table's edge: the two bear 1 kg and the lid."""
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((0.2, 0.4, 0.1), position=(0.45, 0.0, 0.94)))
    lid = board(world, 0.05)
    joint = hinged(world, lid)
    box = box_on(world, 0.2)
    check_rest(world, [lid, box], joint)
    borne = world.contacts(lid).impulses[table.name][2] * world.frame_rate
    assert borne - joint.wrench[0][2] == pytest.approx(1.05 * G, rel=5e-3)


def test_a_kilogram_rests_in_a_light_drawer():
    """1 kg off the middle of a drawer of 100 g that friction holds: at rest, the rail bears the weight."""
    world = nuno.World(device="cpu")
    drawer = board(world, 0.1)
    joint = nuno.slider(drawer, None, axis=(1.0, 0.0, 0.0), friction=2.0)
    box = box_on(world, 0.3, 0.05)
    check_rest(world, [drawer, box], joint)
    assert joint.position == pytest.approx(0.0, abs=1e-5)
    assert joint.wrench[0][2] == pytest.approx(-1.1 * G, rel=2e-3)


def test_a_stack_rests_on_a_shelf_that_a_motor_holds():
    """Three boxes of 1 kg on a shelf of 100 g: the motor bears 3.1 m g l, and creeps by less than 0.01 mm."""
    world = nuno.World(device="cpu")
    shelf = board(world, 0.1, length=0.3)
    joint = hinged(world, shelf, motor=nuno.Motor(velocity=0.0, max_effort=30.0))
    boxes = [box_on(world, 0.15, z=1.06 + 0.1 * k) for k in range(3)]
    check_rest(world, [shelf, *boxes], joint)
    assert joint.position == pytest.approx(0.0, abs=1e-4)
    assert joint.effort == pytest.approx(-3.1 * G * 0.15, rel=5e-3)


def test_a_box_thrown_against_two_joined_bars_keeps_momentum():
    """What hits one of two hinged bars in space keeps their momentum and angular momentum together, within 1 %."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    bars = [world.add(nuno.box((0.2, 0.1, 0.02), position=(0.2 * k, 0.0, 0.0))) for k in range(2)]
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.25, 0.0, 0.1)))
    for body, mass in zip((*bars, box), (0.1, 0.1, 1.0), strict=True):
        world.attach(body, nuno.Rigid(mass=mass, friction=0.0))
    nuno.hinge(bars[1], bars[0], point=(0.1, 0.0, 0.0), axis=Y)
    world.set_velocity(box, (0.0, 0.0, -1.0))
    world.run(0.5)
    assert bars[1].position[2] < -0.1
    total = sum(body.momentum for body in (*bars, box))
    np.testing.assert_allclose(total, (0.0, 0.0, -1.0), atol=0.01)


def test_a_load_on_a_flap_is_the_same_in_a_batch_and_after_restore():
    """Two worlds of a batch and a restored one go on to the bit as the world alone does."""
    world = nuno.World(device="cpu")
    hinged(world, board(world, 0.05), limits=(-1.0, 0.0))
    box_on(world, 0.25)
    world.run(0.2)
    futures, saved = world.imagine(2), world.save()
    world.run(0.3)
    futures.run(0.3)
    ends = [body.vertices.copy() for body in world.bodies]
    world.restore(saved)
    world.run(0.3)
    for body, end, copy in zip(world.bodies, ends, futures.bodies, strict=True):
        np.testing.assert_array_equal(body.vertices, end)
        np.testing.assert_array_equal(copy.vertices, np.stack([end, end]))
