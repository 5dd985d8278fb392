"""A cloth against itself: nothing passes through, layers keep their thickness, lists change no result."""

from types import SimpleNamespace

import numpy as np
import pytest
from crossing import count_crossings, edge_edge_distances, vertex_triangle_distances
from listed_pairs import listed_pairs

import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.state.cloth_state import THICKNESS
from nuno.tables.colliders import Colliders
from nuno.topology.cloth_topology import ClothTopology

CELLS = 20
SIZE = 0.4  # [m]
PICKS = [j * (CELLS + 1) + i for j in (0, 4, 8, 12) for i in (0, 5, 10, 14)]


def lifted(picks: list[int], seconds: float, margin: float | None = None, **material: float) -> ClothSolver:
    """Return a solver in which a sheet on the floor was lifted by another vertex in each world."""
    topology = ClothTopology.sheet((CELLS, CELLS), (SIZE, SIZE))
    worlds = len(picks)
    start = np.repeat(topology.rest[None], worlds, axis=0) + np.array((0.0, 0.0, 0.003))
    cloth = nuno.Cloth(**{"area_density": 0.2, "bending_rigidity": 5e-5, "thickness": 0.004, **material})
    solver = ClothSolver(topology, cloth, start, np.zeros_like(start), substeps=20)
    solver.set_colliders(Colliders.from_bodies([nuno.plane()], worlds, "cpu"))
    held = start[np.arange(worlds), picks]
    path = np.stack([held, held + np.array((0.0, 0.0, 0.35))], axis=1)[:, None]
    solver.set_grips(
        [
            SimpleNamespace(
                vertices=np.array(picks)[:, None], corners=None, barycentric=None, times=[0.0, 0.8], positions=path,
                interpolation="minimum_jerk", compliance=0.0,
            )
        ]
    )  # fmt: skip
    if margin is not None:
        settings = solver.settings

        def with_margin(time: float, dt: float, frame: int) -> object:
            run = settings(time, dt, frame)
            run.margin = margin * topology.cell_size
            return run

        solver.settings = with_margin
    solver.run(0.0, seconds)
    return solver


@pytest.mark.parametrize(
    "material",
    [
        {},
        pytest.param({"thickness": 0.002}, marks=pytest.mark.long),
        pytest.param({"thickness": 0.006}, marks=pytest.mark.long),
        pytest.param({"bending_rigidity": 2e-5}, marks=pytest.mark.long),
        pytest.param({"bending_rigidity": 2e-3}, marks=pytest.mark.long),
    ],
    ids=str,
)
def test_no_triangles_cross_after_a_lift(material: dict[str, float]) -> None:
    """Sixteen ways to crumple a cloth leave no edge in a triangle."""
    solver = lifted(PICKS, 1.2, **material)
    assert solver.finite().all()
    x = solver.positions()
    assert [count_crossings(x[k], solver.topology.faces) for k in range(len(PICKS))] == [0] * len(PICKS)


def test_a_world_of_a_batch_is_the_world_alone() -> None:
    """A list is made for sixteen worlds or for one, and the bits are the same."""
    together = lifted(PICKS, 0.8).positions()
    for k in (5, 15):
        assert np.array_equal(together[k], lifted(PICKS[k : k + 1], 0.8).positions()[0])


def test_the_margin_changes_no_bit() -> None:
    """How many pairs are listed, and how often, is a matter of speed alone."""
    assert np.array_equal(lifted(PICKS, 0.8, margin=0.28).positions(), lifted(PICKS, 0.8, margin=0.5).positions())


def near_edges(x: np.ndarray, edges: np.ndarray, far: float) -> set[tuple[tuple[int, ...], ...]]:
    """Return the pairs of edges without a common vertex that are nearer than ``far`` [m]."""
    near = np.argwhere(np.triu(edge_edge_distances(x, edges) < far, 1))
    pairs = [(edges[a].tolist(), edges[b].tolist()) for a, b in near.tolist()]
    return {tuple(sorted((tuple(sorted(a)), tuple(sorted(b))))) for a, b in pairs if not set(a) & set(b)}


