"""Hinges and sliders of MuJoCo and their drives, beside closed forms and Nuno's own engine."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

STEP = 1.0 / 480.0
"""[s] A substep of MuJoCo in a frame of 1/60 s."""
G = 9.81


def world_of(engine="mujoco", **settings):
    """An empty world."""
    return nuno.World(device="cpu", engine=engine, **settings)


def lever(world, axis, **drives):
    """A rod of 20 cm, 80 g, on a hinge at its end."""
    rod = world.attach(world.add(nuno.box((0.2, 0.02, 0.02), position=(0.1, 0.0, 1.0), name="rod")))
    return rod, nuno.hinge(rod, None, point=(0.0, 0.0, 1.0), axis=axis, **drives)


def inertia_of(rod):
    """[kg m2] Of the rod about its end: m (l^2 + h^2) / 12 + m r^2."""
    return rod.mass * ((0.2**2 + 0.02**2) / 12.0 + 0.1**2)


def test_a_slider_slides_down_its_slope():
    """S = g sin(a) t (t + h) / 2 by semi-implicit steps h, and the slope bears m g cos(a) across: to rounding."""
    world, angle = world_of(), np.radians(30.0)
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0))))
    slope = nuno.slider(block, None, axis=(np.cos(angle), 0.0, -np.sin(angle)))
    world.run(0.5)
    assert slope.position == pytest.approx(0.5 * G * np.sin(angle) * 0.5 * (0.5 + STEP), abs=1e-9)
    assert slope.velocity == pytest.approx(G * np.sin(angle) * 0.5, abs=1e-9)
    across = block.mass * G * np.cos(angle)
    # the body presses the slope down and back; the mean over the last frame, as of the built-in engine
    np.testing.assert_allclose(slope.wrench[0], (-across * np.sin(angle), 0.0, -across * np.cos(angle)), atol=1e-9)
    np.testing.assert_allclose(block.pose()[1], (1.0, 0.0, 0.0, 0.0), atol=1e-12)


def test_a_motor_with_a_limit_speeds_up_by_it_and_then_keeps_its_velocity():
    """W = M t / I while it gives all; then its velocity, without effort: 1e-4 of what the dry friction leaves."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    rod, hinge = lever(world, (0.0, 0.0, 1.0), motor=nuno.Motor(3.0, max_effort=0.005))
    world.run(0.25)
    assert hinge.velocity == pytest.approx(0.005 * 0.25 / inertia_of(rod), rel=1e-6)
    assert hinge.effort == pytest.approx(0.005, rel=1e-6)
    world.run(1.0)
    assert hinge.velocity == pytest.approx(3.0, rel=1e-4)
    assert hinge.effort == pytest.approx(0.0, abs=1e-6)


def test_gains_give_their_terminal_speed_and_place():
    """D (v - w) = c w, and k (p - q) = m g r cos(q): of motors with gains, against a damping and a weight."""
    world = world_of()
    rod, hinge = lever(world, (0.0, 0.0, 1.0), motor=nuno.Motor(2.0, damping=0.1), spring=nuno.Spring(0.0, damping=0.1))
    world.run(0.5)
    # the time constant is I / 0.2 = 5 ms
    assert hinge.velocity == pytest.approx(1.0, abs=1e-6)
    assert hinge.effort == pytest.approx(0.0, abs=1e-6)
    world = world_of()
    rod, hinge = lever(world, (0.0, 1.0, 0.0), motor=nuno.Motor(0.0, position=0.0, stiffness=10.0, damping=0.3))
    world.run(1.0)
    weight = rod.mass * G * 0.1
    # hanging down turns it forwards about y: k q = m g r cos(q)
    assert 10.0 * hinge.position == pytest.approx(weight * np.cos(hinge.position), rel=1e-6)
    assert hinge.effort == pytest.approx(-weight * np.cos(hinge.position), rel=1e-6)


