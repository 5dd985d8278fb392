"""Stages of an estimate that are imagined in one batch, before it is known whether and of what each will be asked.

A GPU takes hardly longer for 400 coarse cloths than for 100, which leave most of it idle. So where the first stage is
not sure, those after it with the same mesh and step are imagined together, of all candidates of the first of them, for
each looks at the best of what the one before looked at. A stage then takes from the batch what it would have imagined
itself, to the bit: a world is the same in any batch, and the batch is kept at every moment at which a stage may find
that one of its cloths is at rest (`nuno.estimate.coming_to_rest`). So the device need not wait either while that is
asked. What no stage asks for was in vain, and what a stage asks for beyond it is imagined anew.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import SimulationDiverged
from nuno.estimate.coming_to_rest import LOOK_SECONDS, REST_SPEED, ComingToRest, mean_speeds
from nuno.estimate.futures import LIFT_SECONDS, Futures, begin_picks, solver_of
from nuno.estimate.hypotheses import Discretisation

if TYPE_CHECKING:
    import warp as wp

    from nuno.solvers.particle_solver import ParticleSolver
    from nuno.solvers.particle_state import Kept

LOOKS = 5
"""Moments that a device goes through without being waited for."""


@dataclass(frozen=True, eq=False)
class Moment:
    """A batch as it was once.

    Attributes:
        time: The world's time then [s].
        solver: The cloths' solver.
        state: What it kept.
        positions: (worlds, n) of vec3, the cloths' vertices [m].
    """

    time: float
    solver: ParticleSolver
    state: Kept
    positions: wp.array

    @cached_property
    def speeds(self) -> np.ndarray:
        """(worlds,) float, the cloths' root mean square speeds [m/s]."""
        return mean_speeds(*self.solver.velocities_apart(self.state))


@dataclass
class Part(Futures):
    """The part of a batch that one stage looks at.

    Attributes:
        batch: The whole batch.
        moments: When the batch was looked at.
        at: (hypotheses * candidates,) int, at which of these each future left, at rest, or as late as it may be.
        places: (hypotheses * candidates,) int, where the futures are in the batch.
    """

    batch: Futures
    moments: tuple[Moment, ...]
    at: np.ndarray
    places: np.ndarray

    @property
    def finite(self) -> np.ndarray:
        """(hypotheses, candidates) bool, all of them: a batch with another has no moment after it."""
        return np.ones((len(self.discretisation.hypotheses), self.candidates), dtype=bool)

    @property
    def positions(self) -> wp.array:
        """(hypotheses * candidates, n) of vec3, the cloths' vertices on the device [m]."""
        import warp as wp

        device: Any = self.moments[0].positions.device
        every: Any = None

        def rows(array: wp.array, which: np.ndarray) -> Any:
            chosen: Any = wp.array(which.astype(np.int32), dtype=int, device=device)
            return wp.indexedarray(array, [chosen, every])

        shape = (len(self.places), self.moments[0].positions.shape[1])
        found: wp.array = wp.empty(shape, dtype=wp.vec3, device=device)
        for number in np.unique(self.at):
            of = np.flatnonzero(self.at == number)
            wp.copy(rows(found, of), rows(self.moments[number].positions, self.places[of]).contiguous())
        return found

    def whole(self, world: int) -> tuple[Futures, int]:
        """The batch, brought back to when future number ``world`` left, and where that is in it."""
        moment = self.moments[self.at[world]]
        moment.solver.put_back(moment.state)
        self.world._time = moment.time
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
        """Return a stage's findings of the ``chosen`` candidates (m,) int; None where not all are in the batch."""
        number = next((k for k, other in enumerate(self.stages) if other is stage), None)
        if number is None or not np.isin(chosen, self.candidates).all():
            return None
        first = sum(len(other.hypotheses) for other in self.stages[:number])
        hypotheses = first + np.arange(len(stage.hypotheses))
        columns = np.array([int(np.nonzero(self.candidates == c)[0][0]) for c in chosen])
        places = (hypotheses[:, None] * len(self.candidates) + columns).ravel()
        # as late as it may be by this stage; another in the batch may let its cloths take longer
        batch, moments = self.batch, self.moments[: _looks(stage)]
        return Part(
            batch.world, batch.body, batch.origin, len(chosen), stage, batch, moments, moments_of_rest(moments, places),
            places,
        )  # fmt: skip


