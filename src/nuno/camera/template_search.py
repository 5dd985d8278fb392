"""The best places of a triangulated polygon on a grid, by dynamic programming (Felzenszwalb, PAMI 2005, section 4).

The paper's tables have a value for every pair of locations of an edge's two ends. Here the size is known up to a
stretch, so that the second end lies in a ring around the first: a table has an array over all locations for each step
of that ring, and a triangle's energy, which depends on steps alone, is added to whole arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.edge_field import EdgeField
from nuno.camera.triangle_deformation import deformation, to_unit
from nuno.camera.triangulated_polygon import TriangulatedPolygon

_LIMIT = 0.6  # [nats^2] a triangle of the coarse search that is deformed more is left out: singular values 2.2 : 1
_ANGLE = 0.35  # [rad] two candidates whose root edges differ less, in place and direction, are one
_NEAR = 2.0  # [cells]


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of the energy's terms.

    Attributes:
        form: Of the triangles' mean deformation, beside the share of the outline that lies on edges.
        scale: By how much lengths in the image are longer than the polygon's.
        stretch: The least and the greatest length of an edge, of what it is at that scale.
    """

    form: float
    scale: float
    stretch: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place of the polygon.

    Attributes:
        points: (n, 2) float, of its vertices [px].
        energy: Lower is better.
    """

    points: np.ndarray
    energy: float


class _Steps:
    """The steps (k, 2) [cells] that an edge may make, and the number of each."""

    def __init__(self, length: float, stretch: tuple[float, float]) -> None:
        reach = int(np.ceil(stretch[1] * length)) + 1
        grid = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="xy"), axis=-1).reshape(-1, 2)
        away = np.hypot(grid[:, 0], grid[:, 1])
        # a step's rounding is half a cell each way; the shortest step is one cell, also of a shorter edge
        furthest = max(stretch[1] * length + 0.5, 1.0)
        self.all = grid[(away >= min(stretch[0] * length - 0.5, furthest)) & (away <= furthest) & (away > 0)]
        self.reach = reach
        self._number = np.full((2 * reach + 1, 2 * reach + 1), -1)
        self._number[self.all[:, 1] + reach, self.all[:, 0] + reach] = np.arange(len(self.all))

    def __len__(self) -> int:
        return len(self.all)

    def number(self, steps: np.ndarray) -> np.ndarray:
        """Return the numbers of steps (..., 2), -1 for those that are none."""
        inside = (np.abs(steps) <= self.reach).all(axis=-1)
        at = np.where(inside[..., None], steps + self.reach, 0)
        return np.where(inside, self._number[at[..., 1], at[..., 0]], -1)


class TemplateSearch:
    """The tables of one polygon over one image.

    Args:
        polygon: In pixels of the image, at scale 1.
        field: The image's edges, as wide as a coarse grid needs.
        spacing: Of the grid [px].
        weights: Of the energy.
    """

    def __init__(self, polygon: TriangulatedPolygon, field: EdgeField, spacing: int, weights: Weights) -> None:
        self.polygon, self.spacing, self.weights = polygon, spacing, weights
        _, height, width = field.maps.shape
        self.shape = (max(1, height // spacing), max(1, width // spacing))
        self._offset = (np.array([width, height]) - 1 - spacing * (np.array(self.shape[::-1]) - 1)) / 2.0
        self.unit = polygon.points * (weights.scale / spacing)  # [cells]
        self._steps: dict[tuple[int, int], _Steps] = {}
        self._tables: dict[tuple[int, int], np.ndarray] = {}
        self._choices: list[list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = []
        for _, i, j in polygon.order:
            self._edge(i, j)
        for k, i, j in polygon.order:
            self._edge(i, k)
            self._edge(j, k)
        self._see_sides(field)
        for number in range(len(polygon.order)):
            self._take_away(number)

    def _edge(self, i: int, j: int) -> None:
        """Make the table of an edge from i to j, of which j is taken away first."""
        if (i, j) not in self._steps:
            steps = _Steps(float(np.linalg.norm(self.unit[j] - self.unit[i])), self.weights.stretch)
            self._steps[i, j] = steps
            self._tables[i, j] = np.zeros((len(steps), *self.shape), dtype=np.float32)

    def _see_sides(self, field: EdgeField) -> None:
        """Take from the tables of the polygon's sides how much of them lies on edges."""
        sides = self.polygon.sides
        lengths = np.array([np.linalg.norm(self.unit[j] - self.unit[i]) for i, j in sides])
        rows, columns = np.indices(self.shape)
        places = np.stack([columns, rows], axis=-1) * self.spacing + self._offset
        for (i, j), share in zip(sides, lengths / lengths.sum(), strict=True):
            edge = (i, j) if (i, j) in self._steps else (j, i)
            samples = max(4, round(1.5 * float(np.linalg.norm(self.unit[j] - self.unit[i]))))
            table = self._tables[edge]
            for number, step in enumerate(self._steps[edge].all):
                end = places + step * self.spacing
                table[number] -= np.float32(share) * field.support(places, end, samples)
                beyond = (rows + step[1] < 0) | (rows + step[1] >= self.shape[0])
                beyond |= (columns + step[0] < 0) | (columns + step[0] >= self.shape[1])
                table[number][beyond] = np.inf

    def _take_away(self, number: int) -> None:
        """Add to a triangle's edge i j the least that its third vertex k costs, for each place of the edge."""
        k, i, j = self.polygon.order[number]
        base, near, far = self._steps[i, j], self._steps[i, k], self._steps[j, k]
        table, to_near, to_far = self._tables[i, j], self._tables[i, k], self._tables[j, k]
        unit = to_unit(self.unit[[i, j, k]])
        per_triangle = np.float32(self.weights.form / len(self.polygon.order))
        choices = []
        for a, step in enumerate(base.all):
            third = far.number(near.all - step)
            cost = deformation(unit, np.broadcast_to(step, near.all.shape), near.all)
            some = np.flatnonzero((third >= 0) & (cost < _LIMIT))
            choice = (some, third[some], per_triangle * cost[some])
            choices.append(choice)
            here, there = _overlap(self.shape, step)
            least = np.full(self.shape, np.inf, dtype=np.float32)
            if len(some):
                total = to_near[some][:, here[0], here[1]]
                total += to_far[choice[1]][:, there[0], there[1]]
                total += choice[2][:, None, None]
                least[here] = total.min(axis=0)
            table[a] += least
        self._choices.append(choices)

    def best(self, count: int) -> list[Candidate]:
        """Return up to ``count`` candidates whose root edges differ, best first."""
        _, i, j = self.polygon.order[-1]
        steps, table = self._steps[i, j], self._tables[i, j].copy()
        rows, columns = np.indices(self.shape)
        found: list[Candidate] = []
        angles = np.arctan2(steps.all[:, 1], steps.all[:, 0])
        middles = np.stack([columns, rows], axis=-1)[None] + 0.5 * steps.all[:, None, None]
        while len(found) < count:
            at = int(table.argmin())
            a, y, x = (int(v) for v in np.unravel_index(at, table.shape))
            energy = float(table[a, y, x])
            if not np.isfinite(energy):
                break
            found.append(Candidate(self._trace(a, np.array([x, y])), energy))
            turned = np.abs((angles - angles[a] + np.pi) % (2.0 * np.pi) - np.pi) < _ANGLE
            close = np.linalg.norm(middles - middles[a, y, x], axis=-1) < _NEAR
            table[turned[:, None, None] & close] = np.inf
        return found

    def _trace(self, a: int, place: np.ndarray) -> np.ndarray:
        """Return where all vertices (n, 2) [px] are if the root edge makes step number ``a`` from a place."""
        cells = np.zeros(self.unit.shape, dtype=int)
        _, i, j = self.polygon.order[-1]
        cells[i], cells[j] = place, place + self._steps[i, j].all[a]
        for (k, i, j), choices in zip(self.polygon.order[::-1], self._choices[::-1], strict=True):
            number = int(self._steps[i, j].number(cells[j] - cells[i]))
            near, far, cost = choices[number]
            total = (
                self._tables[i, k][near, cells[i][1], cells[i][0]] + self._tables[j, k][far, cells[j][1], cells[j][0]]
            )
            cells[k] = cells[i] + self._steps[i, k].all[near[int((total + cost).argmin())]]
        return cells * self.spacing + self._offset


def _overlap(shape: tuple[int, int], step: np.ndarray) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The places of a grid from which a step stays on it, and where it leads."""
    here, there = [], []
    for size, way in zip(shape, (int(step[1]), int(step[0])), strict=True):
        low, high = max(0, -way), max(min(size, size - way), max(0, -way))
        here.append(slice(low, high))
        there.append(slice(low + way, high + way))
    return (here[0], here[1]), (there[0], there[1])
