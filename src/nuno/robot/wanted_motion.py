"""WantedMotion: how a robot is to move as its controllers and its walk say, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.gait import Gait
from nuno.robot.leg_motion import feet_put_down
from nuno.robot.robot_state import RobotState
from nuno.robot.simulated_joints import SimulatedJoints, joined
from nuno.robot.stance import Stance
from nuno.robot.trajectory import Motion

if TYPE_CHECKING:
    from nuno.robot.goal import Goal
    from nuno.robot.humanoid import Humanoid

Servo = Callable[[RobotState, Motion, "np.ndarray | None", float], tuple[np.ndarray, Motion]]
"""Joints that something else moves, and their motion: from the state before, the others' motion, the base, a span."""


class WantedMotion:
    """Joints, walk and stance of a robot, and where they want it.

    Without dynamics that is where the robot is.

    Args:
        robot: The robot, which goes where it is wanted.
        groups: Joint names by controller.
        time: [s], now.

    Attributes:
        robot: The robot.
        joints: Its joints and controllers.
        gait: Its walks.
        stance: Where its base goes as the legs move.
        aim: How it is to move at the end of the frame.
    """

    def __init__(self, robot: Humanoid, groups: Mapping[str, Sequence[str]], time: float) -> None:
        self.robot = robot
        self.joints = SimulatedJoints(robot, groups)
        self.gait, self.stance = Gait(robot, self.joints), Stance(robot)
        nothing = np.zeros(robot.model.nv)
        self.aim = RobotState(time, robot.configuration(), nothing, nothing)
        self._kept: tuple[Any, ...] | None = None  # what it was when the frame began

    @property
    def leg_rows(self) -> np.ndarray:
        """Joints that move the base, (k,), where the feet stay on the ground."""
        return self.stance.rows

    def take(self, state: RobotState) -> None:
        """Be how a state says, whose joints ``joints`` has already."""
        self.aim = state
        self.robot.move_to(self.joints.positions, state.q[:7])

    def begin(self, end: float, span: float, servo: Servo | None = None) -> RobotState:
        """Return how the robot is to move at a time ``end`` [s], ``span`` [s] from now; ``end_frame`` takes that."""
        before, robot = self.aim, self.robot
        rows, given = None, None
        self._kept = (before, *self._pose())
        if span <= 0.0:
            self.joints.step(0.0)
            return before
        base = base_motion = None
        if self.gait.is_walking:
            walk = self.gait.at(self.joints.clock + span)
            rows = self.gait.rows
            given = (robot.angles_of(walk.q)[rows], walk.v[6:][rows], walk.a[6:][rows])
            base, base_motion = walk.q[:7], (walk.v[:6], walk.a[:6])
        if servo is not None:
            others = self.joints.step(span, rows, given)
            rows, given = joined(rows, given, *servo(before, others, base, span))
        positions, velocities, accelerations = self.joints.step(span, rows, given)
        if positions is robot._angles and base is None:
            self.aim = RobotState.moving(end, before.q, before.v, before.a)
            return self.aim
        if base is None and (stood := self.stance.base(robot._angles, (positions, velocities, accelerations))):
            base, base_motion = stood
        v, a = np.zeros(len(before.v)), np.zeros(len(before.a))
        v[6:], a[6:] = velocities, accelerations
        if base is not None and base_motion is not None:
            v[:6], a[:6] = base_motion
        robot.move_to(positions, base)
        self.aim = RobotState.moving(end, robot.configuration(), v, a)
        return self.aim

    def cancel(self) -> None:
        """Go back to where all was when the frame began."""
        assert self._kept is not None
        self.aim, *pose = self._kept
        self._put(*pose)

    def start_from(self, q: np.ndarray, time: float) -> None:
        """Be at rest in a configuration (nq,): nothing that was wanted before is wanted any more."""
        robot, nothing = self.robot, np.zeros(self.robot.model.nv)
        robot.move_to(np.clip(robot.angles_of(q), *robot.joint_limits), q[:7])
        self.aim = RobotState(time, robot.configuration(), nothing, nothing)
        self.gait.give_up("the robot was put elsewhere")
        self.joints.put(robot.angle_vector())

    def take_footing(self, state: RobotState) -> None:
        """Let a walk end where the robot was pushed off it, and go on from where it has come to stand again."""
        step = None if state.footing is None else state.footing.step
        if step is None:
            return
        if self.gait.is_walking:
            self.gait.interrupt()
        if step.is_finished:
            self._stand_on(state)
            self.gait.resume()

    def _stand_on(self, state: RobotState) -> None:
        """Be at rest on the feet where they are, legs and base; the other joints go on as they are wanted."""
        robot, time = self.robot, self.aim.time
        rows, angles = self.gait.rows, self.joints.positions.copy()
        angles[rows] = robot.angles_of(state.q)[rows]
        q = feet_put_down(robot, robot.configuration_of(angles, state.q[:7]))
        robot.move_to(np.clip(robot.angles_of(q), *robot.joint_limits), q[:7])
        self.joints.put_rows(rows, robot.angle_vector())
        for name in self.gait.names:
            self.joints.take_over(name, -np.inf)
        nothing = np.zeros(robot.model.nv)
        v = nothing.copy()
        v[6:] = self.joints.velocities
        self.aim = RobotState(time, robot.configuration(), v, nothing)

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        return self.aim, self._pose(), self.joints.save(), self.gait.save()

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was; goals that came since are given up."""
        self.aim, pose, joints, gait = saved
        self._put(*pose)
        self.joints.load(joints)
        self.gait.load(gait)

    def disown(self) -> dict[int, Goal]:
        """Take copies in place of the goals, and return those of the joints by the ``id`` of what they stand for.

        The goals of whoever it was loaded from stay as they are.
        """
        copied = {}
        for controller in self.joints.controllers.values():
            if controller.goal is not None:
                goal, controller.goal = controller.goal, controller.goal.copy()
                copied[id(goal)] = controller.goal
        self.gait.disown()
        return copied

    def _pose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        robot = self.robot
        return robot._angles, robot._position, robot._quaternion

    def _put(self, angles: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> None:
        self.robot._angles = angles
        self.robot._place(position, quaternion)
