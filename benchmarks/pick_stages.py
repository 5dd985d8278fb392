"""Stages of `estimate_pick` to compare with those that it has, by name."""

from __future__ import annotations

from dataclasses import replace

from nuno.estimate.coming_to_rest import SETTLE_SECONDS
from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation, hypotheses_with

NAMES = ("now", "more", "limp", "weaves", "fine", "coarse")


def stages_named(name: str) -> tuple[Discretisation, ...] | None:
    """Return stages; None of those that there are.

    Args:
        name: "now"; "more": as before that, with more candidates in the last three stages, where cloths take up to
            2.5 s to come to rest, and reflected futures count, too; "limp": as now, with the limpest guesses on the
            coarser mesh; "weaves": as "more", with a stage of a finer, stiffer weave before the last one, still more
            candidates in those before, and the last one on the mesh of these; "fine": as before that, with the early
            stages on that mesh too, and ten weaves; "coarse": as now with all later stages on the early ones' mesh, and
            those on a still coarser one.
    """
    if name == "now":
        return None
    first, second, third = DISCRETISATIONS[:3]
    fourth, fifth, last = later = tuple(
        replace(stage, best=best, settle_seconds=SETTLE_SECONDS, reflects=True)
        for stage, best in zip(DISCRETISATIONS[3:], (8, 6, 4), strict=True)
    )
    if name == "more":
        return (first, second, third, *later)
    if name in ("limp", "coarse"):
        fourth, fifth, last = DISCRETISATIONS[3:]
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
    weaves = hypotheses_with(3000.0, 1200.0, (3e-5, 1e-4, 3e-4, 8e-4, 3e-3))
    if name == "fine":
        first, second = (replace(stage, cells=20, substeps=14) for stage in (first, second))
    else:
        weaves = weaves[:9]
    return (
        first, second, replace(third, share_if_poor=1.0), replace(fourth, best=16), replace(fifth, best=8),
        Discretisation(25, 20, weaves, best=5, any_way=True), replace(last, cells=20, substeps=14),
    )  # fmt: skip
