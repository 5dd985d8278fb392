"""A strip that stands clamped at its foot buckles under its own weight at G = w L^3 / B = 7.8373 (Greenhill 1881)."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from triangles import rectangle
from world_with import GRAVITY, attached, rows

import nuno

GREENHILL = 7.8373
LENGTH, DENSITY = 0.2, 0.2  # [m], [kg/m2]


def standing(loads, *, force, duration=None, seconds=5.0, kind="sheet", cells=10, across=1):
    """Return how far the tips of strips, one for each G, stand aside [m].

    Args:
        loads: G of each strip.
        force: Force per width on the tip, aside, over weight per width.
        duration: How long it pushes [s], or None for all the time.
        seconds: When to look.
        kind: "sheet", or one of `triangles.KINDS`.
        cells: Cells along the strip. The clamp is in the middle of one more, as in elastica.py.
        across: Cells across.
    """
    h = LENGTH / (cells + 0.5)
    size = ((cells + 1) * h, across * h)
    g = np.asarray(loads, dtype=float)
    weight = DENSITY * GRAVITY
    rigidity = weight * LENGTH**3 / g
    material = nuno.Cloth(
        area_density=DENSITY, bending_rigidity=rigidity, stretch_stiffness=5000.0, shear_stiffness=5000.0,
        thickness=1e-3, air_drag=1.5 * 3.516 * np.sqrt(rigidity / (DENSITY * LENGTH**4)),
    )  # fmt: skip
    if kind == "sheet":
        strip = nuno.sheet(size, cells=(cells + 1, across))
        flat, faces = strip.vertices[:, :2], strip.faces
        strip.rotate(-0.5 * np.pi, "y")
    else:
        flat, faces = rectangle(kind, size, h)
        strip = nuno.cloth_mesh(np.stack([0.0 * flat[:, 0], flat[:, 1], flat[:, 0]], axis=1), faces, flat)
    world, body = attached(strip, material, worlds=len(g))
    up = rows(body)[0, :, 2] - rows(body)[0, :, 2].min()
    held, tip = np.flatnonzero(up < 1.1 * h), np.flatnonzero(up > up.max() - 1e-6)
    world.grip(body, held, to=rows(body)[0, held].mean(axis=0))
    push = np.zeros((len(up), 3))
    push[tip, 0] = force * weight * LENGTH * size[1] / len(tip)
    world.push(body, push, duration=duration)
    world.run(seconds)
    return rows(body)[:, tip, 0].mean(axis=1)


def leaning(load):
    """Return tip deflection over length and force of theta'' + G (1 - s) theta = -1, theta(0) = theta'(1) = 0."""
    s = np.linspace(0.0, 1.0, 201)

    def slope(s, y):
        return np.stack([y[1], -load * (1.0 - s) * y[0] - 1.0, y[0]])

    found = solve_bvp(slope, lambda a, b: np.array([a[0], b[1], a[2]]), s, np.zeros((3, 201)), tol=1e-8)
    return found.y[2, -1]


def test_greenhills_load_is_where_the_deflection_has_no_bound():
    """Greenhill 1881: the equation solved here has its pole at 7.8373."""
    assert 1.0 / leaning(GREENHILL - 1e-3) == pytest.approx(0.0, abs=1e-3)
    assert leaning(GREENHILL + 1e-3) < 0.0


@pytest.mark.long
@pytest.mark.parametrize("kind", ["sheet", "right-angled", pytest.param("equilateral", marks=pytest.mark.slow)])
def test_a_strip_stands_below_greenhills_load_and_falls_above(kind):
    """Closed form G = 7.8373, with rigidities 8 % above and below; 10 % is what Nuno promises of them."""
    aside = standing([GREENHILL / 1.08, GREENHILL * 1.08], force=0.02, duration=0.5, seconds=12.0, kind=kind, across=2)
    assert abs(aside[0]) < 0.01 * LENGTH
    assert abs(aside[1]) > 0.3 * LENGTH


@pytest.mark.parametrize("kind", ["sheet", pytest.param("right-angled", marks=pytest.mark.long)])
def test_weight_softens_a_standing_strip_as_the_linear_theory_says(kind):
    """Deflection under a small force aside, which weight makes up to 4 times as large (G = 6), solved above."""
    loads = np.array([0.5, 2.0, 3.0, 4.0, 5.0, 6.0])
    force = 2e-3
    measured = standing(loads, force=force, kind=kind, across=2) / (LENGTH * force * loads)
    # 4 % of mesh, as in test_bending; near the pole a percent of rigidity is several of deflection
    np.testing.assert_allclose(measured, [leaning(g) for g in loads], rtol=0.05)
