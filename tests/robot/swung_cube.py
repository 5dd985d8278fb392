"""Talos with weight, a cube between the tips of its left gripper, and a swing of that arm."""

import numpy as np

import nuno


class SwungCube:
    """A cube of 5 cm and 0.2 kg that Talos has taken, on the engine of a world.

    Attributes:
        robot: Talos.
        cube: The cube, no longer kept by anything but the fingers.
        before: (3,) [m], where it was in the hand when they had taken it.
    """

    def __init__(self, world):
        world.add(nuno.plane(name="floor"))
        self.robot = robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
        assert robot.start_grasp("larm") == [False] and robot.stop_grasp("larm") == [True]
        pose = robot.actual.frame_pose("left_hand")
        place = pose.to_world([(0.0, 0.0, 0.008)])[0]
        self.cube = world.add(nuno.box((0.05,) * 3, name="cube", position=place, quaternion=pose.quaternion))
        world.attach(self.cube, nuno.Rigid(mass=0.2, friction=0.8))
        kept = world.grip(self.cube, to=self.cube.position)
        assert robot.start_grasp("larm") == [True]
        kept.release()
        robot.sleep(0.2)
        self.before = self.local()

    def local(self):
        """Return where the cube is in the hand, (3,) [m]."""
        return self.robot.actual.frame_pose("left_hand").to_local(self.cube.position[None])[0]

    def swing(self):
        """Swing the arm by more than 0.4 m in 1 s, and return how far the cube has gone in the hand, (3,) [m]."""
        robot = self.robot
        began = robot.actual.frame_pose("left_hand").position
        wanted = robot.angle_vector()
        wanted[robot.actual.joint_index("arm_left_4_joint")] -= 0.8
        wanted[robot.actual.joint_index("arm_left_2_joint")] += 0.4
        robot.angle_vector(wanted, 1.0)
        robot.wait_interpolation()
        robot.sleep(0.2)
        assert np.linalg.norm(robot.actual.frame_pose("left_hand").position - began) > 0.4
        return np.abs(self.local() - self.before)

    def is_held(self):
        """Return True if the hand holds the cube, and the robot stands."""
        return self.robot.hands["left_hand"].held == (self.cube,) and self.robot.state().fallen is None

    def let_go(self):
        """Open the fingers, and return how far the cube has gone from where it was in the hand [m]."""
        self.robot.stop_grasp("larm")
        self.robot.sleep(0.2)
        return np.linalg.norm(self.local() - self.before)
