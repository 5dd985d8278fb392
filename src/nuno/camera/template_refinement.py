"""A polygon's place to a fraction of the grid: each vertex moves a little, and the best moves are found together."""

from __future__ import annotations

import numpy as np

from nuno.camera.edge_field import EdgeField
from nuno.camera.template_search import Candidate, Weights
from nuno.camera.triangle_deformation import deformation, to_unit
from nuno.camera.triangulated_polygon import TriangulatedPolygon

_REACH = 2  # steps that a vertex goes to each side: 25 places
_TURNED = np.float32(
    8.0
)  # [nats^2] what a triangle costs at most, also one that is turned over, as where a corner is folded
_LONGEST = 24  # points of a side that are looked at


def refine_candidate(
    polygon: TriangulatedPolygon, points: np.ndarray, field: EdgeField, step: float, weights: Weights, rounds: int
) -> Candidate:
    """Move the vertices by steps as long as that is better.

    Args:
        polygon: At scale 1 [px].
        points: (n, 2) float, where its vertices are [px].
        field: The image's edges.
        step: [px]
        weights: Of the energy.
        rounds: How often at most.
    """
    line = np.arange(-_REACH, _REACH + 1)
    moves = step * np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    order = np.argsort(np.linalg.norm(moves, axis=1), kind="stable")  # of equal ones the shortest
    moves = moves[order]
    energy = np.inf
    for _ in range(rounds):
        moved, new = _best_moves(polygon, points, field, moves, weights)
        if new >= energy - 1e-6:
            break
        points, energy = moved, new
    return Candidate(points, float(energy))


def energy_of(
    polygon: TriangulatedPolygon, points: np.ndarray, field: EdgeField, weights: Weights
) -> tuple[float, float]:
    """Return the share of the outline that lies on edges, and the mean deformation of the triangles [nats^2]."""
    i, j = np.array(polygon.sides).T
    lengths = np.linalg.norm(polygon.points[j] - polygon.points[i], axis=1)
    support = field.support(points[i], points[j], _LONGEST)
    costs = [
        float(np.minimum(deformation(to_unit(polygon.points[t]), points[t[1]] - points[t[0]],
                                     points[t[2]] - points[t[0]], weights.scale), _TURNED))
        for t in polygon.triangles
    ]  # fmt: skip
    return float(support @ (lengths / lengths.sum())), float(np.mean(costs))


def _best_moves(
    polygon: TriangulatedPolygon, points: np.ndarray, field: EdgeField, moves: np.ndarray, weights: Weights
) -> tuple[np.ndarray, float]:
    places = points[:, None] + moves  # (n, m, 2)
    tables: dict[tuple[int, int], np.ndarray] = {}
    count = len(moves)
    for k, i, j in polygon.order:
        for edge in ((i, j), (i, k), (j, k)):
            tables.setdefault(edge, np.zeros((count, count), dtype=np.float32))
    lengths = np.array([np.linalg.norm(polygon.points[j] - polygon.points[i]) for i, j in polygon.sides])
    for (i, j), share in zip(polygon.sides, lengths / lengths.sum(), strict=True):
        a, b = (i, j) if (i, j) in tables else (j, i)
        samples = int(np.clip(np.linalg.norm(points[j] - points[i]), 6, _LONGEST))
        tables[a, b] -= np.float32(share) * field.support(places[a][:, None], places[b][None], samples)
    choices = []
    per_triangle = np.float32(weights.form / len(polygon.order))
    for k, i, j in polygon.order:
        unit = to_unit(polygon.points[[i, j, k]])
        first = (places[j][None] - places[i][:, None])[:, :, None]
        second = (places[k][None] - places[i][:, None])[:, None]
        cost = np.minimum(deformation(unit, first, second, weights.scale), _TURNED)
        total = per_triangle * cost + tables[i, k][:, None] + tables[j, k][None]
        choice = total.argmin(axis=-1)
        choices.append(choice)
        tables[i, j] += np.take_along_axis(total, choice[..., None], axis=-1)[..., 0]
    _, i, j = polygon.order[-1]
    taken = np.zeros(len(points), dtype=int)
    taken[i], taken[j] = np.unravel_index(int(tables[i, j].argmin()), (count, count))
    for (k, i, j), choice in zip(polygon.order[::-1], choices[::-1], strict=True):
        taken[k] = choice[taken[i], taken[j]]
    return places[np.arange(len(points)), taken], float(tables[polygon.order[-1][1:]].min())
