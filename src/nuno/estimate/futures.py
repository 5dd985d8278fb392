"""Imagined picks: one world for every candidate and hypothesis, lifted, and let come to rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.make_bodies import box, plane, sheet
from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.dynamics.dynamics import ParticleDynamics
from nuno.engines.world_view import dynamics_of
from nuno.estimate.coming_to_rest import LOOK_SECONDS, ComingToRest, mean_speeds, slow_part
from nuno.estimate.hypotheses import Discretisation, cell_counts
from nuno.estimate.lift_path import paths_of_hands
from nuno.estimate.outline_body import grips_on, outline_body
from nuno.materials import Cloth
from nuno.shapes.path import Path
from nuno.shapes.surface import SurfacePoints
from nuno.world.world import World

if TYPE_CHECKING:
    import warp as wp

    from nuno.bodies.body import Body

LIFT_SECONDS = 1.5
"""[s] How long the hand's motion takes where it is not known."""
DRAWN_THICKNESS = 0.002
"""[m] A cloth is seen about as thick as it is, which is less than the distance that contact keeps."""
BODY_NAME = "cloth"


@dataclass
class Futures:
    """A batch of imagined picks.

    Attributes:
        world: The batch; world h * k + c is hypothesis h of candidate c.
        body: The cloth in it.
        origin: The single world that it was imagined from.
        candidates: Number of candidates k.
        discretisation: The mesh, the step and the hypotheses.
    """

    world: World
    body: Body
    origin: World
    candidates: int
    discretisation: Discretisation

    @property
    def finite(self) -> np.ndarray:
        """(hypotheses, candidates) bool: which futures' states are numbers."""
        return dynamics_of(self.body).finite().reshape(len(self.discretisation.hypotheses), self.candidates)

    @property
    def positions(self) -> wp.array:
        """(hypotheses * candidates, n) of vec3, the cloths' vertices on the device [m]."""
        return self.world.engine.positions(self.body)

    def whole(self, world: int) -> tuple[Futures, int]:
        """The batch whose world is as these futures are, and the place in it of number ``world`` of these."""
        return self, world


def solver_of(body: Body) -> Any:
    """The solver of a body that has dynamics."""
    assert isinstance(body._dynamics, ParticleDynamics)
    return body._dynamics.solver


def table_world(
    rectangle: ClothRectangle, table: Table, cells: tuple[int, int], *, device: str, substeps: int | None
) -> tuple[World, Body]:
    """A world with the table, the floor and the cloth as it lay before; the cloth is static."""
    world = World(device=device, substeps=substeps)
    world._quiet = True
    if table.half_extents is not None:
        half, centre = table.half_extents, table.centre or (0.0, 0.0)
        size = (2 * half[0], 2 * half[1], table.thickness)
        world.add(box(size, name="table", position=(*centre, table.height - table.thickness / 2)))
        if table.height > table.thickness:  # else heights are not counted from a floor
            world.add(plane(name="floor"))
    else:
        world.add(plane(name="table", position=(0.0, 0.0, table.height)))
    if isinstance(rectangle, ClothOutline):
        return world, world.add(outline_body(rectangle, max(cells), BODY_NAME))
    along = rectangle.corners[1] - rectangle.corners[0]
    cloth = sheet((rectangle.long_m, rectangle.short_m), cells=cells, name=BODY_NAME, position=rectangle.centre)
    cloth.rotate(math.atan2(along[1], along[0]), (0.0, 0.0, 1.0), wrt="world")
    world.add(cloth)
    return world, cloth


def is_turned(rectangle: ClothRectangle) -> bool:
    """Return True if CJ lies clockwise of CI seen from above, so that j runs against the sheet's own y."""
    along, across = (rectangle.corners[k] - rectangle.corners[0] for k in (1, 3))
    return bool(along[0] * across[1] - along[1] * across[0] < 0)


