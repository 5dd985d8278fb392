"""Estimating where a cloth was picked up, from two images and imagined picks of every candidate.

The experiment is that of Ueda et al. on the state of a picked-up cloth, its eq. (1) among the scores.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.compile_ahead import compile_ahead
from nuno.estimate.focal_doubt import with_focal_of_rectangle
from nuno.estimate.futures import LIFT_SECONDS
from nuno.estimate.hand_path import HandPath
from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation
from nuno.estimate.lift_prior import HAND_STD, SIDEWAYS
from nuno.estimate.outline_candidates import with_outline_candidates
from nuno.estimate.outline_or_rectangle import SHAPES
from nuno.estimate.pick_images import PickImages, find_cloth_before, read_images
from nuno.estimate.pick_result import PickResult
from nuno.estimate.pick_settings import PickSettings, check_settings, check_table
from nuno.estimate.pick_trials import PickTrials, try_picks
from nuno.estimate.rotations import TURNS
from nuno.estimate.seeing import begin_to_see
from nuno.estimate.table_doubt import TableDoubt, with_view_of_table
from nuno.kernels.compile_watch import Stages, compiling_watched
from nuno.plans.cpu_threads import core_count
from nuno.validation import choice, number
from nuno.world.progress import with_clock

log = logging.getLogger(__name__)


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
    template: ArrayLike | None = None,
    rectangle: ClothRectangle | None = None,
    discretisations: Sequence[Discretisation] = DISCRETISATIONS,
    sure: float | None = None,
    turns: Sequence[float] = TURNS,
    learned: bool = True,
    sideways: float | None = SIDEWAYS,
    shape: str = "auto",
    spacing: float | None = None,
    hand_std: float = HAND_STD,
    hand_path: ArrayLike | HandPath | None = None,
    score: str = "evidence",
    device: str = "auto",
    engine: str = "nuno",
    progress: bool | None = None,
) -> PickResult:
    """Estimate where a flat cloth was picked up, from an image before and one after.

    The cloth's rectangle, or the outline that it has, is measured in the image before. Then every candidate is picked
    in simulation under a few guesses at the material, on several meshes, and moved to the hand; each result is drawn as
    the camera would see it and compared with the real silhouette. Where both images are given, the cloth's pattern is
    carried along and compared too, each at several turns about the hand's vertical. What counts is how likely all this
    is, averaged over all guesses.

    Args:
        before: RGB image (h, w, 3) uint8 of the cloth flat on the table, or its path; None where ``rectangle`` or
            ``before_mask`` is given.
        after: RGB image of the cloth in the hand, or its path; None where ``after_mask`` is given.
        camera: The camera of both images, or the ``camera`` entry of an input.json. Where the table's border in the
            image before tells that it is clearly turned or focused otherwise, or the outline of the cloth is a
            rectangle with another focal length alone, that is taken instead, with a warning.
        table_height: z of the table top [m]; likewise.
        hand: (3,) where the picked point is now [m].
        table_half_extents: Half sizes of the top along x and y [m]; None: it is taken as endless.
        table_centre: x, y of the top's middle [m].
        table_thickness: Thickness of the top [m].
        candidates: A grid (n along the longer side, m along the shorter), or points (k, 2) as fractions (u, v) of the
            sides from corner C00. A cloth that is no rectangle has no grid: see ``shape``.
        rest_height: Height of the cloth's middle surface above the table [m].
        hand_radius: Radius of what hides the cloth around the hand [m].
        lift_seconds: Duration of the hand's straight motion with minimum jerk [s].
        before_mask: (h, w) the cloth before, instead of looking for it.
        after_mask: (h, w) the cloth after, hand left out, instead of looking for it.
        hidden: (h, w) pixels of the image after that show something before the cloth, such as the robot's own arm; they
            count neither as cloth nor as background.
        hint: A pixel (u, v) on the cloth before, or a box (u0, v0, u1, v1) around it.
        template: (n, 2) the cloth's outline [m], where it is known, to find it by before where colours do not tell it
            from other things (see `nuno.segment_before`); its rectangle is still measured in the image.
        rectangle: The cloth before, instead of measuring it.
        discretisations: Meshes, steps and guesses at the material, in the order in which they are run; the first
            one must look at all candidates.
        sure: The rest of them is left out once a candidate is as likely as this, where evidence ranks; 1 runs all.
            None is 0.96, or 0.85 where candidates are spread over an outline.
        turns: Angles [rad] about the hand's vertical by which every future is turned to be compared, 0 among them;
            "chamfer", "iou" and "eq1" look at 0 only.
        learned: Whether a network that was trained on imagined picks has a say in the likelihood of silhouettes
            (`nuno.estimate.learned`), of rectangular cloths alone, such as it was trained on; "chamfer", "iou" and
            "eq1" are without it.
        sideways: How far sideways the hand went, as a share of how high it went, which half of all lifts are taken to
            stay below: points about under the hand are likelier before the image after is seen
            (`nuno.estimate.lift_prior`). None takes all candidates as alike: right where the hand was led to the side
            on purpose. "chamfer", "iou" and "eq1" are without it.
        shape: "auto" takes a rectangular cloth as a rectangle and any other by its outline, with a warning;
            "rectangle" refuses others; "outline" takes any by its outline. A cloth that is taken by its outline has
            candidates along it and inside, labelled by their positions [m] along the longer and shorter side of the
            smallest rectangle around it, from that one's corner C00 (docs/picks.md).
        spacing: Of an outline's candidates [m]; None gives about 40 of them.
        hand_std: Standard deviation of where the hand is, along each axis [m]. Futures are compared as if it were
            elsewhere, too (`nuno.estimate.hand_error`), and a few of them are imagined so.
        hand_path: (k, 3) where the hand went [m], at even times from when it held the cloth on, to ``hand``, which
            took it ``lift_seconds``; or a `nuno.HandPath`, of which the last hold counts. It replaces the guesses that
            the hand went straight, or up first and sideways then, and the prior of the lift: where it began is where
            the picked point lay, up to ``hand_std`` and to how high it was then.
        score: What ranks: "evidence" of silhouette and pattern, "silhouette" alone, "chamfer", "iou" or "eq1" (see
            `nuno.estimate.ranking`).
        device: "auto", "cpu", "cuda:0" ...
        engine: What moves the imagined cloths, as of ``World``: another than "nuno" is a check of the answer by physics
            that nobody here wrote, and many times slower.
        progress: Progress bar; None shows one on a terminal.

    Raises:
        InvalidInputError: a value that cannot be used; the hand behind the camera, out of the image or under the
            table; two images that are the same.
        ImageError: an image that cannot be read or is not of the camera's size.
        ClothNotFoundError: no cloth in an image.
        EstimationError: no candidate gave a finite future.
        UnknownNameError: there is no such engine.
        MissingPackageError: its package is not installed.
        EngineCapabilityError: it cannot do that, or not on the device.
    """
    if spacing is not None:
        number("spacing", spacing, above=0.0)
    stages = Stages("read", "see", "compile", "imagine", "compare")
    settings = check_settings(
        table=check_table(table_height, table_half_extents, table_centre, table_thickness), camera=camera, hand=hand,
        candidates=candidates, rest_height=rest_height, hand_radius=hand_radius, lift_seconds=lift_seconds,
        discretisations=discretisations, sure=sure, turns=turns, learned=learned, sideways=sideways, score=score,
        device=device, engine=engine, progress=progress, hand_std=hand_std, hand_path=hand_path,
    )  # fmt: skip
    images = read_images(before, after, before_mask, after_mask, hidden, settings.camera)
    stages.end("read")
    wait_for_kernels = compile_ahead(settings.device)
    stages.end("compile")
    measured = rectangle is None
    doubt = with_view_of_table(settings, images) if measured else TableDoubt(settings)
    settings = doubt.settings
    images, rectangle = find_cloth_before(images, rectangle, hint, settings, choice("shape", shape, SHAPES), template)
    if doubt.warnings:
        rectangle = replace(rectangle, warnings=(*doubt.warnings, *rectangle.warnings))
    if measured and not doubt.is_seen:
        settings, rectangle = with_focal_of_rectangle(settings, images, rectangle)
    settings = with_outline_candidates(settings, rectangle, spacing)
    wait_for_seen = begin_to_see(
        images.before, images.after, images.mask_before, images.mask_after, camera=settings.camera,
        table=settings.table, rectangle=rectangle, hand=settings.hand, hand_radius=hand_radius, hidden=images.hidden,
        with_pattern=score == "evidence", meanwhile=settings.device != "cpu" or core_count() > 1,
    )  # fmt: skip
    stages.end("see")
    with with_clock("compiling kernels, which are kept for later runs", progress):
        wait_for_kernels()
    stages.end("compile")
    trials = try_picks(settings, rectangle, wait_for_seen, stages)
    result = _result(settings, images, rectangle, trials, stages)
    for warning in result.warnings:
        log.warning("%s", warning)
    return result


def _result(
    settings: PickSettings, images: PickImages, rectangle: ClothRectangle, trials: PickTrials, stages: Stages
) -> PickResult:
    """Return the answer, with the future that looks most like the image."""
    ranked, seen = trials.ranked, trials.seen
    batch, world, turn = trials.best_match(int(ranked.order[0]), settings.score)
    masks = trials.masks(settings)
    futures, best_index = trials.batches[batch].whole(world)
    stages.end("compare")
    return PickResult(
        labels=settings.labels, order=ranked.order, scores=ranked.scores, score_name=ranked.name, eq1=ranked.eq1,
        trusted=trials.trusted, rectangle=rectangle, camera=settings.camera, grid=settings.grid, seconds=stages.total(),
        futures=futures, best_index=best_index, turn=float(settings.poses.turns[turn]), hand=settings.hand, masks=masks,
        real=seen.silhouette, image_before=images.before, image_after=images.after, mask_before=images.mask_before,
        mask_after=seen.mask, seen_warnings=(*seen.warnings, *trials.warnings),
        sideways=settings.sideways if settings.with_evidence else None,
    )  # fmt: skip
