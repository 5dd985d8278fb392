"""Copies of a robot, and the robot restored, that are to move as it does."""

import numpy as np


def assert_copies_go_on_alike(world, robot, seconds):
    """Run a world, two copies, and the world restored: the robot moves alike in all, to the bit."""
    kept, futures = world.save(), world.imagine(2)
    for own in (world, futures):
        own.run(seconds)
    later, copies = robot.state(), futures.robot.state()
    world.restore(kept)
    world.run(seconds)
    for state in (*copies, robot.state()):
        np.testing.assert_array_equal(state.q, later.q)
        np.testing.assert_array_equal(state.v, later.v)
