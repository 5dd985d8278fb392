"""Damping: where a body rests is elasticity's alone, and a ringing strip dies down as its time constant says."""

import numpy as np
import pytest
from scipy.optimize import curve_fit
from world_with import attached, rows

import nuno
from few_variants import few

MODE = 3.516  # of a cantilever's first angular frequency, times sqrt(B / (rho L^4))


def strip(kind, cells, h=0.02):
    """Return a flat strip of square cells, as a sheet or as a cloth mesh."""
    sheet = nuno.sheet((cells[0] * h, cells[1] * h), cells=cells, position=(0, 0, 1))
    return sheet if kind == "sheet" else nuno.cloth_mesh(sheet.vertices, sheet.faces)


def hold(world, body, axis, end=-1):
    """Grip the two rows of vertices at one end of a strip where they are."""
    x = end * rows(body)[0][:, axis]
    held = np.flatnonzero(x > x.max() - 0.0201)
    for vertex in held:
        world.grip(body, [int(vertex)], to=rows(body)[0][vertex])


def at_rest(kind, axis, rigidity, damping):
    """Return the vertices [m] of a strip that is held at one end and hangs at rest, at default substeps."""
    material = nuno.Cloth(bending_rigidity=rigidity, damping=damping, air_drag=8.0)
    world, body = attached(strip(kind, ((9, 2), (4, 9))[axis]), material)
    hold(world, body, axis, (-1, 1)[axis])
    world.run(3.0)
    return rows(body)[0]


@pytest.mark.parametrize(
    "damping", [pytest.param(0.0005, marks=pytest.mark.long), 0.002, pytest.param(0.02, marks=pytest.mark.long)]
)
@pytest.mark.parametrize(("axis", "rigidity"), [(0, 5e-2), (0, 3e-3), (1, 1e-3)], ids=["stiff", "limp", "hung"])
@pytest.mark.parametrize("kind", few(["sheet", "mesh"], "sheet"))
def test_damping_leaves_a_cloth_where_it_stands_without(kind, axis, rigidity, damping):
    """Invariant: viscous forces do nothing at rest; 2 % of the deflection is asked, what is left of 3 s of swinging."""
    free, damped = at_rest(kind, axis, rigidity, 0.0), at_rest(kind, axis, rigidity, damping)
    sag = 1.0 - free[:, 2].min()
    assert sag > 1e-3
    np.testing.assert_allclose(damped, free, atol=0.02 * sag)


@pytest.mark.parametrize("damping", few([0.0005, 0.002, 0.02], 0.02))
def test_damping_leaves_a_soft_body_where_it_stands_without(damping):
    """Invariant: as of a cloth; a bar held at one end."""

    def lowest(damping):
        bar = nuno.soft_box((0.1, 0.02, 0.02), cells=(10, 2, 2), position=(0, 0, 1))
        material = nuno.Soft(density=100.0, youngs_modulus=5e4, damping=damping, air_drag=8.0)
        world, body = attached(bar, material)
        start = rows(body)[0]
        for vertex in np.flatnonzero(start[:, 0] < -0.0499):
            world.grip(body, [int(vertex)], to=start[vertex])
        world.run(2.0)
        return 0.99 - rows(body)[0][:, 2].min()

    assert lowest(damping) == pytest.approx(lowest(0.0), rel=0.02)


@pytest.mark.parametrize("damping", [pytest.param(0.001, marks=pytest.mark.long), 0.004])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_a_ringing_strip_dies_down_as_its_time_constant_says(kind, damping):
    """Closed form exp(-tau omega^2 t / 2) of a force tau dF/dt beside an elastic force F, omega the frequency found."""

    def ring(damping):
        rigidity, length, density = 2e-3, 0.2, 0.2
        material = nuno.Cloth(
            area_density=density, bending_rigidity=rigidity, damping=damping, air_drag=0.0, stretch_stiffness=1e4
        )
        world, body = attached(strip(kind, (11, 3)), material, gravity=(0, 0, 0), substeps=60)
        hold(world, body, 0)
        tip = np.flatnonzero(rows(body)[0][:, 0] > 0.1099)
        force = np.zeros_like(rows(body)[0])
        force[tip, 2] = 1.5e-4
        world.push(body, force, duration=0.1)
        world.run(0.1)
        heights = []
        for _ in range(180):
            world.step()
            heights.append(rows(body)[0][tip, 2].mean() - 1.0)

        def mode(t, a, b, decay, omega):
            return np.exp(-decay * t) * (a * np.cos(omega * t) + b * np.sin(omega * t))

        expected = MODE * np.sqrt(rigidity / (density * length**4))
        found, _ = curve_fit(mode, np.arange(180) / 60.0, heights, p0=(heights[0], 0.0, 0.5, expected))
        return found[2:]

    decay, omega = ring(damping)
    # what implicit steps damp by themselves is taken off; one pass leaves 2 % of 4 ms undone
    assert decay - ring(0.0)[0] == pytest.approx(0.5 * damping * omega**2, rel=0.05)
