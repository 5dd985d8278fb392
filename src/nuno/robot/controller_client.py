"""ControllerClient: what a program asked of one of a robot's controllers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from nuno.robot.goal import Goal, Tolerances
from nuno.robot.trajectory import JointTrajectory
from nuno.validation import number

Controller = dict[str, Any]
"""One controller: "controller_type" (its name here), "controller_action" and "controller_state" (what the wire calls
its action and the topic of its state), "action_type", and "joint_names"."""


class TrajectorySender(Protocol):
    """A robot to which trajectories are sent; `JointInterface` says what each member does."""

    def send_trajectory(
        self, controller: Controller, trajectory: JointTrajectory, start_time: float, tolerances: Tolerances | None
    ) -> Goal:
        """Send a controller a trajectory, and return its goal."""

    def cancel_trajectories(self, controller: Controller) -> None:
        """Stop what a controller does."""

    def wait_until(self, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait until something is so, and return whether it is."""


class ControllerClient:
    """The client of one controller: the last goal that this program sent.

    Args:
        interface: The robot's.
        controller: The controller.
    """

    def __init__(self, interface: TrajectorySender, controller: Controller) -> None:
        self.interface, self.controller = interface, controller
        self.goal: Goal | None = None

    def send_goal(
        self, trajectory: JointTrajectory, start_time: float = 0.0, tolerances: Tolerances | None = None
    ) -> Goal:
        """Send a trajectory that starts in ``start_time`` [s], in place of the one under way.

        Raises:
            InvalidInputError: a time that is not finite.
        """
        start = number("start_time", start_time)
        self.goal = self.interface.send_trajectory(self.controller, trajectory, start, tolerances)
        return self.goal

    def is_interpolating(self) -> bool:
        """Return True if the last goal is under way."""
        return self.goal is not None and not self.goal.is_done

    def wait_for_result(self, timeout: float = 0.0) -> bool:
        """Wait until the last goal ended, up to ``timeout`` [s], 0 for ever; return whether there is one that did."""
        goal = self.goal
        return goal is not None and self.interface.wait_until(lambda: goal.is_done, timeout)

    def cancel_all_goals(self) -> None:
        """Let the controller give up what it does, whoever asked for it; it holds where it is."""
        self.interface.cancel_trajectories(self.controller)
