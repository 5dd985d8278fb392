"""Estimating where a cloth was picked up, from two images and imagined picks of every candidate.

The experiment is that of Ueda et al. on the state of a picked-up cloth, its eq. (1) among the scores.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, check_mask, read_image
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.camera.segmentation import segment_before
from nuno.camera.table import Table, table_margin
from nuno.errors import EstimationError, InvalidInputError
from nuno.estimate.compile_ahead import compile_ahead
from nuno.estimate.futures import LIFT_SECONDS, imagine_picks
from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation
from nuno.estimate.learned import Outline, correction, outline_of
from nuno.estimate.lift_prior import SIDEWAYS, log_prior_of_lift
from nuno.estimate.pick_result import PickResult
from nuno.estimate.pick_sight import masks_of_turned, score_futures
from nuno.estimate.ranking import EVIDENCE, RANKINGS, SURE, Comparison, Ranked, rank
from nuno.estimate.rotations import TURNS, checked_turns
from nuno.estimate.seeing import IMAGE_SCALE, begin_to_see
from nuno.estimate.together import Ahead, has_room
from nuno.kernels.compile_watch import Stages, compiling_watched
from nuno.validation import finite_array, number
from nuno.world.device import checked_device, found_device
from nuno.world.progress import with_bar, with_clock

if TYPE_CHECKING:
    from nuno.estimate.futures import Futures

log = logging.getLogger(__name__)

MOST_CANDIDATES = 1024
"""Each is imagined several times, on a mesh with a vertex there: more would take hours, and memory that few have."""


@compiling_watched()
def estimate_pick(
    before: ArrayLike | str | FilePath | None,
    after: ArrayLike | str | FilePath | None,
    *,
    camera: Camera | Mapping[str, Any],
    table_height: float,
    hand: ArrayLike,
    table_half_extents: Sequence[float] | None = None,
    table_centre: Sequence[float] | None = None,
    table_thickness: float = 0.04,
    candidates: tuple[int, int] | ArrayLike = (6, 6),
    rest_height: float = 0.0025,
    hand_radius: float = 0.014,
    lift_seconds: float = LIFT_SECONDS,
    before_mask: ArrayLike | None = None,
    after_mask: ArrayLike | None = None,
    hidden: ArrayLike | None = None,
    hint: ArrayLike | None = None,
    rectangle: ClothRectangle | None = None,
    discretisations: Sequence[Discretisation] = DISCRETISATIONS,
    sure: float = SURE,
    turns: Sequence[float] = TURNS,
    learned: bool = True,
    sideways: float | None = SIDEWAYS,
    score: str = "evidence",
    device: str = "auto",
    progress: bool | None = None,
) -> PickResult:
    """Estimate where a flat cloth was picked up, from an image before and one after.

    The cloth's rectangle is measured in the image before. Then every candidate is picked in simulation under a few
    guesses at the material, on several meshes, and moved to the hand; each result is drawn as the camera would see it
    and compared with the real silhouette. Where both images are given, the cloth's pattern is carried along and
    compared too, each at several turns about the hand's vertical. What counts is how likely all this is, averaged over
    all guesses.

    Args:
        before: RGB image (h, w, 3) uint8 of the cloth flat on the table, or its path; None where ``rectangle`` or
            ``before_mask`` is given.
        after: RGB image of the cloth in the hand, or its path; None where ``after_mask`` is given.
        camera: The camera of both images, or the ``camera`` entry of an input.json.
        table_height: z of the table top [m].
        hand: (3,) where the picked point is now [m].
        table_half_extents: Half sizes of the top along x and y [m]; None: it is taken as endless.
        table_centre: x, y of the top's middle [m].
        table_thickness: Thickness of the top [m].
        candidates: A grid (n along the longer side, m along the shorter), or points (k, 2) as fractions (u, v) of the
            sides from corner C00.
        rest_height: Height of the cloth's middle surface above the table [m].
        hand_radius: Radius of what hides the cloth around the hand [m].
        lift_seconds: Duration of the hand's straight motion with minimum jerk [s].
        before_mask: (h, w) the cloth before, instead of looking for it.
        after_mask: (h, w) the cloth after, hand left out, instead of looking for it.
        hidden: (h, w) pixels of the image after that show something before the cloth, such as the robot's own arm; they
            count neither as cloth nor as background.
        hint: A pixel (u, v) on the cloth before, or a box (u0, v0, u1, v1) around it.
        rectangle: The cloth before, instead of measuring it.
        discretisations: Meshes, steps and guesses at the material, in the order in which they are run; the first
            one must look at all candidates.
        sure: The rest of them is left out once a candidate is as likely as this, where evidence ranks; 1 runs all.
        turns: Angles [rad] about the hand's vertical by which every future is turned to be compared, 0 among them;
            "chamfer", "iou" and "eq1" look at 0 only.
        learned: Whether a network that was trained on imagined picks has a say in the likelihood of silhouettes
            (`nuno.estimate.learned`); "chamfer", "iou" and "eq1" are without it.
        sideways: How far sideways the hand went, as a share of how high it went, which half of all lifts are taken to
            stay below: points about under the hand are likelier before the image after is seen
            (`nuno.estimate.lift_prior`). None takes all candidates as alike: right where the hand was led to the side
            on purpose. "chamfer", "iou" and "eq1" are without it.
        score: What ranks: "evidence" of silhouette and pattern, "silhouette" alone, "chamfer", "iou" or "eq1" (see
            `nuno.estimate.ranking`).
        device: "auto", "cpu", "cuda:0" ...
        progress: Progress bar; None shows one on a terminal.

    Raises:
        InvalidInputError: a value that cannot be used; the hand behind the camera, out of the image or under the
            table; two images that are the same.
        ImageError: an image that cannot be read or is not of the camera's size.
        ClothNotFoundError: no cloth in an image.
        EstimationError: no candidate gave a finite future.
    """
    stages = Stages("read", "see", "compile", "imagine", "compare")
    camera = camera if isinstance(camera, Camera) else Camera.from_dict(camera)
    table = Table(
        number("table_height", table_height),
        None if table_half_extents is None else _pair("table_half_extents", table_half_extents),
        None if table_centre is None else _pair("table_centre", table_centre),
        number("table_thickness", table_thickness, above=0.0),
    )
    hand_at = finite_array("hand", hand, (3,))
    _check_hand(camera, hand_at, table)
    labels, uv, grid = _candidates(candidates)
    number("rest_height", rest_height, above=0.0)
    number("lift_seconds", lift_seconds, above=0.0)
    number("sure", sure, above=0.0, high=1.0)
    if sideways is not None:
        number("sideways", sideways, above=0.0)
    if score not in RANKINGS:
        raise InvalidInputError(f"score must be one of {', '.join(RANKINGS)}, got {score!r}")
    if not discretisations or discretisations[0].best is not None:
        raise InvalidInputError("discretisations must begin with one that looks at all candidates (best=None)")
    angles = checked_turns(turns)
    if score not in EVIDENCE:
        angles = np.zeros(1)
    device = found_device(checked_device(device))

    covered = None if hidden is None else check_mask(hidden, camera, "hidden")
    image_before, image_after = _image(before, camera, "before"), _image(after, camera, "after")
    if image_before is not None and image_after is not None and np.array_equal(image_before, image_after):
        raise InvalidInputError("the image after is the image before: nothing was picked up between them")
    wait_for_kernels = compile_ahead(device)
    stages.end("read")
    mask_before = None if before_mask is None else check_mask(before_mask, camera, "before_mask")
    if mask_before is None and (rectangle is None or after_mask is None):
        if image_before is None:
            raise InvalidInputError("the image before is needed, or before_mask, or rectangle and after_mask")
        mask_before = segment_before(image_before, camera, table, hint=hint)
    if rectangle is None:
        assert mask_before is not None
        rectangle = fit_rectangle(mask_before, image_before, camera, table.height + rest_height)
    if after_mask is None and (image_after is None or image_before is None or mask_before is None):
        raise InvalidInputError("both images are needed to find the cloth after, or after_mask")
    wait_for_seen = begin_to_see(
        image_before, image_after, mask_before,
        None if after_mask is None else check_mask(after_mask, camera, "after_mask"),
        camera=camera, table=table, rectangle=rectangle, hand=hand_at, hand_radius=hand_radius, hidden=covered,
        with_pattern=score == "evidence",
        meanwhile=device != "cpu" or len(os.sched_getaffinity(0)) > 1,
    )  # fmt: skip
    stages.end("see")
    with with_clock("compiling kernels, which are kept for later runs", progress):
        wait_for_kernels()
    stages.end("compile")

    comparisons: list[Comparison] = []
    batches: list[Futures] = []
    ranked: Ranked | None = None
    before_seen = None if sideways is None else log_prior_of_lift(rectangle, uv, hand_at, sideways)
    outline: Outline | None = None
    settings: dict[str, Any] = dict(
        rectangle=rectangle, grid=grid, table=table, hand=hand_at, rest_height=rest_height, device=device,
        lift_seconds=lift_seconds,
    )  # fmt: skip
    ahead = Ahead(uv, **settings) if has_room(device) else None
    for k, discretisation in enumerate(with_bar(discretisations, "imagining", progress, "mesh")):
        chosen = np.arange(len(uv))
        if ranked is not None and discretisation.best is not None:
            chosen = ranked.plausible(discretisation.best)
        futures: Futures | None = None if ahead is None else ahead.part(discretisations[k:], chosen)
        if futures is None:
            futures = imagine_picks(candidates=uv[chosen], discretisation=discretisation, **settings)
        stages.end("imagine")
        seen = wait_for_seen()
        stages.end("see")
        values = score_futures(
            futures, seen.camera, seen.silhouette, table, pattern=seen.pattern, turns=angles, hand=hand_at,
            coarse=seen.coarse,
        )  # fmt: skip
        comparison = Comparison(
            chosen, angles, values["chamfer"] / IMAGE_SCALE, values["iou"], values["eq1"], futures.finite,
            None if seen.pattern is None else values["pattern"],
        )  # fmt: skip
        if learned and score in EVIDENCE:
            if not comparisons:
                outline = outline_of(seen.mask, seen.hidden, camera, hand_at)
            if outline is not None:
                added = correction(outline, futures, comparison, table, hand_at)
                comparison = replace(comparison, correction=added)
        comparisons.append(comparison)
        batches.append(futures)
        ranked = rank(comparisons, score, len(uv), before_seen)
        stages.end("compare")
        if ranked.settled(sure):
            break
    assert ranked is not None
    if not np.isfinite(ranked.scores).any():
        raise EstimationError("no imagined pick stayed finite; smaller steps or softer guesses are needed")
    chosen_batch, best_index, best_turn = _most_alike(comparisons, score, int(ranked.order[0]))
    masks = _masks(comparisons, batches, score, seen.camera, table, hand_at)
    best_batch, best_index = batches[chosen_batch].whole(best_index)
    stages.end("compare")
    result = PickResult(
        labels=labels, order=ranked.order, scores=ranked.scores, score_name=ranked.name,
        eq1=ranked.eq1, rectangle=rectangle, camera=camera, grid=grid, seconds=stages.total(),
        futures=best_batch, best_index=best_index, turn=best_turn, hand=hand_at, masks=masks,
        real=seen.silhouette, image_before=image_before, image_after=image_after, mask_before=mask_before,
        mask_after=seen.mask, seen_warnings=seen.warnings, sideways=sideways if score in EVIDENCE else None,
    )  # fmt: skip
    for warning in result.warnings:
        log.warning("%s", warning)
    return result


def _most_alike(comparisons: Sequence[Comparison], score: str, candidate: int) -> tuple[int, int, float]:
    """The batch, the world in it, and its turn [rad], in which a candidate looks most like the image."""
    found: list[tuple[float, int, int, float]] = []
    for k, comparison in enumerate(comparisons):
        at = np.nonzero(comparison.candidates == candidate)[0]
        if len(at):
            error = comparison.error(score)[..., at[0]]
            turn, guess = np.unravel_index(int(error.argmin()), error.shape)
            world = int(guess) * len(comparison.candidates) + int(at[0])
            found.append((float(error[turn, guess]), k, world, float(comparison.turns[turn])))
    return min(found)[1:]


def _masks(
    comparisons: Sequence[Comparison], batches: Sequence[Futures], score: str, small: Camera, table: Table,
    hand: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(k, h, w) bool, every candidate's silhouette where it looks most like the image."""
    count = len(comparisons[0].candidates)
    batch, world, turn = map(np.array, zip(*(_most_alike(comparisons, score, c) for c in range(count)), strict=True))
    masks = np.zeros((count, small.height, small.width), dtype=bool)
    for k in np.unique(batch):
        of = batch == k
        masks[of] = masks_of_turned(batches[k], world[of], turn[of], small, table, hand)
    return masks


