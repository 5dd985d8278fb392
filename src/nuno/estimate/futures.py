"""Imagined picks: one world for every candidate and hypothesis, lifted, let come to rest, and seen by the camera."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.bodies import box, plane, sheet
from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.camera.view import Region, View, view
from nuno.dynamics import ParticleDynamics
from nuno.estimate import appearance, similarity
from nuno.estimate.appearance import Pattern, compare_pattern
from nuno.estimate.hypotheses import Discretisation, cell_counts
from nuno.estimate.similarity import Silhouette, score_masks
from nuno.estimate.turns import turn, view_of_turned
from nuno.materials import Cloth
from nuno.path import Path
from nuno.surface import SurfacePoints
from nuno.world import World

if TYPE_CHECKING:
    from nuno.body import Body

LIFT_SECONDS = 1.5
"""[s] How long the hand's motion takes where it is not known."""
SETTLE_SECONDS = 2.5
"""[s] At most so long the cloth may take to come to rest in the hand."""
REST_SPEED = 0.03
"""[m/s] Below this root mean square speed a cloth counts as at rest: under 1 mm between two looks at it."""
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
        return solver_of(self.body).finite().reshape(len(self.discretisation.spread), self.candidates)


def solver_of(body: Body) -> Any:
    """The solver of a body that has dynamics."""
    assert isinstance(body._dynamics, ParticleDynamics)
    return body._dynamics.solver


def table_world(
    rectangle: ClothRectangle, table: Table, cells: tuple[int, int], *, device: str, substeps: int
) -> tuple[World, Body]:
    """A world with the table, the floor and the cloth as it lay before; the cloth is static."""
    world = World(device=device, substeps=substeps)
    if table.half_extents is not None:
        half, centre = table.half_extents, table.centre or (0.0, 0.0)
        size = (2 * half[0], 2 * half[1], table.thickness)
        world.add(box(size, name="table", position=(*centre, table.height - table.thickness / 2)))
        world.add(plane(name="floor"))
    else:
        world.add(plane(name="table", position=(0.0, 0.0, table.height)))
    along = rectangle.corners[1] - rectangle.corners[0]
    cloth = sheet((rectangle.long_m, rectangle.short_m), cells=cells, name=BODY_NAME, position=rectangle.centre)
    cloth.rotate(math.atan2(along[1], along[0]), (0.0, 0.0, 1.0), wrt="world")
    world.add(cloth)
    return world, cloth


def is_turned(rectangle: ClothRectangle) -> bool:
    """Whether CJ lies clockwise of CI seen from above, so that j runs against the sheet's own y."""
    along, across = (rectangle.corners[k] - rectangle.corners[0] for k in (1, 3))
    return bool(along[0] * across[1] - along[1] * across[0] < 0)


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
        lift_seconds: Duration of the hand's motion [s], on a straight line with minimum jerk.
    """
    cells = cell_counts(rectangle.long_m, rectangle.short_m, discretisation.cells, grid)
    world, cloth = table_world(rectangle, table, cells, device=device, substeps=discretisation.substeps)
    k, spread = len(candidates), discretisation.spread
    count = k * len(spread)

    def each(name: str) -> np.ndarray:
        return np.repeat([getattr(h, name) for h in spread], k)

    futures = world.imagine(count)
    body = futures.find(cloth.name)
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
            thickness=np.repeat([h.thickness or 2.0 * rest_height for h in spread], k),
        ),
    )  # fmt: skip
    uv = np.array(candidates, dtype=float)
    if is_turned(rectangle):
        uv[:, 1] = 1.0 - uv[:, 1]
    at = uv * cells
    start = np.asarray(body.vertices)[0]
    if np.abs(at - np.round(at)).max() < 1e-6:
        vertex = np.round(at[:, 1]).astype(int) * (cells[0] + 1) + np.round(at[:, 0]).astype(int)
        where: np.ndarray | SurfacePoints = np.tile(vertex, len(spread))[:, None]
        begin = start[vertex]
    else:
        points = cloth.at(uv[:, 0], uv[:, 1])
        begin = points.positions(start, np.asarray(body.faces))
        where = SurfacePoints(
            np.tile(points.faces, len(spread)), np.tile(points.barycentric, (len(spread), 1))
        ).per_world()
    ends = np.broadcast_to(np.asarray(hand, dtype=float), begin.shape)
    path = Path(
        np.array((0.0, lift_seconds)),
        np.tile(np.stack([begin, ends], axis=1), (len(spread), 1, 1)),
        None,
        "minimum_jerk",
    )
    futures.grip(body, where, to=path)
    futures.run(lift_seconds, progress=False)
    settled, chunk = 0.0, 0.25
    while settled < SETTLE_SECONDS:
        futures.run(chunk, progress=False)
        settled += chunk
        if rest_speed(body) < REST_SPEED:
            break
    return Futures(futures, body, world, k, discretisation)


def rest_speed(body: Body) -> float:
    """The 90th percentile over the worlds of a cloth's root mean square speed [m/s]."""
    speeds = np.sqrt((solver_of(body).velocities() ** 2).sum(axis=-1).mean(axis=-1))
    return float(np.percentile(speeds, 90))


