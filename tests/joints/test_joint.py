"""Joints as handles: made, read, changed, released, in batches, saved, imagined, beside cloth and contacts."""

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError
from nuno.joints.held_points import held_points
from nuno.joints.joint import set_motors

G = 9.81
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]
KINDS = ("fixed", "hinge", "slider", "ball")


def bar(world, centre, mass=0.5, **options):
    """Add a bar of 0.2 m along x."""
    body = world.add(nuno.box((0.2, 0.03, 0.02), position=centre, **options))
    world.attach(body, nuno.Rigid(mass=mass))
    return body


def made(kind, a, b, point):
    """A joint of a kind, with whatever it can have."""
    if kind == "fixed":
        return nuno.fixed_joint(a, b)
    spring = nuno.Spring(0.5, damping=0.01)
    if kind == "ball":
        return nuno.ball_joint(a, b, point=point, limit=1.0, friction=0.01, spring=spring)
    motor = nuno.Motor(velocity=1.0, max_effort=0.05)
    factory = {"hinge": nuno.hinge, "slider": nuno.slider}[kind]
    return factory(
        a, b, point=point, axis=(0.0, 1.0, 0.5), limits=(-0.5, 0.7), friction=0.01, spring=spring, motor=motor
    )


def linkage(world, kinds=KINDS):
    """A chain that hangs from the world, a joint of each kind."""
    before, joints = None, []
    for k, kind in enumerate(kinds):
        body = bar(world, (0.1 + 0.2 * k, 0.0, 1.0), name=f"bar {k}")
        joints.append(made(kind, body, before, (0.2 * k, 0.0, 1.0)))
        before = body
    return joints


