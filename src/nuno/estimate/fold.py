"""Replaying a fold: a cloth from one image, moved as two hands moved it, as the experiment of Ueda et al. does.

The state that comes out tells what vision alone cannot see: which parts lie under which.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, check_mask, read_image
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.camera.segmentation import segment_after, segment_before
from nuno.camera.table import Table
from nuno.errors import ClothNotFoundError, InvalidInputError
from nuno.estimate.fold_result import FoldResult
from nuno.estimate.fold_view import draw_masks, hand_spheres
from nuno.estimate.futures import table_world
from nuno.estimate.hand_path import HandPath
from nuno.estimate.hand_sight import disc, hands_seen
from nuno.estimate.hypotheses import cell_counts
from nuno.estimate.imagined_fold import ImaginedFold, imagine_fold
from nuno.estimate.pick_settings import MAX_HAND_RADIUS, MAX_REST_HEIGHT, check_table
from nuno.kernels.compile_watch import Stages, compiling_watched
from nuno.materials import Cloth
from nuno.plans.cpu_threads import core_count
from nuno.validation import checked, count, finite_array, number
from nuno.world.device import checked_device, found_device
from nuno.world.progress import with_bar

log = logging.getLogger(__name__)

MATERIALS = ("towel", "napkin", "interlock", "canvas")
"""Presets of ``Cloth`` from 8e-6 to 2e-4 N m of bending rigidity and from 0.15 to 0.35 kg/m2."""
STIFF = (4e-4, 1e-3)
"""[N m] Bending rigidities that are tried beside the presets', each with both frictions."""
STIFF_FRICTIONS = (0.3, 0.6)
STIFF_DENSITY = 0.3
"""[kg/m2]"""
AIR_DRAGS = (1.0, 5.0)
"""[1/s] Each preset is replayed with both: how fast a sheet sinks onto another depends on the air that it must push
out, of which little is known, and on it where the layers come to lie."""
STRETCH = 3000.0
"""[N/m] Of the presets here. Their nominal 1000 N/m lets an edge between two hands sag 1.4 times as deep: a yarn of
stiffness EA that bears a load w over its length L sags by about L (w / EA)^(1/3)."""
REACH = 0.01
"""[m] How far beyond its radius a hand takes hold: what a corner measured in an image, and a tracked hand, are off."""
HAND_MARGIN = 1.0
"""[px] around a hand that count neither as cloth nor as background."""
SEEING = 8
"""Images that are looked at at once, at most: beyond that Python's lock is what they wait for."""
LOW_AGREEMENT = 0.8
"""Overlap below which a frame is named in a warning."""
LOW_MEAN = 0.93
"""Mean overlap of the best material below which a warning says that none fits well."""
REST_SPEED = 0.05
"""[m/s] Root mean square speed over which a cloth is said to be still moving."""

Picture = ArrayLike | str | FilePath


