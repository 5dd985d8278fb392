"""Picks imagined on one mesh after the other and compared with what was seen, until one candidate is sure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.rectangle import ClothRectangle
from nuno.errors import EstimationError
from nuno.estimate import between_candidates
from nuno.estimate.between_candidates import Cells, cells_of
from nuno.estimate.coming_to_rest import groups
from nuno.estimate.doubt import FAIRLY, doubted, misfit, oddities
from nuno.estimate.futures import Futures, imagine_picks
from nuno.estimate.hand_error import GROSS, GROSS_SHARE, SEEN_SHARE
from nuno.estimate.hypotheses import DISCRETISATIONS, OF_OUTLINES, Discretisation, elsewhere
from nuno.estimate.learned import Outline, correction, outline_of
from nuno.estimate.lift_prior import log_prior_of_start, log_priors_of_ways
from nuno.estimate.mirrored import Mirrored, mirrored
from nuno.estimate.pick_settings import PickSettings
from nuno.estimate.pick_sight import masks_of_turned, score_futures
from nuno.estimate.ranking import SHARE, SURE, Comparison, Ranked
from nuno.estimate.seeing import AWAY, COVERED, IMAGE_SCALE, Seen
from nuno.estimate.together import Ahead, has_room
from nuno.kernels.compile_watch import Stages
from nuno.numbers.lanes import LANES
from nuno.world.progress import with_bar


@dataclass(frozen=True, eq=False)
class PickTrials:
    """Imagined picks of all meshes that were gone through.

    Attributes:
        comparisons: Scores by mesh.
        batches: The futures that they are of.
        ranked: The ranking by all of them.
        seen: The image after.
        warnings: What is odd about how the futures fit.
        trusted: How likely the best candidate is, as far as the evidence may be trusted.
        reflected: What the futures of each mesh, reflected, tell of other candidates (`nuno.estimate.mirrored`).
    """

    comparisons: list[Comparison]
    batches: list[Futures]
    ranked: Ranked
    seen: Seen
    warnings: tuple[str, ...] = ()
    trusted: float = 1.0
    reflected: Sequence[list[Comparison]] = ()

    def best_match(self, candidate: int, score: str) -> tuple[int, int, int]:
        """Return the batch, the world in it, and its turn's number, in which a candidate looks most like the image.

        Those whose cloth passes through itself count only where there are no others.
        """
        found: list[tuple[bool, float, int, int, int]] = []
        for k, comparison in enumerate(self.comparisons):
            at = np.nonzero(comparison.candidates == candidate)[0]
            if len(at):
                error = comparison.error(score)[..., at[0]]
                turn, guess = np.unravel_index(int(error.argmin()), error.shape)
                world = int(guess) * len(comparison.candidates) + int(at[0])
                crosses = not self.batches[k].discretisation.self_contact
                found.append((crosses, float(error[turn, guess]), k, world, int(turn)))
        return min(found)[2:]

    def masks(self, settings: PickSettings) -> np.ndarray:
        """Return (k, h, w) bool, every candidate's silhouette where it looks most like the image."""
        count, small = len(settings.uv), self.seen.camera
        alike = (self.best_match(candidate, settings.score) for candidate in range(count))
        batch, world, turn = map(np.array, zip(*alike, strict=True))
        masks = np.zeros((count, small.height, small.width), dtype=bool)
        for k in np.unique(batch):
            of = batch == k
            masks[of] = masks_of_turned(
                self.batches[k], world[of], settings.poses.turns[turn[of]], small, settings.table, settings.hand,
                settings.poses.shifts[turn[of]],
            )  # fmt: skip
        return masks


