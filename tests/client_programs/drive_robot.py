"""A program that drives a robot through its interface; it is checked for types, not run."""

import numpy as np

import nuno


def wave(robot: nuno.RobotInterface, seconds: float) -> bool:
    """Move an arm and wait."""
    posture = np.asarray(robot.robot.angle_vector())
    robot.angle_vector(posture + 0.01, seconds)
    robot.wait_interpolation()
    return True


def make(device: str) -> nuno.RobotInterface:
    """Return Talos in a world with a table."""
    world = nuno.World(device=device)
    world.add(nuno.box((0.6, 1.0, 0.02), name="table", position=(0.8, 0, 0.8)))
    robot = nuno.Humanoid("talos")
    driver = nuno.SimulatedRobot(robot, world)
    trajectory = nuno.JointTrajectory(["head_1_joint"], [0.0, 1.0], [[0.0], [0.1]])
    assert trajectory.times.shape == (2,)
    return driver


def recover(folder: str) -> tuple[float, float]:
    """Estimate a pick, and return the point."""
    result = nuno.read_case(folder).estimate()
    best: tuple[float, float] = result.best
    confidence: float = result.confidence
    assert confidence <= 1.0 or result.warnings
    return best
