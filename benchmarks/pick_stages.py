"""Stages of `estimate_pick` to compare with those that it has, by name."""

from __future__ import annotations

from dataclasses import replace

from nuno.estimate.coming_to_rest import SETTLE_SECONDS
from nuno.estimate.hypotheses import DISCRETISATIONS, OF_OUTLINES, Discretisation, hypotheses_with

NAMES = ("now", "short", "free", "free-up", "before", "outlines-before", "more", "limp", "weaves", "fine", "coarse")


def stages_named(name: str) -> tuple[Discretisation, ...] | None:
    """Return stages; None of those that there are.

    Args:
        name: "now"; "short": as now, with 1.5 s for coming to rest in all; "free": as that, with a first stage whose
            cloths pass through themselves, and the usual first one only on those that hold 98 % then; "free-up": and
            the same of the hands that went up first; "before": as now, with what just exceeds a group of lanes, and
            with a hand that is as it is told; "outlines-before": as that, of a cloth that is taken by its outline, with
            a first stage whose cloths touch themselves, and up to 2.5 s to come to rest and more candidates in the last
            stages; "more": as "before", with more candidates in the last three stages, where cloths take up to 2.5 s to
            come to rest, and reflected futures count, too; "limp": as "before", with the limpest guesses on the coarser
            mesh; "weaves": as "more", with a stage of a finer, stiffer weave before the last one, still more candidates
            in those before, and the last one on the mesh of these; "fine": as before that, with the early stages on
            that mesh too, and ten weaves; "coarse": as "before" with all later stages on the early ones' mesh, and
            those on a still coarser one.
    """
    if name == "now":
        return None
    if name in ("short", "free", "free-up"):
        return _free(name)
    of_outlines = name == "outlines-before"
    before = tuple(replace(stage, spares=0.0, asks_hand=False) for stage in DISCRETISATIONS)
    if name == "before":
        return before
    first, second, third, fourth, fifth, last = before
    later = tuple(
        replace(stage, best=best, settle_seconds=SETTLE_SECONDS, reflects=not of_outlines)
        for stage, best in zip(before[3:], (8, 6, 4), strict=True)
    )
    if of_outlines:
        mesh = OF_OUTLINES[0]
        early = (replace(stage, cells=mesh.cells, substeps=mesh.substeps) for stage in (first, second, third))
        return (*early, *later)
    if name == "more":
        return (first, second, third, *later)
    if name == "limp":
        *firm, limpest, higher, lower, another = fifth.hypotheses
        shearing, mistakes = last.hypotheses[:5], last.hypotheses[5:]
        return (
            first, second, third, fourth,
            replace(fifth, hypotheses=(*firm, higher, replace(another, hand=lower.hand))),
            replace(last, hypotheses=(*shearing, limpest, *mistakes)),
        )  # fmt: skip
    if name == "coarse":
        early = (replace(stage, cells=12, substeps=8) for stage in (first, second, third))
        return (*early, *(replace(stage, cells=15, substeps=10) for stage in (fourth, fifth, last)))
    fourth, fifth, last = later
    weaves = hypotheses_with(3000.0, 1200.0, (3e-5, 1e-4, 3e-4, 8e-4, 3e-3))
    if name == "fine":
        first, second = (replace(stage, cells=20, substeps=14) for stage in (first, second))
    else:
        weaves = weaves[:9]
    return (
        first, second, replace(third, share_if_poor=1.0), replace(fourth, best=16), replace(fifth, best=8),
        Discretisation(25, 20, weaves, best=5, any_way=True), replace(last, cells=20, substeps=14),
    )  # fmt: skip


def _free(name: str) -> tuple[Discretisation, ...]:
    """Stages with less time to come to rest, of which some let cloths pass through themselves."""
    first, second, third, *later = (replace(stage, settle_seconds=1.5) for stage in DISCRETISATIONS)
    if name == "short":
        return (first, second, third, *later)
    third = replace(third, self_contact=name != "free-up")
    free = replace(DISCRETISATIONS[0], self_contact=False)
    return (free, replace(first, best=36, share=0.98, spares=second.spares), second, third, *later)
