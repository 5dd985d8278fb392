"""Imagined picks as the camera would see them, compared with the image: silhouettes and pattern, at several turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.extent import regions_of
from nuno.camera.image_region import Region, View, view
from nuno.camera.table import Table
from nuno.estimate import pattern, similarity
from nuno.estimate.futures import DRAWN_THICKNESS, Futures
from nuno.estimate.pattern import Pattern, begin_pattern
from nuno.estimate.rotations import STILL, UNMOVED, Pose, turn, view_of_turned
from nuno.estimate.similarity import Silhouette, begin_scores
from nuno.plans.cpu_threads import core_count

MARGIN = 4
"""[px] around a cloth's vertices: it is drawn thicker than they tell."""

Scores = dict[str, np.ndarray]
Ground = tuple[wp.array, wp.array] | None


def score_futures(
    futures: Futures, camera: Camera, real: Silhouette, table: Table, *, pattern: Pattern | None = None,
    turns: Sequence[float] | np.ndarray = (0.0,), shifts: np.ndarray | None = None, hand: ArrayLike = STILL,
    coarse: tuple[Camera, Silhouette] | None = None,
) -> Scores:  # fmt: skip
    """Draw every future's cloth as the camera would see it, and compare it with the real silhouette and pattern.

    Args:
        futures: The imagined picks.
        camera: The camera at the silhouette's resolution.
        real: The real silhouette.
        table: The table.
        pattern: The cloth's pattern; None where there are no images: then "pattern" is 0 for all.
        turns: (t,) angles [rad] by which the futures are turned before they are compared.
        shifts: (t, 3) how far they are moved after each turn [m]; None is not at all.
        hand: (3,) the point about whose vertical they are turned [m].
        coarse: The camera and the silhouette at a lower resolution, with which moved futures are compared; None is
            the same for all.

    Returns:
        The scores by name, (turns, hypotheses, candidates) each; "chamfer" in pixels of ``camera``.
    """
    shape = (len(futures.discretisation.hypotheses), futures.candidates)
    device = futures.world.device
    moves = np.zeros((len(turns), 3)) if shifts is None else shifts
    poses = [Pose(float(a), (float(s[0]), float(s[1]), float(s[2]))) for a, s in zip(turns, moves, strict=True)]
    positions = futures.positions
    faces = _on_device(futures.body.faces, wp.vec3i, device)
    finite = futures.finite.ravel()
    seen = {pose: (camera, real) if coarse is None or pose == UNMOVED else coarse for pose in poses}
    regions = regions_of(positions, [view_of_turned(seen[p][0], hand, *p) for p in poses], margin=MARGIN)
    around = dict(zip(poses, regions, strict=True))
    ground = _ground(futures, table, device)
    compare = None if pattern is None else _pattern_comparison(futures, positions, faces, pattern, ground, hand)

    def begin(pose: Pose) -> Callable[[], Scores]:
        seen_by, silhouette = seen[pose]
        keys = _drawn(positions, faces, seen_by, around[pose], ground, pose, hand)
        outline = begin_scores(keys, silhouette, region=around[pose])
        inside = None if compare is None else compare(pose)

        def wait() -> Scores:
            scores = outline()
            del scores["centroid"], scores["area"]  # which are in other pixels
            scores["chamfer"] = scores["chamfer"] * (camera.fx / seen_by.fx)
            scores["pattern"] = np.zeros(len(finite)) if inside is None else np.where(finite, inside(), 0.0)
            return {name: value.reshape(shape) for name, value in scores.items()}

        return wait

    for silhouette in (real,) if coarse is None else (real, coarse[1]):
        silhouette.on(device)  # here, for every thread would do it for itself
    found = _at_each(begin, poses, device)
    return {name: np.stack([scores[name] for scores in found]) for name in found[0]}


def _at_each(begin: Callable[[Pose], Callable[[], Scores]], poses: list[Pose], device: str) -> list[Scores]:
    """The scores at every pose: on CUDA all are begun before any is waited for, on the CPU each core takes one."""
    cores = core_count()
    if min(cores, len(poses)) == 1 or not wp.get_device(device).is_cpu:
        return [wait() for wait in [begin(pose) for pose in poses]]
    for module in (raster, similarity, pattern):
        module.load(device)
    with ThreadPoolExecutor(min(cores, len(poses))) as threads:
        # what is not moved takes longest, so it goes first
        waiting = {p: threads.submit(lambda p: begin(p)(), p) for p in sorted(poses, key=lambda p: p != UNMOVED)}
        return [waiting[pose].result() for pose in poses]


