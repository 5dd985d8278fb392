"""Stages of an estimate that are imagined in one batch, before it is known whether and of what each will be asked.

A GPU takes hardly longer for 400 coarse cloths than for 100, which leave most of it idle. So where a stage is not sure,
those after it with the same mesh and step are imagined with it, of all its candidates, for each looks at the best of
what the one before looked at. A stage then takes from the batch what it would have imagined itself, to the bit: a world
is the same in any batch, and the batch is kept at every moment at which a stage may find that its cloths are at rest.
What no stage asks for was in vain, and what a stage asks for beyond it is imagined by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.estimate.futures import (
    LIFT_SECONDS,
    LOOK_SECONDS,
    REST_SPEED,
    SETTLE_SECONDS,
    Futures,
    begin_picks,
    mean_speeds,
    solver_of,
)
from nuno.estimate.hypotheses import Discretisation
from nuno.run_start import RunStart

if TYPE_CHECKING:
    import warp as wp

    from nuno.world import World


@dataclass(frozen=True, eq=False)
class Moment:
    """A batch as it was once.

    Attributes:
        time: The world's time then [s].
        state: What the world goes back to.
        positions: (worlds, n) of vec3, the cloths' vertices [m].
        speeds: (worlds,) float, the cloths' root mean square speeds [m/s].
    """

    time: float
    state: RunStart
    positions: wp.array
    speeds: np.ndarray


@dataclass
class Part(Futures):
    """What one stage looks at of a batch of several.

    Attributes:
        batch: The whole batch.
        moment: When the part was at rest, or as late as it may be.
        places: (hypotheses * candidates,) int, where the futures are in the batch.
    """

    batch: Futures
    moment: Moment
    places: np.ndarray

    @property
    def finite(self) -> np.ndarray:
        """(hypotheses, candidates) bool, all of them: a batch with another has no moment after it."""
        return np.ones((len(self.discretisation.spread), self.candidates), dtype=bool)

    @property
    def positions(self) -> wp.array:
        """(hypotheses * candidates, n) of vec3, the cloths' vertices on the device [m]."""
        import warp as wp

        found = self.moment.positions
        places: Any = wp.array(self.places.astype(np.int32), dtype=int, device=found.device)
        every: Any = None
        return wp.indexedarray(found, [places, every]).contiguous()

    def whole(self, world: int) -> tuple[Futures, int]:
        """The batch, brought back to the part's moment, and where future number ``world`` is in it."""
        self.moment.state.go_back()
        self.world._time = self.moment.time
        return self.batch, int(self.places[world])


@dataclass(frozen=True, eq=False)
class Together:
    """Several stages in one batch.

    Attributes:
        batch: The batch of all their hypotheses, one stage's after the other's.
        stages: The stages.
        candidates: (k,) int, the numbers of the candidates in it.
        moments: When it was looked at, one after the other.
    """

    batch: Futures
    stages: tuple[Discretisation, ...]
    candidates: np.ndarray
    moments: tuple[Moment, ...]

    def part(self, stage: Discretisation, chosen: np.ndarray) -> Part | None:
        """What a stage finds of the ``chosen`` candidates (m,) int; None where not all of that is in the batch."""
        number = next((k for k, other in enumerate(self.stages) if other is stage), None)
        if number is None or not np.isin(chosen, self.candidates).all():
            return None
        first = sum(len(other.spread) for other in self.stages[:number])
        hypotheses = first + np.arange(len(stage.spread))
        columns = np.array([int(np.nonzero(self.candidates == c)[0][0]) for c in chosen])
        places = (hypotheses[:, None] * len(self.candidates) + columns).ravel()
        # as `nuno.estimate.futures.imagine_picks` asks it
        rests = (m for m in self.moments if float(np.percentile(m.speeds[places], 90)) < REST_SPEED)
        moment = next(rests, self.moments[-1])
        batch = self.batch
        return Part(batch.world, batch.body, batch.origin, len(chosen), stage, batch, moment, places)


def has_room(device: str) -> bool:
    """Whether more worlds take hardly longer; a CPU's cores are busy with any."""
    return device != "cpu"


def alike(stages: Sequence[Discretisation]) -> tuple[Discretisation, ...]:
    """The first stage, and those after it that look at some candidates on the same mesh with the same step."""
    first = stages[0]
    same = (first.cells, first.substeps)
    return (first, *(s for s in stages[1:] if s.best is not None and (s.cells, s.substeps) == same))


def imagine_together(
    stages: tuple[Discretisation, ...], chosen: np.ndarray, uv: np.ndarray, *, lift_seconds: float = LIFT_SECONDS,
    **settings: Any,
) -> Together:  # fmt: skip
    """Imagine what several stages of the same mesh and step may look at.

    Args:
        stages: The stages.
        chosen: (k,) int, the candidates' numbers.
        uv: (all, 2) float, where all candidates are.
        lift_seconds: As `nuno.estimate.futures.imagine_picks` takes it, like the ``settings``.
        settings: The other arguments of that function.
    """
    spread = tuple(guess for stage in stages for guess in stage.spread)
    batch = begin_picks(
        candidates=uv[chosen], discretisation=replace(stages[0], spread=spread), lift_seconds=lift_seconds, **settings
    )
    batch.world.run(lift_seconds, progress=False)
    moments: list[Moment] = []
    # once the fastest is at rest, any part of them is
    while len(moments) * LOOK_SECONDS < SETTLE_SECONDS and not (moments and moments[-1].speeds.max() < REST_SPEED):
        batch.world.run(LOOK_SECONDS, progress=False)
        moments.append(_moment(batch))
    return Together(batch, stages, chosen, tuple(moments))


def _moment(batch: Futures) -> Moment:
    world: World = batch.world
    assert batch.body._dynamics is not None
    state = RunStart(world, {batch.body: batch.body._dynamics})
    return Moment(world.time, state, solver_of(batch.body).positions_on_device(), mean_speeds(batch.body))
