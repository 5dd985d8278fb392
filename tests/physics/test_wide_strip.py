"""Wide strips: where a Poisson effect makes a material stiffer by 1 / (1 - nu^2) than in a narrow strip, cloth is not.

A strip as wide as long, clamped over its width, cannot curve or contract across near its clamps. Nuno's cloth has no
Poisson effect, neither in bending (whose energy is 1/2 B (k_xx^2 + k_yy^2 + 2 k_xy^2)) nor in its plane: nu = 0 in the
closed forms.
"""

import numpy as np
import pytest
from elastica import cantilever, rigidity_ratio
from triangles import rectangle
from world_with import attached

import nuno
from few_variants import few


@pytest.mark.parametrize(
    "kind",
    [
        "sheet",
        pytest.param("right-angled", marks=pytest.mark.long),
        pytest.param("equilateral", marks=pytest.mark.long),
        pytest.param("jittered", marks=pytest.mark.long),
    ],
)
def test_a_wide_strip_has_the_rigidity_of_a_narrow_one(kind):
    """Elastica at G = 10 with B, not B / (1 - nu^2), for strips 2 and 10 cells wide and 10 long."""
    for across in (2, 10):
        measured, felt, _ = cantilever([10.0] * 2, 10, across=across, kind=kind, substeps=60)
        # 2 % on sheets, and irregular triangles within 5 %; 1 / (1 - nu^2) is 10 % for the usual nu = 0.3
        assert rigidity_ratio(felt[0], measured[0]) == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("kind", few(["sheet", "right-angled", "jittered"], "sheet"))
def test_a_wide_clamped_strip_stretches_by_its_stiffness(kind):
    """Closed form F / width = Et strain with Et, not Et / (1 - nu^2), and no contraction across."""
    stiffness, traction, cells, side = 100.0, 2.0, 10, 0.2  # [N/m], [N/m]
    h = side / cells
    if kind == "sheet":
        body = nuno.sheet((side, side), cells=(cells, cells))
    else:
        points, faces = rectangle(kind, (side, side), h)
        body = nuno.cloth_mesh(np.column_stack([points - 0.5 * side, np.zeros(len(points))]), faces)
    material = nuno.Cloth(stretch_stiffness=stiffness, shear_stiffness=stiffness, air_drag=8.0, thickness=1e-3)
    world, body = attached(body, material, gravity=(0, 0, 0), substeps=240)
    start = body.vertices
    left, right = (np.flatnonzero(sign * start[:, 0] > 0.5 * side - 1e-6) for sign in (-1, 1))
    world.grip(body, left, to=start[left].mean(axis=0))
    # each of the right rim's vertices has half of its two sides' traction
    y = np.sort(start[right, 1])
    share = np.interp(start[right, 1], y, np.gradient(y) * np.where(np.abs(y) > 0.5 * side - 1e-6, 0.5, 1.0))
    force = np.zeros_like(start)
    force[right, 0] = traction * share
    world.push(body, force)
    world.run(2.0)
    end = body.vertices
    middle = np.abs(start[:, 0]) < 0.3 * side
    slope = np.polyfit(start[middle, 0], end[middle, 0], 1)[0] - 1.0
    # one pass a substep adds Et dt^2 / (rho h^2), 0.6 % or up to twice that where triangles are small, to 1 / Et
    assert slope == pytest.approx(traction / stiffness, rel=0.02)
    # a Poisson ratio of 0.3 would take 0.3 x 2 % of 0.1 m, 600 um, off each side; substeps leave a tenth of a percent
    np.testing.assert_allclose(end[:, 1], start[:, 1], atol=3e-5)
    np.testing.assert_allclose(end[:, 2], start[:, 2], atol=3e-5)
