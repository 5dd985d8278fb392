"""Compliances of a cloth's elements: one number for all of a kind, or each its own."""

import numpy as np
import pytest

import nuno
from nuno.constraints.compliances import UNIFORM_BENDS, compliances, vertex_masses
from nuno.topology.cloth_topology import ClothTopology


@pytest.mark.parametrize("cells", [(1, 1), (1, 2), (1, 3), (2, 2), (6, 5)])
def test_bends_that_differ_outnumber_those_that_do_not(cells):
    """CUDA's strips tell by the count whether to read each element's number, also where a sheet has few elements."""
    cloth = ClothTopology.sheet(cells, (0.03 * cells[0], 0.03 * cells[1]))
    same = compliances(cloth, nuno.Cloth().resolved(1, cloth.element_count))
    rigidity = np.linspace(1e-5, 1e-4, cloth.element_count)[None]
    own = compliances(cloth, nuno.Cloth(bending_rigidity=rigidity).resolved(1, cloth.element_count))
    assert same.bend.shape == (1, UNIFORM_BENDS)
    if cloth.element_count > 1:
        assert own.bend.shape[1] > UNIFORM_BENDS
        elements = np.concatenate([own.place["line"], own.place["twist"]])
        assert len(np.unique(elements)) == len(cloth.lines) + len(cloth.twists)
        np.testing.assert_allclose(np.sort(1 / own.bend[0, own.place["twist"]]), rigidity[0], rtol=1e-7)  # floats


@pytest.mark.parametrize("own", [False, True])
def test_twist_has_the_geometric_mean_of_the_two_rigidities(own):
    """Definition (axis 2 of `ClothTopology`): B_xy = sqrt(B_warp B_weft), of each element; lines have their own."""
    cloth = ClothTopology.sheet((4, 3), (0.12, 0.09))
    factor = np.linspace(1.0, 2.0, cloth.element_count)[None] if own else 1.0
    warp, weft = 1e-5 * factor, 9e-5 * factor
    found = compliances(cloth, nuno.Cloth(bending_rigidity=(warp, weft)).resolved(1, cloth.element_count))
    twists = 1.0 / found.bend[0, found.place["twist"]]
    expected = 3e-5 * (np.sort(factor[0]) if own else np.ones(cloth.element_count))
    np.testing.assert_allclose(np.sort(twists), expected, rtol=1e-6)
    lines = 1.0 / found.bend[0, found.place["line"]]
    assert lines[cloth.lines.axis == 0].max() <= 2.0001e-5 and lines[cloth.lines.axis == 1].min() >= 8.999e-5


@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_masses_of_elements_that_differ_add_up(kind):
    """Exact: in all the density times the area of each element; where all have the same, what one number gives."""
    cloth = ClothTopology.sheet((5, 4), (0.1, 0.06))
    if kind == "mesh":
        cloth = ClothTopology.mesh(cloth.rest[:, :2], cloth.faces)
    density = np.random.default_rng(5).uniform(0.1, 0.4, (2, cloth.element_count))
    mass = vertex_masses(cloth, density)
    np.testing.assert_allclose(mass.sum(axis=1), (density * 0.1 * 0.06 / cloth.element_count).sum(axis=1), rtol=1e-9)
    inner = np.linalg.norm(cloth.rest - cloth.rest.mean(axis=0), axis=1).argmin()
    same = vertex_masses(cloth, np.full((1, cloth.element_count), 0.2))
    assert same[0, inner] == pytest.approx(0.2 * cloth.area[inner], rel=1e-9)
