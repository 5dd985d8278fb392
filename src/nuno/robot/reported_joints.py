"""ReportedJoints: the joints of a robot as it tells of them, from the newest joint state that came."""

from __future__ import annotations

import logging
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, RobotTimeoutError
from nuno.robot.other_models import angles_of_model, is_model, show_on_model
from nuno.robot.readings import JointState
from nuno.validation import as_array, checked, finite_array, number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

logger = logging.getLogger(__name__)

TICK = 0.01
"""[s] Between two looks at what is waited for."""
BEYOND = 0.02
"""[rad; m] What encoders may tell beyond a limit, so that a robot can be sent to where it is."""
STATE_TIMEOUT = 3.0
"""[s] How long a fresh joint state is waited for."""


Angles = ArrayLike | Mapping[str, float]
"""Of all joints in the order of ``joint_names``, or by name; a model of scikit-robot stands for its own, by names."""


class ReportedJoints(ABC):
    """The joints of a robot, and a clock to wait on until more is known of them.

    Angle vectors are as in ``JointInterface``.

    Args:
        robot: The model, of which a copy is kept.

    Attributes:
        robot: Shows what was last known of the real one.
        joint_state: The newest that came, None before the first.
    """

    def __init__(self, robot: Humanoid) -> None:
        self.robot = robot.copy()
        self.joint_state: JointState | None = None
        self._order_reported = False
        self._joints = frozenset(self.robot.joint_names)
        self._velocities = np.zeros(len(self.robot.joint_names))
        self._efforts = np.zeros(len(self.robot.joint_names))

    # What a robot must bring

    @abstractmethod
    def now(self) -> float:
        """Return the time of the robot's clock [s]."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Let the robot's clock go on by ``seconds`` [s]; the place of ``time.sleep`` in a program for robots."""

    @abstractmethod
    def read_joint_state(self) -> JointState | None:
        """Return the newest joint state there is, None before the first; it may lack joints."""

    @abstractmethod
    def read_reference(self) -> JointState | None:
        """Return where the controllers want the joints now, None where that is not known; it may lack joints."""

    @checked
    def wait_until(self, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait until a condition holds, up to ``timeout`` [s] of the robot's clock, None or 0 for ever.

        Returns:
            Whether it holds.
        """
        end = None if not timeout else self.now() + timeout
        while not condition():
            if end is not None and self.now() >= end:
                return False
            self.sleep(TICK)
        return True

    # State

    def update_robot_state(self, wait_until_update: bool | float = False) -> bool:
        """Bring ``robot`` to the newest joint state.

        Args:
            wait_until_update: Wait for one that is newer than now, or than a time [s] of the robot's clock.

        Returns:
            Whether there is one.
        """
        if wait_until_update is not False and wait_until_update is not None:
            since = self.now() if wait_until_update is True else number("wait_until_update", wait_until_update)
            if not self.wait_until(lambda: self._newer_than(since), STATE_TIMEOUT):
                return False
        state = self.read_joint_state()
        if state is None:
            return False
        self.joint_state = state
        angles = self.robot.angle_vector()
        rows = [(k, self.robot.joint_index(name)) for k, name in enumerate(state.names) if name in self._joints]
        of_state, of_robot = np.array(rows, dtype=int).reshape(-1, 2).T
        angles[of_robot] = state.positions[of_state]
        self._show(angles)
        self._velocities[of_robot] = state.velocities[of_state]
        self._efforts[of_robot] = state.efforts[of_state]
        return True

    @checked
    def angle_vector_from_names(self, angles: Mapping[str, float]) -> np.ndarray:
        """Return the angles (n,) that were last known, with some replaced by name.

        Raises:
            UnknownNameError: no joint of a name.
            InvalidInputError: an angle that is not finite.
        """
        return self._checked_vector("angles", dict(angles))

    def show_on(self, model: Any) -> None:
        """Set a scikit-robot model's joints as they were last known, by name: its own order is another.

        Raises:
            InvalidInputError: something else than such a model.
        """
        if not is_model(model):
            raise InvalidInputError(f"model must have a joint_list, as scikit-robot's have, got {type(model).__name__}")
        self.update_robot_state()
        show_on_model(model, dict(zip(self.robot.joint_names, self.robot.angle_vector().tolist(), strict=True)))

    def potentio_vector(self) -> np.ndarray:
        """Return the angles (n,) that were last known or sent, without asking the robot."""
        return self.robot.angle_vector()

    def velocity_vector(self) -> np.ndarray:
        """Return the joints' velocities (n,) [rad/s; m/s], fresh."""
        self._refresh()
        return self._velocities.copy()

    def torque_vector(self) -> np.ndarray:
        """Return the joints' torques (n,) [N m; N for slides], fresh."""
        self._refresh()
        return self._efforts.copy()

    def reference_vector(self) -> np.ndarray:
        """Return where the controllers want the joints now, (n,).

        Raises:
            RobotTimeoutError: the controllers do not tell.
        """
        if not self.wait_until(lambda: self.read_reference() is not None, STATE_TIMEOUT):
            raise RobotTimeoutError(f"the controllers told no reference within {STATE_TIMEOUT:g} s")
        state = self.read_reference()
        assert state is not None
        angles = self.robot.angle_vector()
        for name, position in zip(state.names, state.positions, strict=True):
            if name in self._joints:
                angles[self.robot.joint_index(name)] = position
        return angles

    def error_vector(self) -> np.ndarray:
        """Return how far the joints are from where the controllers want them, (n,), reference less measured."""
        self._refresh()
        return self.sub_angle_vector(self.reference_vector(), self.robot.angle_vector())

    @checked
    def sub_angle_vector(self, v0: Angles, v1: Angles) -> np.ndarray:
        """Return v0 - v1, (n,); of joints that turn freely the shorter way round."""
        change = self._checked_vector("v0", v0) - self._checked_vector("v1", v1)
        lower, upper = self.robot.joint_limits
        turns = np.isinf(lower) & np.isinf(upper)
        change[turns] = (change[turns] + np.pi) % (2.0 * np.pi) - np.pi
        return change

    # Inside

    def _newer_than(self, time: float) -> bool:
        state = self.read_joint_state()
        return state is not None and state.time > time

    def _refresh(self) -> None:
        if not self.update_robot_state(wait_until_update=True):
            raise RobotTimeoutError(f"no fresh joint state came within {STATE_TIMEOUT:g} s")

    def _present(self) -> np.ndarray:
        """Return the angles as they are now, to plan from: no time is let pass where a state is known."""
        if not self.update_robot_state():
            self._refresh()
        return self.robot.angle_vector()

    def _show(self, angles: np.ndarray) -> None:
        """Let ``robot`` show angles; encoders may tell a little more than the limits, and goals may be beyond them."""
        lower, upper = self.robot.joint_limits
        self.robot.angle_vector(np.clip(angles, lower, upper))

    def _checked_vector(self, what: str, av: Any) -> np.ndarray:
        if is_model(av):
            av = angles_of_model(av)
        if not isinstance(av, Mapping):
            names = self.robot.joint_names
            av = as_array(what, av)
            if av.ndim == 1 and len(av) != len(names):
                raise InvalidInputError(
                    f"{what} has {len(av)} angles, {self.robot.name!r} has {len(names)} joints: {', '.join(names)}; "
                    "a mapping from names to angles, or a scikit-robot model, does as well"
                )
            return finite_array(what, av, (len(names),))
        angles = self._present()
        for joint, angle in av.items():
            angles[self.robot.joint_index(joint)] = number(f"the angle of {joint!r}", angle)
        return angles

    def _checked_goal(self, what: str, av: Any) -> np.ndarray:
        """Return angles (n,) to go to; a bare vector beyond the limits is most likely in another model's order."""
        wanted = self._checked_vector(what, av)
        if isinstance(av, Mapping) or is_model(av):
            return wanted
        lower, upper = self.robot.joint_limits
        beyond = np.maximum(lower - wanted, wanted - upper)
        if (beyond > BEYOND).any():
            k = int(beyond.argmax())
            raise InvalidInputError(
                f"{what}[{k}] is {wanted[k]:.4f}, and {self.robot.joint_names[k]!r} goes from {lower[k]:.4f} to "
                f"{upper[k]:.4f}: is the vector in another model's order? The order here is that of joint_names; a "
                "scikit-robot model itself, or a mapping from names, is taken by names"
            )
        if len(wanted) and not self._order_reported and "skrobot" in sys.modules:
            self._order_reported = True
            logger.warning(
                "a vector without names is taken in the order of joint_names, %s first; scikit-robot's models have "
                "another: pass the model itself, or a mapping", self.robot.joint_names[0],
            )  # fmt: skip
        return wanted
