"""The tasks: a table, a sheet of cloth on it, where an episode begins, and a score of how far it has come."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.make_bodies import box, plane, sheet
from nuno.envs.top_view import TopView
from nuno.errors import InvalidInputError
from nuno.materials import Cloth
from nuno.validation import count
from nuno.world.world import World

SIDE = 0.3
"""[m] of the square cloth."""
TABLE = 0.9
"""[m], the side of the square table, whose top is at z = 0."""
LIFT = 0.002
"""[m] above the table at which a cloth that lies flat begins."""
ABOVE = 0.02
"""[m] above two corners at which the hands begin: within their reach."""
FRAME_RATE = 64.0
"""[1/s] A power of two: times of frames are then exact, and an episode does not depend on when it begins."""


@dataclass(frozen=True, eq=False)
class Start:
    """The beginning of an episode in one world.

    Attributes:
        vertices: (n, 3) [m], of the cloth, at rest.
        hands: (hands, 3) [m], open.
        place: (3,) [m], of what the task has beside the cloth.
    """

    vertices: np.ndarray
    hands: np.ndarray
    place: np.ndarray


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A place on the way of a scripted hand, in every world.

    Attributes:
        places: (worlds, hands, 3) [m]; with ``vertices`` where the hands go beside them.
        closed: Whether the hands are closed on the way there.
        vertices: (hands,) int, vertices of the cloth that the hands follow, or None.
    """

    places: np.ndarray
    closed: bool
    vertices: np.ndarray | None = None


def moved(places: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    """Return places (..., 3) moved by x, y and z [m]."""
    return places + np.array((x, y, z))


def waypoints(*ways: tuple[np.ndarray, bool]) -> list[Waypoint]:
    """Return waypoints from places (worlds, hands, 3) [m] and whether the hands are closed."""
    return [Waypoint(places, closed) for places, closed in ways]


class ClothTask(ABC):
    """A task with a square cloth.

    Args:
        cells: Cells of the cloth along x and y.
        substeps: Substeps of a frame; None is the solver's rule.
        device: As of ``nuno.World``.
        material: Of the cloth; None is ``nuno.Cloth()``.

    Attributes:
        name: The task's.
        horizon: Control steps after which an episode is cut.
        done_at: The score from which on it is solved, once all hands are open.
    """

    name: ClassVar[str]
    horizon: ClassVar[int] = 32
    done_at: ClassVar[float]
    hands: ClassVar[int] = 2

    def __init__(
        self, cells: Sequence[int] = (12, 12), substeps: int | None = None, device: str = "auto",
        material: Cloth | None = None,
    ) -> None:  # fmt: skip
        if np.shape(cells) != (2,):
            raise InvalidInputError(f"cells must be two whole numbers, got {cells!r}")
        self.cells = (count("cells", cells[0], low=2), count("cells", cells[1], low=2))
        self.substeps, self.device, self.material = substeps, device, material
        nx, ny = self.cells
        x, y = (np.linspace(-0.5 * SIDE, 0.5 * SIDE, n + 1) for n in self.cells)
        self._grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self.corners = np.array([0, nx, ny * (nx + 1), (ny + 1) * (nx + 1) - 1])  # (-x, -y), (+x, -y), (-x, +y) ...

    def world(self) -> World:
        """Return one world of the task, with a body "cloth"."""
        world = World(device=self.device, frame_rate=FRAME_RATE, substeps=self.substeps)
        world.add(plane(name="floor", position=(0.0, 0.0, -0.5), color=(0.75, 0.75, 0.78)))
        world.add(box((TABLE, TABLE, 0.02), name="table", position=(0.0, 0.0, -0.01), color=(0.55, 0.42, 0.3)))
        self.furnish(world)
        cloth = sheet((SIDE, SIDE), self.cells, name="cloth", position=(0.0, 0.0, LIFT), color=(0.2, 0.4, 0.75))
        world.attach(world.add(cloth), Cloth() if self.material is None else self.material)
        return world

    def flat(self, centre: ArrayLike, angle: float) -> np.ndarray:
        """Return vertices (n, 3) [m] of the cloth flat on the table, its middle at (x, y), turned [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        vertices = np.empty((len(self._grid), 3))
        vertices[:, :2] = self._grid @ np.array([[c, s], [-s, c]]) + np.asarray(centre)
        vertices[:, 2] = LIFT
        return vertices

    def furnish(self, world: World) -> None:  # noqa: B027  (some tasks have nothing else)
        """Put into a world what the task has beside table and cloth; what moves with an episode is called "object"."""

    @abstractmethod
    def start(self, random: np.random.Generator) -> Start:
        """Return where an episode begins."""

    @abstractmethod
    def score(self, vertices: np.ndarray, places: np.ndarray, view: TopView) -> np.ndarray:
        """Return how far each world has come.

        Args:
            vertices: (worlds, n, 3) [m].
            places: (worlds, 3) [m], ``Start.place`` of each.
            view: Of the table from above.

        Returns:
            (worlds,), 0 to 1.
        """

    @abstractmethod
    def script(self, vertices: np.ndarray, places: np.ndarray) -> list[Waypoint]:
        """Return a way that solves the task, from what a camera does not tell: the vertices at its start."""

    def pair_at(self, places: np.ndarray) -> np.ndarray:
        """Return places (worlds, 2, 3) [m] of two hands that hold a side along x, its middle at (worlds, 3) [m]."""
        return places[:, None] + np.array([(-0.5 * SIDE, 0.0, 0.0), (0.5 * SIDE, 0.0, 0.0)])
