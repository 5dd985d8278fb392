"""Trees of joints, which are solved whole, against closed forms and invariants."""

import numpy as np
import pytest

import nuno
from pair_with import moments

G = 9.81
LINK = 0.1


def gap(joint):
    """How far a joint's two places are apart [m]."""
    own, other = joint._poses()
    return np.linalg.norm(own[0] - other[0], axis=-1).max()


def arm(world, joints=6, mass=0.5, **drive):
    """Add an arm of links along x from a wall at z = 1 m, on hinges about y."""
    before, made = None, []
    for k in range(joints):
        link = world.add(nuno.box((LINK, 0.03, 0.03), position=((k + 0.5) * LINK, 0.0, 1.0)))
        world.attach(link, nuno.Rigid(mass=mass))
        made.append(nuno.hinge(link, before, point=(k * LINK, 0.0, 1.0), axis=(0.0, 1.0, 0.0), **drive))
        before = link
    return made


def test_a_chain_of_30_links_bears_250_times_their_mass():
    """5 kg swing on links of 20 g: apart by less than 5 um, and the top bears all the weight at rest."""
    world = nuno.World(device="cpu")
    before, joints = None, []
    for k in range(30):
        link = world.add(nuno.capsule(0.01, 0.02, position=(0.0, 0.0, 4.98 - 0.04 * k)))
        world.attach(link, nuno.Rigid(mass=0.02))
        joints.append(nuno.ball_joint(link, before, point=(0.0, 0.0, 5.0 - 0.04 * k)))
        before = link
    ball = world.add(nuno.sphere(0.1, position=(0.0, 0.0, 3.7)))
    world.attach(ball, nuno.Rigid(mass=5.0))
    joints.append(nuno.ball_joint(ball, before, point=(0.0, 0.0, 3.8)))
    world.run(0.1)
    np.testing.assert_allclose(joints[0].wrench[0], (0.0, 0.0, -5.6 * G), rtol=1e-3, atol=0.05)
    world.push(ball, (20.0, 0.0, 0.0), duration=0.2)
    for _ in range(30):
        world.step()
        assert max(map(gap, joints)) < 5e-6


def test_motors_that_hold_an_arm_bear_what_is_beyond_them():
    """Each hinge bears sum of m g x of the links beyond it, within 0.1 %, and sags by that over its stiffness."""
    world = nuno.World(device="cpu")
    joints = arm(world, motor=nuno.Motor(position=0.0, stiffness=5e4, damping=200.0))
    world.run(1.0)
    for k, joint in enumerate(joints):
        beyond = sum(0.5 * G * (n - k + 0.5) * LINK for n in range(k, 6))
        assert joint.effort == pytest.approx(-beyond, rel=1e-3)
        assert joint.position == pytest.approx(beyond / 5e4, rel=0.01)


@pytest.mark.parametrize("held_by", ["stop", "friction", "velocity motor"])
def test_what_holds_a_joint_entirely_holds_it_in_a_tree(held_by):
    """Stops, friction and motors that keep a velocity of nothing: no link moves, and each bears what is beyond it."""
    world = nuno.World(device="cpu")
    drive = {
        "stop": {"limits": (-0.5, 0.0)}, "friction": {"friction": 50.0}, "velocity motor": {"motor": nuno.Motor()},
    }[held_by]  # fmt: skip
    joints = arm(world, **drive)
    world.run(0.5)
    for k, joint in enumerate(joints):
        beyond = sum(0.5 * G * (n - k + 0.5) * LINK for n in range(k, 6))
        assert joint.effort == pytest.approx(-beyond, rel=2e-3)
        assert joint.position == pytest.approx(0.0, abs=1e-5)


def test_a_motor_gives_way_at_its_effort():
    """The first hinge has less than the arm needs and falls with (M - tau) / I of a stiff arm; the others hold."""
    world = nuno.World(device="cpu")
    joints = arm(world, motor=nuno.Motor(position=0.0, stiffness=5e4, damping=200.0))
    moment = 0.5 * G * sum((n + 0.5) * LINK for n in range(6))
    joints[0].motor = nuno.Motor(position=0.0, stiffness=5e4, damping=200.0, max_effort=0.8 * moment)
    world.run(2 / 60)
    early = joints[0].velocity  # once the motors have taken the load
    world.run(2 / 60)
    inertia = 3.0 * ((6 * LINK) ** 2 + 0.03**2) / 12 + 3.0 * (3 * LINK) ** 2
    assert joints[0].effort == pytest.approx(-0.8 * moment, rel=1e-3)
    assert joints[0].velocity - early == pytest.approx(0.2 * moment / inertia * 2 / 60, rel=2e-3)
    assert max(abs(joint.position) for joint in joints[1:]) < 1e-3


