"""The listing by a CUDA block in batches, against a search of all pairs and against the CPU's list."""

import numpy as np
import pytest
import trimesh
from listed_pairs import listed_pairs

import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.state.cloth_state import MOTION
from nuno.topology.cloth_topology import ClothTopology

THICKNESS = 0.004


def listed(cloth, positions, device):
    """The listed vertex-triangle and edge-edge pairs as sets, and the distance up to which they are complete [m]."""
    made = ClothSolver(
        cloth, nuno.Cloth(thickness=THICKNESS), positions[None], 0 * positions[None], plan="fused", device=device
    )
    made.open(0.0, 1e-3, 20)
    made.step_parts(0, MOTION)
    counts = made.pair_counts[0]
    assert counts[0] <= made._size.vertex_triangle and counts[1] <= made._size.edge_edge
    faces, edges = listed_pairs(made, 0)
    near = {(int(q[0]), *sorted(map(int, q[1:]))) for q in faces}
    return near, {frozenset((frozenset(map(int, q[:2])), frozenset(map(int, q[2:])))) for q in edges}, made


@pytest.mark.cuda
@pytest.mark.parametrize("scale", [0.004, 0.02])
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_a_block_lists_all_that_is_near(kind, scale):
    """Exact: every pair nearer than thickness and margin; at 20 mm nearly all blocks are near each other."""
    cloth = ClothTopology.sheet((14, 11), (0.28, 0.22))
    if kind == "mesh":
        cloth = ClothTopology.mesh(cloth.rest[:, :2], cloth.faces)
    positions = cloth.rest + np.random.default_rng(3).normal(scale=scale, size=cloth.rest.shape)
    vertex_triangle, edge_edge, made = listed(cloth, positions, "cuda:0")
    far = made.scalars[0, 3] + made.settings(0.0, 1e-3, 20).margin
    n, m = len(positions), len(cloth.faces)
    i, f = np.repeat(np.arange(n), m), np.tile(np.arange(m), n)
    found = trimesh.triangles.closest_point(positions[cloth.faces[f]], positions[i])
    apart = (cloth.faces[f] != i[:, None]).all(axis=1)
    # 10 um: positions are floats
    near = apart & (np.linalg.norm(found - positions[i], axis=1) < far - 1e-5)
    assert near.sum() > 100
    missing = {(int(a), *sorted(map(int, cloth.faces[b]))) for a, b in zip(i[near], f[near], strict=True)}
    assert missing <= vertex_triangle
    # the test of two edges is exact, so that both devices list the same but for rounding
    _, expected, _ = listed(cloth, positions, "cpu")
    assert len(expected) > 100
    assert len(expected ^ edge_edge) <= 2
