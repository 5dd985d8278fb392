"""Grips: held points follow their path, and what is let go falls."""

import numpy as np
import pytest
from world_with import GRAVITY, attached, rows

import nuno


def lifted(**options):
    """A sheet in the air, ready to be gripped."""
    return attached(nuno.sheet((0.3, 0.2), cells=(12, 8), position=(0, 0, 1)), nuno.Cloth(), **options)


@pytest.mark.parametrize("interpolation", ["linear", "minimum_jerk"])
def test_a_gripped_vertex_is_where_its_path_is(interpolation):
    """Exact: a stiff grip on a vertex has no error but float32's, at any time on the path."""
    world, body = lifted()
    start = body.vertices[0]
    keys = start + np.array([[0, 0, 0], [0.1, 0.05, 0.2], [0.0, 0.1, 0.1]])
    path = nuno.Path([0.0, 0.4, 0.9], keys, interpolation=interpolation)
    world.grip(body, 0, to=path)
    for _ in range(11):
        world.run(0.1)
        # coordinates within 0.5 m of the origin (3e-8 m); the clock, a float32 of up to 0.1 s summed over 200
        # substeps, is off by up to 1e-6 s at 0.8 m/s
        np.testing.assert_allclose(body.vertices[0], path.at(world.time), atol=1.5e-6)


def test_gripped_vertices_turn_with_the_path():
    """Exact: a rigid motion of the held points, a quarter turn about the path's z axis."""
    world, body = lifted()
    held = np.arange(13)
    start = body.vertices[held]
    middle = start.mean(axis=0)
    half = np.sqrt(0.5)
    path = nuno.Path([0.0, 0.5], [middle, middle], [(1, 0, 0, 0), (half, 0, 0, half)])
    world.grip(body, held, to=path)
    world.run(0.6)
    turned = (start - middle)[:, [1, 0, 2]] * [-1, 1, 1] + middle
    np.testing.assert_allclose(body.vertices[held], turned, atol=1e-6)  # float32


def test_a_gripped_point_between_vertices_follows_closely():
    """A stiff grip on a surface point is the last constraint but for contact: within 0.1 mm."""
    world, body = lifted()
    point = body.at(0.37, 0.61)

    def where():
        return (body.vertices[body.faces[point.faces[0]]] * point.barycentric[0][:, None]).sum(axis=0)

    start = where()
    path = nuno.Path([0.0, 0.5], [start, start + np.array([0.1, 0, 0.2])], interpolation="minimum_jerk")
    world.grip(body, point, to=path)
    for _ in range(8):
        world.run(0.1)
        np.testing.assert_allclose(where(), path.at(world.time), atol=1e-4)


def test_release_gives_a_vertex_its_mass_back():
    """Closed form g t^2 / 2: a sheet held flat everywhere falls as one when it is let go."""
    world, body = lifted()
    grip = world.grip(body, np.arange(len(body.vertices)), to=body.vertices.mean(axis=0))
    world.run(0.5)
    start = body.vertices
    np.testing.assert_allclose(start[:, 2], 1.0, atol=1e-6)  # float32
    grip.release()
    assert not grip.active
    world.run(0.3)
    fallen = start[:, 2] - body.vertices[:, 2]
    # air drag of 1 / s: g (t - (1 - exp(-t))), and the Euler step's g t dt / 2 of at most 2.5 mm
    np.testing.assert_allclose(fallen, GRAVITY * (0.3 - (1 - np.exp(-0.3))), atol=2.5e-3)
    np.testing.assert_allclose(fallen, fallen.mean(), atol=1e-5)


def test_a_soft_grip_gives_by_its_load_times_compliance():
    """Closed form F / k: one point that carries the whole cloth sinks by weight x compliance."""
    material = nuno.Cloth(air_drag=8.0)
    world, body = attached(nuno.sheet((0.2, 0.2), cells=(8, 8), position=(0, 0, 1)), material)
    compliance = 0.25  # [m/N]
    goal = body.vertices[0]
    world.grip(body, 0, to=goal, compliance=compliance)
    world.run(6.0)
    weight = 0.2 * 0.04 * GRAVITY
    # implicit drag takes c dt of what gravity adds in a substep too
    weight /= 1 + 8.0 / (60 * body._dynamics.solver.substeps)
    np.testing.assert_allclose(goal - body.vertices[0], [0, 0, weight * compliance], atol=2e-3 * weight * compliance)


def test_a_grip_led_by_a_body_follows_it():
    """Exact: held points keep their places in the frame of the body that leads them."""
    world, body = lifted()
    hand = world.add(nuno.box((0.02, 0.02, 0.02), position=(-0.15, -0.1, 1.05)))
    world.grip(body, [0, 1], to=hand)
    start = body.vertices[[0, 1]]
    for _ in range(10):
        hand.translate((0.002, 0, 0.005))
        world.step()
    np.testing.assert_allclose(body.vertices[[0, 1]], start + np.array([0.02, 0, 0.05]), atol=1e-6)  # float32


def test_each_world_s_grip_is_its_own():
    """Exact: in a batch, worlds hold different vertices along different paths, and one holds none."""
    world, body = lifted(worlds=3)
    start = rows(body)
    goals = np.array([[0, 0, 1.2], [0.1, 0, 1.1], [0, 0, 0]])
    world.grip(body, [[0], [7], [-1]], to=goals)
    world.run(0.1)
    end = rows(body)
    np.testing.assert_allclose(end[0, 0], goals[0], atol=1e-6)
    np.testing.assert_allclose(end[1, 7], goals[1], atol=1e-6)
    assert np.ptp(end[2, :, 2]) < 1e-5 and end[2, 0, 2] < start[2, 0, 2]