def test_a_strong_motor_of_a_light_joint_goes_where_it_is_sent():
    """A rod of 5 g with 2 kN m/rad and 2 N m: the limited implicit steps' own recursion, within 1 % of the way.

    With explicit steps a motor of 2 N m would throw it by h^2 2 N m / I = 0.9 rad and more to and fro.
    """
    world, way, limit, k, d = world_of(gravity=(0.0, 0.0, 0.0)), 0.3, 2.0, 2000.0, 1.0
    rod = world.add(nuno.box((0.1, 0.01, 0.01), position=(0.0, 0.0, 1.0), name="rod"))
    world.attach(rod, nuno.Rigid(mass=0.005))
    motor = nuno.Motor(0.0, position=way, stiffness=k, damping=d, max_effort=limit)
    hinge = nuno.hinge(rod, None, point=rod.position, axis=(0.0, 0.0, 1.0), motor=motor)
    inertia = 0.005 * (0.1**2 + 0.01**2) / 12.0
    x = v = 0.0
    for _ in range(20):
        world.run(1.0 / 60.0)
        for _ in range(8):
            pull = (k * (way - x - STEP * v) - d * v) / (1.0 + (k * STEP + d) * STEP / inertia)
            v += STEP * np.clip(pull, -limit, limit) / inertia
            x += STEP * v
        assert hinge.position == pytest.approx(x, abs=0.01 * way)
    assert hinge.position == pytest.approx(way, abs=1e-5)


def test_friction_holds_what_is_below_it_and_brakes_what_is_above():
    """A slider sticks under 0.9 f, and goes with (F - f) / m under F: s = (F - f) t (t + h) / (2 m), within 1 %."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1))))
    slider = nuno.slider(block, None, axis=(1.0, 0.0, 0.0), friction=1.0)
    world.push(block, (0.9, 0.0, 0.0), duration=0.3)
    world.run(0.3)
    # dry friction in MuJoCo is a stiff damper below its bound
    assert slider.position == pytest.approx(0.0, abs=1e-6)
    world.push(block, (2.0, 0.0, 0.0), duration=0.3)
    world.run(0.3)
    assert slider.position == pytest.approx(0.5 * 1.0 / block.mass * 0.3 * (0.3 + STEP), rel=0.01)


def test_a_spring_swings_as_implicit_steps_have_it():
    """x_n = x0 (1 - (1 + (w h)^2)^(-n/2) cos(n atan(w h))): the oscillator of implicit steps, to 1e-9."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1))))
    slider = nuno.slider(block, None, axis=(1.0, 0.0, 0.0), spring=nuno.Spring(50.0, rest=0.05))
    angle = STEP * np.sqrt(50.0 / block.mass)
    for n in range(8, 8 * 61, 8):
        world.step()
        wanted = 0.05 * (1.0 - (1.0 + angle**2) ** (-0.5 * n) * np.cos(n * np.arctan(angle)))
        assert slider.position == pytest.approx(wanted, abs=1e-9)


def test_stops_hold():
    """A lever falls on its stop and lies there; a slider is pushed on its own: to 0.1 mrad, 0.1 mm, and the load."""
    world = world_of()
    rod, hinge = lever(world, (0.0, 1.0, 0.0), limits=(-0.2, 0.3))
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(1.0, 0.0, 1.0))))
    slider = nuno.slider(block, None, axis=(1.0, 0.0, 0.0), limits=(-0.1, 0.05))
    world.push(block, (-3.0, 0.0, 0.0), duration=2.0)
    world.run(1.5)
    assert hinge.position == pytest.approx(0.3, abs=1e-4)
    assert hinge.effort == pytest.approx(-rod.mass * G * 0.1 * np.cos(0.3), rel=1e-3)
    assert slider.position == pytest.approx(-0.1, abs=1e-4)
    assert slider.effort == pytest.approx(3.0, rel=1e-3)
    assert abs(hinge.velocity) < 1e-4 and abs(slider.velocity) < 1e-4


