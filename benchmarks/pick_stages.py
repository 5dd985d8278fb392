"""Stages of `estimate_pick` to compare with those that it has, by name."""

from __future__ import annotations

from dataclasses import replace

from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation, hypotheses_with

EARLY = 2  # stages that were imagined on the finer mesh before
NAMES = ("now", "fine", "no-weaves", "lean", "lean-12")


def stages_named(name: str) -> tuple[Discretisation, ...] | None:
    """Return stages; None of those that there are.

    Args:
        name: "now"; "fine": the early stages on the mesh of the later ones, and all ten weaves, as once; "no-weaves":
            without the stage of a finer weave; "lean": without it, with fewer candidates in the stages before and
            where hands are tried that went up first, and with the last stage on the early ones' mesh; "lean-12": the
            same with the early stages' mesh still coarser.
    """
    early, later = DISCRETISATIONS[:3], DISCRETISATIONS[3:]
    if name == "now":
        return None
    if name == "fine":
        weaves = hypotheses_with(3000.0, 1200.0, (3e-5, 1e-4, 3e-4, 8e-4, 3e-3))
        fine = tuple(replace(stage, cells=20, substeps=14) for stage in DISCRETISATIONS[:EARLY])
        return fine + tuple(replace(s, hypotheses=weaves) if s.cells == 25 else s for s in DISCRETISATIONS[EARLY:])
    if name == "no-weaves":
        return early + tuple(stage for stage in later if stage.cells != 25)
    cells, substeps = (12, 8) if name == "lean-12" else (15, 10)
    early = (*early[:2], replace(early[2], share_if_poor=0.98))
    first, second, _, last = later
    return (
        *(replace(stage, cells=cells, substeps=substeps) for stage in early),
        replace(first, best=8), replace(second, best=6), replace(last, cells=15, substeps=10),
    )  # fmt: skip