def test_a_joint_bears_no_more_than_its_limit():
    """Links hang on each other; the third joint lets the rest down with g less what it bears over its mass."""
    world = nuno.World(device="cpu")
    before, joints = None, []
    for k in range(5):
        link = world.add(nuno.box((0.03, 0.03, LINK), position=(0.0, 0.0, 1.0 - (k + 0.5) * LINK)))
        world.attach(link, nuno.Rigid(mass=1.0))
        limit = 20.0 if k == 2 else None
        joints.append(nuno.ball_joint(link, before, point=(0.0, 0.0, 1.0 - k * LINK), max_force=limit))
        before = link
    world.run(0.1)
    assert np.linalg.norm(joints[2].wrench[0]) == pytest.approx(20.0, rel=1e-3)
    assert joints[0].wrench[0][2] == pytest.approx(-(2.0 * G + 20.0), rel=1e-3)
    assert before.velocity[2] == pytest.approx(-(G - 20.0 / 3.0) * 0.1, rel=0.02)
    assert max(gap(joints[k]) for k in (0, 1, 3, 4)) < 1e-6


def tree(world):
    """Add a torso with a hinged, a sliding, a swinging and a fixed link, of which two carry others."""
    torso = world.add(nuno.box((0.2, 0.2, 0.3)))
    world.attach(torso, nuno.Rigid(mass=5.0))
    bodies, joints = [torso], []

    def link(name, carrier, place, mass, make, **options):
        body = world.add(nuno.box((0.12, 0.05, 0.04), name=name, position=place))
        world.attach(body, nuno.Rigid(mass=mass))
        middle = 0.5 * (np.array(carrier.position) + place)
        at = {} if make in (nuno.fixed_joint, nuno.slider) else {"point": middle}
        joints.append(make(body, carrier, **at, **options))
        bodies.append(body)
        return body

    drive = {"spring": nuno.Spring(0.5, rest=0.1), "friction": 0.01}
    elbow = link("upper", torso, (0.25, 0.0, 0.1), 0.7, nuno.hinge, axis=(0.2, 1.0, 0.3), **drive)
    link("lower", elbow, (0.4, 0.1, 0.1), 0.3, nuno.ball_joint, friction=0.001)
    rail = link("rail", torso, (-0.25, 0.0, 0.1), 0.4, nuno.slider, axis=(0.1, 0.2, 1.0), limits=(-0.02, 0.02), **drive)
    # the other way round: the carried body is the joint's other
    tip = world.add(nuno.box((0.1, 0.04, 0.04), name="tip", position=(-0.4, 0.0, 0.1)))
    world.attach(tip, nuno.Rigid(mass=0.2))
    joints.append(nuno.hinge(rail, tip, point=(-0.33, 0.0, 0.1), axis=(0.0, 0.0, 1.0)))
    bodies.append(tip)
    link("mast", torso, (0.0, 0.0, 0.3), 0.2, nuno.fixed_joint)
    return bodies, joints


def test_a_thrown_tree_keeps_momentum():
    """Momentum to rounding and angular momentum within 1 % over 2 s, whatever acts inside; no joint opens."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    bodies, joints = tree(world)
    world.push(bodies[0], (10.0, 20.0, -10.0), torque=(2.0, 5.0, 3.0), duration=0.1)
    world.run(0.1)
    momentum, spin, _ = moments(*bodies)
    for _ in range(120):
        world.step()
        assert max(gap(joint) for joint in joints if joint.kind != "slider") < 3e-6
    now, now_spin, _ = moments(*bodies)
    np.testing.assert_allclose(now, momentum, atol=1e-4 * np.linalg.norm(momentum))  # rounding
    # arms are those of where each substep began: turns of 0.01 rad, of which the square is left
    np.testing.assert_allclose(now_spin, spin, atol=0.01 * np.linalg.norm(spin))
