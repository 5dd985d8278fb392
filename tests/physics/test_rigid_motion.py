"""Rigid bodies without friction's or stacks' part in it: free motion, bounces, collisions."""

import numpy as np
import pytest

from nuno.shapes import quaternion
from nuno.shapes.shape import Box, Cylinder, Sphere
from nuno.solvers.rigid_solver import RigidSolver
from rigid_with import GRAVITY, about, drop, on_floor

RUN_AT = 1.0 / 600.0  # [s], a substep


def test_free_fall_is_the_parabola():
    """Closed form; symplectic steps of dt fall g t dt / 2 farther, exactly."""
    solver = RigidSolver(2)
    body = drop(solver, Box((0.1, 0.2, 0.3)), [[0, 0, 0], [1, 2, 3]], velocity=[[1.0, 0, 2.0], [0, 0, 0]])
    solver.run(0.0, 1.0)
    v = np.array([[1.0, 0, 2.0], [0, 0, 0]])
    expected = np.array([[0, 0, 0], [1, 2, 3]]) + v
    expected[:, 2] -= 0.5 * GRAVITY * (1.0 + RUN_AT)
    # 600 sums of float32 numbers of up to 10: 1e-6 each at worst, random in sign
    np.testing.assert_allclose(solver.pose(body)[0], expected, atol=2e-5)
    # a sum of g dt rounds by up to 5e-7, often the same way 600 times
    np.testing.assert_allclose(solver.velocity(body)[0][:, 2], v[:, 2] - GRAVITY, atol=3e-4)


def test_a_force_and_a_torque_do_what_newton_and_euler_say():
    """Closed form: v = F t / m, and about a principal axis spin = M t / I."""
    solver = RigidSolver(gravity=(0.0, 0.0, 0.0))
    body = drop(solver, Box((0.1, 0.2, 0.3)), (0, 0, 0))
    mass = 6.0
    solver.set_forces(body, (3.0, 0.0, 0.0), (0.0, 0.0, 0.01))
    solver.run(0.0, 1.0)
    velocity, spin = solver.velocity(body)
    # 600 sums in float32
    np.testing.assert_allclose(velocity[0], [3.0 / mass, 0, 0], atol=1e-5)
    np.testing.assert_allclose(spin[0], [0, 0, 0.01 / (mass * (0.1**2 + 0.2**2) / 12.0)], rtol=1e-5, atol=1e-6)


def test_a_free_body_spun_about_its_middle_axis_flips_and_keeps_its_angular_momentum():
    """Invariant (and Dzhanibekov's flip): the middle axis is unstable, angular momentum is not."""
    solver = RigidSolver(gravity=(0.0, 0.0, 0.0))
    shape = Box((0.1, 0.2, 0.4))
    body = drop(solver, shape, (0, 0, 0), about((1, 2, 3), 40.0))
    mass, (a, b, c) = 8.0, shape.size
    inertia = mass / 12.0 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])

    def turn():
        return quaternion.to_matrix(solver.pose(body)[1][0])

    def momentum():
        return turn() @ inertia @ turn().T @ solver.velocity(body)[1][0]

    def energy():
        spin = turn().T @ solver.velocity(body)[1][0]
        return 0.5 * spin @ inertia @ spin

    solver.set_velocity(body, (0, 0, 0), turn() @ [0.01, 6.0, 0.0])
    start, begun, axis = momentum(), energy(), turn()[:, 1]
    along = []
    for _ in range(100):
        solver.run(0.0, 0.1)
        along.append(float(turn()[:, 1] @ axis))
    # rounding of 6,000 steps of 1e-7
    assert np.linalg.norm(momentum() - start) < 2e-4 * np.linalg.norm(start)
    # the midpoint rule errs by (spin dt)^2 / 24 of a turn's energy, back and forth: 4e-6
    assert energy() == pytest.approx(begun, rel=1e-3)
    assert min(along) < -0.95  # it looked the other way
    assert max(along[along.index(min(along)) :]) > 0.9  # and came back