@compiling_watched()
@checked
def replay_fold(
    first_image: Picture | None,
    hands: Sequence[HandPath],
    *,
    camera: Camera | Mapping[str, Any],
    table_height: float,
    table_half_extents: Sequence[float] | None = None,
    table_centre: Sequence[float] | None = None,
    table_thickness: float = 0.04,
    frame_times: ArrayLike | None = None,
    images: Mapping[int, Picture] | None = None,
    masks: Mapping[int, Picture] | None = None,
    materials: Sequence[str] | Mapping[str, Cloth] | None = None,
    rest_height: float = 0.0025,
    hand_radius: float = 0.014,
    first_mask: ArrayLike | None = None,
    hint: ArrayLike | None = None,
    rectangle: ClothRectangle | None = None,
    cells: int = 20,
    substeps: int = 14,
    device: str = "auto",
    progress: bool | None = None,
) -> FoldResult:
    """Replay how hands folded a cloth, and tell how it lies.

    The cloth's rectangle is measured in the first image, in which it lies flat. Each hand takes, as its hold begins,
    the point of the cloth that is nearest, and leads it along its path until it lets go. All materials are replayed in
    one batch; the one whose silhouettes agree best with the video is kept.

    Args:
        first_image: RGB image (h, w, 3) uint8 of the cloth before, or its path; None where ``rectangle`` is given.
        hands: Their paths, on one clock with ``frame_times``.
        camera: The camera, or the ``camera`` entry of an input.json.
        table_height: z of the table top [m].
        table_half_extents: Half sizes of the top along x and y [m]; None: it is taken as endless.
        table_centre: x, y of the top's middle [m].
        table_thickness: Thickness of the top [m].
        frame_times: (k,) [s] of the video's frames, increasing; None: the times of the hands.
        images: RGB images, or their paths, by index of the frame; those there are.
        masks: True masks (h, w) of the cloth, or paths of mask images, by index of the frame. Where there is none but
            an image, the cloth is looked for in the image.
        materials: Names of ``Cloth`` presets, which get a stretch stiffness of 3000 N/m and twice ``rest_height`` as
            thickness, each with two values of air drag; or materials by name, which are taken as they are. None is
            four limp presets (`MATERIALS`), and stiff cloths of two rigidities with two frictions (`STIFF`).
        rest_height: Height of the cloth's middle surface above the table [m].
        hand_radius: Radius of what hides the cloth around a hand [m].
        first_mask: (h, w) the cloth in the first image, instead of looking for it.
        hint: A pixel (u, v) on the cloth in the first image, or a box (u0, v0, u1, v1) around it.
        rectangle: The cloth before, instead of measuring it.
        cells: Cells along the cloth's longer side.
        substeps: Substeps of 1/60 s.
        device: "auto", "cpu", "cuda:0" ...
        progress: Progress bars; None shows them on a terminal.

    Raises:
        InvalidInputError: a value that cannot be used; no hand holds, or none touches the cloth.
        ImageError: an image that cannot be read or is not of the camera's size.
        ClothNotFoundError: no cloth in the first image.
        EstimationError: what lies there is no rectangle.
        SimulationDiverged: a state stopped being finite.
    """
    stages = Stages("read", "see", "compile", "imagine", "segment", "compare")
    camera = camera if isinstance(camera, Camera) else Camera.from_dict(camera)
    table = check_table(table_height, table_half_extents, table_centre, table_thickness)
    paths = _checked_hands(hands)
    times = _frame_times(frame_times, paths)
    number("rest_height", rest_height, above=0.0, high=MAX_REST_HEIGHT)
    number("hand_radius", hand_radius, low=0.0, high=MAX_HAND_RADIUS)
    named = _materials(materials, rest_height)
    count("cells", cells, low=4)
    count("substeps", substeps)
    device = found_device(checked_device(device))
    before = _picture(first_image, camera, "the first image")
    seen_images = {k: _picture(v, camera, f"the image of frame {k}") for k, v in _by_frame("images", images, times)}
    given = {k: _mask(v, camera, f"the mask of frame {k}") for k, v in _by_frame("masks", masks, times)}
    stages.end("read")

    lying = None if first_mask is None else check_mask(first_mask, camera, "first_mask")
    if lying is None and before is not None:
        lying = segment_before(before, camera, table, hint=hint)
    if rectangle is None:
        if lying is None:
            raise InvalidInputError("the first image is needed, or first_mask, or rectangle")
        rectangle = fit_rectangle(lying, before, camera, table.height + rest_height)
    stages.end("see")

    size = cell_counts(rectangle.long_m, rectangle.short_m, cells, (2, 2))
    world, cloth = table_world(rectangle, table, size, device=device, substeps=substeps)
    fold = imagine_fold(
        world, cloth, paths, list(named.values()), begin=float(times[0]), end=float(times[-1]),
        reach=hand_radius + REACH,
    )  # fmt: skip
    stages.end("imagine")

    warnings = [*rectangle.warnings, *_hold_warnings(fold, hand_radius + REACH)]
    at = np.stack([hand.at(times) for hand in paths], axis=1)
    held = np.array([[hand.holds_at(t) for hand in paths] for t in times])
    there = hands_seen(seen_images, camera, at, held, hand_radius, before, lying)
    real = dict(given)
    if before is not None and lying is not None:
        looked_for = {k: fold.at(times[[k]], 0)[0] for k in seen_images if k not in given}
        real |= _segmented(seen_images, before, lying, camera, table, looked_for, warnings, progress)
    stages.end("segment")

    faces = np.asarray(fold.body.faces)
    spheres = hand_spheres(at, there, max(hand_radius, 1e-4))
    around = {k: _around(camera, at[k], there[k], hand_radius) for k in real}
    scene: dict[str, Any] = {"table": world.find("table"), "device": device}

    def agreement(w: int) -> dict[int, float]:
        if not real:
            return {}
        rows = sorted(real)
        drawn = draw_masks(fold.at(times[rows], w), faces, camera, hands=(spheres[0][rows], spheres[1]), **scene)
        return {k: overlap(mask, real[k], around[k]) for k, mask in zip(rows, drawn, strict=True)}

    agreements = [agreement(w) for w in range(len(named))]
    scores = {
        name: float(np.mean(list(a.values()))) if a else np.nan for name, a in zip(named, agreements, strict=True)
    }
    best = int(np.nanargmax(list(scores.values()))) if real else 0
    if not real:
        warnings.append(f"no frame to compare with, so the first material, {next(iter(named))}, was kept")
    vertices = fold.at(times, best)
    drawn = _in_pieces(vertices, faces, camera, spheres, scene)
    if real and scores[list(named)[best]] < LOW_MEAN:
        warnings.append(
            f"even the best material, {list(named)[best]}, agrees with the video by {scores[list(named)[best]]:.2f} "
            "only, in the mean: materials= takes others; are the hands' paths, the camera and the table right?"
        )
    low = [k for k, value in agreements[best].items() if value < LOW_AGREEMENT]
    if low:
        warnings.append(f"low agreement (overlap under {LOW_AGREEMENT}) in frames {', '.join(map(str, low))}")
    speed = _last_speed(fold, best)
    if speed > REST_SPEED:
        warnings.append(f"the cloth still moves at the last frame, by {speed:.2f} m/s")
    stages.end("compare")
    for warning in warnings:
        log.warning("%s", warning)
    return FoldResult(
        times=times, vertices=vertices, faces=faces, masks=drawn, real=real, agreement=agreements[best],
        given=frozenset(given), material_name=list(named)[best], material=list(named.values())[best], scores=scores,
        rectangle=rectangle, camera=camera, hands=paths, hands_at=at, hands_seen=there, hand_radius=hand_radius,
        seconds=stages.total(), warnings=warnings, fold=fold, best_index=best, images=seen_images, first_image=before,
    )  # fmt: skip


