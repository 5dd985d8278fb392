"""Guesses at the material: what is tried, and how the stages share it out."""

from nuno.estimate.hypotheses import DISCRETISATIONS, FIRM, FRICTIONS, LOOSE, cell_counts


def test_stages_share_out_every_guess_once() -> None:
    """The first three stages together hold all firm and loose guesses, none twice: evidence is a mean over them."""
    guesses = [guess for stage in DISCRETISATIONS[:3] for guess in stage.hypotheses]
    assert len(set(guesses)) == len(guesses)
    assert set(guesses) == {*FIRM, *LOOSE}


def test_stages_narrow_down() -> None:
    """The first stage looks at every candidate, as an estimate demands, and each after it at fewer."""
    bests = [stage.best for stage in DISCRETISATIONS]
    assert bests[0] is None
    assert bests[1:] == sorted(bests[1:], reverse=True)


def test_every_stage_tries_both_frictions() -> None:
    """How far the cloth slides is as unknown as how it bends, so no stage may take one friction alone."""
    for stage in DISCRETISATIONS:
        assert {guess.friction for guess in stage.hypotheses} == set(FRICTIONS)


def test_cells_are_multiples_of_the_grid() -> None:
    """Candidates of a 6 x 6 grid lie on vertices, also of a cloth whose sides are far from equal."""
    assert cell_counts(0.8, 0.4, 20, (6, 6)) == (20, 10)
    assert cell_counts(0.45, 0.41, 25, (6, 6)) == (25, 25)
    assert cell_counts(0.8, 0.1, 20, (6, 6)) == (20, 5)
