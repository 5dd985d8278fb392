"""Bending: strips under their own weight against the elastica, and plates under moments."""

import numpy as np
import pytest
from elastica import cantilever, drop_over_reach, rigidity_ratio
from scipy.integrate import solve_ivp
from world_with import GRAVITY, attached

import nuno
from few_variants import few


def ratios(loads, cells, **options):
    """Return effective over nominal rigidity of each strip."""
    measured, felt, _ = cantilever(list(loads), cells, **options)
    return np.array([rigidity_ratio(g, r) for g, r in zip(felt, measured, strict=True)])


def test_the_master_curve_is_the_published_one():
    """Solved here against Peirce's rule: at G = 8 the chord falls by 41.5 degrees (Peirce 1930)."""
    assert np.degrees(np.arctan(drop_over_reach(8.0))) == pytest.approx(41.5, abs=0.05)  # as he rounds it
    assert drop_over_reach(0.1) == pytest.approx(0.1 / 8, rel=1e-3)  # small deflection G / 8, next order G^2


@pytest.mark.parametrize("tip", [0.1, 0.8, 1.3, 1.5, 1.565])
def test_the_master_curve_is_what_integration_from_the_tip_gives(tip):
    """Another method: from a tip at an angle [rad], theta'' = -t cos(theta) is level at t^3 = G."""

    def slope(t, y):
        return [y[1], -t * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

    def level(t, y):
        return y[0]

    level.terminal = True
    found = solve_ivp(slope, (0.0, 100.0), [tip, 0.0, 0.0, 0.0], events=level, rtol=1e-10, atol=1e-12)
    load, ratio = found.t[-1] ** 3, found.y[3, -1] / found.y[2, -1]
    assert drop_over_reach(load) == pytest.approx(ratio, rel=1e-5)  # the accuracy asked of solve_bvp is 1e-8


@pytest.mark.parametrize("along", ["warp", "weft"])
def test_a_resolved_strip_has_its_nominal_rigidity(along):
    """Elastica at G = 3, 10, 30, with substeps that resolve the stiffness (see the comment)."""
    # the mesh of 10 cells itself is off by up to 4 %; of what one pass would add to 1 / B, 3 dt^2 / (rho h^4) or up to
    # 1.2 % of it here, `bend_stiffness` takes off most
    np.testing.assert_allclose(ratios((3.0, 10.0, 30.0), 10, along=along, substeps=120), 1.0, atol=0.08)


@pytest.mark.parametrize(
    ("cells", "load"),
    [
        (10, 10.0),
        pytest.param(10, 30.0, marks=pytest.mark.long),
        pytest.param(20, 30.0, marks=pytest.mark.long),
        (20, 10.0),
    ],
)
def test_a_strip_has_its_nominal_rigidity_at_default_substeps(cells, load):
    """Elastica within 10 %, what Nuno promises for G from 1 to 30."""
    assert ratios((load,) * 2, cells)[0] == pytest.approx(1.0, abs=0.10)


LOADS = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0)


@pytest.mark.slow
@pytest.mark.parametrize(("cells", "load"), [(cells, load) for cells in (10, 20, 40) for load in LOADS])
def test_any_strip_has_its_nominal_rigidity_at_default_substeps(cells, load):
    """Elastica within 10 %, what Nuno promises for G from 1 to 30."""
    assert ratios((load,) * 2, cells)[0] == pytest.approx(1.0, abs=0.10)


def test_a_wide_strip_bends_like_a_narrow_one():
    """Elastica at G = 10: without Poisson effect a strip's shape does not depend on its width."""
    narrow, *_ = cantilever([10.0, 20.0], 10, across=1, substeps=60)
    wide, *_ = cantilever([10.0, 20.0], 10, across=6, substeps=60)
    np.testing.assert_allclose(wide, narrow, rtol=0.02)  # what a pass leaves undone depends on the order, 2 %


def test_a_small_deflection_is_that_of_a_beam():
    """Closed form w L^4 / (8 B) at G = 0.1 and 0.2, H / L = G / 8."""
    # 5 cells so that few substeps resolve so stiff a strip: the mesh's own error is then (h / L)^2 = 4 %, and
    # what one pass would add to 1 / B, 3 dt^2 / (rho h^4) or 0.4 % of it, is taken off by `bend_stiffness`
    measured, felt, _ = cantilever([0.1, 0.2], 5, substeps=300)
    np.testing.assert_allclose(measured, felt / 8, rtol=0.10)


