"""The listing of one world at a time: nothing near is passed over, and the order is the same whatever the margin."""

import numpy as np
import pytest
from crossing import edge_edge_distances, vertex_triangle_distances
from listed_pairs import listed_pairs

import nuno
from few_variants import few
from nuno.solvers.cloth_solver import ClothSolver
from nuno.state.cloth_state import THICKNESS
from nuno.topology.cloth_topology import ClothTopology

CELLS, CELL = (17, 12), 0.02  # no multiple of anything; [m]


def sheet() -> ClothTopology:
    """A sheet of square cells."""
    return ClothTopology.sheet(CELLS, (CELLS[0] * CELL, CELLS[1] * CELL))


def shapes() -> dict[str, np.ndarray]:
    """Ways to bend the sheet, (n, 3) each [m]: from flat to near itself everywhere."""
    x, y, _ = sheet().rest.T
    random = np.random.default_rng(5)
    made = {"flat": np.stack([x, y, 0 * x], 1)}
    for radius in (1.0, 1.5, 2.0, 3.0, 5.0):
        # slanted, so that the check's axis is along neither warp nor weft, and its layers come to lie on each other
        along, across = 0.8 * x + 0.6 * y, 0.8 * y - 0.6 * x
        angle, r = along / (radius * CELL), radius * CELL + 0.004 * (along / CELL) / radius
        made[f"rolled {radius:g}"] = np.stack([r * np.sin(angle), across, r * np.cos(angle)], 1)
    for angle in (0.5, 2.2, 3.0):
        over = np.maximum(x - 0.3 * y, 0.0)
        turned = np.stack([-over * (1 - np.cos(angle)), 0 * x, over * np.sin(angle)], 1)
        made[f"folded {angle:g}"] = made["flat"] + turned
    for shrink in (0.9, 0.6, 0.4):
        made[f"pressed {shrink:g}"] = made["flat"] * [shrink, 1.0, 1.0]
        made[f"sheared {shrink:g}"] = np.stack([x + (1 - shrink) * 1.5 * y, y * shrink, 0.2 * x], 1)
    for scale in (0.1, 0.25, 0.5):
        made[f"wrinkled {scale:g}"] = made["flat"] + random.normal(scale=scale * CELL, size=(len(x), 3))
    return made


def listed(positions: np.ndarray, plan: str, thickness: float, margin: float) -> tuple[list[np.ndarray], float]:
    """The (k, 4) vertex-triangle and edge-edge rows of the last world of a batch, and how near they are to be [m]."""
    made = ClothSolver(sheet(), nuno.Cloth(thickness=thickness), positions, 0 * positions, substeps=20, plan=plan)
    size, settings = made._size, made.settings
    for kind in ("vertex_triangle", "edge_edge"):  # a sheet pressed together lists more than any that moves
        setattr(size, kind, 20 * getattr(size, kind))
    made._allocate_lists()

    def with_margin(time: float, dt: float, frame: int) -> object:
        run = settings(time, dt, frame)
        run.margin = margin
        return run

    made.settings = with_margin
    made.run(0.0, 1e-4)
    count = made.pair_counts[-1]
    assert count[0] <= size.vertex_triangle and count[1] <= size.edge_edge
    rows = listed_pairs(made, len(positions) - 1)
    return rows, float(made.scalars[-1, THICKNESS]) + margin


@pytest.mark.parametrize(
    "thickness", [pytest.param(0.002, marks=pytest.mark.long), 0.004, pytest.param(0.01, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("shape", few(list(shapes()), *list(shapes())[::3]))
def test_nothing_near_is_passed_over(shape: str, thickness: float) -> None:
    """Brute force finds no pair within the thickness and the margin that is not listed, creases included."""
    x = shapes()[shape]
    rows, far = listed(x[None], "vector", thickness, 0.007)
    faces, blocks = sheet().faces, sheet().leaves
    have = {(r[0], *sorted(r[1:])) for r in rows[0].tolist()}
    near = np.argwhere(vertex_triangle_distances(x, faces) < far)
    assert {(i, *sorted(faces[f].tolist())) for i, f in near.tolist() if i not in faces[f]} <= have
    have = {tuple(sorted((tuple(sorted(r[:2])), tuple(sorted(r[2:]))))) for r in rows[1].tolist()}
    edges = sheet().edges.vertices
    near = np.argwhere(np.triu(edge_edge_distances(x, edges) < far, 1))
    pairs = [(edges[a].tolist(), edges[b].tolist()) for a, b in near.tolist()]
    pairs = [(a, b) for a, b in pairs if not set(a) & set(b)]
    creases = blocks.crease.reshape(-1, 2)
    ends, which = np.unique(creases, axis=0, return_inverse=True)
    distance = edge_edge_distances(x, ends)
    for a, b in which.reshape(-1, 2)[distance[tuple(which.reshape(-1, 2).T)] < far].tolist():
        pairs.append((ends[a].tolist(), ends[b].tolist()))
    assert {tuple(sorted((tuple(sorted(a)), tuple(sorted(b))))) for a, b in pairs} <= have


def test_flat_cloth_is_passed_over() -> None:
    """A flat sheet has no pair nearer than a diagonal's 0.7 of a cell, and none is listed."""
    rows, _ = listed(shapes()["flat"][None], "vector", 0.004, 0.007)
    assert [len(r) for r in rows] == [0, 0]


@pytest.mark.parametrize("alone", ["vector", pytest.param("fused", marks=pytest.mark.long)])
@pytest.mark.parametrize("shape", ["rolled 1.5", "folded 3", "wrinkled 0.25"])
def test_order_depends_on_the_world_alone(shape: str, alone: str) -> None:
    """Invariant: pairs of a short margin come in the same order with a long one, among other worlds or alone."""
    every = shapes()
    x = every[shape]
    short, _ = listed(x[None], "vector", 0.004, 0.003)
    assert len(short[0]) > 3 and len(short[1]) > 3
    batch = np.stack([every["wrinkled 0.5"], every["flat"], x])
    for other, _ in (
        listed(x[None], alone, 0.004, 0.008),
        listed(batch, "fused", 0.004, 0.003),
        listed(batch, "fused", 0.004, 0.008),
    ):
        for fewer, many in zip(short, other, strict=True):
            wanted = set(map(tuple, fewer.tolist()))
            assert [row for row in map(tuple, many.tolist()) if row in wanted] == list(map(tuple, fewer.tolist()))
