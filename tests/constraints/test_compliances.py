"""Compliances of a cloth's elements: one number for all of a kind, or each its own."""

import numpy as np
import pytest

import nuno
from nuno.constraints.compliances import UNIFORM_BENDS, compliances
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
        elements = np.concatenate([own.line, own.twist])
        assert len(np.unique(elements)) == len(cloth.lines) + len(cloth.twists)
        np.testing.assert_allclose(np.sort(1 / own.bend[0, own.twist]), rigidity[0], rtol=1e-7)  # floats
