"""Stages of `estimate_pick` to compare with those that it has, by name."""

from __future__ import annotations

from dataclasses import replace

from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation, hypotheses_with

EARLY = 2  # stages that were imagined on the finer mesh before
NAMES = ("now", "fine", "lean", "coarse")


def stages_named(name: str) -> tuple[Discretisation, ...] | None:
    """Return stages; None of those that there are.

    Args:
        name: "now"; "fine": the early stages on the mesh of the later ones, and all ten weaves, as once; "lean":
            without the stage of a finer weave, with fewer candidates in the stages before and where hands are tried
            that went up first, and with the last stage on the early ones' mesh; "coarse": the same with all later
            stages on the early ones' mesh, and those on a still coarser one.
    """
    if name == "now":
        return None
    if name == "fine":
        weaves = hypotheses_with(3000.0, 1200.0, (3e-5, 1e-4, 3e-4, 8e-4, 3e-3))
        fine = tuple(replace(stage, cells=20, substeps=14) for stage in DISCRETISATIONS[:EARLY])
        return fine + tuple(replace(s, hypotheses=weaves) if s.cells == 25 else s for s in DISCRETISATIONS[EARLY:])
    first, second, third, fourth, fifth, _, last = DISCRETISATIONS
    early = (first, second, replace(third, share_if_poor=0.98))
    later = (replace(fourth, best=8), replace(fifth, best=6), replace(last, cells=15, substeps=10))
    if name == "lean":
        return early + later
    return (
        *(replace(stage, cells=12, substeps=8) for stage in early),
        *(replace(stage, cells=15, substeps=10) for stage in later),
    )