def test_warp_and_weft_bend_by_their_own_rigidity():
    """Elastica: a strip cut along the weft answers to the second of two rigidities, whatever the first is."""
    length, cells, load = 0.2, 10, 10.0
    h = length / (cells + 0.5)
    nominal = 0.2 * GRAVITY * length**3 / load
    for axis, rigidity in enumerate([(nominal, 7 * nominal), (7 * nominal, nominal)]):
        size, grid = ((cells + 1) * h, h), (cells + 1, 1)
        material = nuno.Cloth(bending_rigidity=rigidity, air_drag=10.0, thickness=1e-3)
        sheet = nuno.sheet(size[:: 1 - 2 * axis], cells=grid[:: 1 - 2 * axis], position=(0, 0, 1))
        world, body = attached(sheet, material, substeps=60)
        start = body.vertices
        held = np.flatnonzero(start[:, axis] < start[:, axis].min() + 1.5 * h)
        world.grip(body, held, to=start[held].mean(axis=0))
        world.run(3.0)
        tip = body.vertices[start[:, axis] > start[:, axis].max() - 0.5 * h].mean(axis=0)
        ratio = (1.0 - tip[2]) / (tip[axis] - start[held, axis].mean())
        assert rigidity_ratio(load, ratio) == pytest.approx(1.0, abs=0.08)  # mesh and pass, as above


def free_plate(force, material, cells=(8, 8), side=0.16):
    """Return a free plate's deflections and x, y, (ny + 1, nx + 1) each [m], at rest under forces along z."""
    sheet = nuno.sheet((side, side), cells=cells, position=(0, 0, 1))
    world, body = attached(sheet, material, gravity=(0, 0, 0), substeps=120)
    start = body.vertices
    world.push(body, force.reshape(-1, 1) * [0, 0, 1])
    world.run(3.0)
    shape = (cells[1] + 1, cells[0] + 1)
    return (body.vertices[:, 2] - 1.0).reshape(shape), start[:, 0].reshape(shape), start[:, 1].reshape(shape)


def test_corner_forces_twist_a_plate():
    """Closed form w = P x y / (2 D (1 - nu)) under corner forces +-P (Timoshenko), here with nu = 0."""
    rigidity, twist = 1e-3, 0.1  # [N m], [1/m]
    force = np.zeros((9, 9))
    force[0, 0] = force[-1, -1] = 2 * rigidity * twist
    force[0, -1] = force[-1, 0] = -2 * rigidity * twist
    w, x, y = free_plate(force, nuno.Cloth(bending_rigidity=rigidity, air_drag=6.0))
    measured = (w * x * y).sum() / (x * y * x * y).sum()
    # `bend_stiffness` takes off what one pass would add to 1 / B, which is of the order of dt^2 / (rho h^4), 0.06 % of
    # it at 120 substeps; a saddle strains, which counts as (w / 3.5 mm)^2 for the 0.6 mm of w (3.5 mm: sqrt(12 B / Et))
    assert measured == pytest.approx(twist, rel=0.04)
    np.testing.assert_allclose(w - w.mean(), twist * x * y, atol=0.05 * twist * 0.08**2)


@pytest.mark.parametrize("direction", ["warp", "weft", "diagonal"])
def test_edge_moments_bend_a_plate_to_a_cylinder_in_any_direction(direction):
    """Closed form kappa = M / B: isotropic, also at 45 degrees, where half of the energy is twist.

    A moment M along an edge is a couple of forces M / h per length on its two outermost rows. A cylinder at
    45 degrees needs M / 2 along all four edges and twisting moments M / 2, which are corner forces 2 (M / 2).
    """
    rigidity, curvature, n, side = 1e-3, 0.5, 8, 0.16
    moment = rigidity * curvature
    share = np.full(n + 1, 1.0)
    share[[0, -1]] = 0.5
    couple = np.zeros((n + 1, n + 1))
    couple[:, 0] += share
    couple[:, 1] -= share
    couple[:, -1] += share
    couple[:, -2] -= share  # forces of M / h on a width of h are M each
    corners = np.zeros((n + 1, n + 1))
    corners[0, 0] = corners[-1, -1] = 1.0
    corners[0, -1] = corners[-1, 0] = -1.0
    force = {
        "warp": moment * couple, "weft": moment * couple.T,
        "diagonal": 0.5 * moment * (couple + couple.T) + moment * corners,
    }[direction]  # fmt: skip
    w, x, y = free_plate(force, nuno.Cloth(bending_rigidity=rigidity, air_drag=6.0), (n, n), side)
    s = {"warp": x, "weft": y, "diagonal": (x + y) * np.sqrt(0.5)}[direction]
    expected = 0.5 * curvature * s**2
    measured = np.polyfit(s.ravel(), w.ravel(), 2)[0] * 2
    # `bend_stiffness` takes off what one pass would add, 3 dt^2 / (rho h^4) or 0.2 % of 1 / B; slopes are up to 6 %,
    # whose squares do not count
    assert measured == pytest.approx(curvature, rel=0.04)
    np.testing.assert_allclose(w - w.mean(), expected - expected.mean(), atol=0.05 * np.ptp(expected))


