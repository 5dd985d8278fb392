"""WireGoals: goals that were sent to a robot on the wire."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from nuno.errors import NunoError
from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.wire.connection import SentGoal
from nuno.robot.wire.newest import Newest
from nuno.robot.wire.protocol import ABORTED, CANCELED, SUCCEEDED

Fields = dict[str, Any]


class WireGoals:
    """The last goal of each controller, of the base and of each hand.

    Args:
        newest: Whom feedback and results are told to.
    """

    def __init__(self, newest: Newest) -> None:
        self._newest = newest
        self._sent: dict[str, tuple[Goal, SentGoal]] = {}

    def is_under_way(self, who: str) -> bool:
        """Return True if a goal that was sent from here has not ended."""
        return who in self._sent and not self._sent[who][0].is_done

    def send(self, who: str, goal: Goal, action: str, kind: str, fields: Fields, acknowledged: bool) -> Goal:
        """Send a goal, and return it.

        Args:
            who: Whose it is: a controller, "base", or a hand.
            goal: The goal.
            action: The action's name.
            kind: Its type.
            fields: Of the goal on the wire.
            acknowledged: Whether the other side says at once that it has accepted a goal, which is waited for.
        """
        accepted = threading.Event()

        def feedback(values: Fields) -> None:
            goal.feedback = values
            accepted.set()
            self._newest.tell()

        def done(sent: SentGoal) -> None:
            _finish(goal, sent)
            self._newest.tell()

        connection = self._newest.connection
        sent = connection.send_goal(action, kind, fields, feedback)
        self._sent[who] = goal, sent
        if not goal.is_done:
            goal.status = GoalStatus.ACTIVE
        sent.when_done(done)
        if acknowledged:
            self._newest.wait(lambda: accepted.is_set() or goal.is_done, connection.timeout)
        return goal

    def cancel(self, who: str, wait: bool = True) -> bool:
        """Cancel what was sent from here; returns whether anything was under way."""
        if not self.is_under_way(who):
            return False
        goal, sent = self._sent[who]
        sent.cancel()
        if wait:
            self._newest.wait(lambda: goal.is_done, self._newest.connection.timeout)
        return True


def _finish(goal: Goal, sent: SentGoal) -> None:
    """Let a goal end as its result says."""
    try:
        status, values, accepted = sent.result(0.0)
    except NunoError as error:
        goal.finish(GoalStatus.LOST, text=str(error))
        return
    fields = values if isinstance(values, Mapping) else {}
    code = fields.get("error_code")
    text = str(fields.get("error_string") or fields.get("error_msg") or ("" if fields else values or ""))
    code = code if isinstance(code, int) else None
    if isinstance(stalled := fields.get("stalled"), bool):
        goal.holds = stalled
    ends = {SUCCEEDED: GoalStatus.SUCCEEDED, CANCELED: GoalStatus.PREEMPTED, ABORTED: GoalStatus.ABORTED}
    if not accepted:
        goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_GOAL if code is None else code, text)
    elif status == SUCCEEDED and fields.get("reached_goal") is False:
        goal.finish(GoalStatus.ABORTED, code, "the hand was stopped")
    else:
        goal.finish(ends.get(status, GoalStatus.LOST), code, text)