def _image(image: Any, camera: Camera, name: str) -> np.ndarray | None:
    if image is None:
        return None
    if isinstance(image, str | FilePath):
        image = read_image(image)
    return check_image(image, camera, f"the image {name}")


def _pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    a, b = finite_array(name, value, (2,))
    return float(a), float(b)


def _check_hand(camera: Camera, hand: np.ndarray, table: Table) -> None:
    depth = float(camera.depth_of(hand))
    if depth <= 0:
        raise InvalidInputError(f"the hand at {hand.tolist()} m is {-depth:.3f} m behind the camera")
    u, v = camera.project(hand)
    if not (-camera.width < u < 2 * camera.width and -camera.height < v < 2 * camera.height):
        raise InvalidInputError(
            f"the hand at {hand.tolist()} m projects to pixel ({u:.0f}, {v:.0f}), far outside of the "
            f"{camera.width} x {camera.height} image"
        )
    if hand[2] < table.height and (table.half_extents is None or float(table_margin(table, hand[:2])) > 0.0):
        raise InvalidInputError(f"the hand at {hand.tolist()} m is below the table's top, z = {table.height:g} m")


def _candidates(candidates: Any) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Labels (k, 2), fractions (k, 2) of the sides, and the grid that the mesh's vertices should lie on."""
    if isinstance(candidates, tuple) and len(candidates) == 2 and all(isinstance(c, int) for c in candidates):
        n, m = candidates
        if n < 2 or m < 2:
            raise InvalidInputError(f"a grid of candidates needs at least 2 x 2 points, got {n} x {m}")
        if n * m > MOST_CANDIDATES:
            raise InvalidInputError(f"a grid of candidates has at most {MOST_CANDIDATES} points, got {n} x {m}")
        ij = np.stack(np.meshgrid(np.arange(n), np.arange(m), indexing="ij"), axis=-1).reshape(-1, 2)
        return ij, ij / (n - 1, m - 1), (n, m)
    uv = finite_array("candidates", candidates, ("k", 2))
    if len(uv) > MOST_CANDIDATES or uv.min() < 0 or uv.max() > 1:
        raise InvalidInputError(
            f"candidates must be up to {MOST_CANDIDATES} fractions (u, v) of the cloth's sides, each from 0 to 1"
        )
    return uv, uv, (2, 2)