def _pattern_comparison(
    futures: Futures, positions: wp.array, faces: wp.array, pattern: Pattern, ground: Ground, hand: ArrayLike
) -> Callable[[Pose], Callable[[], np.ndarray]]:
    """Return what scores, at a pose, how well the pattern that every future carries explains the image.

    It returns a function that waits for the answer, (worlds,) float.
    """
    device: Any = positions.device
    layer = _table_layer(ground, view(pattern.camera, pattern.region), raster.LAST_LABEL, device, ids=True)
    uv = pattern.rectangle.fractions(np.asarray(futures.origin.find(futures.body.name).vertices))
    pattern.on(device)  # here, for every thread would do it for itself

    def begin(pose: Pose) -> Callable[[], np.ndarray]:
        keys = raster.key_images(positions.shape[0], pattern.region, device, ids=True)
        raster.clear(keys, layer)
        # light is fitted in the frame of the cloth, which is turned as a whole
        turned = replace(pattern, camera=view_of_turned(pattern.camera, hand, *pose))
        raster.draw(keys, positions, faces, view(turned.camera, pattern.region), None)
        return begin_pattern(keys, positions, faces, uv, turned)

    return begin


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
    positions = futures.positions
    faces = _on_device(futures.body.faces, wp.vec3i, positions.device)
    (region,) = regions_of(positions, [view_of_turned(camera, hand, angle)], margin=MARGIN)
    ground = _ground(futures, table, positions.device)
    return _drawn(positions, faces, camera, region, ground, Pose(angle), hand), region


def masks_of_turned(
    futures: Futures, worlds: np.ndarray, turns: np.ndarray, camera: Camera, table: Table, hand: ArrayLike,
    shifts: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Masks (k, h, w) bool of worlds (k,) of a batch, each at a turn (k,) [rad] and shift (k, 3) [m] of its own."""
    positions = futures.positions
    moved = np.stack([turn(p, hand, a) for p, a in zip(positions.numpy()[worlds], turns, strict=True)])
    moved = moved if shifts is None else moved + shifts[:, None]
    turned = _on_device(moved, wp.vec3, positions.device)
    (region,) = regions_of(turned, [camera], margin=MARGIN)
    faces = _on_device(futures.body.faces, wp.vec3i, positions.device)
    keys = _drawn(turned, faces, camera, region, _ground(futures, table, positions.device))
    masks = np.zeros((len(worlds), camera.height, camera.width), dtype=bool)
    part = raster.masks_of(keys).numpy()
    masks[:, region.y0 : region.y0 + region.height, region.x0 : region.x0 + region.width] = part
    return masks


def _ground(futures: Futures, table: Table, device: Any) -> Ground:
    """The table's triangles on the device, where its extents are known."""
    if table.half_extents is None:
        return None
    body = futures.origin.find("table")
    return _on_device(np.asarray(body.vertices)[None], wp.vec3, device), _on_device(body.faces, wp.vec3i, device)


def _drawn(
    positions: wp.array, faces: wp.array, camera: Camera, region: Region, ground: Ground, pose: Pose = UNMOVED,
    hand: ArrayLike = STILL,
) -> wp.array:  # fmt: skip
    device: Any = positions.device
    keys = raster.key_images(positions.shape[0], region, device)
    raster.clear(keys, _table_layer(ground, view(camera, region), 1, device))
    looking = view(view_of_turned(camera, hand, *pose), region)
    raster.draw(keys, positions, faces, looking, 0, thickness=DRAWN_THICKNESS)
    return keys


def _table_layer(ground: Ground, looking: View, label: int, device: Any, *, ids: bool = False) -> wp.array:
    """A key image of the table alone, or of nothing."""
    layer = raster.key_images(1, Region(0, 0, looking.width, looking.height), device, ids=ids)
    if ground is not None:
        raster.draw(layer, *ground, looking, label)
    return layer


def _on_device(values: ArrayLike, dtype: Any, device: Any) -> wp.array:
    kind = np.int32 if dtype is wp.vec3i else np.float32
    return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=device)