@pytest.mark.parametrize("shape", [Sphere(0.05), Box((0.1, 0.1, 0.1))], ids=["sphere", "box"])
@pytest.mark.parametrize("bounce", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_a_dropped_body_rebounds_to_the_square_of_its_restitution(shape, bounce):
    """Closed form: e^2 h, within 5 % (issued tolerance; a step of v dt = 7 mm on 1 m)."""
    solver = on_floor()
    body = drop(solver, shape, (0, 0, 1.05), restitution=bounce)
    heights = []
    for _ in range(60):
        solver.run(0.0, 1.0 / 60.0)
        heights.append(solver.pose(body)[0][0, 2] - 0.05)
    low = int(np.argmin(heights[:40]))
    assert max(heights[low:]) == pytest.approx(bounce**2, rel=0.05, abs=2e-3)
    # flat on four corners at once: what the order of the corners leaves of a spin
    assert np.abs(solver.velocity(body)[1]).max() < 0.01


@pytest.mark.parametrize("bounce", [0.0, 0.7, 1.0])
def test_two_bodies_that_collide_keep_their_momentum(bounce):
    """Invariant: momentum and angular momentum of an isolated pair; energy never grows."""
    solver = RigidSolver(gravity=(0.0, 0.0, 0.0))
    shapes = (Box((0.1, 0.1, 0.2)), Cylinder(0.05, 0.12))
    slots = [
        drop(solver, shapes[0], (0, 0, 0), about((1, 1, 0), 30), velocity=(1.0, 0.0, 0.2), restitution=bounce),
        drop(solver, shapes[1], (0.3, 0.03, 0.02), about((0, 1, 1), 50), velocity=(-1.0, 0.1, 0.0), restitution=bounce),
    ]
    masses = [1000.0 * 0.1 * 0.1 * 0.2, 1000.0 * np.pi * 0.05**2 * 0.12]
    box = masses[0] / 12.0 * np.diag([0.05, 0.05, 0.02])
    across = masses[1] * (3 * 0.05**2 + 0.12**2) / 12.0
    inertias = [box, np.diag([across, across, masses[1] * 0.05**2 / 2.0])]

    def sums():
        linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
        for slot, mass, inertia in zip(slots, masses, inertias, strict=True):
            place, turn = (each[0] for each in solver.pose(slot))
            velocity, spin = (each[0] for each in solver.velocity(slot))
            r = quaternion.to_matrix(turn)
            tensor = r @ inertia @ r.T
            linear += mass * velocity
            angular += mass * np.cross(place, velocity) + tensor @ spin
            energy += 0.5 * mass * velocity @ velocity + 0.5 * spin @ tensor @ spin
        return linear, angular, energy

    before = sums()
    solver.run(0.0, 0.6)
    after = sums()
    assert np.abs(solver.velocity(slots[1])[1]).max() > 0.1  # they did collide
    np.testing.assert_allclose(after[0], before[0], atol=1e-5)  # 2 kg m/s in float32
    # equal and opposite at points that are the overlap or gap of one substep apart, up to 2 m/s dt = 3 mm of 0.05 m
    np.testing.assert_allclose(after[1], before[1], atol=5e-3)
    assert after[2] <= before[2] * (1.0 + 1e-5)


def test_a_sphere_hands_its_speed_to_an_equal_one():
    """Closed form: elastic, head on, equal masses exchange velocities."""
    solver = RigidSolver(gravity=(0.0, 0.0, 0.0))
    slots = [
        drop(solver, Sphere(0.05), (0, 0, 0), velocity=(2.0, 0, 0), restitution=1.0),
        drop(solver, Sphere(0.05), (0.5, 0, 0), restitution=1.0),
    ]
    solver.run(0.0, 0.5)
    # exact but for rounding
    np.testing.assert_allclose(solver.velocity(slots[0])[0][0], [0, 0, 0], atol=1e-4)
    np.testing.assert_allclose(solver.velocity(slots[1])[0][0], [2.0, 0, 0], atol=1e-4)


@pytest.mark.parametrize(("shape", "share"), [(Sphere(0.05), 5 / 7), (Cylinder(0.05, 0.1), 2 / 3)])
def test_what_rolls_down_an_incline_is_slowed_by_its_inertia(shape, share):
    """Closed form: a = g sin / (1 + I / m r^2), 5/7 for a sphere, 2/3 for a cylinder."""
    slope = np.radians(10.0)
    solver = on_floor(slope=slope)
    body = drop(solver, shape, (0, 0, 0.05), about((1, 0, 0), 90.0))
    solver.run(0.0, 1.0)
    # a step of dt starts half a dt early, 0.2 %, and a cylinder is met at a rim of chords
    assert solver.pose(body)[0][0, 0] == pytest.approx(0.5 * share * GRAVITY * np.sin(slope), rel=0.01)
    velocity, spin = (each[0] for each in solver.velocity(body))
    assert spin[1] * 0.05 == pytest.approx(velocity[0], rel=2e-3)  # without slipping
