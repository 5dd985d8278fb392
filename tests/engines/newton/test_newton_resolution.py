"""The number of substeps that Newton's engine takes, and what it says where they do not suffice."""

import logging

import numpy as np
import pytest

import nuno
from nuno.engines.newton.newton_resolution import MAXIMUM, MINIMUM, NOMINAL, substeps_for


def world_of(cells=10, stretch=1000.0, density=0.2, **settings):
    """Return a world with a cloth of 0.2 m, whose cells and material are given."""
    pytest.importorskip("newton.solvers")
    world = nuno.World(device="cpu", engine="newton", **settings)
    sheet = world.add(nuno.sheet((0.2, 0.2), (cells, cells), name="mat"))
    world.attach(sheet, nuno.Cloth(stretch_stiffness=stretch, area_density=density))
    return world


@pytest.mark.parametrize(("cells", "stretch", "density"), [(10, 1000.0, 0.2), (16, 300.0, 0.5), (4, 1000.0, 0.2)])
def test_there_are_as_many_as_the_membrane_takes(cells, stretch, density):
    """The least even number with k h^2 / (m / cell) of at most 0.6, and at least 40."""
    count = substeps_for(world_of(cells, stretch, density))

    def ratio(n):
        return stretch / (density * (0.2 / cells) ** 2) / (60.0 * n) ** 2

    assert count % 2 == 0 and count >= MINIMUM and ratio(count) <= NOMINAL
    assert count == MINIMUM or ratio(count - 2) > NOMINAL


def test_the_stiffest_direction_world_and_frame_rate_count():
    """Of a value for warp and weft, or for each world, the largest; of longer frames more; what is asked for is met."""
    base = substeps_for(world_of())
    assert substeps_for(world_of(stretch=np.array(1000.0))) == base
    world = world_of(stretch=500.0).imagine(2)
    cloth = world.find("mat")
    world.set_material(cloth, nuno.Cloth(stretch_stiffness=np.array([500.0, 1000.0])))
    assert substeps_for(world) == base
    assert substeps_for(world_of(frame_rate=120.0)) <= max(MINIMUM, base // 2 + 2)
    assert substeps_for(world_of(substeps=24)) == 24


def test_too_few_are_told_once_with_the_cure(caplog):
    """Few that were asked for say how many it takes; cells that take more than the most say that, too.

    sqrt(1000 / (0.2 0.02^2 0.6)) / 60 is 76.1, and the next even number 78.
    """
    few = world_of(substeps=20)
    with caplog.at_level(logging.WARNING):
        substeps_for(few)
        substeps_for(few)
    assert len(caplog.records) == 1
    assert "'mat' is too limp: with 20 substeps" in caplog.text and "World(substeps=78)" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        assert substeps_for(world_of(cells=60)) == MAXIMUM
    assert "Larger cells or a smaller stretch stiffness" in caplog.text
