"""Hypotheses about a real cloth: a few guesses at its material, friction and resolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nuno.estimate.coming_to_rest import SETTLE_SECONDS
from nuno.estimate.hand_error import GROSS


@dataclass(frozen=True)
class Hypothesis:
    """One guess at the cloth and how it is simulated.

    Attributes:
        bending_rigidity: [N m].
        friction: Coulomb's coefficient against the table and itself.
        area_density: [kg/m2].
        air_drag: [1/s].
        stretch_stiffness: [N/m].
        shear_stiffness: [N/m].
        thickness: Contact thickness [m]; None is twice the cloth's height above the table at rest.
        up_first: Whether the hand went straight up and sideways then, instead of on a straight line.
        hand: Where the hand is instead of where it is told, in standard deviations along x, y and z.
        mistake: By how much the hand is higher than it is told, by mistake [m]. Such a guess is less likely beforehand
            (`nuno.estimate.hand_error.GROSS_SHARE`).
    """

    bending_rigidity: float
    friction: float = 0.5
    area_density: float = 0.22
    air_drag: float = 1.5
    stretch_stiffness: float = 1000.0
    shear_stiffness: float = 300.0
    thickness: float | None = None
    up_first: bool = False
    hand: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mistake: float = 0.0


@dataclass(frozen=True)
class Discretisation:
    """A mesh and a time step.

    Attributes:
        cells: Cells along the longer side; the shorter gets as many as keep cells square, and both are rounded so
            that candidates are vertices.
        substeps: Substeps per 1/60 s.
        hypotheses: The hypotheses that are run on it.
        best: It looks at so many of the candidates that are best so far at most, and at no more than are plausible
            (`nuno.estimate.ranking.SHARE`); None is all.
        share_if_poor: It looks at all candidates that together hold so much of the probability where even the best
            future so far fits poorly (`nuno.estimate.doubt.FAIRLY`) and the hand's way is not known; 1 is all, None
            at no more than otherwise.
        any_way: Where the hand's way is not known, as large a share of its guesses goes up first as that way is likely
            by what was looked at before.
        settle_seconds: At most so long its cloths may take to come to rest in the hand [s].
        reflects: Whether its futures, reflected, count for candidates that it passes over
            (`nuno.estimate.mirrored`).
        self_contact: Whether parts of its cloths touch each other. Those that pass through themselves take a quarter
            to a half of the time; no estimate ends with such a stage.
        share: The plausible candidates together hold so much of the probability; None is
            `nuno.estimate.ranking.SHARE`.
        spares: Of the probability it may leave out where its worlds are a group of lanes fewer then, on a CPU.
        asks_hand: Of the first stage: whether all guesses after it take the hand's height for a mistake where the image
            after shows cloth at the hand's place, or none near it (`elsewhere`).
    """

    cells: int
    substeps: int
    hypotheses: tuple[Hypothesis, ...]
    best: int | None = None
    share_if_poor: float | None = None
    any_way: bool = False
    settle_seconds: float = SETTLE_SECONDS
    reflects: bool = True
    self_contact: bool = True
    share: float | None = None
    spares: float = 0.0
    asks_hand: bool = False

    def with_up_first(self, share: float) -> Discretisation:
        """The same with a ``share`` of the guesses, 0 to 1, going up first, evenly spread; those that do still do."""
        k = np.arange(len(self.hypotheses) + 1)
        ups = np.diff(np.floor(k * share + 0.5)) > 0.0
        if not ups.any():
            return self
        guesses = (replace(g, up_first=g.up_first or bool(up)) for g, up in zip(self.hypotheses, ups, strict=True))
        return replace(self, hypotheses=tuple(guesses))


def elsewhere(stages: Sequence[Discretisation], mistake: float) -> tuple[Discretisation, ...]:
    """Return stages to follow the first of some, where the hand is seen to be higher than it is told by a mistake.

    The first one once more, and those after it; guesses that took it to be wrong the other way take it to be as told.

    Args:
        stages: The stages.
        mistake: By how much it is higher [m]; below 0 it is lower.
    """

    def moved(guess: Hypothesis) -> Hypothesis:
        return replace(guess, mistake=0.0 if guess.mistake * mistake < 0.0 else mistake)

    return tuple(replace(stage, hypotheses=tuple(map(moved, stage.hypotheses))) for stage in stages)


RIGIDITIES = (3e-5, 1e-4, 3e-4, 8e-4, 1.6e-3)
"""[N m] From measured fabrics (1.4e-5 to 1.25e-4) on to stiffer cloths such as canvas."""
FRICTIONS = (0.25, 0.5)
"""The part on the table slides after the hand, which changes the silhouette as much as the rigidity does."""


def hypotheses_with(
    stretch_stiffness: float, shear_stiffness: float, rigidities: tuple[float, ...] = RIGIDITIES
) -> tuple[Hypothesis, ...]:
    """One hypothesis for each friction and bending rigidity."""
    return tuple(
        Hypothesis(rigidity, friction, stretch_stiffness=stretch_stiffness, shear_stiffness=shear_stiffness)
        for friction in FRICTIONS
        for rigidity in rigidities
    )


HYPOTHESES = hypotheses_with(1000.0, 300.0)
"""Guesses for a mesh of one's own choice."""

LIMP = (5e-6, 3e-5, 1e-4, 3e-4, 1e-3)
"""[N m] Lower ones, for coarse meshes that give in their plane: they stay open longer than a real cloth."""

