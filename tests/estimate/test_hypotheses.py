"""Guesses at the material: what is tried, and how the stages share it out."""

from dataclasses import replace

import numpy as np

from nuno.estimate.hand_error import GROSS
from nuno.estimate.hypotheses import DISCRETISATIONS, FRICTIONS, OF_OUTLINES, cell_counts, elsewhere


def test_no_guess_is_made_twice() -> None:
    """Evidence is a mean over the guesses: one that is among those of two stages on the same mesh would count twice."""
    guesses = [(stage.cells, guess) for stage in DISCRETISATIONS for guess in stage.hypotheses]
    assert len(set(guesses)) == len(guesses)


def test_guesses_reach_from_limp_to_stiff() -> None:
    """From 1e-6 N m, limper than measured fabrics, to 5e-3 N m, a thick place mat; one is stiff in the first stage."""
    rigidities = [guess.bending_rigidity for stage in DISCRETISATIONS for guess in stage.hypotheses]
    assert min(rigidities) == 1e-6 and max(rigidities) == 5e-3
    assert max(guess.bending_rigidity for guess in DISCRETISATIONS[0].hypotheses) >= 2e-3


def test_some_guesses_take_the_hand_elsewhere() -> None:
    """As often higher as lower, so that no side is favoured; mistakes only after all else; none in the first stage."""
    guesses = [guess for stage in DISCRETISATIONS for guess in stage.hypotheses]
    assert np.sum([guess.hand for guess in guesses], axis=0).tolist() == [0.0, 0.0, 0.0]
    assert sum(guess.mistake for guess in guesses) == 0.0
    assert {abs(guess.mistake) for guess in DISCRETISATIONS[-1].hypotheses} == {0.0, GROSS}
    for guess in DISCRETISATIONS[0].hypotheses:
        assert guess.mistake == 0.0 and not any(guess.hand)


def test_stages_narrow_down() -> None:
    """The first stage looks at every candidate, as an estimate demands, and each after it at fewer."""
    bests = [stage.best for stage in DISCRETISATIONS]
    assert bests[0] is None
    assert bests[1:] == sorted(bests[1:], reverse=True)


def test_every_stage_tries_both_frictions() -> None:
    """How far the cloth slides is as unknown as how it bends, so every stage has slippery guesses and others."""
    for stage in DISCRETISATIONS:
        frictions = [guess.friction for guess in stage.hypotheses]
        assert min(frictions) == FRICTIONS[0] and max(frictions) == FRICTIONS[1]


def test_a_share_of_the_guesses_goes_up_first():
    """As many as the share says to one half, evenly spread; those that do already still do, and no more changes."""
    stage = next(stage for stage in DISCRETISATIONS if stage.any_way and len(stage.hypotheses) == 8)
    assert stage.with_up_first(0.0) is stage and stage.with_up_first(0.06) is stage
    ups = [guess.up_first for guess in stage.with_up_first(0.25).hypotheses]
    assert ups == [False, True, False, False, False, True, False, False]
    assert all(guess.up_first for guess in stage.with_up_first(1.0).hypotheses)
    assert stage.with_up_first(1.0).with_up_first(0.25) == stage.with_up_first(1.0)
    back = [replace(guess, up_first=False) for guess in stage.with_up_first(0.5).hypotheses]
    assert back == list(stage.hypotheses)


def test_cells_are_multiples_of_the_grid() -> None:
    """Candidates of a 6 x 6 grid lie on vertices, also of a cloth whose sides are far from equal."""
    assert cell_counts(0.8, 0.4, 20, (6, 6)) == (20, 10)
    assert cell_counts(0.45, 0.41, 25, (6, 6)) == (25, 25)
    assert cell_counts(0.8, 0.1, 20, (6, 6)) == (20, 5)


def test_outlines_are_looked_at_by_the_same_guesses_on_no_finer_meshes():
    """Triangles take longer than a grid: no stage is on a finer mesh than a rectangle's, the first on a coarser."""
    free, *touching = OF_OUTLINES
    assert [stage.hypotheses for stage in touching] == [stage.hypotheses for stage in DISCRETISATIONS]
    assert all(a.cells <= b.cells for a, b in zip(touching, DISCRETISATIONS, strict=True))
    # the first guesses once more, on every candidate, with cloths that pass through themselves
    assert free == replace(DISCRETISATIONS[0], cells=free.cells, substeps=free.substeps, self_contact=False)
    assert all(stage.self_contact for stage in touching) and touching[0].best is not None
    assert OF_OUTLINES[0].cells < DISCRETISATIONS[0].cells


def test_a_hand_that_is_elsewhere_moves_all_guesses():
    """Those that took it to be wrong the other way take it to be as told; as many, and the first stage once more."""
    moved = elsewhere(DISCRETISATIONS, -GROSS)
    assert [len(stage.hypotheses) for stage in moved] == [len(stage.hypotheses) for stage in DISCRETISATIONS]
    for before, after in zip(DISCRETISATIONS, moved, strict=True):
        for old, new in zip(before.hypotheses, after.hypotheses, strict=True):
            assert new == replace(old, mistake=0.0 if old.mistake > 0.0 else -GROSS)