def overlap(imagined: np.ndarray, real: np.ndarray, ignored: np.ndarray) -> float:
    """Return intersection over union of two masks (h, w), 1 where both are empty; ``ignored`` pixels do not count."""
    either = (imagined | real) & ~ignored
    return float((imagined & real & ~ignored).sum() / either.sum()) if either.any() else 1.0


def _checked_hands(hands: Any) -> tuple[HandPath, ...]:
    paths = tuple(hands) if isinstance(hands, Sequence) else ()
    if not paths or not all(isinstance(hand, HandPath) for hand in paths):
        raise InvalidInputError(f"hands must be one or more HandPath, got {hands!r}")
    return paths


def _frame_times(given: Any, hands: Sequence[HandPath]) -> np.ndarray:
    times = np.unique(np.concatenate([hand.times for hand in hands]))
    if given is not None:
        times = finite_array("frame_times", given, ("k",))
    if len(times) < 2 or (np.diff(times) <= 0.0).any():
        raise InvalidInputError("frame_times must be two or more times that increase")
    return times


def _materials(given: Any, rest_height: float) -> dict[str, Cloth]:
    if isinstance(given, Mapping):
        named = dict(given)
    else:
        names = MATERIALS if given is None else (given,) if isinstance(given, str) else tuple(given)
        same: dict[str, Any] = dict(stretch_stiffness=STRETCH, thickness=2.0 * rest_height)
        named = {
            f"{name}, air drag {drag:g}/s": replace(Cloth.preset(name), air_drag=drag, **same)
            for name in names
            for drag in AIR_DRAGS
        }
        if given is None:
            named |= {
                f"stiff, {rigidity:g} N m, friction {friction:g}, air drag {drag:g}/s": Cloth(
                    area_density=STIFF_DENSITY, bending_rigidity=rigidity, friction=friction, air_drag=drag, **same
                )
                for rigidity in STIFF
                for friction in STIFF_FRICTIONS
                for drag in AIR_DRAGS
            }
    if not named or not all(isinstance(material, Cloth) for material in named.values()):
        raise InvalidInputError(f"materials must be names of presets, or Cloth by name, got {given!r}")
    return named