FIRM = hypotheses_with(1000.0, 40.0)
"""Guesses for a coarse mesh."""
LOOSE = hypotheses_with(150.0, 15.0, LIMP)
"""Guesses at a cloth that gives in its plane, for a coarse mesh.

A coarse mesh that hardly stretches cannot fold in two directions at once and holds a lifted cloth open. One that gives
falls into pleats, as a limp cloth on a finer mesh does (docs/reports/accuracy.md).
"""
SHEARING = hypotheses_with(1000.0, 10.0, LIMP)
"""Guesses at a cloth that gives on the bias alone, for a coarse mesh."""


def _firm(bending_rigidity: float, friction: float, **others: Any) -> Hypothesis:
    """A guess for a coarse mesh."""
    return Hypothesis(bending_rigidity, friction, stretch_stiffness=1000.0, shear_stiffness=40.0, **others)


def _loose(bending_rigidity: float, friction: float, **others: Any) -> Hypothesis:
    """A guess at a cloth that gives in its plane."""
    return Hypothesis(bending_rigidity, friction, stretch_stiffness=150.0, shear_stiffness=15.0, **others)


_HIGHER, _LOWER = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
_MISTAKES = tuple(
    replace(guess, mistake=sign * GROSS)
    for guess in (_firm(1e-4, 0.3), _firm(8e-4, 0.5), _loose(1e-4, 0.4))
    for sign in (-1.0, 1.0)
)

_LATER = SHEARING[::2] + _MISTAKES
_SPARING: dict[str, Any] = dict(spares=0.02)
"""Of 416 estimates whose futures were kept none changed its answer by that (docs/reports/accuracy.md)."""
_SHORT: dict[str, Any] = dict(any_way=True, settle_seconds=1.5, reflects=False, **_SPARING)
"""Stages of few candidates, among many guesses."""

DISCRETISATIONS = (
    Discretisation(15, 10, (_firm(1e-4, 0.25), _firm(2e-3, 0.5), _loose(3e-5, 0.5)), asks_hand=True),
    Discretisation(
        15, 10, (_firm(3e-5, 0.25), _firm(5e-3, 0.3), _loose(1e-4, 0.25), _loose(1e-3, 0.5)), best=16, **_SPARING
    ),
    Discretisation(
        15, 10, (_firm(3e-4, 0.25, up_first=True), _loose(1e-4, 0.5, up_first=True)), best=16, share_if_poor=0.98,
        **_SPARING,
    ),
    Discretisation(
        20, 14,
        (_loose(3e-4, 0.25), _firm(8e-4, 0.5, hand=_HIGHER), _loose(1e-3, 0.25), _firm(1e-4, 0.5, hand=_LOWER)),
        best=6, **_SHORT,
    ),
    Discretisation(
        20, 14,
        (
            _firm(8e-4, 0.25), _firm(3e-5, 0.5), _firm(3e-4, 0.5), _firm(1.6e-3, 0.5),
            _loose(1e-6, 0.25), _loose(3e-5, 0.25, hand=_HIGHER), _loose(5e-6, 0.5, hand=_LOWER), _loose(3e-4, 0.5),
        ),
        best=4, **_SHORT,
    ),
    Discretisation(15, 10, _LATER, best=4, **_SHORT),
)  # fmt: skip
"""Stages, which end as soon as a candidate is sure (`nuno.estimate.ranking.SURE`).

Three guesses that differ as far as they may, firm and loose, limp and stiff, slippery and not, look at every candidate;
the others of both kinds at the best, and one that shears at the best of these. How a lifted cloth buckles depends on
how it stretches and shears and on the mesh: those that differ in all three had more right answers than any one. A weave
that is finer and stiffer still had not (docs/reports/accuracy.md). Some guesses take it that the hand went up first and
sideways then, that it is a standard deviation higher or lower than it is told, or, by mistake, much more; where the
image after shows that it is, all after the first stage do. A cloth that is led up first swings, and takes half as much
time again as others to be imagined. So such guesses look at nearly every candidate only where the best of seven
straight ways fits poorly: these then often take the true candidate for one of the worst. All but the stages between are
on a coarser mesh, which ranks the true one about as high in less than half of the time; different meshes together rank
it higher than any. After the first three, guesses go the way that is likelier by then. Those last stages look at the
few candidates that many guesses have left, so that reflections tell nothing new, and most of their cloths hang still
after 1.5 s.
"""

_COARSE = tuple(replace(stage, cells=12, substeps=8, settle_seconds=1.5) for stage in DISCRETISATIONS[:3])
OF_OUTLINES = (
    replace(_COARSE[0], settle_seconds=SETTLE_SECONDS, self_contact=False),
    replace(_COARSE[0], best=36, share=0.98, **_SPARING),
    *_COARSE[1:],
    *(replace(stage, cells=15, substeps=10) for stage in DISCRETISATIONS[3:5]),
    replace(DISCRETISATIONS[5], cells=12, substeps=8),
)
"""The same of a cloth that is taken by its outline, whose triangles take several times as long as a rectangle's grid.

So each stage is on a coarser mesh, which told as much of outlines (docs/reports/accuracy.md). The first guesses look at
every candidate with cloths that pass through themselves, in a quarter of the time, and only at all that hold 98 % of
the probability then with cloths that touch themselves. Of rectangles that told no more.
"""


def cell_counts(long_m: float, short_m: float, cells: int, grid: tuple[int, int]) -> tuple[int, int]:
    """Cells along both sides, multiples of the candidate grid's steps (grid - 1).

    Args:
        long_m: Longer side [m].
        short_m: Shorter side [m].
        cells: Wanted along the longer side.
        grid: Candidates along the longer and shorter side.
    """
    steps = np.maximum(np.asarray(grid) - 1, 1)
    along = max(1, round(cells / steps[0])) * steps[0]
    across = max(1, round(along * short_m / long_m / steps[1])) * steps[1]
    return int(along), int(across)
