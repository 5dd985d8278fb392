"""Force and torque sensors: what a limb's end does to the rest of the robot, in a frame between the two."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.placement import frame_called

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

NOTHING = 1e-9
"""[kg] What is left by rounding of a mass that is taken off itself."""


class WrenchSensor:
    """A 6-axis sensor in a frame, which feels all that lies beyond it: its own link and what that carries.

    Args:
        robot: The robot.
        frame: The frame's name.
        data: Pinocchio's, from which it reads what ``rnea`` has left there.

    Attributes:
        frame: The frame's name.
        joint: Pinocchio's index of the joint that carries the frame.
        feels_all: Whether all that its joint moves lies beyond it.
    """

    def __init__(self, robot: Humanoid, frame: str, data: Any) -> None:
        self.frame, model = frame, robot.model
        own = model.frames[robot.frame_index(frame)]
        self.joint = int(own.parentJoint)
        role = robot.description.frames.get(frame)
        link = frame_called(model, frame if role is None else role.link)
        first = model.frames[link].parentFrame  # the joint that holds the link, fixed or not
        beyond = _beyond(model, first)
        # The first link of a joint has everything that the joint moves; of others only what is fixed behind them
        self.feels_all = bool(model.frames[first].type == pin.FrameType.JOINT)
        # of what the joint carries before the sensor
        self._inertia = model.inertias[self.joint].copy()
        for k in beyond:
            if model.frames[k].parentJoint == self.joint and model.frames[k].inertia.mass > 0.0:
                self._inertia -= model.frames[k].placement.act(model.frames[k].inertia)
        if self._inertia.mass < NOTHING:
            self._inertia = pin.Inertia.Zero()
        nearby = [j for j in range(model.njoints) if model.parents[j] == self.joint]
        joints = [j for j in nearby if _frame_of(model, j) in beyond]
        self._before = [(data.liMi[j], data.f[j]) for j in nearby if j not in joints]
        self._carried = {
            j for j in range(model.njoints) if any(above in joints for above in model.supports[j].tolist())
        }
        if self.feels_all:
            self._carried = {j for j in range(model.njoints) if self.joint in model.supports[j].tolist()}
        self._links = {model.frames[k].name for k in beyond}
        self._to_sensor = -own.placement.inverse().toDualActionMatrix()
        self._force = data.f[self.joint].vector
        self._velocity, self._acceleration = data.v[self.joint], data.a_gf[self.joint]

    def feels(self, link: str) -> bool:
        """Return True if a link that its own joint carries lies beyond the sensor."""
        return self.feels_all or link in self._links

    def carries(self, joint: int) -> bool:
        """Return True if a joint other than its own lies beyond the sensor."""
        return joint in self._carried

    def read(self, before: np.ndarray | float = 0.0) -> np.ndarray:
        """Return force and torque (6,) [N, N m], in the sensor's frame and about its origin, after ``rnea``.

        They act on what is before the sensor: a hand that hangs pulls down by its weight and that of what it holds; a
        foot that stands pushes its leg up.

        Args:
            before: What acts from outside on the links that its joint carries before the sensor, (6,) in the joint's
                frame; it does not matter to one that feels all.
        """
        if self.feels_all:
            return self._to_sensor @ self._force
        # all that the joint bears, but what it takes to move what is before the sensor
        moved = self._inertia * self._acceleration + self._inertia.vxiv(self._velocity)
        beyond = self._force + before - moved.vector
        for placement, force in self._before:
            beyond -= placement.act(force).vector
        return self._to_sensor @ beyond


def _frame_of(model: Any, joint: int) -> int:
    return int(model.getFrameId(model.names[joint], pin.FrameType.JOINT))


def _beyond(model: Any, first: int) -> set[int]:
    """Return a frame and all that hang on it."""
    found = {first}
    for k in range(first + 1, model.nframes):  # frames come after those that they hang on
        if model.frames[k].parentFrame in found:
            found.add(k)
    return found