def test_what_hangs_on_a_body_on_a_path_keeps_still_where_it_is_free():
    """A block slides along x on a carriage that goes along x and y: its own velocity in x stays zero, to rounding."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    carriage = world.add(nuno.box((0.3, 0.3, 0.1), name="carriage"))
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.2))))
    slider = nuno.slider(block, carriage, axis=(1.0, 0.0, 0.0))
    world.move(carriage, nuno.Path([0.0, 0.5], [(0.0, 0.0, 0.0), (0.3, 0.2, 0.0)], None, "minimum_jerk"))
    world.run(0.25)
    middle = world.save()
    world.run(0.25)
    np.testing.assert_allclose(block.position, (0.0, 0.2, 0.2), atol=1e-9)
    assert slider.position == pytest.approx(-0.3, abs=1e-9)
    place = block.position
    world.restore(middle)
    world.run(0.25)
    np.testing.assert_array_equal(block.position, place)


def test_a_loop_is_closed_by_a_light_helper():
    """A parallelogram of two cranks and a bar: its bar goes in a circle, within 1 % of the way, and stays level."""
    world = world_of()
    cranks = [
        world.attach(world.add(nuno.box((0.02, 0.02, 0.1), position=(x, 0.0, 1.05), name=f"crank {x}")))
        for x in (0.0, 0.2)
    ]
    bar = world.attach(world.add(nuno.box((0.2, 0.02, 0.02), position=(0.1, 0.0, 1.1), name="bar")))
    feet = [
        nuno.hinge(crank, None, point=(x, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
        for crank, x in zip(cranks, (0.0, 0.2), strict=True)
    ]
    for crank, x in zip(cranks, (0.0, 0.2), strict=True):
        nuno.hinge(bar, crank, point=(x, 0.0, 1.1), axis=(0.0, 1.0, 0.0))
    feet[0].motor = nuno.Motor(2.0)
    world.run(0.4)
    # the motor is up to speed within two substeps' time constant, 2 rad/s * 4.2 ms
    assert feet[0].position == pytest.approx(0.8, abs=0.01)
    angle = feet[0].position
    wanted = (0.1 + 0.1 * np.sin(angle), 0.0, 1.0 + 0.1 * np.cos(angle))
    np.testing.assert_allclose(bar.position, wanted, atol=2e-5)
    assert feet[1].position == pytest.approx(angle, abs=1e-4)
    np.testing.assert_allclose(bar.pose()[1], (1.0, 0.0, 0.0, 0.0), atol=1e-4)


def test_air_slows_down_what_turns_on_a_hinge():
    """A rod's torque is c (m r^2 + the mean moment) w: it turns on with exp(-t) by that over its moment, within 1 %."""
    world = world_of(gravity=(0.0, 0.0, 0.0))
    rod = world.add(nuno.box((0.2, 0.02, 0.02), position=(0.1, 0.0, 1.0)))
    world.attach(rod, nuno.Rigid(air_drag=1.0))
    hinge = nuno.hinge(rod, None, point=(0.0, 0.0, 1.0), axis=(0.0, 0.0, 1.0))
    world.set_velocity(rod, (0.0, 0.2, 0.0), (0.0, 0.0, 2.0))
    world.run(0.5)
    mean = (2.0 * (0.2**2 + 0.02**2) + 2.0 * 0.02**2) / 36.0
    rate = (0.1**2 + mean) / (0.1**2 + (0.2**2 + 0.02**2) / 12.0)
    assert hinge.velocity == pytest.approx(2.0 * np.exp(-0.5 * rate), rel=0.01)


def test_new_drives_compile_nothing():
    """A goal, gains, a spring and stops are numbers; only the first velocity that is kept exactly makes a clutch."""
    world = world_of()
    _, hinge = lever(world, (0.0, 0.0, 1.0))
    world.step()
    before = world.engine.scene.compilations
    for k in range(3):
        hinge.motor = nuno.Motor(0.0, position=0.1 * k, stiffness=1.0, damping=0.1)
        hinge.limits, hinge.spring, hinge.friction = (-1.0, 1.0), nuno.Spring(0.1), 0.01
        world.step()
    assert world.engine.scene.compilations == before
    hinge.motor = nuno.Motor(1.0)
    world.step()
    hinge.motor = nuno.Motor(2.0)
    world.step()
    assert world.engine.scene.compilations == before + 1


def test_worlds_of_a_batch_have_drives_of_their_own():
    """Each goes to its own place, and is to the bit what a single world with those numbers is."""
    world = world_of()
    _, hinge = lever(world, (0.0, 0.0, 1.0), motor=nuno.Motor(0.0, position=0.2, stiffness=5.0, damping=0.2))
    world.step()
    batch = world.imagine(3)
    rods = batch.find("rod")
    joint = rods._dynamics.grips[0]
    joint.motor = nuno.Motor(0.0, position=np.array([0.2, -0.4, 0.6]), stiffness=5.0, damping=0.2)
    batch.run(0.5)
    world.run(0.5)
    np.testing.assert_allclose(joint.position, (0.2, -0.4, 0.6), atol=1e-3)
    np.testing.assert_array_equal(rods.pose()[0][0], world.find("rod").pose()[0])
    assert hinge.position == joint.position[0]


