"""Joints against closed forms: pendulums, a four-bar, a door, drawers with friction, motors, springs and stops."""

import numpy as np
import pytest
from scipy.special import ellipk

import nuno
from few_variants import few
from nuno.shapes.coordinates import apply
from pair_with import moment, moments

G = 9.81
BAR = 0.4


def bar(world, centre, mass=0.5, length=BAR):
    """Add a bar along x."""
    body = world.add(nuno.box((length, 0.03, 0.02), position=centre))
    world.attach(body, nuno.Rigid(mass=mass))
    return body


def energy_of(*bodies):
    """Energy [J], potential from z = 1 m, in the middle of the last of 600 substeps a second: that of velocities."""
    total = 0.0
    for body in bodies:
        momentum, _, kinetic = moment(body)
        mass = body.material.mass
        total += kinetic + mass * G * (body.position[2] - 1.0) - 0.5 * G * momentum[2] / 600.0
    return total


def gap(joint):
    """How far a joint's two places are apart [m]."""
    own, other = joint._poses()
    return np.linalg.norm(own[0] - other[0], axis=-1).max()


def periods(values, step):
    """The time [s] between rises through zero, on the mean."""
    k = np.flatnonzero((values[:-1] <= 0.0) & (values[1:] > 0.0))
    return np.diff(k - values[k] / (values[k + 1] - values[k])).mean() * step


