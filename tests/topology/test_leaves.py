"""Leaves of a cloth: keys of creases, and regions that tell how long a list is good."""

import numpy as np
import pytest

from nuno.topology.cloth_topology import ClothTopology
from nuno.topology.leaves import MAX_REGION, MIN_REGION, crease_ends, region_leaves


@pytest.mark.parametrize("cells", [(4, 4), (15, 11), (5, 17)])
def test_a_key_names_its_crease(cells: tuple[int, int]) -> None:
    """Exact: a key's cell and kind give the diagonal and the other edge of every crease, and no two are the same."""
    topology = ClothTopology.sheet(cells, (0.6, 0.5))
    leaves, count = topology.leaves, len(topology.rest)
    kind, cell = leaves.crease_key // count, leaves.crease_key % count
    others = cell[:, None] + np.array(crease_ends(leaves.columns))[kind]
    diagonals = np.stack([cell, cell + leaves.columns + 1], axis=1)
    swapped = others[:, 0] < diagonals[:, 0]
    first = np.where(swapped[:, None], others, diagonals)
    second = np.where(swapped[:, None], diagonals, others)
    assert np.array_equal(np.concatenate([first, second], axis=1), leaves.crease)
    assert len(np.unique(leaves.crease_key)) == len(leaves.crease) > 0


def test_regions_have_every_vertex() -> None:
    """Exact: all vertices are in some region, there are as many as their size asks for, and sizes have bounds."""
    for cells in ((3, 3), (20, 16), (30, 30), (64, 64)):
        leaves = ClothTopology.sheet(cells, (0.6, 0.5)).leaves
        assert len(np.unique(leaves.region_corner)) == (cells[0] + 1) * (cells[1] + 1)
        assert len(leaves.region_start) - 1 == -(-leaves.count // region_leaves(leaves.count))
    assert [region_leaves(count) for count in (1, 128, 256, 10_000)] == [MIN_REGION, 4, 8, MAX_REGION]
