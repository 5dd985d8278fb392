"""A robot without a world, whose joints are at once where its controllers want them: for tests of the wire alone."""

import numpy as np

from nuno.errors import RobotModelError, UnknownNameError
from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.interface import RobotInterface
from nuno.robot.readings import JointState
from nuno.shapes.coordinates import Coordinates


class PlainRobot(RobotInterface):
    """Joints go straight from where they are to the last point; the base moves evenly; hands close at once."""

    def __init__(self, robot):
        """Start at rest at time 0."""
        self.time, self.goals, self.place, self.going, self.failure = 0.0, {}, np.zeros(3), None, None
        self.grips = []
        super().__init__(robot)
        self.angles = dict(zip(self.robot.joint_names, self.robot.angle_vector().tolist(), strict=True))

    def now(self):
        """Own clock."""
        return self.time

    def sleep(self, seconds):
        """Let the joints and the base go on."""
        if self.failure is not None:
            raise self.failure
        self.time += seconds
        for goal, start, begin in [own for own in self.goals.values() if not own[0].is_done]:
            share = min(1.0, max(0.0, (self.time - start + 1e-9) / goal.asked.duration))
            for joint, target in zip(goal.asked.names, goal.asked.positions[-1], strict=True):
                self.angles[joint] = begin[joint] + share * (target - begin[joint])
            if share == 1.0:
                goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
        if self.going is not None and not self.going[0].is_done:
            goal, velocity, end = self.going
            self.place = self.place + velocity * seconds
            if self.time >= end - 1e-9:
                goal.finish(GoalStatus.SUCCEEDED)

    def read_joint_state(self):
        """All joints."""
        still = np.zeros(len(self.angles))
        return JointState(self.time, tuple(self.angles), np.array(list(self.angles.values())), still, still + 1.5)

    read_reference = read_joint_state

    def send_trajectory(self, controller, trajectory, start_time, tolerances):
        """Pre-empt what was there."""
        name = controller["controller_type"]
        if set(trajectory.names) != set(controller["joint_names"]):
            raise UnknownNameError("joint", trajectory.names[0], controller["joint_names"])
        self.cancel_trajectories(controller)
        goal = Goal(trajectory)
        goal.status = GoalStatus.ACTIVE
        self.goals[name] = goal, self.time + start_time, dict(self.angles)
        return goal

    def cancel_trajectories(self, controller):
        """Hold."""
        if controller["controller_type"] in self.goals:
            self.goals[controller["controller_type"]][0].finish(GoalStatus.PREEMPTED, text="another took its place")

    def is_busy(self, controller):
        """Whether there is a goal."""
        name = controller["controller_type"]
        return name in self.goals and not self.goals[name][0].is_done

    def read_base(self):
        """Where it has got to."""
        x, y, yaw = self.place
        return Coordinates((x, y, 0.0), (np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)))

    def send_base(self, x, y, yaw, seconds, stop):
        """Go evenly, in 1 s unless told otherwise."""
        self.cancel_base()
        span = seconds or 1.0
        goal = Goal((x, y, yaw))
        goal.status = GoalStatus.ACTIVE
        self.going = goal, np.array([x, y, yaw]) / span, self.time + span
        return goal

    def cancel_base(self):
        """Stand."""
        if self.going is not None:
            self.going[0].finish(GoalStatus.PREEMPTED)

    def send_gripper(self, hand, position, effort):
        """Done at once."""
        self.grips.append((hand, position, effort))
        goal = Goal(position)
        goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
        return goal

    def read_wrench(self, frame):
        """Of one wrist only."""
        if frame != "left_wrist":
            raise RobotModelError(f"no force sensor in {frame}")
        return np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, self.time])

    def read_imu(self):
        """None."""
        raise RobotModelError("no inertial measurement unit")