def readings(world):
    """All that bodies and joints tell, as one row a world."""
    rows = []
    for body in world.bodies:
        rows += [body.vertices, body.velocities]
        for joint in body._dynamics.grips if body.is_dynamic else ():
            rows += [np.asarray(v) for v in (joint.position, joint.velocity, joint.effort, *joint.wrench)]
    worlds = world.world_count
    return np.concatenate([np.reshape(row, (worlds, -1)) for row in rows], axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_a_released_joint_is_gone(kind):
    """A body falls as if it had never been joined; what a released joint is asked for is refused by name."""
    world = nuno.World(device="cpu")
    body = bar(world, (0.1, 0.0, 1.0))
    joint = made(kind, body, None, (0.0, 0.0, 1.0))
    assert joint.active and joint.kind == kind and kind in repr(joint)
    joint.release()
    joint.release()
    free = nuno.World(device="cpu")
    other = bar(free, (0.1, 0.0, 1.0))
    for each in (world, free):
        each.run(0.2)
    np.testing.assert_array_equal(body.vertices, other.vertices)
    for name in ("position", "velocity", "effort", "wrench"):
        with pytest.raises(nuno.BodyStateError, match="released"):
            getattr(joint, name)
    with pytest.raises(nuno.BodyStateError, match="released"):
        joint.friction = 0.0


def test_a_joint_goes_with_its_bodies():
    """Detaching or removing either body releases it, as grips are."""
    for act in ("detach", "remove"):
        for which in (0, 1):
            world = nuno.World(device="cpu")
            pair = bar(world, (0.1, 0.0, 1.0)), bar(world, (0.3, 0.0, 1.0))
            joint = nuno.hinge(pair[1], pair[0], point=(0.2, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
            world.run(0.1)
            getattr(world, act)(pair[which])
            assert not joint.active
            world.run(0.1)


def test_a_joint_ends_where_its_other_body_becomes_a_cloth():
    """Attached as another kind, a dynamic body is detached first: the joint with it is released."""
    world = nuno.World(device="cpu")
    sheet = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.2, 0.0, 1.0)))
    world.attach(sheet, nuno.Rigid())
    joint = nuno.hinge(bar(world, (0.0, 0.0, 1.0)), sheet, point=(0.1, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    world.run(0.1)
    world.attach(sheet, nuno.Cloth(), keep_velocity=True)
    assert not joint.active
    world.run(0.1)


def test_joined_bodies_pass_through_each_other_unless_asked():
    """Two overlapping bars rest on their hinge; with contact they push each other, and when it is released they do."""
    for contact in (False, True):
        world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
        one, two = bar(world, (0.0, 0.0, 0.0)), bar(world, (0.15, 0.0, 0.0))
        joint = nuno.hinge(one, two, point=(0.075, 0.0, 0.0), axis=(0.0, 1.0, 0.0), contact=contact)
        world.run(0.2)
        assert bool(len(world.contacts(one).points)) == contact
        joint.release()
        world.run(0.3)
        assert abs(two.position[2] - one.position[2]) > 5e-3  # on the shortest way out, across their thickness


def test_what_acts_along_a_joint_is_changed_at_any_time():
    """A setter takes effect from the next step on, and tells what was set."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    box = world.add(nuno.box((0.1, 0.1, 0.1)))
    world.attach(box, nuno.Rigid(mass=1.0))
    joint = nuno.slider(box, None, axis=(1.0, 0.0, 0.0))
    assert joint.motor is None and joint.spring is None
    assert joint.limits == (-np.inf, np.inf) and joint.friction == 0.0
    joint.motor = nuno.Motor(velocity=0.2, max_effort=50.0)
    world.run(1.0)
    assert joint.position == pytest.approx(0.2, abs=1e-3)
    assert (joint.motor.velocity, joint.motor.position, joint.motor.damping) == (0.2, None, None)
    joint.motor, joint.friction = None, 0.1
    world.run(3.0)  # v^2 / 2 a = 0.2 m
    assert joint.position == pytest.approx(0.4, abs=2e-3)
    assert joint.velocity == pytest.approx(0.0, abs=5e-5)  # a coordinate's last digit, 600 times a second
    joint.friction, joint.spring = 0.0, nuno.Spring(100.0, rest=0.1, damping=20.0)
    assert (joint.spring.stiffness, joint.spring.rest, joint.spring.damping) == (100.0, 0.1, 20.0)
    world.run(3.0)
    assert joint.position == pytest.approx(0.1, abs=1e-4)
    joint.limits = (0.3, 0.5)
    world.run(1.0)
    assert joint.limits == (0.3, 0.5)
    assert joint.position == pytest.approx(0.3, abs=1e-4)


def test_a_joint_follows_what_it_is_joined_to():
    """A drawer's frame that follows a path carries the drawer; a pushed cart does so too, and feels it."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    frame = world.add(nuno.box((0.3, 0.3, 0.3)))
    drawer = world.add(nuno.box((0.2, 0.2, 0.1)))
    world.attach(drawer, nuno.Rigid(mass=1.0))
    joint = nuno.slider(drawer, frame, axis=(1.0, 0.0, 0.0))
    goal = np.array([(0.0, 0.0, 0.0), (0.0, 0.5, 0.2)])
    world.move(frame, nuno.Path((0.0, 1.0), goal, interpolation="minimum_jerk"))
    for _ in range(75):
        world.step()
        np.testing.assert_allclose(drawer.position[1:], frame.position[1:], atol=1e-6)
    np.testing.assert_allclose(drawer.position, (0.0, 0.5, 0.2), atol=1e-6)
    assert joint.velocity == pytest.approx(0.0, abs=5e-5)
    world.move(frame, None)
    world.attach(frame, nuno.Rigid(mass=3.0))  # the joint stays
    assert joint.active
    world.push(frame, (0.0, 4.0, 0.0))
    world.run(1.0)
    assert drawer.position[1] == pytest.approx(1.0, rel=0.01)  # both at 1 m/s2
    np.testing.assert_allclose(joint.wrench[0], (0.0, -1.0, 0.0), atol=0.01)


@pytest.mark.parametrize("device", DEVICES)
def test_a_saved_linkage_goes_on_bit_for_bit(device, tmp_path):
    """In mid-motion: restored in place, from a file in an empty world, imagined, and adopted."""
    world = nuno.World(device=device)
    joints = linkage(world)
    world.run(0.3)
    joints[1].motor = nuno.Motor(position=0.2, stiffness=1.0, damping=0.05)
    saved = world.save(tmp_path / "linkage.npz")
    futures, empty = world.imagine(3), nuno.World(device=device)
    empty.restore(tmp_path / "linkage.npz")
    world.run(0.3)
    expected = readings(world)
    for other in (empty, futures):
        other.run(0.3)
        for row in readings(other):
            np.testing.assert_array_equal(row, expected[0])
    world.restore(saved)
    assert all(joint.active for joint in joints)
    world.run(0.3)
    np.testing.assert_array_equal(readings(world), expected)
    world.restore(saved)
    world.adopt(futures, 1)
    assert world.time == futures.time
    for each in (world, futures):
        each.run(0.2)
    np.testing.assert_array_equal(readings(futures)[1], readings(world)[0])


@pytest.mark.parametrize("device", DEVICES)
def test_a_batch_of_joints_is_each_of_them_alone(device):
    """Worlds with other axes, limits and motors go as they go alone, to the bit."""
    axes = np.array([(0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 1.0, 0.0)])
    speeds, stops = np.array((1.0, -2.0, 0.5)), np.array((0.2, 0.9, 0.4))

    def run(world, axis, speed, stop):
        body = bar(world, (0.1, 0.0, 1.0))
        motor = nuno.Motor(velocity=speed, max_effort=0.2)
        nuno.hinge(body, None, point=(0.0, 0.0, 1.0), axis=axis, limits=(-stop, stop), motor=motor)
        world.run(0.5)
        return readings(world)

    batch = nuno.World(device=device).imagine(3)
    together = run(batch, axes, speeds, stops)
    for k in range(3):
        np.testing.assert_array_equal(run(nuno.World(device=device), axes[k], speeds[k], stops[k])[0], together[k])
    (joint,) = batch.bodies[0]._dynamics.grips
    assert joint.position.shape == joint.velocity.shape == joint.effort.shape == (3,)
    np.testing.assert_array_equal(joint.limits[1], stops)
    np.testing.assert_array_equal(joint.motor.velocity, speeds)
    for k in range(3):
        np.testing.assert_allclose(held_points(joint, k), [(0.0, 0.0, 1.0)], atol=1e-5)


def test_a_run_in_pieces_is_a_run():
    """Determinism: frame by frame as in one go, to the bit."""
    worlds = [nuno.World(device="cpu") for _ in range(2)]
    for world in worlds:
        linkage(world)
    worlds[0].run(0.5)
    for _ in range(30):
        worlds[1].step()
    for one, other in zip(worlds[0].bodies, worlds[1].bodies, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.velocities, other.velocities)


def test_what_cannot_be_joined_is_refused_by_name():
    """Bad input: nothing changes, and each message says what is valid."""
    world = nuno.World(device="cpu")
    body, other = bar(world, (0.0, 0.0, 0.0)), bar(world, (1.0, 0.0, 0.0))
    still = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 1.0, 0.0)))
    towel = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.0, 2.0, 0.0)))
    world.attach(towel)
    alone = nuno.box((0.1, 0.1, 0.1))
    y = {"point": (0.0, 0.0, 0.0), "axis": (0.0, 1.0, 0.0)}
    for error, words, act in (
        (nuno.BodyStateError, "static", lambda: nuno.hinge(still, body, **y)),
        (nuno.BodyStateError, "in no world", lambda: nuno.hinge(alone, None, **y)),
        (nuno.BodyStateError, "no world", lambda: nuno.hinge(body, alone, **y)),
        (nuno.InvalidInputError, "itself", lambda: nuno.hinge(body, body, **y)),
        (nuno.InvalidInputError, "deforms", lambda: nuno.hinge(towel, None, **y)),
        (nuno.InvalidInputError, "deforms", lambda: nuno.hinge(body, towel, **y)),
        (nuno.InvalidInputError, "a must be a Body", lambda: nuno.hinge("bar", None, **y)),
        (nuno.InvalidInputError, "b must be a Body", lambda: nuno.hinge(body, "bar", **y)),
        (nuno.InvalidInputError, "axis", lambda: nuno.hinge(body, None, point=(0, 0, 0), axis=(0, 0, 0))),
        (nuno.InvalidInputError, "point", lambda: nuno.hinge(body, None, point=(0, 0), axis=(0, 0, 1))),
        (nuno.InvalidInputError, "pi", lambda: nuno.hinge(body, other, limits=(-4.0, 1.0), **y)),
        (nuno.InvalidInputError, "above", lambda: nuno.slider(body, other, axis=(1, 0, 0), limits=(1.0, 0.0))),
        (nuno.InvalidInputError, "lower, upper", lambda: nuno.slider(body, other, axis=(1, 0, 0), limits=1.0)),
        (nuno.InvalidInputError, "limit", lambda: nuno.ball_joint(body, other, point=(0, 0, 0), limit=3.2)),
        (nuno.InvalidInputError, "friction", lambda: nuno.hinge(body, other, friction=-1.0, **y)),
        (nuno.InvalidInputError, "Motor", lambda: nuno.hinge(body, other, motor=1.0, **y)),
        (nuno.InvalidInputError, "Spring", lambda: nuno.hinge(body, other, spring=1.0, **y)),
        (nuno.InvalidInputError, "max_force", lambda: nuno.hinge(body, other, max_force=0.0, **y)),
        (nuno.InvalidInputError, "stiffness", lambda: nuno.Motor(position=1.0)),
        (nuno.InvalidInputError, "position", lambda: nuno.Motor(stiffness=1.0)),
        (nuno.InvalidInputError, "max_effort", lambda: nuno.Motor(max_effort=-1.0)),
        (nuno.InvalidInputError, "damping", lambda: nuno.Spring(1.0, damping=-1.0)),
        (nuno.InvalidInputError, "rest", lambda: nuno.ball_joint(body, None, point=[0] * 3, spring=nuno.Spring(1, 2))),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            act()
    assert not body._dynamics.grips and not other._dynamics.grips
    joint = nuno.fixed_joint(body, None)
    with pytest.raises(nuno.InvalidInputError, match="friction"):
        joint.friction = 1.0
    with pytest.raises(nuno.InvalidInputError, match="motor"):
        joint.motor = nuno.Motor(velocity=1.0)
    base = world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(0.0, 3.0, 0.0)))
    nuno.fixed_joint(other, base)
    with pytest.raises(nuno.BodyStateError, match="joined"):
        world.attach(base)


