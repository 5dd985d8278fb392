"""VelocityStream: the velocity of a base, which real ones want to be told again and again."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from nuno.errors import NunoError
from nuno.robot.goal import Goal, GoalStatus
from nuno.robot.wire import messages as ros
from nuno.robot.wire.clock import WireClock
from nuno.robot.wire.connection import Connection

INTERVAL = 0.1
"""[s] Between two messages; bases stop when none came for about half a second."""


class VelocityStream:
    """A velocity that is published until its time is over, in a thread of its own.

    Args:
        connection: To the robot.
        clock: The robot's.
        topic: Where bases take velocities from.
        twist: The velocity, a geometry_msgs/msg/Twist.
        seconds: For how long [s] of the robot's clock.
        stop: Whether the base rests after that.
        goal: What ends when it is over.
        tell: Called after that.
    """

    def __init__(
        self, connection: Connection, clock: WireClock, topic: str, twist: dict[str, Any], seconds: float, stop: bool,
        goal: Goal, tell: Callable[[], None],
    ) -> None:  # fmt: skip
        self._connection, self._clock, self._topic, self._twist = connection, clock, topic, twist
        self._seconds, self._stop, self._goal, self._tell = seconds, stop, goal, tell
        self._cancelled = threading.Event()
        goal.status = GoalStatus.ACTIVE
        self._thread = threading.Thread(target=self._run, name="nuno-velocity", daemon=True)
        self._thread.start()

    def cancel(self, rest: bool = True) -> None:
        """End it now, and with ``rest`` stop the base; nothing where it is over."""
        self._stop = rest
        self._cancelled.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            end = self._clock.now() + self._seconds
            while not self._cancelled.is_set() and (left := end - self._clock.now()) > 0.0:
                self._connection.publish(self._topic, ros.TWIST, self._twist)
                self._cancelled.wait(min(INTERVAL, max(left, 0.001)))
            if self._stop:
                self._connection.publish(self._topic, ros.TWIST, ros.twist_fields(0.0, 0.0, 0.0))
            self._goal.finish(GoalStatus.PREEMPTED if self._cancelled.is_set() else GoalStatus.SUCCEEDED)
        except NunoError as error:
            self._goal.finish(GoalStatus.LOST, text=str(error))
        self._tell()
