"""Stages of a pick: which candidates each of them looks at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_pick_settings import settings

from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate import pick_trials
from nuno.estimate.hand_error import GROSS
from nuno.estimate.hypotheses import Discretisation, Hypothesis
from nuno.estimate.lift_prior import UP_FIRST
from nuno.estimate.pick_trials import PickTrials, in_fewer_groups
from nuno.estimate.ranking import Comparison, Ranked
from nuno.kernels.compile_watch import Stages

CORNERS = np.array([(-0.3, -0.2, 0.0), (0.3, -0.2, 0.0), (0.3, 0.2, 0.0), (-0.3, 0.2, 0.0)])
RECTANGLE = ClothRectangle(CORNERS, 0.6, 0.4, np.zeros(3), 0.0, 0.0)
STAGES = (
    Discretisation(20, 14, (Hypothesis(1e-4), Hypothesis(1e-3))),
    Discretisation(20, 14, (Hypothesis(1e-4, up_first=True), Hypothesis(1e-3, up_first=True)), 3, share_if_poor=1.0),
    Discretisation(20, 14, (Hypothesis(1e-5), *(Hypothesis(k * 1e-5) for k in range(2, 11))), best=3, any_way=True),
)
ups: list[int] = []
"""How many guesses of each stage went up first in what was looked at last."""

mistakes: list[set[float]] = []
"""By how much the guesses of each stage took the hand to be higher by mistake."""

reflected: list[int] = []
"""How many guesses the stages had whose futures were reflected then."""


def looked_at(
    monkeypatch: pytest.MonkeyPatch, chamfer: float, stages: tuple[Discretisation, ...] = STAGES, hand_is: int = 0,
    cloth: ClothRectangle = RECTANGLE, **changes: Any,
) -> list[int]:  # fmt: skip
    """How many candidates of six each stage looks at, where all fit alike but for two, which are ``chamfer`` px off."""
    numbers: list[int] = []
    ups.clear()
    reflected.clear()
    mistakes.clear()

    def compare(futures: Any, chosen: np.ndarray, seen: Any, given: Any) -> Comparison:
        numbers.append(len(chosen))
        up_first = np.array([guess.up_first for guess in futures.discretisation.hypotheses])
        ups.append(int(up_first.sum()))
        mistakes.append({guess.mistake for guess in futures.discretisation.hypotheses})
        shape = (len(given.turns), len(futures.discretisation.hypotheses), len(chosen))
        far = np.where(np.isin(chosen, (0, 1)), chamfer, 40.0)
        return Comparison(
            chosen, given.turns, np.broadcast_to(far, shape), np.full(shape, 0.9), np.full(shape, 0.9),
            np.ones(shape[1:], dtype=bool), up_first=up_first,
        )  # fmt: skip

    def imagine(candidates: np.ndarray, discretisation: Discretisation, **_: Any) -> Any:
        return SimpleNamespace(discretisation=discretisation, candidates=len(candidates))

    def reflect(futures: Any, *_: Any) -> None:
        reflected.append(len(futures.discretisation.hypotheses))

    monkeypatch.setattr(pick_trials, "compare", compare)
    monkeypatch.setattr(pick_trials, "imagine_picks", imagine)
    monkeypatch.setattr(pick_trials, "mirrored", reflect)
    given = settings(discretisations=stages, turns=(0.0,), learned=False, sideways=None, **changes)
    if "spacing" in changes:
        given = replace(given, labels=given.uv * (cloth.long_m, cloth.short_m))
    seen: Any = SimpleNamespace(warnings=(), hand_is=hand_is)
    pick_trials.try_picks(given, cloth, lambda: seen, Stages("imagine", "see", "compile", "compare"))
    return numbers


def test_another_way_of_the_hand_is_tried_on_all_candidates_where_none_fits_well(monkeypatch):
    """Contours 1.5 px off cost 5 ln 2.5 + 1 = 5.6, those 6 px off 10.7: above 10 is poor; the next stage is as ever."""
    assert looked_at(monkeypatch, 1.5) == [6, 2, 2]
    assert looked_at(monkeypatch, 6.0) == [6, 6, 2]


def test_where_none_fits_well_all_of_a_share_are_tried(monkeypatch):
    """Beside the best two, four at 40 px are exp(-8.8 / 0.8) as likely where those are at 6 px, exp(-1) at 34 px."""
    wide = (STAGES[0], replace(STAGES[1], share_if_poor=0.98), STAGES[2])
    assert looked_at(monkeypatch, 6.0, stages=wide) == [6, 2, 2]
    assert looked_at(monkeypatch, 34.0, stages=wide) == [6, 6, 3]


def test_a_known_way_of_the_hand_is_no_guess(monkeypatch):
    """Where it is given, and where no evidence ranks, as few are looked at as by any stage."""
    way = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, 0.2)])
    assert looked_at(monkeypatch, 6.0, hand_path=way)[1] < 6
    assert looked_at(monkeypatch, 6.0, score="iou")[1] == 3


def test_later_guesses_go_the_likelier_way(monkeypatch):
    """Both ways fit alike, so up first is as likely as before: two of ten guesses; none where the way is known."""
    looked_at(monkeypatch, 1.5)
    assert ups == [0, 2, round(10 * UP_FIRST)]
    way = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, 0.2)])
    looked_at(monkeypatch, 1.5, hand_path=way)
    assert ups == [0, 2, 0]


def test_a_stage_may_leave_reflections_out(monkeypatch):
    """Futures of stages that do not reflect are not asked about other candidates."""
    stages = (STAGES[0], replace(STAGES[1], reflects=False), STAGES[2])
    looked_at(monkeypatch, 6.0, stages=stages)
    assert reflected == [2, 10]


def test_no_estimate_ends_with_cloths_that_pass_through_themselves(monkeypatch):
    """Two candidates alone hold all of the probability: a stage for which one is sure ends an estimate, if it may."""
    sure = dict(sure=0.4)
    assert looked_at(monkeypatch, 1.5, **sure) == [6]
    stages = (replace(STAGES[0], self_contact=False), *STAGES[1:])
    assert looked_at(monkeypatch, 1.5, stages=stages, **sure) == [6, 2]


def test_candidates_of_an_outline_are_as_sure_as_what_is_between_allows(monkeypatch):
    """Two of six hold half each, so 0.4 ends an estimate; with what lies between them and the others each holds less.

    Where candidates were given, and not spread at a spacing, one of them is taken for true, as of a rectangle.
    """
    outline = ClothOutline(CORNERS, 0.6, 0.4, np.zeros(3), 0.0, 0.0, outline=CORNERS)
    points = np.stack(np.meshgrid((0.0, 0.5, 1.0), (0.0, 1.0)), axis=-1).reshape(-1, 2)
    given = dict(cloth=outline, candidates=points, sure=0.4)
    assert looked_at(monkeypatch, 20.0, **given) == [6]
    assert len(looked_at(monkeypatch, 20.0, spacing=0.3, **given)) == 3


def test_a_stage_may_look_at_a_larger_share(monkeypatch):
    """Two at 10 px hold 99.9 % beside four at 40 px: enough for the usual 95 %, but not for 99.99 %."""
    stages = (STAGES[0], replace(STAGES[1], best=6, share_if_poor=None), STAGES[2])
    assert looked_at(monkeypatch, 10.0, stages=stages)[1] == 2
    wider = (STAGES[0], replace(stages[1], share=0.9999), STAGES[2])
    assert looked_at(monkeypatch, 10.0, stages=wider)[1] > 2


def test_few_are_left_out_where_that_saves_a_group():
    """Nine of two guesses are 18 worlds, two groups of 16; without the least likely one. Not where it holds more."""
    likely = np.array([0.3, 0.2, 0.01, 0.1, 0.1, 0.1, 0.1, 0.05, 0.04])
    ranked = Ranked("log_evidence", np.log(likely), likely, likely)
    stage = replace(STAGES[0], spares=0.02)
    every = np.arange(9)
    assert in_fewer_groups(every, ranked, stage).tolist() == [0, 1, 3, 4, 5, 6, 7, 8]
    assert in_fewer_groups(every, ranked, replace(stage, spares=0.009)).tolist() == every.tolist()
    assert in_fewer_groups(every[:8], ranked, stage).tolist() == every[:8].tolist()  # one group: none is saved
    assert in_fewer_groups(every, ranked, STAGES[0]).tolist() == every.tolist()


def test_the_best_match_touches_itself_where_one_does():
    """A cloth that passes through itself looks more like the image, but is adopted only where there is no other."""

    def compared(candidates: tuple[int, ...], chamfer: float) -> Comparison:
        shape = (1, 1, len(candidates))
        return Comparison(
            np.array(candidates), np.zeros(1), np.full(shape, chamfer), np.ones(shape), np.ones(shape),
            np.ones(shape[1:], dtype=bool),
        )  # fmt: skip

    one = Discretisation(20, 14, (Hypothesis(1e-4),))
    batches: Any = [SimpleNamespace(discretisation=replace(one, self_contact=touching)) for touching in (False, True)]
    given: Any = None
    trials = PickTrials([compared((0, 1), 1.0), compared((1,), 2.0)], batches, given, given)
    assert trials.best_match(1, "evidence") == (1, 0, 0)
    assert trials.best_match(0, "evidence") == (0, 0, 0)


def test_a_hand_that_is_seen_to_be_elsewhere_is_taken_to_be_there(monkeypatch):
    """All candidates are looked at again, with a hand 5 cm lower, also where one was sure with the hand as told."""
    asking = (replace(STAGES[0], asks_hand=True), *STAGES[1:])
    assert looked_at(monkeypatch, 1.5, stages=asking, hand_is=-1) == [6, 6, 2, 2]
    assert mistakes == [{0.0}, {-GROSS}, {-GROSS}, {-GROSS}]
    assert looked_at(monkeypatch, 1.5, stages=asking, hand_is=-1, sure=0.4) == [6, 6]
    # not where it is as told, nobody asks, the way is known, or no evidence ranks
    way = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, 0.2)])
    assert looked_at(monkeypatch, 1.5, stages=asking) == looked_at(monkeypatch, 1.5, hand_is=-1) == [6, 2, 2]
    looked_at(monkeypatch, 1.5, stages=asking, hand_is=-1, hand_path=way)
    assert set.union(*mistakes) == {0.0}
    looked_at(monkeypatch, 1.5, stages=asking, hand_is=-1, score="iou")
    assert set.union(*mistakes) == {0.0}