def moments_of_rest(moments: Sequence[Moment], places: np.ndarray) -> np.ndarray:
    """(k,) int, at which of the ``moments`` worlds ``places`` (k,) leave, as `imagine_picks` would let them."""
    resting = ComingToRest(len(places))
    at = np.full(len(places), len(moments) - 1)
    for number, moment in enumerate(moments):
        before = resting.going
        if resting.look(moment.speeds[places[before]]):
            at[before] = number
            break
        if (stay := resting.leave()) is not None:
            at[before[~stay]] = number
    return at


def has_room(device: str) -> bool:
    """Return True if more worlds take hardly longer; a CPU's cores are busy with any."""
    return device != "cpu"


class Ahead:
    """Imagined stages of an estimate, some before they were asked for.

    Args:
        uv: (all, 2) float, where all candidates are.
        settings: The other arguments of `nuno.estimate.futures.imagine_picks`, but for the discretisation.
    """

    def __init__(self, uv: np.ndarray, **settings: Any) -> None:
        self._uv, self._settings = uv, settings
        self._batches: list[Together] = []

    def part(self, stages: Sequence[Discretisation], chosen: np.ndarray) -> Part | None:
        """Return the first stage's findings of the ``chosen`` candidates (m,) int; None where some world diverged.

        If need be they are imagined, and with them what the stages after it may look at.
        """
        for batch in self._batches:
            if (part := batch.part(stages[0], chosen)) is not None:
                return part
        try:
            self._batches.append(imagine_together(alike(stages), chosen, self._uv, **self._settings))
        except SimulationDiverged:  # maybe in a world that this stage does not ask for
            return None
        return self._batches[-1].part(stages[0], chosen)


def alike(stages: Sequence[Discretisation]) -> tuple[Discretisation, ...]:
    """The first stage, and where it looks at the best candidates those after it with the same mesh and step.

    Those whose hands' ways hang on what comes out before are left for later.
    """
    first = stages[0]
    if first.best is None:
        return (first,)

    def kind(stage: Discretisation) -> tuple[int, int, bool, bool]:
        return stage.cells, stage.substeps, stage.any_way, stage.self_contact

    return (first, *(stage for stage in stages[1:] if stage.best is not None and kind(stage) == kind(first)))


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
    together = replace(stages[0], hypotheses=tuple(guess for stage in stages for guess in stage.hypotheses))
    batch = begin_picks(candidates=uv[chosen], discretisation=together, lift_seconds=lift_seconds, **settings)
    world, solver = batch.world, solver_of(batch.body)
    world.run(lift_seconds, progress=False)
    moments: list[Moment] = []
    first = 0

    def look(time: float) -> None:
        moments.append(Moment(time, solver, solver.keep(), solver.positions_on_device()))

    def look_again() -> None:
        del moments[first:]

    # once the fastest is at rest, any part of them is
    most = max(map(_looks, stages))
    while len(moments) < most and not (moments and moments[-1].speeds.max() < REST_SPEED):
        first = len(moments)
        instants = world.time + LOOK_SECONDS * np.arange(1, min(LOOKS, most - first) + 1)
        end = float(instants[-1])
        with world._call():
            world._advance(end - world.time, end, look, instants, look_again)
    return Together(batch, stages, chosen, tuple(moments))


def _looks(stage: Discretisation) -> int:
    """The most times that a stage looks at its cloths."""
    return max(1, math.ceil(stage.settle_seconds / LOOK_SECONDS))
