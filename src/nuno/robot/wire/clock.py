"""WireClock: what time it is for a robot on the wire."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

from nuno.errors import MessageError
from nuno.robot.reported_joints import TICK
from nuno.robot.wire import messages as ros
from nuno.robot.wire.connection import Connection
from nuno.robot.wire.names import CLOCK_KIND, STEPPED, Names

DRIFT = 1e-4
"""Of clocks against each other: what is known of the robot's is held for a little less sure as time goes by."""


class WireClock:
    """The robot's clock.

    Where "/clock" is published, as by simulations, that is the time. Where it is not, joint states tell: when one
    comes, the robot's clock is at least as far as its stamp, and the one that came fastest tells best. The clocks of
    the two machines need not agree.

    Args:
        connection: To the robot.
        names: Of topics.
        tell: Called when the time was heard.
    """

    def __init__(self, connection: Connection, names: Names, tell: Callable[[], None]) -> None:
        self.is_nuno = self.is_stepped = False
        self.tick = TICK  # between two looks of whoever waits [s]
        self._time: float | None = None
        self._ahead: float | None = None  # of the robot's clock, against this machine's
        self._heard = 0.0
        self._tell = tell
        connection.subscribe(CLOCK_KIND, ros.STRING, self._take_kind)
        connection.subscribe(names.full(names.clock), ros.CLOCK, self._take_clock)

    def now(self) -> float:
        """Return the time [s]; 0 before anything was heard."""
        if self._time is not None:
            return self._time
        return 0.0 if self._ahead is None else time.monotonic() + self._ahead

    def set(self, now: float) -> None:
        """Take the time [s] that a simulation told."""
        self._time = now

    def hear(self, stamp: float) -> None:
        """Take the time [s] of a joint state that has just come."""
        here = time.monotonic()
        ahead = stamp - here
        if self._ahead is not None:
            ahead = max(ahead, self._ahead - DRIFT * (here - self._heard))
        self._ahead, self._heard = ahead, here

    def _take_kind(self, fields: dict[str, Any]) -> None:
        try:
            kind = json.loads(ros.field(fields, "data", str))
        except ValueError as error:
            raise MessageError(f"{CLOCK_KIND} says {fields.get('data')!r}, which is no JSON") from error
        self.is_nuno, self.is_stepped = True, ros.field(kind, "kind", str) == STEPPED
        self.tick = max(1e-4, ros.real(kind, "tick", TICK))

    def _take_clock(self, fields: dict[str, Any]) -> None:
        self._time = ros.seconds(fields, "clock")
        self._tell()
