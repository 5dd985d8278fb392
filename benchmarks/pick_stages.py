"""Stages of `estimate_pick` to compare with those that it has, by name."""

from __future__ import annotations

from dataclasses import replace

from nuno.estimate.coming_to_rest import SETTLE_SECONDS
from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation, hypotheses_with

NAMES = ("now", "more", "weaves", "fine", "coarse")


def stages_named(name: str) -> tuple[Discretisation, ...] | None:
    """Return stages; None of those that there are.

    Args:
        name: "now"; "more": as before that, with more candidates in the last three stages and limp guesses on the finer
            mesh, where cloths take up to 2.5 s to come to rest, and reflected futures count, too; "weaves": as before
            that, with a stage of a finer, stiffer weave before the last one, still more candidates in those before, and
            the last one on the mesh of these; "fine": as before that, with the early stages on that mesh too, and ten
            weaves; "coarse": as now with all later stages on the early ones' mesh, and those on a still coarser one.
    """
    if name == "now":
        return None
    first, second, third = DISCRETISATIONS[:3]
    fourth, fifth, last = later = _with_more(DISCRETISATIONS[3:])
    if name == "more":
        return (first, second, third, *later)
    if name == "coarse":
        fourth, fifth, last = DISCRETISATIONS[3:]
        early = (replace(stage, cells=12, substeps=8) for stage in (first, second, third))
        return (*early, *(replace(stage, cells=15, substeps=10) for stage in (fourth, fifth, last)))
    weaves = hypotheses_with(3000.0, 1200.0, (3e-5, 1e-4, 3e-4, 8e-4, 3e-3))
    if name == "fine":
        first, second = (replace(stage, cells=20, substeps=14) for stage in (first, second))
    else:
        weaves = weaves[:9]
    return (
        first, second, replace(third, share_if_poor=1.0), replace(fourth, best=16), replace(fifth, best=8),
        Discretisation(25, 20, weaves, best=5, any_way=True), replace(last, cells=20, substeps=14),
    )  # fmt: skip


def _with_more(stages: tuple[Discretisation, ...]) -> tuple[Discretisation, ...]:
    """The last three stages as they were once."""
    fourth, fifth, last = (replace(stage, settle_seconds=SETTLE_SECONDS, reflects=True) for stage in stages)
    (limp,) = (guess for guess in last.hypotheses if guess.bending_rigidity == 1e-6)
    *firm, higher, lower = fifth.hypotheses
    guesses = (
        *firm, limp, higher, replace(limp, bending_rigidity=5e-6, friction=0.5, hand=lower.hand),
        replace(lower, hand=limp.hand),
    )  # fmt: skip
    return (
        replace(fourth, best=8), replace(fifth, best=6, hypotheses=guesses),
        replace(last, hypotheses=tuple(guess for guess in last.hypotheses if guess is not limp)),
    )  # fmt: skip