def test_a_chain_goes_as_in_nuno():
    """Three links with a motor, a spring, friction and stops on a cart: both engines within 2 mm after 0.5 s.

    Nuno's substep is 1/1200 s here, MuJoCo's 1/960 s; they go by up to 0.4 m.
    """
    places = {}
    for engine, substeps in (("nuno", 20), ("mujoco", 16)):
        world = world_of(engine, substeps=substeps)
        world.add(nuno.plane())
        cart = world.attach(world.add(nuno.box((0.2, 0.2, 0.1), position=(0.0, 0.0, 0.05), name="cart")))
        nuno.slider(cart, None, axis=(1.0, 0.0, 0.0), friction=0.5)
        before, links = cart, []
        for k in range(3):
            link = world.attach(world.add(nuno.box((0.04, 0.04, 0.2), position=(0.0, 0.0, 0.2 + 0.2 * k))))
            drives = (
                {"motor": nuno.Motor(0.0, position=0.5, stiffness=20.0, damping=0.5, max_effort=4.0)},
                {"spring": nuno.Spring(3.0, rest=0.2, damping=0.05)},
                {"friction": 0.05, "limits": (-0.4, 0.4)},
            )[k]
            nuno.hinge(link, before, point=(0.0, 0.0, 0.1 + 0.2 * k), axis=(0.0, 1.0, 0.0), **drives)
            before = link
            links.append(link)
        world.run(0.5)
        places[engine] = np.array([body.position for body in (cart, *links)])
    assert np.abs(places["nuno"][3] - (0.0, 0.0, 0.6)).max() > 0.1
    np.testing.assert_allclose(places["mujoco"], places["nuno"], atol=2e-3)


def test_joints_come_and_go_while_bodies_move():
    """What a hinge held falls from where it is with the velocity that it has; a joint made later holds again."""
    world = world_of()
    rod, hinge = lever(world, (0.0, 1.0, 0.0))
    world.run(0.1)
    velocity, place = rod.velocity, rod.position
    hinge.release()
    np.testing.assert_array_equal(rod.velocity, velocity)
    world.run(0.1)
    fallen = place + 0.1 * velocity + (0.0, 0.0, -0.5 * G * 0.1 * (0.1 + STEP))
    np.testing.assert_allclose(rod.position, fallen, atol=1e-6)
    again = nuno.hinge(rod, None, point=rod.position, axis=(0.0, 1.0, 0.0))
    place = rod.position
    world.run(0.1)
    np.testing.assert_allclose(rod.position, place, atol=1e-9)
    world.detach(rod)
    assert not again.active
    world.run(0.1)


def test_a_grip_tells_what_it_bears_of_a_body_on_a_joint():
    """A slider bears nothing along its axis, a hinge no torque about it: the grip bears the weight, and the torque."""
    world = world_of()
    block = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0), name="block").rotate(0.7, "x"))
    world.attach(block, nuno.Rigid(mass=1.0))
    nuno.slider(block, None, axis=(0.0, 0.0, 1.0))
    grip = world.grip(block, to=block.position)
    world.run(0.3)
    assert grip.wrench[0][2] == pytest.approx(-G, rel=1e-3)
    world = world_of(gravity=(0.0, 0.0, 0.0))
    rod = world.add(nuno.box((0.2, 0.02, 0.02), position=(0.0, 0.0, 1.0), name="rod").rotate(0.7, "x"))
    world.attach(rod, nuno.Rigid(mass=1.0))
    nuno.hinge(rod, None, point=rod.position, axis=(0.0, 0.0, 1.0))
    grip = world.grip(rod, to=rod.position)
    world.push(rod, (0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.3), duration=1.0)
    world.run(0.3)
    assert grip.wrench[1][2] == pytest.approx(0.3, rel=1e-3)
