"""Serving: a robot that a thread of its own serves to other programs."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Self

from nuno.robot.interface import RobotInterface
from nuno.robot.reported_joints import TICK
from nuno.validation import number


class Serving(ABC):
    """A server of a robot, to the program that made it.

    Args:
        robot: The robot.
        tick: Between two looks at it [s]; None takes the frames of the robot's world, else 0.01 s.

    Attributes:
        robot: The robot.
        lock: To be held by who uses the robot or its world besides.
        tick: Between two looks at the robot [s].
        error: What the simulation failed with, None as long as it has not.
    """

    _thread: threading.Thread

    def __init__(self, robot: RobotInterface, tick: float | None) -> None:
        own = 1.0 / robot.world.frame_rate if hasattr(robot, "world") else TICK
        self.tick = own if tick is None else number("tick", tick, above=0.0)
        self.robot, self.lock = robot, threading.RLock()
        self.error: Exception | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Return True if it serves: until ``close``, or until the simulation failed, which ``error`` then tells."""
        return self._thread.is_alive()

    @abstractmethod
    def close(self) -> None:
        """Stop what others have asked for and end; a second time does nothing."""

    def join(self, timeout: float | None = None) -> bool:
        """Wait until it has ended, up to ``timeout`` [s]; returns whether it has.

        Raises:
            Exception: what the simulation failed with.
        """
        self._thread.join(timeout)
        if self.error is not None:
            raise self.error
        return not self._thread.is_alive()
