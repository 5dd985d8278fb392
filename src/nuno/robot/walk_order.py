"""WalkOrder: what a robot was told to do with its legs, kept for another that is to do the same later."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nuno.robot.walk import TimedMotion

SOON = 1e-9
"""[s] Rounding of sums of frames."""

Place = tuple[float, float, float]
"""x, y [m] and yaw [rad]."""


@dataclass(frozen=True, eq=False)
class WalkOrder:
    """An order to walk, or to come to rest.

    Attributes:
        clock: When it was given [s], by the joints' clock.
        place: Ahead, to the left [m], counterclockwise [rad], seen from where the robot was then; None to come to rest.
        seconds: In which it is to cover that [s]; None as it walks by itself.
        walk: The walk that came of it, so that whoever stands so takes it as it is; None where there is none.
        hold: Where ``place`` is a velocity [m/s, rad/s] to keep, for how long [s]; None where it is a place.
    """

    clock: float
    place: Place | None
    seconds: float | None = None
    walk: TimedMotion | None = None
    hold: float | None = None


def queued(waiting: Sequence[WalkOrder], given: Iterable[WalkOrder], later: float = 0.0) -> tuple[WalkOrder, ...]:
    """Return what waits, and what was given, each of which took the place of all that waited for after it.

    Args:
        waiting: Orders, in the order of time.
        given: Others, likewise.
        later: By how much later each is to be carried out [s].
    """
    queue = list(waiting)
    for own in given:
        queue = [*(before for before in queue if before.clock <= own.clock + SOON), own]
    return tuple(replace(own, clock=own.clock + later) for own in queue)
