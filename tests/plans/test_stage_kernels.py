"""Stages: which block does which elements when, so that colours keep their order and few waits are needed."""

import numpy as np
import pytest

from nuno.plans.stage_kernels import CELLS, GRID_LINES, LINES, PARTICLES, SORTED, TWISTS, divide
from nuno.topology.barrier_stages import Colour, make_stages
from nuno.topology.cloth_topology import ClothTopology


def vertices_of(topology, stages, step, first, last):
    """The vertices of a block's share of a step."""
    kind = stages.kind[step]
    if kind == PARTICLES:
        return np.arange(first, last)
    if kind in SORTED:
        tables = {TWISTS: topology.twists, LINES: topology.lines, CELLS: topology.cells}
        return tables[kind].vertices[stages.row[first:last, 1]].ravel()
    sides = int(np.sqrt(topology.vertex_count))
    grid = np.arange(sides * sides).reshape(sides, sides)
    return np.concatenate([grid, grid.T])[first:last].ravel()  # grid lines along the rows, then along the columns


@pytest.mark.parametrize("cells", [16, 33])
@pytest.mark.parametrize("blocks", [1, 7, 132])
def test_blocks_share_no_vertex_within_a_stage(cells, blocks):
    """Promise: within a stage a block's threads wait for each other alone, so no other block may touch its vertices."""
    topology = ClothTopology.sheet((cells, cells), (0.6, 0.6))
    stages = divide(topology, blocks)
    for begin, end in zip(stages.first[:-1], stages.first[1:], strict=True):
        owner = np.full(topology.vertex_count, -1)
        for block in range(blocks):
            for step in range(begin, end):
                mine = vertices_of(topology, stages, step, *stages.share[block, step])
                assert np.isin(owner[mine], (-1, block)).all()
                owner[mine] = block


@pytest.mark.parametrize("blocks", [1, 7, 132])
def test_every_element_is_done_once_and_colours_keep_their_order(blocks):
    """Invariant: the steps are the colours, from particles to grid lines, and the shares of each make it up."""
    topology = ClothTopology.sheet((20, 16), (0.5, 0.4))
    stages = divide(topology, blocks)
    assert stages.kind.tolist() == [PARTICLES] + 4 * [TWISTS] + 6 * [LINES] + 4 * [CELLS] + 2 * [GRID_LINES]
    for kind, elements in ((TWISTS, topology.twists), (LINES, topology.lines), (CELLS, topology.cells)):
        done = [
            np.sort(np.concatenate([stages.row[a:b, 1] for a, b in stages.share[:, step]]))
            for step in np.nonzero(stages.kind == kind)[0]
        ]
        expected = [np.arange(a, b) for a, b in zip(elements.offsets[:-1], elements.offsets[1:], strict=True)]
        for one, other in zip(done, expected, strict=True):
            np.testing.assert_array_equal(one, other)
    for step, count in ((0, topology.vertex_count), (15, 17), (16, 21)):
        share = stages.share[:, step]
        np.testing.assert_array_equal(share[1:, 0], share[:-1, 1])
        assert share[-1, 1] - share[0, 0] == count


def test_a_sheet_needs_six_waits_for_seventeen_colours():
    """By hand: rows in pairs hold two colours of cells, and bends and grid lines along them; so do columns."""
    stages = divide(ClothTopology.sheet((128, 128), (0.6, 0.6)), 132)
    assert len(stages.first) - 1 == 6


def test_what_hangs_together_is_not_shared_out():
    """A chain of links in two colours is one strip: two stages are quicker than one block for all."""
    chain = np.arange(20000)
    colours = [
        Colour(0, 0, 10000, np.repeat(np.arange(10000), 2), chain),
        Colour(0, 10000, 9999, np.repeat(np.arange(9999), 2), chain[1:-1]),
    ]
    assert make_stages(colours, 20000, 100, (0,)).ends.tolist() == [1, 1]
