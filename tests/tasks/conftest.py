"""A robot, a coarse mat, and walks that are none: what tests of carrying share."""

import numpy as np
import pytest

import nuno
from nuno.shapes.path import minimum_jerk
from nuno.tasks.arms import hands_level


class Glide:
    """A robot that slides over the floor without moving a joint, along a path in time."""

    def __init__(self, stance, seconds, shift):
        self.stance, self.seconds, self.shift = stance, seconds, np.asarray(shift, dtype=float)

    def configuration_at(self, time):
        """Return the configuration (nq,) at a time [s], from rest to rest by a minimum jerk path."""
        s = np.clip(time / self.seconds, 0.0, 1.0)
        q = self.stance.copy()
        q[:3] += minimum_jerk(s) * self.shift
        return q


@pytest.fixture(scope="session")
def talos():
    """Return a robot that tests share; they leave it as it was."""
    return nuno.Humanoid("talos")


@pytest.fixture(scope="session")
def glides(talos):
    """Return a function that makes a walk for each arm distance."""

    def make(distances, seconds=1.0, shift=(0.0, 0.0, 0.0)):
        return [Glide(hands_level(talos, distance, 0.5, 1.1), seconds, shift) for distance in distances]

    return make


@pytest.fixture
def mat():
    """Return a coarse soft mat with three layers of cells."""
    return nuno.soft_box((0.6, 0.4, 0.02), cells=(9, 6, 3))
