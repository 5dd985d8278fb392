"""A cloth and static shapes: where it rests, and that it never passes through."""

import numpy as np
import pytest
from world_with import GRAVITY, attached, rows

import nuno


@pytest.mark.parametrize("thickness", [0.001, 0.004, 0.01])
@pytest.mark.parametrize("ground", ["box", "plane", "mesh"])
def test_a_cloth_at_rest_lies_half_its_thickness_above_the_table(ground, thickness):
    """Promise of the interface: the middle surface is thickness / 2 above what it lies on."""
    tops = {"box": nuno.box((1, 1, 0.1), position=(0, 0, -0.05)), "plane": nuno.plane()}
    slab = nuno.box((1, 1, 0.1)).shape.mesh()
    tops["mesh"] = nuno.mesh((slab[0] - [0, 0, 0.05], slab[1]))
    sheet = nuno.sheet((0.2, 0.2), cells=(8, 8), position=(0, 0, 0.03))
    world, body = attached(sheet, nuno.Cloth(thickness=thickness, air_drag=2.0), tops[ground])
    world.run(2.0)
    # the last step's fall g dt^2 is 4 um; float32
    np.testing.assert_allclose(body.vertices[:, 2], 0.5 * thickness, atol=2e-5)
    assert np.abs(body.velocities).max() < 1e-2


def test_a_cloth_over_a_table_s_edge_hangs():
    """Inextensible and limp: the part beyond the edge hangs straight down, its end its length below."""
    table = nuno.box((1.0, 1.0, 0.1), name="table", position=(-0.5, 0, -0.05))
    sheet = nuno.sheet((0.6, 0.2), cells=(30, 10), position=(0.0, 0, 0.01))
    material = nuno.Cloth(thickness=0.002, bending_rigidity=1e-6, air_drag=2.0, friction=0.0)
    world, body = attached(sheet, material, table)
    start = body.vertices
    held = np.flatnonzero(start[:, 0] < -0.29)
    # pulled 10 cm over the edge, and held there
    goal = start[held].mean(axis=0) + np.array([0.1, 0, -0.009])
    path = nuno.Path([0.0, 1.0], [start[held].mean(axis=0), goal], interpolation="minimum_jerk")
    world.grip(body, held, to=path)
    world.run(4.0)
    end = body.vertices
    beyond = 0.4  # half of the sheet and what it was pulled
    tip = start[:, 0] > 0.29
    # a hundredth of strain, a corner of about half a cell, and the cloth's own width of 2 mm
    np.testing.assert_allclose(end[tip, 2], -beyond, atol=0.01 + 0.01 * beyond)
    np.testing.assert_allclose(end[tip, 0], 0.001, atol=0.01)
    lying = start[:, 0] < -0.15
    np.testing.assert_allclose(end[lying, 2], 0.001, atol=5e-4)


def inside(vertices, size, position):
    """Return how deep the deepest vertex lies within a box [m]."""
    return (0.5 * np.asarray(size) - np.abs(vertices - position)).min(axis=-1).max()


@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_a_fast_cloth_does_not_pass_a_thin_plate(speed):
    """Invariant: a sheet dropped onto a plate of 1 cm at 5 m/s stops at its surface."""
    plate = nuno.box((0.5, 0.5, 0.01), position=(0, 0, -0.005))
    height = speed**2 / (2 * GRAVITY) + 0.002
    sheet = nuno.sheet((0.3, 0.3), cells=(10, 10), position=(0, 0, height))
    world, body = attached(sheet, nuno.Cloth(air_drag=0.0), plate)
    fall = np.sqrt(2 * height / GRAVITY)
    world.run(fall - 0.005)
    deepest = 0.0
    for _ in range(60):
        world.run(0.005)
        deepest = min(deepest, body.vertices[:, 2].min() - 0.002)
    assert deepest > -1e-3  # within its own half thickness of the surface, and never within the plate


def test_a_cloth_pushed_onto_a_thin_plate_by_a_gale_does_not_pass():
    """Invariant: a push of 20 times its weight drives it onto a narrower plate, and not through."""
    size, at = (0.2, 0.2, 0.01), np.array([0.0, 0, -0.005])
    sheet = nuno.sheet((0.3, 0.3), cells=(15, 15), position=(0, 0, 0.1))
    world, body = attached(sheet, nuno.Cloth(thickness=0.002), nuno.box(size, position=at))
    world.push(body, (0, 0, -20 * 0.2 * 0.09 * GRAVITY))
    deepest = 0.0
    for _ in range(25):
        world.run(0.02)
        deepest = max(deepest, inside(body.vertices, size, at))
    assert deepest < 5e-4
    middle = np.abs(rows(body)[0, :, :2]).max(axis=1) < 0.05
    assert body.vertices[middle, 2].min() > 0.0


def signed(beyond):
    """Return signed distances of points that are ``beyond`` (n, k) [m] each face of a convex corner."""
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


@pytest.mark.parametrize("shape", ["sphere", "cylinder", "capsule", "box"])
def test_a_draped_cloth_stays_outside_of_what_it_lies_on(shape):
    """Invariant: no vertex is nearer to the shape than half the thickness, but for the last step's fall."""
    made = {
        "sphere": nuno.sphere(0.1), "cylinder": nuno.cylinder(0.1, 0.2),
        "capsule": nuno.capsule(0.05, 0.1).rotate(0.5 * np.pi, "x"), "box": nuno.box((0.16, 0.16, 0.2)),
    }  # fmt: skip
    sheet = nuno.sheet((0.4, 0.4), cells=(20, 20), position=(0, 0, 0.13))
    world, body = attached(sheet, nuno.Cloth(thickness=0.004, friction=0.8, air_drag=2.0), made[shape])
    world.run(1.0)
    x = body.vertices
    rho = np.hypot(x[:, 0], x[:, 1])
    outside = {
        "sphere": np.linalg.norm(x, axis=1) - 0.1,
        "cylinder": signed(np.stack([rho - 0.1, np.abs(x[:, 2]) - 0.1], axis=1)),
        "capsule": np.linalg.norm(x - np.clip(x[:, 1:2], -0.05, 0.05) * [0, 1, 0], axis=1) - 0.05,
        "box": signed(np.abs(x) - [0.08, 0.08, 0.1]),
    }[shape]
    assert outside.min() > 0.002 - 1e-4
    assert x[:, 2].max() > 0.05  # it is still up there
