"""Force and torque sensors: what a limb's end does to the rest of the robot, in a frame between the two."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid


class WrenchSensor:
    """A 6-axis sensor in a frame, which feels all that lies beyond it: its own link and what that carries.

    Args:
        robot: The robot.
        frame: The frame's name.

    Attributes:
        frame: The frame's name.
        joint: Pinocchio's index of the joint that carries the frame.
    """

    def __init__(self, robot: Humanoid, frame: str) -> None:
        self.frame, model = frame, robot.model
        own = model.frames[robot.frame_index(frame)]
        self.joint, self._placement = int(own.parentJoint), own.placement.copy()
        role = robot.description.frames.get(frame)
        link = model.getFrameId(frame if role is None else role.link)
        first = model.frames[link].parentFrame  # the joint that holds the link, fixed or not
        beyond = _beyond(model, first)
        # The first link of a joint has everything that the joint moves; of others only what is fixed behind them
        self._all = model.frames[first].type == pin.FrameType.JOINT
        self._inertia = pin.Inertia.Zero()
        for k in beyond:
            if model.frames[k].parentJoint == self.joint and model.frames[k].inertia.mass > 0.0:
                self._inertia += model.frames[k].placement.act(model.frames[k].inertia)
        self._joints = [
            j for j in range(model.njoints) if model.parents[j] == self.joint and _frame_of(model, j) in beyond
        ]
        self._carried = {
            j for j in range(model.njoints) if any(above in self._joints for above in model.supports[j].tolist())
        }
        if self._all:
            self._carried = {j for j in range(model.njoints) if self.joint in model.supports[j].tolist()}
        self._links = {model.frames[k].name for k in beyond}

    def feels(self, link: str) -> bool:
        """Whether a link that its own joint carries lies beyond the sensor."""
        return self._all or link in self._links

    def carries(self, joint: int) -> bool:
        """Whether a joint other than its own lies beyond the sensor."""
        return joint in self._carried

    def read(self, data: Any, external: Any) -> np.ndarray:
        """Return force and torque (6,) [N, N m], in the sensor's frame and about its origin.

        They act on what is before the sensor: a hand that hangs pulls down by its weight and that of what it holds; a
        foot that stands pushes its leg up.

        Args:
            data: Pinocchio's data after ``rnea``.
            external: What acts from outside on the links of its joint beyond the sensor, in the joint's frame.
        """
        if self._all:
            return -self._placement.actInv(data.f[self.joint]).vector
        motion = data.v[self.joint]
        needed = self._inertia * data.a_gf[self.joint] + motion.cross(self._inertia * motion) - external
        for j in self._joints:
            needed += data.liMi[j].act(data.f[j])
        return -self._placement.actInv(needed).vector


def _frame_of(model: Any, joint: int) -> int:
    return int(model.getFrameId(model.names[joint], pin.FrameType.JOINT))


def _beyond(model: Any, first: int) -> set[int]:
    """Return a frame and all that hang on it."""
    found = {first}
    for k in range(first + 1, model.nframes):  # frames come after those that they hang on
        if model.frames[k].parentFrame in found:
            found.add(k)
    return found
