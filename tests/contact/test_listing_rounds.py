"""The listing by many threads in three rounds, tried out on the CPU with a launch for each round."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.contact import nearness, pair_lists, rounds
from nuno.scene.cloth import ClothTopology
from nuno.solver.cloth_solver import ClothSolver
from nuno.solver.state import THICKNESS, Settings, Sizes, StateFloat, Topology, view

BOUND, GROUPS, ALONE, BLOCKS, SUSPECTS, EXAMINE = range(6)


@wp.kernel(enable_backward=False)
def listing(s: StateFloat, topo: Topology, size: Sizes, run: Settings, phase: int, threads: int):
    """One phase of the listing; block pairs are taken without their groups."""
    thread = wp.tid()
    t = view(s, 0, topo.particles, size)
    far = t.scalars[THICKNESS] + 1.01 * run.margin
    far2 = far * far
    if phase == BOUND:
        nearness.middles(t, topo, thread, threads)
        nearness.bound_blocks(t, topo, thread, threads)
    elif phase == GROUPS:
        nearness.bound_groups(t, topo, thread, threads)
    elif phase == ALONE:
        pair_lists.find_pairs(t, topo, run.margin, thread, threads)
    elif phase == BLOCKS:
        for a in range(thread, topo.blocks, threads):
            for b in range(a, topo.blocks):
                gap = far + 1.0
                for c in range(3):
                    gap = wp.min(gap, t.bounds[6 * b + 3 + c] - t.bounds[6 * a + c] + far)
                    gap = wp.min(gap, t.bounds[6 * a + 3 + c] - t.bounds[6 * b + c] + far)
                if gap > 0.0:
                    if rounds.put_off(t, a, b, threads) == 0:
                        pair_lists.find_vertex_triangle(t, topo, a, b, far, far2)
                        if a != b:
                            pair_lists.find_vertex_triangle(t, topo, b, a, far, far2)
                        pair_lists.find_edge_edge(t, topo, a, b, far, far2)
        pair_lists.find_creases(t, topo, far2, thread, threads)
    elif phase == SUSPECTS:
        rounds.suspect_vertices(t, topo, far, far2, thread, threads)
        rounds.suspect_edges(t, topo, far, far2, thread, threads)
    else:
        rounds.examine(t, topo, far2, thread, threads)


def listed(cloth, positions, phases, threads):
    """The sorted vertex-triangle and edge-edge pairs, and how many entries the first two rounds asked for."""
    made = ClothSolver(cloth, nuno.Cloth(thickness=0.004), positions[None], 0 * positions[None], plan="fused")
    state, size, run = made._state, made._size, made.settings(0.0, 1e-3)
    kept = state.pair_count, state.vertex_triangle, state.edge_edge
    for phase in phases:
        inputs = [state, made._topology, size, run, phase, threads]
        wp.launch(listing, dim=threads, inputs=inputs, device="cpu")
    counts = kept[0].numpy()
    assert counts[0] <= size.vertex_triangle and counts[1] <= size.edge_edge
    pairs = [np.array(a.numpy()).reshape(-1, 4)[:k] for a, k in zip(kept[1:], counts, strict=True)]
    return [p[np.lexsort(p.T)] for p in pairs], state.touch_count.numpy()


@pytest.mark.parametrize("threads", [64, 256])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_three_rounds_list_the_pairs_of_one_thread(kind, threads):
    """Invariant: the same pairs, also where the suspects do not fit their list and are examined on the spot."""
    cloth = ClothTopology.sheet((14, 11), (0.28, 0.22))
    if kind == "mesh":
        cloth = ClothTopology.mesh(cloth.rest[:, :2], cloth.faces)
    positions = cloth.rest + np.random.default_rng(3).normal(scale=0.02, size=cloth.rest.shape)
    expected, _ = listed(cloth, positions, (BOUND, GROUPS, ALONE), 1)
    found, asked = listed(cloth, positions, (BOUND, GROUPS, BLOCKS, SUSPECTS, EXAMINE), threads)
    assert len(expected[0]) > 100 and len(expected[1]) > 100
    assert asked[0] > 0 and asked[1] > 2 * (16 * len(positions) + 128), "the lists are to overflow"
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