def score_futures(
    futures: Futures, camera: Camera, real: Silhouette, table: Table, *, pattern: Pattern | None = None,
    turns: Sequence[float] | np.ndarray = (0.0,), hand: ArrayLike = (0.0, 0.0, 0.0),
    coarse: tuple[Camera, Silhouette] | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Draw every future's cloth as the camera would see it, and compare it with the real silhouette and pattern.

    Args:
        futures: The imagined picks.
        camera: The camera at the silhouette's resolution.
        real: The real silhouette.
        table: The table.
        pattern: The cloth's pattern; None where there are no images: then "pattern" is 0 for all.
        turns: Angles [rad] by which the futures are turned before they are compared.
        hand: (3,) the point about whose vertical they are turned [m].
        coarse: The camera and the silhouette at a lower resolution, with which turned futures are compared; None is
            the same for all.

    Returns:
        The scores by name, (turns, hypotheses, candidates) each; "chamfer" in pixels of ``camera``.
    """
    shape = (len(futures.discretisation.spread), futures.candidates)

    def compare(angle: float) -> dict[str, np.ndarray]:
        seen_by, silhouette = (camera, real) if coarse is None or angle == 0.0 else coarse
        keys, region = draw_futures(futures, seen_by, table, angle, hand)
        scores = score_masks(keys, silhouette, region=region)
        del scores["centroid"], scores["area"]  # which are in other pixels
        scores["chamfer"] = scores["chamfer"] * (camera.fx / seen_by.fx)
        scores["pattern"] = (
            np.zeros(keys.shape[0]) if pattern is None else score_pattern(futures, pattern, table, angle, hand)
        )
        return {name: value.reshape(shape) for name, value in scores.items()}

    device = futures.world.device
    for silhouette in (real,) if coarse is None else (real, coarse[1]):
        silhouette.on(device)  # here, for every thread would do it for itself
    found = _at_each(compare, turns, device)
    return {name: np.stack([scores[name] for scores in found]) for name in found[0]}


def _at_each(compare: Callable[[float], Any], turns: Sequence[float] | np.ndarray, device: str) -> list[Any]:
    """What ``compare`` says at every turn; on the CPU a thread a core takes one after the other."""
    cores = len(os.sched_getaffinity(0))
    if min(cores, len(turns)) == 1 or not wp.get_device(device).is_cpu:
        return [compare(float(angle)) for angle in turns]
    for module in (raster, similarity, appearance):
        module.load(device)
    with ThreadPoolExecutor(min(cores, len(turns))) as threads:
        # 0 takes longest, so it goes first
        waiting = {angle: threads.submit(compare, angle) for angle in sorted(map(float, turns), key=abs)}
        return [waiting[float(angle)].result() for angle in turns]


def score_pattern(
    futures: Futures, pattern: Pattern, table: Table, angle: float = 0.0, hand: ArrayLike = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """How well the cloth's pattern, carried along by every future, explains the image after.

    Returns:
        (hypotheses * candidates,) float, see `nuno.estimate.appearance`; 0 where a future is not finite.
    """
    positions = solver_of(futures.body).positions_on_device()
    faces = _on_device(futures.body.faces, wp.vec3i, positions.device)
    keys = raster.key_images(positions.shape[0], pattern.region, positions.device, ids=True)
    _begin_with_table(keys, futures, table, view(pattern.camera, pattern.region), raster.LAST_LABEL)
    # light is fitted in the frame of the cloth, which is turned as a whole
    turned = replace(pattern, camera=view_of_turned(pattern.camera, hand, angle))
    raster.draw(keys, positions, faces, view(turned.camera, pattern.region), None)
    lay = np.asarray(futures.origin.find(futures.body.name).vertices)
    scores = compare_pattern(keys, positions, faces, pattern.rectangle.fractions(lay), turned)
    return np.where(futures.finite.ravel(), scores, 0.0)


def draw_futures(
    futures: Futures, camera: Camera, table: Table, angle: float = 0.0, hand: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[wp.array, Region]:
    """Key images of the cloth behind the table's edge, and the part of the image that they hold.

    Args:
        futures: The imagined picks.
        camera: The camera.
        table: The table.
        angle: By how much the cloth is turned [rad] about the vertical through ``hand`` (3,) [m].
        hand: That point.
    """
    return _drawn(futures, solver_of(futures.body).positions_on_device(), camera, table, angle, hand)


def masks_of_turned(
    futures: Futures, worlds: np.ndarray, turns: np.ndarray, camera: Camera, table: Table, hand: ArrayLike
) -> np.ndarray:
    """Masks (k, h, w) bool of some worlds (k,) of a batch, each at a turn (k,) [rad] of its own."""
    positions = solver_of(futures.body).positions_on_device()
    moved = np.stack([turn(p, hand, a) for p, a in zip(positions.numpy()[worlds], turns, strict=True)])
    keys, region = _drawn(futures, _on_device(moved, wp.vec3, positions.device), camera, table)
    masks = np.zeros((len(worlds), camera.height, camera.width), dtype=bool)
    part = raster.masks_of(keys).numpy()
    masks[:, region.y0 : region.y0 + region.height, region.x0 : region.x0 + region.width] = part
    return masks


def _drawn(
    futures: Futures, positions: wp.array, camera: Camera, table: Table, angle: float = 0.0,
    hand: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[wp.array, Region]:  # fmt: skip
    turned = view_of_turned(camera, hand, angle)
    corners = positions.numpy().reshape(-1, 3)
    region = Region.around(turned, corners[np.isfinite(corners).all(axis=1)], margin=4.0)
    device: Any = positions.device
    keys = raster.key_images(positions.shape[0], region, device)
    _begin_with_table(keys, futures, table, view(camera, region), 1)
    faces = _on_device(futures.body.faces, wp.vec3i, device)
    raster.draw(keys, positions, faces, view(turned, region), 0, thickness=DRAWN_THICKNESS)
    return keys, region


def _begin_with_table(keys: wp.array, futures: Futures, table: Table, looking: View, label: int) -> None:
    """Reset key images to the table, where its extents are known."""
    device: Any = keys.device
    layer = raster.key_images(1, Region(0, 0, looking.width, looking.height), device, ids=keys.dtype == wp.int64)
    if table.half_extents is not None:
        body = futures.origin.find("table")
        points = _on_device(np.asarray(body.vertices)[None], wp.vec3, device)
        raster.draw(layer, points, _on_device(body.faces, wp.vec3i, device), looking, label)
    raster.clear(keys, layer)


def _on_device(values: ArrayLike, dtype: Any, device: Any) -> wp.array:
    kind = np.int32 if dtype is wp.vec3i else np.float32
    return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)
