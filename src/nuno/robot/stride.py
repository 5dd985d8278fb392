"""Stride: how a robot walks: how far, how high and how fast its steps are."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from nuno.errors import RobotModelError
from nuno.robot.pinocchio import pin
from nuno.validation import checked, number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

LENGTH, SIDE, LIFT = 0.25, 0.1, 0.06
"""A step ahead, aside and up, relative to the height of the hip above the sole: small enough for bent knees."""
TURN = 0.25
"""[rad] Turned in by two steps; soles that stand a hand's breadth apart do not meet."""


@dataclass(frozen=True)
class Stride:
    """The stride of a robot; ``Stride.of(robot)`` has values for a robot, ``dataclasses.replace`` changes some.

    Attributes:
        step_length: How far a step brings the robot ahead at most [m].
        side_step: How far two steps bring it aside at most [m]: one foot opens the stance, the other closes it.
        turn_step: How far two steps turn it at most [rad].
        lift: How high the sole goes [m].
        stance: How far apart the middles of the soles are [m].
        single_support: How long a foot is in the air [s].
        double_support: How long both stand between two steps [s].
        shift: How long both stand before the first step and after the last [s], while the weight goes to a foot or
            to the middle.
        settle: For how long the robot comes to rest after that [s].

    Raises:
        InvalidInputError: a value that is not positive or not finite.
    """

    step_length: float
    side_step: float
    turn_step: float
    lift: float
    stance: float
    single_support: float = 0.8
    double_support: float = 0.2
    shift: float = 1.0
    settle: float = 0.8

    def __post_init__(self) -> None:
        for own in fields(self):
            object.__setattr__(self, own.name, number(own.name, getattr(self, own.name), above=0.0))

    @property
    def step_time(self) -> float:
        """From one step to the next [s]."""
        return self.single_support + self.double_support

    @classmethod
    @checked
    def of(cls, robot: Humanoid) -> Stride:
        """Return a stride that suits the size of a robot, its stance as in its posture.

        Raises:
            RobotModelError: the robot has not two legs.
        """
        left, right = two_feet(robot)
        model, data = robot.model, robot.scratch
        pin.framesForwardKinematics(model, data, robot.posture_configuration())
        index = robot.frame_index(left)
        soles = [data.oMf[index], data.oMf[robot.frame_index(right)]]
        hip = next(j for j in model.supports[model.frames[index].parentJoint] if j >= 2)
        # upright as the sole is, wherever the base is now
        height = float(soles[0].rotation[:, 2] @ (data.oMi[hip].translation - soles[0].translation))
        return cls(
            LENGTH * height,
            SIDE * height,
            TURN,
            LIFT * height,
            float(np.linalg.norm((soles[0].actInv(soles[1])).translation[:2])),
        )


def two_feet(robot: Humanoid) -> tuple[str, str]:
    """Return the frames of the left and the right sole.

    Raises:
        RobotModelError: the robot has no legs, or its feet have no size.
    """
    feet = robot.feet
    sizes = [robot.description.frames[foot].size for foot in feet]
    if len(feet) != 2 or any(size is None for size in sizes):
        raise RobotModelError(f"walking needs two feet with sizes; the description of {robot.name!r} has {list(feet)}")
    return feet[0], feet[1]