def test_a_lid_falls_shut_on_its_basket():
    """A motor opens it; without it falls and rests on the rim, which bears half its weight, and the hinge the other."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    walls = [((0.4, 0.3, 0.01), (0, 0, 0.005)), ((0.01, 0.3, 0.3), (-0.195, 0, 0.15)),
             ((0.01, 0.3, 0.3), (0.195, 0, 0.15)), ((0.38, 0.01, 0.3), (0, -0.145, 0.15)),
             ((0.38, 0.01, 0.3), (0, 0.145, 0.15))]  # fmt: skip
    basket = world.add(nuno.compound([(nuno.Box(size), place) for size, place in walls]))
    world.attach(basket, nuno.Rigid(mass=2.0))
    lid = world.add(nuno.box((0.4, 0.3, 0.01), position=(0.0, 0.0, 0.306)))
    world.attach(lid, nuno.Rigid(mass=0.5))
    motor = nuno.Motor(position=1.2, stiffness=20.0, damping=2.0)
    joint = nuno.hinge(
        lid, basket, point=(-0.2, 0.0, 0.301), axis=(0.0, -1.0, 0.0), motor=motor, limits=(-0.1, 1.5), contact=True
    )
    world.run(2.0)
    arm = 0.2 * np.cos(joint.position) - 0.005 * np.sin(joint.position)  # of its middle
    assert joint.position == pytest.approx(1.2 - 0.5 * G * arm / 20.0, abs=1e-4)
    joint.motor, joint.friction = None, 0.02
    world.run(2.0)
    assert joint.position == pytest.approx(-0.001 / 0.4, abs=1e-3)  # the gap that it was made with
    assert np.abs(lid.velocities).max() < 1e-3
    own, other = joint._poses()
    assert np.linalg.norm(own[0] - other[0]) < 1e-5
    borne = -joint.wrench[0] + world.contacts(lid).forces.sum(axis=0)
    np.testing.assert_allclose(borne, (0.0, 0.0, 0.5 * G), atol=0.05 * 0.5 * G)
    assert np.linalg.norm(basket.position[:2]) < 2e-3


@pytest.mark.long
def test_a_towel_goes_along_in_a_drawer():
    """A motor pulls a drawer out by 0.2 m at a quarter of mu g: the towel in it goes along within 2 mm."""
    world = nuno.World(device="cpu")
    walls = [((0.3, 0.3, 0.01), (0, 0, 0.005)), ((0.01, 0.3, 0.1), (-0.145, 0, 0.05)),
             ((0.01, 0.3, 0.1), (0.145, 0, 0.05)), ((0.28, 0.01, 0.1), (0, -0.145, 0.05)),
             ((0.28, 0.01, 0.1), (0, 0.145, 0.05))]  # fmt: skip
    drawer = world.add(nuno.compound([(nuno.Box(size), place) for size, place in walls], position=(0.0, 0.0, 0.5)))
    world.attach(drawer, nuno.Rigid(mass=1.0))
    towel = world.add(nuno.sheet((0.16, 0.16), (8, 8), position=(0.0, 0.0, 0.5125)))
    world.attach(towel, nuno.Cloth(area_density=0.3))
    motor = nuno.Motor(position=0.0, stiffness=200.0, damping=40.0)
    joint = nuno.slider(drawer, None, axis=(1.0, 0.0, 0.0), limits=(0.0, 0.2), motor=motor)
    world.run(0.5)
    before = towel.vertices.mean(axis=0)[0] - drawer.position[0]
    for k in range(60):
        s = (k + 1) / 60  # minimum jerk
        goal = 0.2 * s**3 * (10.0 + s * (6.0 * s - 15.0))
        joint.motor = nuno.Motor(position=goal, stiffness=2000.0, damping=100.0)
        world.step()
    world.run(1.0)
    assert joint.position == pytest.approx(0.2, abs=1e-4)
    assert towel.vertices.mean(axis=0)[0] - drawer.position[0] == pytest.approx(before, abs=2e-3)
    weight = (1.0 + 0.3 * 0.16**2) * G
    assert joint.wrench[0][2] == pytest.approx(-weight, rel=0.01)


@pytest.mark.long
def test_a_clothes_peg_holds_a_cloth_and_lets_go():
    """Two arms, a hinge and a spring: 2 mu N of the jaws is more than a towel weighs; opened, it falls."""
    world = nuno.World(device="cpu")
    one, two = (world.add(nuno.box((0.01, 0.02, 0.08), position=(x, 0.0, 0.5))) for x in (-0.0065, 0.0065))
    towel = world.add(nuno.sheet((0.1, 0.1), (10, 10)).rotate(np.pi / 2, "y"))
    towel.locate((0.0, 0.0, 0.43))
    for arm in (one, two):
        world.attach(arm, nuno.Rigid(mass=0.01, friction=0.6))
    world.attach(towel, nuno.Cloth(area_density=0.2, friction=0.6))
    world.grip(one, to=one.position)
    peg = nuno.hinge(two, one, point=(0.0, 0.0, 0.53), axis=(0.0, 1.0, 0.0), spring=nuno.Spring(0.5, rest=0.3))
    world.run(0.5)
    held = towel.vertices[:, 2].mean()
    world.run(1.0)
    assert towel.vertices[:, 2].mean() == pytest.approx(held, abs=1e-3)
    assert np.abs(peg.position) < 0.05  # it is the towel that keeps it open
    peg.spring = nuno.Spring(0.5, rest=-0.4)
    world.run(0.5)
    assert towel.vertices[:, 2].mean() < held - 0.2


def test_motors_are_set_together_as_each_by_itself():
    """The drives are the same to the bit, in a batch too; what no motor can have is refused before anything changes."""
    world = nuno.World(device="cpu")
    joints = linkage(world, ("hinge", "slider", "hinge"))
    rng = np.random.default_rng(0)
    futures = world.imagine(2)
    for place, worlds in ((world, ()), (futures, (2,))):
        keys = {grip.key: grip for body in place.bodies for grip in body._dynamics.grips}
        own = [keys[joint.key] for joint in joints]
        position, velocity, effort = rng.normal(size=(3, *worlds, 3))
        stiffness, damping, most = rng.uniform(0.5, 2.0, (3, *worlds, 3))
        set_motors(own, position, velocity, stiffness, damping, most, effort)
        together = [joint.spec.drives for joint in own]
        for k, joint in enumerate(own):
            values = (part[..., k] for part in (velocity, position, stiffness, damping, most, effort))
            joint.motor = nuno.Motor(*values)
            np.testing.assert_array_equal(joint.spec.drives, together[k])
        before = [joint.spec.drives.copy() for joint in own]
        good = [position, velocity, stiffness, damping, most, effort]
        for k, value in ((0, np.nan), (2, 0.0), (3, -1.0), (4, -1.0), (5, np.inf)):
            bad = [np.where(np.arange(3) == 1, value, part) if n == k else part for n, part in enumerate(good)]
            with pytest.raises(InvalidInputError):
                set_motors(own, *bad)
        np.testing.assert_array_equal([joint.spec.drives for joint in own], before)
    own[0].release()
    with pytest.raises(nuno.BodyStateError):
        set_motors(own, position, velocity, stiffness, damping, most, effort)


def test_loads_are_read_together_beside_bodies_without_joints():
    """Wrenches and efforts of all joints at once are those of each by itself, while a box lies on a cloth elsewhere."""
    world = nuno.World(device="cpu")
    joints = linkage(world, ("hinge", "slider"))
    world.add(nuno.box((0.5, 0.5, 0.02), position=(2.0, 0.0, 0.5)))
    world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), position=(2.0, 0.0, 0.512))), nuno.Cloth(0.2))
    world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(2.0, 0.0, 0.539))), nuno.Rigid(mass=0.1))
    world.run(3 / 60)
    wrenches, efforts = world.engine.joint_loads(joints)
    np.testing.assert_array_equal(wrenches, [[np.concatenate(joint.wrench) for joint in joints]])
    np.testing.assert_array_equal(efforts, [[joint.effort for joint in joints]])
    assert wrenches.any()