@pytest.mark.long
def test_a_compound_pendulum_swings_as_the_elliptic_integral_says():
    """From 60 degrees: T = 4 sqrt(I / m g l) K(sin^2 30), within 0.5 %; energy stays within 0.1 % for 10 s."""
    world = nuno.World(device="cpu")
    body = bar(world, (0.5 * BAR, 0.0, 1.0))
    body.rotate(np.radians(30.0), "y")
    body.locate((0.5 * BAR * np.cos(np.radians(30.0)), 0.0, 1.0 - 0.5 * BAR * np.sin(np.radians(30.0))))
    joint = nuno.hinge(body, None, point=(0.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    angles, energy = [], []
    for _ in range(600):
        world.step()
        angles.append(joint.position - np.radians(60.0))  # from the lowest point
        energy.append(energy_of(body))
        assert gap(joint) < 1e-6
    inertia = 0.5 * (BAR**2 + 0.02**2) / 12 + 0.5 * (0.5 * BAR) ** 2
    exact = 4 * np.sqrt(inertia / (0.5 * G * 0.5 * BAR)) * ellipk(np.sin(np.radians(30.0)) ** 2)
    assert periods(np.array(angles), 1 / 60) == pytest.approx(exact, rel=5e-3)
    assert np.ptp(energy) < 1e-3 * 0.5 * G * BAR


@pytest.mark.long
def test_a_double_pendulum_keeps_its_energy():
    """Chaotic motion from the horizontal, 10 s: energy drifts by less than 0.5 % of what it falls through."""
    world = nuno.World(device="cpu")
    one, two = bar(world, (0.5 * BAR, 0.0, 1.0)), bar(world, (1.5 * BAR, 0.0, 1.0))
    joints = [
        nuno.hinge(one, None, point=(0.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0)),
        nuno.hinge(two, one, point=(BAR, 0.0, 1.0), axis=(0.0, 1.0, 0.0)),
    ]
    energy = []
    for _ in range(600):
        world.step()
        energy.append(energy_of(one, two))
        assert max(map(gap, joints)) < 2e-6
    # rounding, a walk to either side: five starts ended within 0.4 %
    assert np.abs(energy).max() < 5e-3 * 0.5 * G * (0.5 + 1.5) * BAR


@pytest.mark.long
def test_a_four_bar_closes_and_its_rocker_goes_where_geometry_says():
    """A driven crank-rocker: closed within 0.02 mm, its rocker's angle is that of the closed form."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    crank, coupler, rocker, base = 0.1, 0.3, 0.25, 0.3
    start = np.array((0.0, 0.0, 1.0))
    end = np.add(start, (base, 0.0, 0.0))

    def corner(pin):
        """Where coupler and rocker meet, of a crank pin."""
        apart = end - pin
        far = np.linalg.norm(apart)
        along = (coupler**2 - rocker**2 + far**2) / (2 * far)
        side = np.array((-apart[2], 0.0, apart[0])) / far
        return pin + along * apart / far + np.sqrt(coupler**2 - along**2) * side

    def link(a, b, mass):
        body = world.add(nuno.box((np.linalg.norm(b - a), 0.02, 0.02), position=0.5 * (a + b)))
        body.rotate(np.arctan2(a[2] - b[2], b[0] - a[0]), "y")
        world.attach(body, nuno.Rigid(mass=mass))
        return body

    pin = np.add(start, (0.0, 0.0, crank))
    meet = corner(pin)
    first, middle, last = link(start, pin, 0.2), link(pin, meet, 0.4), link(end, meet, 0.3)
    y = (0.0, 1.0, 0.0)
    drive = nuno.hinge(first, None, point=start, axis=y, motor=nuno.Motor(velocity=6.0, max_effort=5.0))
    joints = [
        drive, nuno.hinge(middle, first, point=pin, axis=y), nuno.hinge(last, middle, point=meet, axis=y),
        nuno.hinge(last, None, point=end, axis=y),
    ]  # fmt: skip
    for _ in range(180):
        world.step()
        assert max(map(gap, joints)) < 2e-5
        now = apply(first.pose(), np.array([(0.5 * crank, 0.0, 0.0)]))[0]
        found = apply(last.pose(), np.array([(0.5 * rocker, 0.0, 0.0)]))[0]
        np.testing.assert_allclose(found, corner(now), atol=1e-4)  # the gaps, as the linkage multiplies them
    assert drive.velocity == pytest.approx(6.0, rel=0.01)


@pytest.mark.long
def test_a_door_on_a_slope_swings_about_its_lowest_point():
    """Axis 10 degrees off the vertical: T = 2 pi sqrt(I / m g b sin 10) (1 + A^2 / 16) within 0.5 %; it ends lowest."""
    world = nuno.World(device="cpu")
    tilt = np.radians(10.0)
    axis, across = np.array((np.sin(tilt), 0.0, np.cos(tilt))), np.array((np.cos(tilt), 0.0, -np.sin(tilt)))
    door = world.add(nuno.box((0.8, 0.04, 2.0)).rotate(tilt, "y"))
    door.locate(0.4 * across + axis)
    world.attach(door, nuno.Rigid(mass=20.0))
    joint = nuno.hinge(door, None, point=(0.0, 0.0, 0.0), axis=axis)
    world.push(door, (0.0, 20.0, 0.0), duration=0.3)
    angles = []
    for _ in range(900):
        world.step()
        angles.append(joint.position)
    inertia = 20.0 * ((0.8**2 + 0.04**2) / 12 + 0.4**2)
    small = 2 * np.pi * np.sqrt(inertia / (20.0 * G * 0.4 * np.sin(tilt)))
    assert periods(np.array(angles), 1 / 60) == pytest.approx(small * (1 + max(angles) ** 2 / 16), rel=5e-3)
    joint.spring = nuno.Spring(0.0, damping=10.0)
    world.run(8.0)
    assert joint.position == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("friction", [0.0, 3.0, 4.9, 4.91])
def test_a_drawer_on_a_slope_slides_by_coulombs_law(friction):
    """Displacement (g sin 30 - f / m) t^2 / 2 within 1 %, and nothing at all while friction holds it."""
    world = nuno.World(device="cpu")
    slope = np.radians(30.0)
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0)))
    world.attach(box, nuno.Rigid(mass=1.0))
    joint = nuno.slider(box, None, axis=(np.cos(slope), 0.0, -np.sin(slope)), friction=friction)
    world.run(1.0)
    goes = max(0.0, G * np.sin(slope) - friction)
    assert joint.velocity == pytest.approx(goes, rel=1e-3, abs=1e-6)
    assert joint.position == pytest.approx(0.5 * goes, rel=0.01, abs=1e-6)
    assert joint.effort == pytest.approx(-min(friction, G * np.sin(slope)), rel=1e-3, abs=1e-6)
    force, torque = joint.wrench  # what the box does to the rail: its weight, less what speeds it up
    along = np.array((np.cos(slope), 0.0, -np.sin(slope)))
    np.testing.assert_allclose(force, np.array((0.0, 0.0, -G)) - goes * along, atol=2e-3)
    np.testing.assert_allclose(torque, 0.0, atol=1e-3)


def test_a_motor_reaches_its_speed_against_friction():
    """Speed (M - f) t / I up to the speed that was asked for, which it then keeps with no more than f."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    wheel = world.add(nuno.cylinder(0.1, 0.05))
    world.attach(wheel, nuno.Rigid(mass=2.0))
    motor = nuno.Motor(velocity=5.0, max_effort=0.1)
    joint = nuno.hinge(wheel, None, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), motor=motor, friction=0.02)
    inertia = 0.5 * 2.0 * 0.1**2
    for _ in range(4):
        world.run(0.15)
        assert joint.velocity == pytest.approx(0.08 * world.time / inertia, rel=2e-3)
        assert joint.effort == pytest.approx(0.08, rel=1e-3)
    world.run(0.4)
    assert joint.velocity == pytest.approx(5.0, abs=2e-3)
    assert joint.effort == pytest.approx(0.0, abs=1e-3)
    joint.motor = nuno.Motor(velocity=5.0, damping=0.02, max_effort=1.0)
    world.run(5.0)
    # 0.02 (5 - omega) = f
    assert joint.velocity == pytest.approx(4.0, rel=1e-3)


def test_a_motor_goes_to_a_position():
    """Critically damped: 1 - (1 + w t) exp(-w t) within 2 %, and there within a thousandth in the end."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    wheel = world.add(nuno.cylinder(0.1, 0.05))
    world.attach(wheel, nuno.Rigid(mass=2.0))
    inertia, stiffness = 0.5 * 2.0 * 0.1**2, 2.0
    speed = np.sqrt(stiffness / inertia)
    motor = nuno.Motor(position=1.0, stiffness=stiffness, damping=2.0 * stiffness / speed)
    joint = nuno.hinge(wheel, None, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), motor=motor)
    for _ in range(12):
        world.step()
        wt = speed * world.time
        assert joint.position == pytest.approx(1.0 - (1.0 + wt) * np.exp(-wt), abs=0.02)
    world.run(2.0)
    assert joint.position == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("stiffness", few([10.0, 100.0, 1e5], 100.0))
def test_a_spring_keeps_its_amplitude(stiffness):
    """1 kg let go 50 mm from rest: period 2 pi sqrt(m / k) within 1 %, the amplitude after 5 s within 1 %."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0), frame_rate=60.0 if stiffness < 1e3 else 600.0)
    box = world.add(nuno.box((0.1, 0.1, 0.1)))
    world.attach(box, nuno.Rigid(mass=1.0))
    joint = nuno.slider(box, None, axis=(1.0, 0.0, 0.0), spring=nuno.Spring(stiffness, rest=0.05))
    seconds = 5.0 if stiffness < 1e3 else 1.0
    stretch = []
    for _ in range(round(seconds * world.frame_rate)):
        world.step()
        stretch.append(joint.position - 0.05)
    stretch = np.array(stretch)
    assert periods(stretch, 1 / world.frame_rate) == pytest.approx(2 * np.pi / np.sqrt(stiffness), rel=0.01)
    half = len(stretch) // 2
    assert np.abs(stretch[half:]).max() == pytest.approx(0.05, rel=0.01)


def test_stops_hold():
    """A flap that falls on its stop at 0.5 rad stays there, and the stop bears m g l cos 0.5."""
    world = nuno.World(device="cpu")
    flap = world.add(nuno.box((0.4, 0.3, 0.02), position=(0.2, 0.0, 1.0)))
    world.attach(flap, nuno.Rigid(mass=1.0))
    joint = nuno.hinge(flap, None, point=(0.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0), limits=(-0.2, 0.5))
    for _ in range(90):
        world.step()
        assert joint.position < 0.5 + 1e-5
    assert joint.position == pytest.approx(0.5, abs=1e-5)
    assert joint.effort == pytest.approx(-G * 0.2 * np.cos(0.5), rel=1e-3)
    joint.limits = (-0.2, 0.2)  # what is beyond a stop comes back at 1 rad/s
    world.run(0.15)
    assert 0.3 < joint.position < 0.4
    world.run(0.5)
    assert joint.position == pytest.approx(0.2, abs=1e-4)


def test_a_ball_joint_swings_and_stays_in_its_cone():
    """A conical pendulum keeps length and energy; with a limit its axis leans by that, which bears m g l sin 0.3."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.sphere(0.05, position=(0.3, 0.0, 1.0)))
    world.attach(ball, nuno.Rigid(mass=1.0))
    joint = nuno.ball_joint(ball, None, point=(0.0, 0.0, 1.0))
    world.push(ball, (0.0, 3.0, 0.0), duration=0.1)
    world.run(0.1)
    energy = []
    for _ in range(300):
        world.step()
        assert np.linalg.norm(ball.position - (0.0, 0.0, 1.0)) == pytest.approx(0.3, abs=1e-6)
        energy.append(energy_of(ball))
    assert np.ptp(energy) < 1e-3 * G * 0.3
    joint.release()
    stick = world.add(nuno.box((0.05, 0.05, 0.4), position=(1.0, 0.0, 1.2)))
    world.attach(stick, nuno.Rigid(mass=1.0))
    held = nuno.ball_joint(stick, None, point=(1.0, 0.0, 1.0), limit=0.3)
    world.push(stick, (1.0, 0.5, 0.0), duration=0.1)
    world.run(2.0)
    assert np.linalg.norm(held.position) == pytest.approx(0.3, abs=1e-4)
    assert held.effort == pytest.approx(-G * 0.2 * np.sin(0.3), rel=0.01)


def test_a_ball_joint_with_friction_and_a_spring_comes_to_rest_where_they_balance():
    """Statics: with friction above m g l it stays; with a spring alone it leans where k theta = m g l sin theta."""
    world = nuno.World(device="cpu")
    stick = world.add(nuno.box((0.05, 0.05, 0.4), position=(0.2, 0.0, 1.0)).rotate(np.pi / 2, "y"))
    stick.locate((0.2, 0.0, 1.0))
    world.attach(stick, nuno.Rigid(mass=1.0))
    joint = nuno.ball_joint(stick, None, point=(0.0, 0.0, 1.0), friction=2.0)
    world.run(1.0)
    assert np.linalg.norm(joint.position) < 1e-5
    joint.friction, joint.spring = 0.0, nuno.Spring(10.0, damping=1.0)
    world.run(4.0)
    lean = np.linalg.norm(joint.position)
    assert 10.0 * lean == pytest.approx(G * 0.2 * np.cos(lean), rel=2e-3)


@pytest.mark.parametrize("kind", few(["fixed", "hinge", "slider", "ball"], "hinge"))
def test_joints_of_free_bodies_keep_momentum(kind):
    """Two joined bodies that were thrown keep momentum and angular momentum, whatever acts inside."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    one, two = bar(world, (0.0, 0.0, 0.0), 0.3), bar(world, (0.3, 0.1, 0.0), 0.7, 0.2)
    inside = {"spring": nuno.Spring(0.5, rest=0.1), "friction": 0.01}
    if kind == "fixed":
        nuno.fixed_joint(one, two)
    elif kind == "ball":
        nuno.ball_joint(one, two, point=(0.2, 0.05, 0.0), friction=0.001)
    else:
        made = {"hinge": nuno.hinge, "slider": nuno.slider}[kind]
        made(one, two, point=(0.2, 0.05, 0.0), axis=(0.2, 1.0, 0.3), **inside)
    world.push(one, (1.0, 2.0, -1.0), torque=(0.02, 0.05, 0.1), duration=0.1)
    world.run(0.1)
    momentum, spin, _ = moments(one, two)
    world.run(2.0)
    now, now_spin, _ = moments(one, two)
    size = np.linalg.norm(momentum)
    np.testing.assert_allclose(now, momentum, atol=1e-4 * size)  # rounding
    # arms are those of where each substep began: turns of 0.01 rad, of which the square is left
    np.testing.assert_allclose(now_spin, spin, atol=0.01 * np.linalg.norm(spin))


def test_a_chain_bears_what_is_250_times_as_heavy():
    """Six links of 20 g on which 5 kg swing: apart by less than 0.2 mm, and the top bears the weight at rest."""
    world = nuno.World(device="cpu")
    before, joints = None, []
    for k in range(6):
        link = world.add(nuno.capsule(0.01, 0.06, position=(0.0, 0.0, 1.96 - 0.08 * k)))
        world.attach(link, nuno.Rigid(mass=0.02))
        joints.append(nuno.ball_joint(link, before, point=(0.0, 0.0, 2.0 - 0.08 * k)))
        before = link
    ball = world.add(nuno.sphere(0.08, position=(0.0, 0.0, 1.44)))
    world.attach(ball, nuno.Rigid(mass=5.0))
    joints.append(nuno.ball_joint(ball, before, point=(0.0, 0.0, 1.52)))
    world.run(0.5)
    np.testing.assert_allclose(joints[0].wrench[0], (0.0, 0.0, -5.12 * G), rtol=0.01, atol=0.05)
    world.push(ball, (20.0, 0.0, 0.0), duration=0.2)
    for _ in range(120):
        world.step()
        assert max(map(gap, joints)) < 2e-4