def _by_frame(name: str, given: Any, times: np.ndarray) -> list[tuple[int, Any]]:
    if given is None:
        return []
    if not isinstance(given, Mapping):
        raise InvalidInputError(f"{name} must be a mapping from the frame's index, got {type(given).__name__}")
    wrong = [k for k in given if not isinstance(k, int | np.integer) or not 0 <= k < len(times)]
    if wrong:
        raise InvalidInputError(f"{name} has frames {wrong}; the video has frames 0 to {len(times) - 1}")
    return sorted((int(k), value) for k, value in given.items())


def _picture(image: Any, camera: Camera, name: str) -> Any:
    if image is None:
        return None
    return check_image(read_image(image) if isinstance(image, str | FilePath) else image, camera, name)


def _mask(mask: Any, camera: Camera, name: str) -> np.ndarray:
    if isinstance(mask, str | FilePath):
        mask = read_image(mask)[..., 0]
    return check_mask(mask, camera, name)


def _hold_warnings(fold: ImaginedFold, reach: float) -> list[str]:
    return [
        f"hand {hold.hand} holds from t = {hold.begin:.2f} s, but is {hold.away:.3f} m from the cloth then (it takes "
        f"what is within {reach:.3f} m), so it moved nothing"
        for hold in fold.holds
        if not hold.held_cloth
    ]


def _segmented(
    images: Mapping[int, np.ndarray], before: np.ndarray, lying: np.ndarray, camera: Camera, table: Table,
    near: Mapping[int, np.ndarray], warnings: list[str], progress: bool | None,
) -> dict[int, np.ndarray]:  # fmt: skip
    """The cloth in images, by frame, near vertices (n, 3) [m] that a replay has; where there is none, a warning."""

    def look(frame: int) -> np.ndarray | ClothNotFoundError:
        at = near[frame].mean(axis=0)
        try:
            return segment_after(images[frame], camera, table, before, lying, at, hand_radius=0.0)
        except ClothNotFoundError as error:
            return error

    found = {}
    # each image by itself, on a thread a core: NumPy and OpenCV let others run meanwhile
    with ThreadPoolExecutor(min(max(len(near), 1), core_count(), SEEING)) as threads:
        looking = {frame: threads.submit(look, frame) for frame in near}
        for frame in with_bar(list(near), "looking for the cloth", progress, "frame"):
            seen = looking[frame].result()
            if isinstance(seen, ClothNotFoundError):
                warnings.append(f"frame {frame} is not compared: {seen}")
            else:
                found[frame] = seen
    return found


def _around(camera: Camera, positions: np.ndarray, there: np.ndarray, radius: float) -> np.ndarray:
    """(h, w) bool, the pixels at the hands, which the images show neither as cloth nor as background."""
    ignored = np.zeros((camera.height, camera.width), dtype=bool)
    for centre in positions[there]:
        ignored |= disc(camera, centre, radius, HAND_MARGIN)
    return ignored


def _in_pieces(vertices: np.ndarray, faces: np.ndarray, camera: Camera, spheres: Any, scene: Any) -> np.ndarray:
    """The masks of all frames, (k, h, w) bool, some at a time: key images take four bytes a pixel."""
    size = max(1, 2**27 // (4 * camera.width * camera.height))
    parts = [slice(k, k + size) for k in range(0, len(vertices), size)]
    return np.concatenate(
        [draw_masks(vertices[p], faces, camera, hands=(spheres[0][p], spheres[1]), **scene) for p in parts]
    )


def _last_speed(fold: ImaginedFold, world: int) -> float:
    moved = fold.states[-1, world] - fold.states[-2, world]
    return float(np.sqrt((moved**2).sum(axis=-1).mean()) / (fold.times[-1] - fold.times[-2]))
