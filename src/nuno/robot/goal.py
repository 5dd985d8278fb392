"""Goals: what a robot was asked to do, and how far it is; the states and codes are those of ROS' actions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from nuno.validation import check_fields, number

_numbers = itertools.count(1)


class GoalStatus(IntEnum):
    """The status of a goal, numbered as in actionlib_msgs/GoalStatus."""

    PENDING = 0
    ACTIVE = 1
    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    PREEMPTING = 6
    RECALLING = 7
    RECALLED = 8
    LOST = 9


class ResultCode(IntEnum):
    """The result of a trajectory, numbered as in control_msgs/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


ENDS = frozenset(
    (GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED, GoalStatus.REJECTED, GoalStatus.RECALLED,
     GoalStatus.LOST)
)  # fmt: skip


class Goal:
    """A handle on what a robot was asked to do. The robot's side writes it, everyone may read it.

    Args:
        asked: What was asked for, such as a ``JointTrajectory``.
        name: Of the goal, as the wire knows it; None gives it a number.

    Attributes:
        status: Where it stands.
        code: How it ended, a ``ResultCode`` where it is a trajectory; None until then.
        text: What went wrong, "" where nothing did.
        feedback: What was last told of it, None before that.
        holds: Of a hand's goal, whether the hand holds something; None until it ended, and where nobody told.
    """

    def __init__(self, asked: Any = None, name: str | None = None) -> None:
        self.asked = asked
        self.name = f"goal_{next(_numbers)}" if name is None else name
        self.status = GoalStatus.PENDING
        self.code: int | None = None
        self.text = ""
        self.feedback: Any = None
        self.holds: bool | None = None

    def __repr__(self) -> str:
        return f"<Goal {self.name!r}, {self.status.name.lower()}{f': {self.text}' if self.text else ''}>"

    def copy(self) -> Goal:
        """Return another goal of the same name that stands where this one stands."""
        made = Goal(self.asked, self.name)
        made.status, made.code, made.text, made.feedback = self.status, self.code, self.text, self.feedback
        made.holds = self.holds
        return made

    @property
    def is_done(self) -> bool:
        """Return True if it has come to an end, of whichever kind."""
        return self.status in ENDS

    @property
    def succeeded(self) -> bool:
        """Return True if what was asked for was done."""
        return self.status == GoalStatus.SUCCEEDED

    def finish(self, status: GoalStatus, code: int | None = None, text: str = "") -> None:
        """End it; a goal that has ended stays as it ended."""
        if not self.is_done:
            self.code, self.text = code, text
            self.status = status  # last, as a waiting thread looks at it


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of joints along a trajectory; joints that are not named are free.

    Attributes:
        path: Along the way, by joint [rad; m for slides].
        goal: At the end, likewise.
        goal_time: How much later than planned the end may be reached [s]; 0 waits for ever.

    Raises:
        InvalidInputError: a tolerance that is negative or not finite.
    """

    path: Mapping[str, float] = field(default_factory=dict)
    goal: Mapping[str, float] = field(default_factory=dict)
    goal_time: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        for what in ("path", "goal"):
            given = {name: number(f"the {what} tolerance of {name!r}", value, low=0.0)
                     for name, value in getattr(self, what).items()}  # fmt: skip
            object.__setattr__(self, what, given)
        object.__setattr__(self, "goal_time", number("goal_time", self.goal_time, low=0.0))


def standing_for(goal: Goal | None, goals: Mapping[int, Goal]) -> Goal | None:
    """Return what stands for a goal in another world: by its ``id`` one of these, else a copy of it."""
    return goal if goal is None else goals.get(id(goal)) or goal.copy()