@pytest.mark.parametrize("worlds", [1, pytest.param(3, marks=pytest.mark.long)])
def test_a_substep_solves_all_pairs_in_reach(worlds: int) -> None:
    """Brute force over where the last substep began finds no pair within 1.1 thicknesses that it did not look at.

    That is the least that `swept` adds up to. A vertex counts where it is over the triangle; what is beside one belongs
    to the edges.
    """
    solver = lifted(PICKS[5 : 5 + worlds], 0.9)
    state, faces = solver.state, solver.topology.faces
    far = 1.1 * float(solver.scalars[0, THICKNESS])
    count = solver.download(state.active_count, 2)
    start = np.stack([solver.download(a, solver.particle_count) for a in (state.px, state.py, state.pz)], axis=-1)
    found = np.zeros(2, dtype=int)
    for k in range(worlds):
        x = start[k].astype(float)
        rows = solver.download(state.active_triangle, 4 * solver._size.vertex_triangle)[k].reshape(-1, 4)[: count[k, 0]]
        have = {(r[0], *sorted(r[1:])) for r in rows.tolist()}
        a, b, c = (x[faces[:, j]] for j in range(3))
        normal = np.cross(b - a, c - a)
        weights = [(np.cross(q - p, x[:, None] - p) * normal).sum(axis=-1) for p, q in ((a, b), (b, c), (c, a))]
        over = np.min(weights, axis=0) >= 0.0
        near = np.argwhere(over & (vertex_triangle_distances(x, faces) < far))
        want = {(i, *sorted(faces[f].tolist())) for i, f in near.tolist() if i not in faces[f]}
        assert want <= have
        rows = solver.download(state.active_edge, 4 * solver._size.edge_edge)[k].reshape(-1, 4)[: count[k, 1]]
        have = {tuple(sorted((tuple(sorted(r[:2])), tuple(sorted(r[2:]))))) for r in rows.tolist()}
        edges = near_edges(x, solver.topology.edges.vertices, far)
        assert edges <= have
        found += (len(want), len(edges))
    assert (found > 0).all()


@pytest.mark.parametrize("worlds", [1, 3])
def test_lists_hold_all_near_pairs(worlds: int) -> None:
    """Brute force over all pairs finds none within the thickness and the margin that is not listed."""
    solver = lifted(PICKS[5 : 5 + worlds], 0.7)
    state, n, faces = solver.state, solver.particle_count, solver.topology.faces
    edges = solver.topology.edges.vertices
    far = float(solver.scalars[0, THICKNESS]) + solver.settings(0.0, 1e-3, 20).margin
    listed = (
        solver.download(state.reference, solver._size.reference)[:, : 3 * n].reshape(worlds, 3, n).transpose(0, 2, 1)
    )
    found = 0
    for k in range(worlds):
        x = listed[k].astype(float)
        triangles, pairs = listed_pairs(solver, k)
        have = {(r[0], *sorted(r[1:])) for r in triangles.tolist()}
        near = np.argwhere(vertex_triangle_distances(x, faces) < far)
        want = {(i, *sorted(faces[f].tolist())) for i, f in near.tolist() if i not in faces[f]}
        assert want <= have
        have = {tuple(sorted((tuple(sorted(r[:2])), tuple(sorted(r[2:]))))) for r in pairs.tolist()}
        want = near_edges(x, edges, far)
        assert want <= have
        found += len(want)
    assert found > 10  # the case has folds to find


@pytest.mark.parametrize("thickness", [0.002, 0.006])
def test_layers_keep_their_thickness(thickness: float) -> None:
    """A sheet that lies folded in two on the floor keeps its layers a thickness apart."""
    topology = ClothTopology.sheet((16, 8), (0.4, 0.2))
    x = topology.rest.copy()
    upper = x[:, 0] > 0.0125
    x[upper, 0] *= -1.0
    x[upper, 0] += 0.025
    x[upper, 2] = 0.02
    x[:, 2] += thickness
    material = nuno.Cloth(area_density=0.2, bending_rigidity=2e-5, thickness=thickness, air_drag=2.0)
    solver = ClothSolver(topology, material, x[None], 0 * x[None], substeps=20)
    solver.set_colliders(Colliders.from_bodies([nuno.plane()], 1, "cpu"))
    solver.run(0.0, 1.5)
    y = solver.positions()[0]
    assert count_crossings(y, topology.faces) == 0
    inner = upper & (np.abs(x[:, 1]) < 0.09) & (x[:, 0] < -0.05)  # away from the fold and the rim
    lower = ~np.isin(topology.faces, np.nonzero(upper)[0]).any(axis=1)
    gap = vertex_triangle_distances(y, topology.faces[lower])[inner].min(axis=1)
    # one pass of contact and gravity within a substep let a pair in by a few per cent
    assert gap.min() > 0.9 * thickness
    # and the upper layer has come down onto the lower one
    assert np.median(gap) < 2.0 * thickness
