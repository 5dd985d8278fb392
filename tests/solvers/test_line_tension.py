"""The tension of a sheet's grid lines, and the warning of one that its substeps do not bear."""

import logging

import numpy as np
import pytest

import nuno
from nuno.solvers.line_tension import EDGES, line_tension

LENGTH, WIDTH, CELLS = 0.3, 0.1, (30, 10)


@pytest.mark.parametrize("worlds", [1, 3, 18])
@pytest.mark.parametrize("along", [0, 1])
def test_the_tension_of_an_even_strain_is_stiffness_times_strain(worlds, along):
    """Closed form T = k e along warp or weft, each world with its own stiffness and strain; slack is none."""
    world = nuno.World(device="cpu")
    world.add(nuno.sheet((LENGTH, WIDTH), cells=CELLS, name="strip"))
    world = world.imagine(worlds) if worlds > 1 else world
    strip = world.find("strip")
    warp, weft = 500.0 + 100.0 * np.arange(worlds), 2000.0 + 10.0 * np.arange(worlds)
    stiffness = np.stack([warp, weft], axis=-1)
    world.attach(strip, nuno.Cloth(stretch_stiffness=(warp, weft)))
    solver = strip._dynamics.solver
    strain = 0.01 * (1 + np.arange(worlds))
    stretched = solver.positions().astype(float)
    stretched[:, :, 1 - along] *= 0.98
    stretched[:, :, along] *= 1.0 + strain[:, None]
    solver.set_state(stretched, np.zeros_like(stretched))
    np.testing.assert_allclose(line_tension(solver), stiffness[:, along] * strain, rtol=2e-3)


def test_one_taut_edge_counts_for_its_share_of_the_neighbours_that_are_looked_at():
    """Closed form: one edge strained by e among slack ones, at the end of its line, is k e over their number."""
    world = nuno.World(device="cpu")
    strip = world.add(nuno.sheet((LENGTH, WIDTH), cells=CELLS, name="strip"))
    world.attach(strip, nuno.Cloth(stretch_stiffness=1000.0))
    solver = strip._dynamics.solver
    x = solver.positions()
    x[0, 0, 0] -= 0.2 * 0.01
    solver.set_state(x, np.zeros_like(x))
    assert line_tension(solver)[0] == pytest.approx(1000.0 * 0.2 / EDGES, rel=2e-3)


def test_a_cloth_mesh_has_no_grid_lines():
    """A mesh's tension is not known: no number, and no error."""
    points = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1], [0.1, 0.1, 1.0]])
    world = nuno.World(device="cpu")
    body = world.attach(world.add(nuno.cloth_mesh(points, [[0, 1, 2], [1, 3, 2]])))
    assert line_tension(body._dynamics.solver).tolist() == [0.0]
    world.run(0.5)


def pulled(tension, substeps=None, worlds=1, name="strip", **material):
    """A strip held at one end and pulled at the other by a load [N/m], a number or one a world, for half a second."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0), substeps=substeps)
    world.add(nuno.sheet((LENGTH, WIDTH), cells=CELLS, position=(0, 0, 1), name=name))
    world = world.imagine(worlds) if worlds > 1 else world
    strip = world.find(name)
    world.attach(strip, nuno.Cloth(air_drag=5.0, **material))
    start = strip.vertices.reshape(-1, *strip.vertices.shape[-2:])[0]
    left, right = (np.flatnonzero(np.abs(start[:, 0] - x) < 1e-6) for x in (-0.5 * LENGTH, 0.5 * LENGTH))
    world.grip(strip, left, to=start[left].mean(axis=0))
    share = np.ones(len(right))
    share[[0, -1]] = 0.5
    force = np.zeros((worlds, len(start), 3))
    force[:, right, 0] = np.reshape(tension, (-1, 1)) * WIDTH * share / share.sum()
    for k in range(10):  # not at once, which would swing to twice as much
        world.push(strip, (k + 1) / 10 * (force if worlds > 1 else force[0]))
        world.run(0.05)
    return world, strip


def warnings_in(caplog):
    """The messages of warnings that tell of a load."""
    return [record.getMessage() for record in caplog.records if "is stretched as by" in record.getMessage()]


def test_a_load_beyond_what_is_borne_is_told_once_with_the_cure(caplog):
    """Promise: silent under what `resolution.tension` says, one warning above, by name, with a material that bears it.

    That material makes no less of its other stiffnesses, so that no other warning sends one back.
    """
    with caplog.at_level(logging.WARNING, logger="nuno"):
        _, strip = pulled(255.0, name="light")
        assert 255.0 < strip.resolution.tension < 330.0
        assert not warnings_in(caplog)
        world, strip = pulled(450.0, name="heavy")
        world.run(0.5)
        futures = world.imagine(2)
        futures.run(0.5)
        assert len(warnings_in(caplog)) == 1
    (text,) = warnings_in(caplog)
    assert "'heavy'" in text and "'heavy'.resolution.tension" in text
    enough = int(text.partition("Cloth(max_tension=")[2].partition(")")[0])
    needed = strip.resolution.substeps * np.sqrt(450.0 / strip.resolution.tension)
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="nuno"):
        world, strip = pulled(450.0, name="cured", max_tension=enough)
        world.run(0.5)
    assert needed < strip.resolution.substeps < 1.1 * needed and strip.resolution.tension >= enough
    assert not caplog.records
    x = strip.vertices[:, 0]
    assert np.ptp(x) / LENGTH == pytest.approx(1.0 + 450.0 / 1000.0, abs=0.005)  # T = k e


def test_given_substeps_are_told_how_many_bear_a_load(caplog):
    """Promise: where substeps were given the cure is their number, for a load and for a tension that is asked for."""
    with caplog.at_level(logging.WARNING, logger="nuno"):
        pulled(150.0, substeps=40, name="few")
        asked = pulled(1.0, substeps=40, name="asked", max_tension=200.0)[1].resolution
    (text,) = warnings_in(caplog)
    assert "World(substeps=" in text and "max_tension" not in text
    (text,) = (record.getMessage() for record in caplog.records if "is to bear" in record.getMessage())
    enough = int(text.partition("World(substeps=")[2].partition(")")[0])
    assert text.startswith("'asked' is to bear 200 N/m")
    assert enough == np.ceil(40 * np.sqrt(200.0 / asked.tension))


def test_a_load_in_one_world_of_a_batch_is_told(caplog):
    """Promise: the world that bears most counts; a batch in which none has too much stays silent."""
    with caplog.at_level(logging.WARNING, logger="nuno"):
        pulled(np.linspace(30.0, 240.0, 5), worlds=5, name="all light")
        assert not warnings_in(caplog)
        pulled(np.array([30.0, 60.0, 600.0, 90.0, 120.0]), worlds=5, name="one heavy")
    (text,) = warnings_in(caplog)
    assert "'one heavy'" in text


def test_substeps_that_a_neighbour_brings_along_count(caplog):
    """A sheet that goes with a body of more substeps bears what these do: the borne tension goes with their square."""
    world = nuno.World(device="cpu", substeps=40)
    strip = world.attach(world.add(nuno.sheet((LENGTH, WIDTH), cells=CELLS)))
    solver = strip._dynamics.solver
    solver.run(0.0, 1.0 / 60.0)
    own = solver.bearable_tension()
    assert own == pytest.approx([strip.resolution.tension])
    solver.run(1.0 / 60.0, 1.0 / 60.0, 120)
    assert solver.bearable_tension() == pytest.approx(9.0 * own)
