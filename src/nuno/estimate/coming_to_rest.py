"""Imagined cloths that come to rest in the hand: those that have leave the batch, so that the others take less time.

Some hang still half a second after the lift, some swing for two and a half. A CPU goes through a batch by groups of
`nuno.numbers.lanes.LANES` worlds. So as soon as the cloths that still move make up fewer groups, they go on by
themselves. What a world comes to is the same in any batch, to the bit; only when it is looked at for the last time
hangs on the others.
"""

from __future__ import annotations

import numpy as np

from nuno.numbers.lanes import LANES

SETTLE_SECONDS = 2.5
"""[s] At most so long the cloth may take to come to rest in the hand."""
LOOK_SECONDS = 0.25
"""[s] After so long each it is asked whether it has."""
REST_SPEED = 0.03
"""[m/s] Below this root mean square speed a cloth counts as at rest: under 1 mm between two looks at it."""


class ComingToRest:
    """Worlds of a batch that still move, look by look.

    Args:
        count: How many worlds there are.

    Attributes:
        going: (k,) int, the worlds that go on.
    """

    def __init__(self, count: int) -> None:
        self.going = np.arange(count)
        self._speeds = np.full(count, np.inf)
        self._calm = np.zeros(count, dtype=bool)

    def look(self, speeds: np.ndarray) -> bool:
        """Note the speeds (k,) [m/s] of the worlds that go on; return True if nine of ten of all worlds are at rest."""
        # one that was twice as fast before does not swing through the turning point now
        self._calm = (speeds < REST_SPEED) & (self._speeds[self.going] < 2.0 * REST_SPEED)
        self._speeds[self.going] = speeds
        return slow_part(self._speeds) < REST_SPEED

    def leave(self) -> np.ndarray | None:
        """Let those at rest go, if the others are fewer groups of lanes.

        Returns:
            (k,) bool, which of those that went on still do; None where all do. They are two at least: where fewer of
            more than `LANES` worlds move, `look` says that it is over.
        """
        stay = ~self._calm
        if groups(int(stay.sum())) == groups(len(stay)):
            return None
        self.going = self.going[stay]
        return stay


def groups(worlds: int) -> int:
    """The number of groups of lanes that some worlds take."""
    return -(-worlds // LANES)


def mean_speeds(vx: np.ndarray, vy: np.ndarray, vz: np.ndarray) -> np.ndarray:
    """(worlds,) float, root mean square speeds [m/s] of velocities (worlds, n) each."""
    return np.asarray(np.sqrt((vx * vx + vy * vy + vz * vz).mean(axis=-1)))


def slow_part(speeds: np.ndarray) -> float:
    """The 90th percentile of speeds (worlds,) [m/s]."""
    return float(np.percentile(speeds, 90))