@pytest.mark.parametrize("angle", few([0.0, 45.0, 90.0], 45.0))
def test_a_bias_strip_of_a_mesh_bends_by_the_same_rigidity(angle):
    """Elastica at G = 10 for a strip cut at an angle to the warp, which the pattern says."""
    length, cells, across, load = 0.2, 10, 2, 10.0
    h = length / (cells + 0.5)
    nx, ny = cells + 1, across
    i, j = (c.ravel() for c in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="xy"))
    a, b = (c.ravel() for c in np.meshgrid(np.arange(nx), np.arange(ny), indexing="xy"))
    a = b * (nx + 1) + a
    faces = np.concatenate([np.stack([a, a + 1, a + nx + 2], 1), np.stack([a, a + nx + 2, a + nx + 1], 1)])
    flat = np.stack([i * h, j * h], axis=1)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    pattern = flat @ np.array([[c, s], [-s, c]])
    cut = nuno.cloth_mesh(np.column_stack([flat, np.ones(len(flat))]), faces, pattern)
    nominal = 0.2 * GRAVITY * length**3 / load
    # a shear as stiff as the stretch: in-plane strain is not what is measured
    material = nuno.Cloth(bending_rigidity=nominal, air_drag=10.0, shear_stiffness=1000.0, thickness=1e-3)
    world, body = attached(cut, material, substeps=100)
    held, tip = np.flatnonzero(i <= 1), i == nx
    world.grip(body, held, to=body.vertices[held].mean(axis=0))
    world.run(3.0)
    x = body.vertices
    ratio = (1.0 - x[tip, 2].mean()) / (x[tip, 0].mean() - 0.5 * h)
    # a mesh of 10 cells, and what 100 substeps leave
    assert rigidity_ratio(load, ratio) == pytest.approx(1.0, abs=0.05)


def curvatures(body, cells):
    """Return second differences [m] along the first side of a sheet, as vectors."""
    x = body.vertices.reshape(cells[1] + 1, cells[0] + 1, 3)
    return x[:, :-2] - 2.0 * x[:, 1:-1] + x[:, 2:]


def zigzag(bends, smooth):
    """Return the amplitude [m] of a pattern of three vertices by which curvatures differ from smooth ones."""
    excess = bends - smooth
    return np.linalg.norm(excess, axis=-1).max() / 3.0  # of a pattern of three, c is three times the amplitude


@pytest.mark.parametrize(
    ("h", "rigidity", "most"),
    [
        pytest.param(0.01, 5e-5, 1e-5, marks=pytest.mark.long),
        (0.02, 5e-5, 2e-6),
        pytest.param(0.01, 3e-2, 1.2e-4, marks=pytest.mark.long),
        (0.02, 3e-2, 1.2e-4),
    ],
)
def test_a_strip_at_rest_has_little_of_a_zigzag(h, rigidity, most):
    """Bound: a thirtieth of the thickness (4 mm) at the substeps of the rule, against many, and less in limp cloth.

    Bends of one colour after another are corrected once, so that the first keeps alpha + D / 2 as its compliance and
    the last alpha - D / 2: a pattern of three vertices of up to half of c = kappa h^2 where D is at its bound.
    """
    cells = (round(0.2 / h) + 1, 3)
    found = []
    for substeps in (None, 240):
        sheet = nuno.sheet((cells[0] * h, 3 * h), cells=cells, position=(0, 0, 1))
        world, body = attached(sheet, nuno.Cloth(bending_rigidity=rigidity, air_drag=6.0), substeps=substeps)
        start = body.vertices
        for vertex in np.flatnonzero(start[:, 0] < start[:, 0].min() + 1.01 * h):
            world.grip(body, [int(vertex)], to=start[vertex])
        world.run(4.0)
        found.append(curvatures(body, cells))
    assert zigzag(*found) < most


@pytest.mark.parametrize("tension", [1.0, pytest.param(20.0, marks=pytest.mark.long), 90.0])
def test_a_pulled_strip_lies_straight(tension):
    """Exact: a pulled strip has no pattern of vertices at all; rounding makes 0.1 um, 1 um is asked."""
    sheet, cells = nuno.sheet((0.3, 0.06), cells=(30, 6), position=(0, 0, 1)), (30, 6)
    world, body = attached(sheet, nuno.Cloth(air_drag=4.0))
    start = body.vertices
    left, right = (np.flatnonzero(np.abs(start[:, 0] - x) < 1e-6) for x in (-0.15, 0.15))
    end = start[right].mean(axis=0)
    world.grip(body, left, to=start[left].mean(axis=0))
    pulled = nuno.Path([0, 0.5], [end, end + tension / 1000.0 * np.array([0.3, 0, 0])], interpolation="minimum_jerk")
    world.grip(body, right, to=pulled)
    world.run(4.0)
    bends = curvatures(body, cells)
    # the fourth difference is sixteen times the amplitude of a pattern of two vertices
    assert np.abs(bends[:, :-2] - 2.0 * bends[:, 1:-1] + bends[:, 2:]).max() / 16.0 < 1e-6
