"""JointInterface: the joints of a robot as its driver offers them, whether it is real, simulated or behind a wire.

Names, order of arguments, defaults, units and what is returned are those of scikit-robot's interface to a real robot
(0.4.7), so that a program written for that runs here. What a robot itself must bring are the abstract methods.
"""

from __future__ import annotations

import itertools
import logging
from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.controller_client import Controller, ControllerClient
from nuno.robot.controller_groups import controller_groups
from nuno.robot.goal import Goal, Tolerances
from nuno.robot.limb_controllers import LimbControllers
from nuno.robot.reported_joints import Angles, ReportedJoints
from nuno.robot.trajectory import JointTrajectory, passing_velocities
from nuno.shapes.path import minimum_jerk
from nuno.validation import checked, finite_array, number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

logger = logging.getLogger(__name__)

STILL = (np.deg2rad(0.1), 0.01)
"""[rad], [m] Changes of hinges and slides that count as none when the shortest time is worked out."""
INTERPOLATIONS = ("linear", "minjerk")
MAX_POINTS = 100_000
"""That an interpolation makes; a minute at 1 kHz has 60,000."""


class JointInterface(LimbControllers, ReportedJoints):
    """The joints of a robot and the controllers that move them.

    Angle vectors are (n,) [rad; m for slides] in the order of ``robot.joint_names``; where one is sent, a mapping from
    joint names does as well, other joints staying where they are, and so does a scikit-robot model, whose own order is
    another. A bare vector that is beyond the limits is refused.

    Args:
        robot: The model; the interface keeps a copy, ``robot``, that shows what was last known of the real one.
        default_controller: The name of all controllers together.
        controller_timeout: How long a controller is waited for at the beginning [s]; None for ever.
        namespace: What the names of actions and topics begin with.
    """

    @checked
    def __init__(
        self, robot: Humanoid, default_controller: str = "default_controller", *,
        controller_timeout: float | None = 3.0, namespace: str | None = None,
    ) -> None:  # fmt: skip
        super().__init__(robot)
        self.controller_timeout, self.namespace = controller_timeout, namespace
        self.controller_table: dict[str, list[ControllerClient]] = {}
        self.controller_param_table: dict[str, list[Controller]] = {}
        self.controller_type = default_controller
        self.controller_actions = self.add_controller(default_controller, create_actions=True)

    # What a robot must bring

    @abstractmethod
    def send_trajectory(
        self, controller: Controller, trajectory: JointTrajectory, start_time: float, tolerances: Tolerances | None
    ) -> Goal:
        """Send a trajectory to a controller, to start ``start_time`` [s] from now, and return the goal at once.

        A trajectory that the controller does not take comes back as a goal that was rejected or aborted.
        """

    @abstractmethod
    def cancel_trajectories(self, controller: Controller) -> None:
        """Let a controller give up what it does; its goal ends as preempted, and the joints hold where they are."""

    @abstractmethod
    def is_busy(self, controller: Controller) -> bool:
        """Return True if a controller follows a goal, whoever sent it."""

    def has_controller(self, controller: Controller) -> bool:
        """Return True if the robot has a controller, once that is known or ``controller_timeout`` has passed."""
        return True

    # Controllers

    def default_controller(self) -> list[Controller]:
        """Return the controllers of the robot; by default one for each group of joints that its model shows."""
        return [
            {
                "controller_type": name,
                "controller_action": f"{name}/follow_joint_trajectory",
                "controller_state": f"{name}/state",
                "action_type": "control_msgs/FollowJointTrajectoryAction",
                "joint_names": list(joints),
            }
            for name, joints in controller_groups(self.robot).items()
        ]

    @checked
    def add_controller(
        self, controller_type: str, joint_enable_check: bool = True, create_actions: bool | None = None
    ) -> list[ControllerClient]:
        """Let a name stand for the controllers of ``default_controller``, and return them.

        Args:
            controller_type: The name.
            joint_enable_check: Whether one that does not answer leaves the name without any.
            create_actions: Whether to make them known, each also by its own name; else only the name is taken for
                default.
        """
        made: dict[str, list[ControllerClient]] = {}
        controllers = self.default_controller()
        if create_actions:
            for controller in controllers:
                if self.has_controller(controller):
                    made[controller["controller_type"]] = [ControllerClient(self, controller)]
                    continue
                logger.warning("the controller %r does not answer", controller["controller_type"])
                if joint_enable_check:
                    return []
        else:
            self.controller_type = controller_type
        self.controller_table[controller_type] = [client for clients in made.values() for client in clients]
        self.controller_param_table[controller_type] = controllers
        self.controller_table.update(made)
        self.controller_param_table.update(
            {own["controller_type"]: [own] for own in controllers if own["controller_type"] in made}
        )
        return self.controller_table[controller_type]

    # Motions

    @checked
    def angle_vector(
        self, av: Angles | None = None, time: float | None = None,
        controller_type: str | None = None, start_time: float = 0.0, time_scale: float = 5.0,
        velocities: ArrayLike | None = None, interpolation: str | None = None, interpolation_dt: float = 0.01,
    ) -> Any:  # fmt: skip
        """Send the joints to angles, and return at once; without any, wait for a fresh joint state and return it.

        Args:
            av: (n,), or by name.
            time: How long the motion takes [s]; shorter than the velocity limits allow is stretched, None takes
                ``time_scale`` times the shortest.
            controller_type: Which controllers move; None for the default.
            start_time: When it starts [s] from now.
            time_scale: At least 1.
            velocities: (n,) [rad/s; m/s] on arrival; None for rest.
            interpolation: "linear" or "minjerk" sends many points on such a motion; None the last one only.
            interpolation_dt: [s] between those.

        Returns:
            The angles (n,), those sent where any were; False where there is no such controller; what
            ``angle_vector_sequence`` returns where ``interpolation`` was asked for.

        Raises:
            RobotTimeoutError: no joint state came.
            InvalidInputError: not finite, another length, a time that is negative or no number.
        """
        if av is None:
            self._refresh()
            return self.robot.angle_vector()
        wanted = self._checked_goal("av", av)
        clients = self._clients_of(controller_type)
        if clients is None:
            return False
        start = number("start_time", start_time, low=0.0)
        arrival = np.zeros_like(wanted) if velocities is None else finite_array("velocities", velocities, wanted.shape)
        present = self._present()
        duration = self._checked_time(time, present, wanted, controller_type, time_scale)
        if interpolation is not None:
            return self._interpolated(
                present, wanted, duration, controller_type, start, interpolation, interpolation_dt
            )
        self._show(wanted)
        self._send(clients, np.array([duration]), wanted[None], arrival[None], start)
        return wanted

    @checked
    def angle_vector_sequence(
        self, avs: Sequence[Angles], times: Sequence[float | None] | float | None = None,
        controller_type: str | None = None, start_time: float = 0.0, time_scale: float = 5.0,
    ) -> Any:  # fmt: skip
        """Send the joints through many angles, and return at once.

        At a point between, a joint passes with the mean of the velocities before and after, or rests where those
        differ in sign; at the last it rests.

        Args:
            avs: The angles, (n,) each, or by name.
            times: How long each takes [s] from the one before, or one number for all; stretched and chosen as in
                ``angle_vector``.
            controller_type: Which controllers move; None for the default.
            start_time: When it starts [s] from now.
            time_scale: At least 1.

        Returns:
            The angles that were sent, a list; False where there is no such controller.

        Raises:
            RobotTimeoutError: no joint state came.
            InvalidInputError: no angles; other values than ``angle_vector`` takes; another number of times.
        """
        clients = self._clients_of(controller_type)
        wanted = [self._checked_goal(f"avs[{k}]", av) for k, av in enumerate(avs)]
        if not wanted:
            raise InvalidInputError("avs must hold at least one vector of angles")
        each: list[Any] = list(times) if isinstance(times, Sequence | np.ndarray) else [times] * len(wanted)
        if len(each) != len(wanted):
            raise InvalidInputError(f"times must be one for each of {len(wanted)} vectors, got {len(each)}")
        if clients is None:
            return False
        start = number("start_time", start_time, low=0.0)
        ways = [self._present(), *wanted]
        spans = np.array([
            self._checked_time(each[k], ways[k], ways[k + 1], controller_type, time_scale) for k in range(len(wanted))
        ])  # fmt: skip
        steps = np.array([self.sub_angle_vector(b, a) for a, b in itertools.pairwise(ways)])
        velocities = passing_velocities(steps, spans)
        self._show(wanted[-1])
        self._send(clients, np.cumsum(spans), np.array(wanted), velocities, start)
        return wanted

    @checked
    def wait_interpolation(self, controller_type: str | None = None, timeout: float = 0) -> list[bool]:
        """Wait until the motions that were sent have ended.

        Args:
            controller_type: Of which controllers; None for the default.
            timeout: How long at most [s], for each controller; 0 is for ever.

        Returns:
            Of each controller, whether its motion is still under way.

        Raises:
            UnknownNameError: there is no such controller.
        """
        longest = number("timeout", timeout, low=0.0)
        clients = self._checked_clients(controller_type)
        for client in clients:
            client.wait_for_result(longest)
        return [client.is_interpolating() for client in clients]

    @checked
    def is_interpolating(self, controller_type: str | None = None) -> bool:
        """Return True if a motion that was sent from here is under way.

        Raises:
            UnknownNameError: there is no such controller.
        """
        return any(client.is_interpolating() for client in self._checked_clients(controller_type))

    def is_moving(self, controller_type: str | None = None) -> bool:
        """Return True if a controller follows a goal, whoever sent it.

        Raises:
            UnknownNameError: there is no such controller.
        """
        return any(self.is_busy(client.controller) for client in self._checked_clients(controller_type))

    @checked
    def cancel_angle_vector(self, controller_type: str | None = None) -> None:
        """Let controllers give up what they do; the joints hold where they are.

        Args:
            controller_type: Which; None for all.

        Raises:
            UnknownNameError: there is no such controller.
        """
        for client in self.controller_actions if controller_type is None else self._checked_clients(controller_type):
            client.cancel_all_goals()

    @checked
    def stop_motion(self, stop_time: float = 0.0, wait: bool = True) -> None:
        """Bring the joints to rest within ``stop_time`` [s], at once where it is 0.

        Args:
            stop_time: [s]; shorter than the velocity limits allow is stretched.
            wait: Return when they rest.
        """
        duration = number("stop_time", stop_time, low=0.0)
        self.cancel_angle_vector() if duration == 0.0 else self._slow_down(duration)
        if wait:
            self.wait_interpolation()

    @checked
    def angle_vector_duration(
        self, start_av: Angles, end_av: Angles, controller_type: str | None = None,
        return_joint_names: bool = False,
    ) -> Any:  # fmt: skip
        """Return the shortest time [s] between two vectors of angles at the velocity limits.

        Args:
            start_av: (n,).
            end_av: (n,).
            controller_type: Whose joints count; None for the default.
            return_joint_names: Return a list of (time, joint name) instead.

        Raises:
            UnknownNameError: there is no such controller.
        """
        start, end = self._checked_vector("start_av", start_av), self._checked_vector("end_av", end_av)
        name = self.controller_type if controller_type is None else controller_type
        if name not in self.controller_param_table:
            raise UnknownNameError("controller", name, list(self.controller_param_table))
        moved = {joint for own in self.controller_param_table[name] for joint in own["joint_names"]}
        change = np.abs(self.sub_angle_vector(end, start))
        still = change < np.where(self.robot.is_slide, STILL[1], STILL[0])
        counts = np.array([joint in moved for joint in self.robot.joint_names], dtype=bool) & ~still
        times = np.where(counts, change / self.robot.velocity_limits, 0.0)
        if return_joint_names:
            return list(zip(times.tolist(), self.robot.joint_names, strict=True))
        return float(times.max(initial=0.0))

    # Inside

    def _checked_time(
        self, time: Any, start: np.ndarray, end: np.ndarray, controller_type: str | None, time_scale: float
    ) -> float:
        scale = number("time_scale", time_scale, low=1.0)
        needed = self.angle_vector_duration(start, end, controller_type, return_joint_names=True)
        shortest, slowest = max(needed, default=(0.0, "no joint"))
        if time is None:
            return scale * shortest
        asked = number("time", time, low=0.0)
        if asked < shortest:
            logger.warning("%g s is stretched to %.3f s, the least that %s needs", asked, shortest, slowest)
        return max(asked, shortest)

    def _clients_of(self, controller_type: str | None) -> list[ControllerClient] | None:
        name = self.controller_type if controller_type is None else controller_type
        if name not in self.controller_table:
            logger.warning("there is no controller %r; there are: %s", name, ", ".join(self.controller_table))
            return None
        return self.controller_table[name]

    def _checked_clients(self, controller_type: str | None) -> list[ControllerClient]:
        name = controller_type or self.controller_type
        if name not in self.controller_table:
            raise UnknownNameError("controller", name, list(self.controller_table))
        return self.controller_table[name]

    def _interpolated(
        self, start: np.ndarray, end: np.ndarray, duration: float, controller_type: str | None, start_time: float,
        interpolation: str, interpolation_dt: float,
    ) -> Any:  # fmt: skip
        if interpolation not in INTERPOLATIONS:
            raise InvalidInputError(f"interpolation must be one of {INTERPOLATIONS}, got {interpolation!r}")
        wanted = duration / number("interpolation_dt", interpolation_dt, above=0.0)
        if wanted > MAX_POINTS:
            raise InvalidInputError(f"interpolation_dt makes {wanted:.3g} points, at most {MAX_POINTS} are sent")
        count = max(1, int(wanted + 1e-9))
        s = np.arange(1, count + 1) / count
        if interpolation == "minjerk":
            s = minimum_jerk(s)
        points = start + s[:, None] * self.sub_angle_vector(end, start)
        times = [duration / count] * count
        return self.angle_vector_sequence(list(points), times, controller_type, start_time, time_scale=1.0)

    def _slow_down(self, duration: float) -> None:
        """Send the joints to where a steady deceleration would bring them."""
        angles = self._present() + 0.5 * duration * self._velocities
        lower, upper = self.robot.joint_limits
        self.angle_vector(np.clip(angles, lower, upper), duration)

    def _send(
        self, clients: list[ControllerClient], times: np.ndarray, positions: np.ndarray, velocities: np.ndarray,
        start_time: float,
    ) -> None:  # fmt: skip
        # where nothing is to move a time is 0: such a point adds nothing but the last one
        kept = np.append(np.diff(times) > 0.0, True)
        times, positions, velocities = times[kept], positions[kept], velocities[kept]
        for client in clients:
            names = tuple(client.controller["joint_names"])
            columns = [self.robot.joint_index(name) for name in names]
            client.send_goal(JointTrajectory(names, times, positions[:, columns], velocities[:, columns]), start_time)
