"""A limp strip between two points, against the catenary."""

import numpy as np
import pytest
from scipy.optimize import brentq
from world_with import GRAVITY, attached, rows

import nuno

SLACK = np.array([1.01, 1.05, 1.10, 1.25, 1.5, 2.0, 3.0])  # length over span
LENGTH, CELLS, WIDTH, DENSITY, STIFFNESS = 1.0, 50, 0.02, 0.2, 2e4


def catenary(q):
    """Return sag / span and horizontal tension / (weight per length x span): sinh(u) / u = q."""
    u = brentq(lambda u: np.sinh(u) / u - q, 1e-3, 10.0)
    return (np.cosh(u) - 1) / (2 * u), 1 / (2 * u)


@pytest.fixture(scope="module")
def hanging():
    """Strips whose right end was brought nearer and is then held softly; spans and vertices (worlds, ...)."""
    material = nuno.Cloth(
        area_density=DENSITY, bending_rigidity=0.0, stretch_stiffness=STIFFNESS, air_drag=4.0, thickness=1e-3
    )
    sheet = nuno.sheet((LENGTH, WIDTH), cells=(CELLS, 1), position=(0, 0, 2))
    world, body = attached(sheet, material, worlds=len(SLACK), substeps=100)
    ends = [0, CELLS + 1], [CELLS, 2 * CELLS + 1]
    world.grip(body, ends[0], to=(-LENGTH / 2, 0, 2))
    goal = -LENGTH / 2 + LENGTH / SLACK
    keys = np.zeros((len(SLACK), 2, 3))
    keys[:, 0, 0], keys[:, 1, 0], keys[..., 2] = LENGTH / 2, goal, 2.0
    compliance = 0.01  # [m/N]: 1 mm for 0.1 N, which float32 resolves to 1e-4
    world.grip(body, ends[1], to=nuno.Path([0.0, 0.8], keys, interpolation="minimum_jerk"), compliance=compliance)
    world.run(5.0)
    x = rows(body)
    pull = ((keys[:, 1, None, :2] + [0, 0]) - x[:, ends[1], :2])[..., 0].sum(axis=1) / compliance
    x = x.reshape(len(SLACK), 2, CELLS + 1, 3).mean(axis=1)
    return x, pull


def stretched(x):
    """Return length over span: the pull of a taut strip, up to 4 N/m, lengthens it by 2 % of its slack."""
    span = x[:, -1, 0] - x[:, 0, 0]
    pull = np.array([catenary(LENGTH / s)[1] for s in span]) * DENSITY * GRAVITY * span
    return LENGTH * (1.0 + pull / STIFFNESS) / span


def test_the_sag_is_the_catenarys(hanging):
    """Closed form: sinh(u) / u = length / span, sag / span = (cosh(u) - 1) / (2 u)."""
    x, _ = hanging
    span = x[:, -1, 0] - x[:, 0, 0]
    sag = (0.5 * (x[:, 0, 2] + x[:, -1, 2]) - x[:, CELLS // 2, 2]) / span
    # the ends give by up to 0.3 mm: the span is the measured one. A polygon of 50 sides
    np.testing.assert_allclose(sag, [catenary(q)[0] for q in stretched(x)], rtol=0.005)


def test_the_pull_at_the_ends_is_the_catenarys_tension(hanging):
    """Closed form: horizontal tension / (weight per length x span) = 1 / (2 u), read off a soft grip."""
    x, pull = hanging
    span = x[:, -1, 0] - x[:, 0, 0]
    tension = pull / (DENSITY * GRAVITY * WIDTH * span)
    # as above; the tension falls by 1 % for 2 % of slack, and each end's last digits count
    np.testing.assert_allclose(tension, [catenary(q)[1] for q in stretched(x)], rtol=0.02)