def begin_picks(
    rectangle: ClothRectangle,
    candidates: np.ndarray,
    grid: tuple[int, int],
    discretisation: Discretisation,
    *,
    table: Table,
    hand: np.ndarray,
    rest_height: float,
    device: str,
    lift_seconds: float = LIFT_SECONDS,
    engine: str = "nuno",
    hand_std: float = 0.0,
    hand_path: np.ndarray | None = None,
    numbers: np.ndarray | None = None,
    elapsed: float = 0.0,
    state: dict[str, np.ndarray] | None = None,
) -> Futures:
    """Begin `imagine_picks`: all before any time passes; the arguments are the same, but for three.

    With ``numbers`` (n,) int it is begun with these of its worlds alone, in their order, and with ``elapsed`` [s] as if
    so much of the hand's time had passed before, by which the cloths had come to the ``state`` (n, ...).
    """
    cells = cell_counts(rectangle.long_m, rectangle.short_m, discretisation.cells, grid)
    if isinstance(rectangle, ClothOutline):
        cells = (discretisation.cells, 1)
    substeps = discretisation.substeps if engine == "nuno" else None  # they are those of Nuno's solver
    world, cloth = table_world(rectangle, table, cells, device=device, substeps=substeps)
    k, hypotheses = len(candidates), discretisation.hypotheses
    if numbers is None:
        numbers = np.arange(k * len(hypotheses))

    def each(name: str) -> np.ndarray:
        return np.array([getattr(h, name) for h in hypotheses])[numbers // k]

    futures = world.imagine(len(numbers), engine=engine)
    body = futures.find(cloth.name)
    if not discretisation.self_contact:
        futures.ignore_contact(body, body)
    for static in ("table", "floor"):
        if any(b.name == static for b in futures.bodies):
            # the pair's coefficient is the geometric mean: with equal ones it is the hypothesis's
            futures.find(static).friction = each("friction")
    futures.attach(
        body,
        Cloth(
            area_density=each("area_density"), bending_rigidity=each("bending_rigidity"),
            stretch_stiffness=each("stretch_stiffness"), shear_stiffness=each("shear_stiffness"),
            friction=each("friction"), air_drag=each("air_drag"),
            thickness=np.array([h.thickness or 2.0 * rest_height for h in hypotheses])[numbers // k],
        ),
    )  # fmt: skip
    uv = np.array(candidates, dtype=float)
    if is_turned(rectangle):
        uv[:, 1] = 1.0 - uv[:, 1]
    at = uv * cells
    start = np.asarray(body.vertices)[0]
    where: np.ndarray | SurfacePoints
    if isinstance(rectangle, ClothOutline):
        points, begin = grips_on(rectangle, np.asarray(candidates, dtype=float), cloth)
        where = _one_each(points, numbers % k)
    elif np.abs(at - np.round(at)).max() < 1e-6:
        vertex = np.round(at[:, 1]).astype(int) * (cells[0] + 1) + np.round(at[:, 0]).astype(int)
        where = vertex[numbers % k, None]
        begin = start[vertex]
    else:
        points = cloth.at(uv[:, 0], uv[:, 1])
        begin = points.positions(start, np.asarray(body.faces))
        where = _one_each(points, numbers % k)
    ways = paths_of_hands(begin, hand, hypotheses, lift_seconds, hand_std, hand_path)
    if state is not None:
        dynamics_of(body).load_worlds(np.arange(len(numbers)), state)
    futures.grip(body, where, to=Path(ways.times - elapsed, ways.positions[numbers], None, "linear"))
    return Futures(futures, body, world, k, discretisation)


def _one_each(points: SurfacePoints, which: np.ndarray) -> SurfacePoints:
    """Return for each world one of k points, ``which`` (worlds,)."""
    return SurfacePoints(points.faces[which], points.barycentric[which]).per_world()


def imagine_picks(
    rectangle: ClothRectangle,
    candidates: np.ndarray,
    grid: tuple[int, int],
    discretisation: Discretisation,
    *,
    table: Table,
    hand: np.ndarray,
    rest_height: float,
    device: str,
    lift_seconds: float = LIFT_SECONDS,
    engine: str = "nuno",
    hand_std: float = 0.0,
    hand_path: np.ndarray | None = None,
) -> Futures:
    """Pick the cloth at every candidate under every hypothesis, move it to the hand and let it come to rest.

    Args:
        rectangle: The cloth before.
        candidates: (k, 2) float, (u, v) in [0, 1] along the longer and shorter side from C00.
        grid: Candidates along both sides, where they form a grid: the mesh gets vertices there.
        discretisation: Mesh, step, hypotheses.
        table: The table.
        hand: (3,) float, where the picked point ends [m].
        rest_height: Height of the cloth's middle surface above the table [m].
        device: Where to simulate.
        lift_seconds: Duration of the hand's motion [s].
        engine: What moves the cloths.
        hand_std: Standard deviation of where the hand is [m], by which hypotheses may be off.
        hand_path: (k, 3) float, where the hand went [m], at even times; None: as each hypothesis says.
    """
    begin = partial(
        begin_picks, rectangle, candidates, grid, discretisation, table=table, hand=hand, rest_height=rest_height,
        device=device, lift_seconds=lift_seconds, engine=engine, hand_std=hand_std, hand_path=hand_path,
    )  # fmt: skip
    futures = begin()
    futures.world.run(lift_seconds, progress=False)
    _settle(futures, begin, lift_seconds, device == "cpu" and engine == "nuno")
    return futures


def _settle(futures: Futures, begin: Callable[..., Futures], elapsed: float, may_leave: bool) -> None:
    """Let cloths come to rest; see `nuno.estimate.coming_to_rest`.

    Args:
        futures: The cloths, lifted.
        begin: Begins the worlds of some ``numbers``.
        elapsed: Since they were begun [s].
        may_leave: Whether those at rest leave the batch.
    """
    batch, settled, longest = futures, 0.0, futures.discretisation.settle_seconds
    resting = ComingToRest(futures.world.world_count)
    over = False
    while not over:
        batch.world.run(LOOK_SECONDS, progress=False)
        settled += LOOK_SECONDS
        over = resting.look(_speeds(batch.body)) or settled >= longest
        before = resting.going
        stay = np.zeros(len(before), dtype=bool) if over else resting.leave() if may_leave else None
        if stay is None:
            continue
        state = dynamics_of(batch.body).state()
        if batch is not futures:
            dynamics_of(futures.body).load_worlds(before[~stay], {name: of[~stay] for name, of in state.items()})
        if not over:
            on = {name: of[stay] for name, of in state.items()}
            batch = begin(numbers=resting.going, elapsed=elapsed + settled, state=on)


def rest_speed(body: Body) -> float:
    """The 90th percentile over the worlds of a cloth's root mean square speed [m/s]."""
    return slow_part(_speeds(body))


def _speeds(body: Body) -> np.ndarray:
    """(worlds,) float, a cloth's root mean square speeds [m/s]."""
    dynamics = dynamics_of(body)
    if isinstance(dynamics, ParticleDynamics):
        return mean_speeds(*solver_of(body).velocities_apart())
    return mean_speeds(*np.moveaxis(dynamics.velocities(body), -1, 0))