def try_picks(
    settings: PickSettings, rectangle: ClothRectangle, wait_for_seen: Callable[[], Seen], stages: Stages
) -> PickTrials:
    """Imagine and compare picks on one mesh after the other, until a candidate is as likely as ``settings.sure``.

    Args:
        settings: All that is asked for.
        rectangle: The cloth before.
        wait_for_seen: Returns the image after, once it has been looked at.
        stages: Gets the seconds of "imagine", "see" and "compare".

    Raises:
        EstimationError: no candidate gave a finite future.
    """
    uv, table, hand = settings.uv, settings.table, settings.hand
    arguments: dict[str, Any] = dict(
        rectangle=rectangle, grid=settings.grid, table=table, hand=hand, rest_height=settings.rest_height,
        device=settings.device, lift_seconds=settings.lift_seconds, engine=settings.engine, hand_std=settings.hand_std,
        hand_path=settings.hand_path,
    )  # fmt: skip
    prior = _prior(settings, rectangle)
    cells = _cells(settings, rectangle)
    usually_sure = SURE if cells is None else between_candidates.SURE
    sure = usually_sure if settings.sure is None else settings.sure
    comparisons: list[Comparison] = []
    reflected: list[list[Comparison]] = []

    def likely(warnings: Sequence[str] = ()) -> Ranked:
        """Return how likely each candidate is the nearest to the pick, by all comparisons."""
        found, count = _all(comparisons, reflected), len(uv)
        if cells is None:
            return doubted(found, settings.score, count, prior, warnings)
        return cells.nearest(doubted(found, settings.score, count, prior, warnings, between_candidates.TEMPERATURE))

    batches: list[Futures] = []
    ranked: Ranked | None = None
    outline: Outline | None = None
    ahead = Ahead(uv, **arguments) if has_room(settings.device) else None
    is_outline = isinstance(rectangle, ClothOutline)
    usual = settings.discretisations is DISCRETISATIONS
    meshes = list(OF_OUTLINES if is_outline and usual else settings.discretisations)
    path_given = settings.hand_path is not None
    # an outline's triangles take several times as long as a rectangle's grid, and it is no image of itself
    is_open = settings.with_evidence and not path_given and not is_outline
    hand_is = 0
    for k in chain(
        with_bar(range(len(meshes)), "imagining", settings.progress, "mesh"), (len(meshes), len(meshes) + 1)
    ):
        if k == len(meshes):
            break
        if meshes[k].any_way and ranked is not None and not path_given:
            # once for all that follow, so that a device may imagine them together
            meshes[k:] = [
                replace(m.with_up_first(ranked.up_first), any_way=False) if m.any_way else m for m in meshes[k:]
            ]
        discretisation = meshes[k]
        chosen = np.arange(len(uv))
        wider = discretisation.share_if_poor
        if wider is not None and not (is_open and _fits_poorly(comparisons, ranked)):
            wider = None
        if ranked is not None and wider is not None:
            chosen = ranked.plausible(len(uv), wider)
        elif ranked is not None and discretisation.best is not None:
            share = SHARE if discretisation.share is None else discretisation.share
            chosen = ranked.plausible(discretisation.best, share)
        if ranked is not None and ahead is None and discretisation.best is not None:
            chosen = in_fewer_groups(chosen, ranked, discretisation)
        # what is imagined ahead is of the stages after this one, too, which look at fewer candidates
        stages_ahead = meshes[k : k + 1] if wider is not None else meshes[k:]
        futures: Futures | None = None if ahead is None else ahead.part(stages_ahead, chosen)
        if futures is None:
            futures = imagine_picks(candidates=uv[chosen], discretisation=discretisation, **arguments)
        stages.end("imagine")
        seen = wait_for_seen()
        stages.end("see")
        if k == 0 and settings.learned and settings.with_evidence:
            outline = outline_of(seen.mask, seen.hidden, settings.camera, hand)
        if k == 0 and discretisation.asks_hand and settings.with_evidence and not path_given and seen.hand_is != 0:
            hand_is = seen.hand_is
            meshes[1:] = elsewhere(meshes, hand_is * GROSS)
        share_of_mistakes = GROSS_SHARE if hand_is == 0 else SEEN_SHARE
        comparisons.append(_compared(futures, chosen, seen, settings, outline, share_of_mistakes))
        others = (
            mirrored(futures, chosen, uv, rectangle, table, hand, settings.hand_std)
            if is_open and discretisation.reflects else None
        )  # fmt: skip
        reflected.append(
            [] if others is None else _of_each_kind(others, seen, settings, outline, share_of_mistakes)
        )  # fmt: skip
        batches.append(futures)
        ranked = doubted(_all(comparisons, reflected), settings.score, len(uv), prior)
        stages.end("compare")
        may_end = discretisation.self_contact and (k > 0 or hand_is == 0)
        if may_end and (ranked if cells is None else likely()).settled(sure):
            break
    assert ranked is not None
    if not np.isfinite(ranked.scores).any():
        raise EstimationError("no imagined pick stayed finite; smaller steps or softer guesses are needed")
    best = int(ranked.order[0])
    batch, world, _ = PickTrials(comparisons, batches, ranked, seen).best_match(best, settings.score)
    guess = meshes[batch].hypotheses[world // len(comparisons[batch].candidates)]
    odd = oddities(comparisons, best, settings.score, guess, seen=hand_is != 0)
    reported = (*rectangle.warnings, *seen.warnings, *odd)
    if hand_is != 0 and guess.mistake != 0.0:  # what was seen of the hand is explained, and told once
        reported = tuple(warning for warning in reported if not warning.startswith((AWAY, COVERED)))
    ranked = likely(reported)
    trusted = 1.0 if ranked.likely is None else float(ranked.likely[best])
    return PickTrials(comparisons, batches, ranked, seen, odd, trusted, reflected)


def _cells(settings: PickSettings, rectangle: ClothRectangle) -> Cells | None:
    """Return what lies between candidates that are spread over an outline, where evidence ranks; None of others."""
    if settings.spacing is None or not settings.with_evidence or not isinstance(rectangle, ClothOutline):
        return None
    return cells_of(rectangle.polygon, settings.labels, settings.spacing)


def in_fewer_groups(chosen: np.ndarray, ranked: Ranked, discretisation: Discretisation) -> np.ndarray:
    """Return the candidates (k,) int without the least likely, where few are too many for one group of lanes less."""
    guesses, likely = len(discretisation.hypotheses), ranked.probabilities
    fewer = (groups(len(chosen) * guesses) - 1) * LANES // guesses
    if likely is None or not 2 <= fewer < len(chosen):
        return chosen
    order = chosen[np.argsort(-likely[chosen], kind="stable")]
    return np.sort(order[:fewer]) if likely[order[fewer:]].sum() < discretisation.spares else chosen


def _all(comparisons: list[Comparison], reflected: list[list[Comparison]]) -> list[Comparison]:
    """Return all comparisons, those of reflected futures too."""
    return [*comparisons, *(comparison for of_mesh in reflected for comparison in of_mesh)]


def _of_each_kind(
    others: Mirrored, seen: Seen, settings: PickSettings, outline: Outline | None, share_of_mistakes: float
) -> list[Comparison]:
    """Compare reflected futures, those of each reflection by themselves."""
    comparison = _compared(others, others.chosen, seen, settings, outline, share_of_mistakes)
    together = replace(comparison, weights=others.weights)
    return [together.part(others.kinds == kind) for kind in np.unique(others.kinds)]


def _compared(
    futures: Futures, chosen: np.ndarray, seen: Seen, settings: PickSettings, outline: Outline | None,
    share_of_mistakes: float,
) -> Comparison:  # fmt: skip
    """Compare futures of chosen candidates, with the network's correction, if it has a say, and unlikely mistakes."""
    comparison = compare(futures, chosen, seen, settings)
    if outline is not None:
        added = correction(outline, futures, comparison, settings.table, settings.hand)
        comparison = replace(comparison, correction=added)
    return _weighed(comparison, futures.discretisation, share_of_mistakes)


def _fits_poorly(comparisons: list[Comparison], ranked: Ranked | None) -> bool:
    """Return True if even the best future so far fits poorly."""
    return ranked is not None and misfit(comparisons, int(ranked.order[0])) > FAIRLY


def _weighed(comparison: Comparison, discretisation: Discretisation, share_of_mistakes: float) -> Comparison:
    """The comparison, with guesses that take the hand's place for a mistake, or not, as likely as they are."""
    mistakes = np.array([hypothesis.mistake != 0.0 for hypothesis in discretisation.hypotheses])
    expected = share_of_mistakes >= 0.5
    if not expected and not mistakes.any():
        return comparison
    added = 0.0 if comparison.correction is None else comparison.correction
    others = 1.0 - share_of_mistakes if expected else 1.0
    return replace(comparison, correction=added + np.log(np.where(mistakes, share_of_mistakes, others))[:, None])


def _prior(settings: PickSettings, rectangle: ClothRectangle) -> np.ndarray:
    """Logarithms of how likely each candidate is before the image after is seen, where need be by the hand's way."""
    if settings.hand_path is not None:
        return log_prior_of_start(rectangle, settings.uv, settings.hand_path[0], settings.hand_std)
    return log_priors_of_ways(rectangle, settings.uv, settings.hand, settings.sideways)


def compare(futures: Futures, chosen: np.ndarray, seen: Seen, settings: PickSettings) -> Comparison:
    """Compare the futures of chosen candidates with the image after, at every turn about the hand's vertical."""
    values = score_futures(
        futures, seen.camera, seen.silhouette, settings.table, pattern=seen.pattern, turns=settings.poses.turns,
        shifts=settings.poses.shifts, hand=settings.hand, coarse=seen.coarse,
    )  # fmt: skip
    return Comparison(
        chosen, settings.poses.turns, values["chamfer"] / IMAGE_SCALE, values["iou"], values["eq1"], futures.finite,
        None if seen.pattern is None else values["pattern"], shifts=settings.poses.shifts,
        log_priors=settings.poses.log_priors,
        up_first=np.array([guess.up_first for guess in futures.discretisation.hypotheses]),
    )  # fmt: skip
