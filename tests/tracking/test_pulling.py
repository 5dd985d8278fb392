"""Forces by which a mass comes to where it is wanted: closed forms of uniform acceleration."""

import numpy as np
import pytest

from nuno.tracking.pulling import STRONGEST, gain, limited, phases


@pytest.mark.parametrize("frames", [1, 2, 3, 6, 12])
def test_phases_displace_by_one(frames):
    """Integrated by hand, x = v t + a t^2 / 2, the accelerations displace a free mass by 1 in the span."""
    frame = 1.0 / 60.0
    place = speed = 0.0
    parts = phases(frames * frame, frame)
    for duration, acceleration in parts:
        place += speed * duration + 0.5 * acceleration * duration**2
        speed += acceleration * duration
    assert place == pytest.approx(1.0)
    assert sum(duration for duration, _ in parts) == pytest.approx(frames * frame)


@pytest.mark.parametrize("frames", [2, 2.5, 3, 3.9, 4, 5, 7])
def test_what_is_pulled_keeps_some_of_its_velocity(frames):
    """However a span divides into frames, braking leaves 0.4 of the velocity that the pull gave, and turns none."""
    frame = 1.0 / 60.0
    (first, pull), (second, brake) = phases(frames * frame, frame)
    assert pull * first + brake * second == pytest.approx(0.4 * pull * first)


def test_more_is_taken_off_within_longer():
    """1 - exp(-t / 0.08 s): two spans leave the product of what each leaves."""
    assert (1.0 - gain(0.1)) ** 2 == pytest.approx(1.0 - gain(0.2))


def test_forces_are_limited_by_mass():
    """What is weaker keeps every bit; what is stronger keeps its direction, at the limit times the mass."""
    masses = np.array([[0.001, 0.002]])
    forces = np.array([[[0.0, 0.0, 0.01], [3.0, 4.0, 0.0]]])
    found = limited(forces, masses)
    np.testing.assert_array_equal(found[0, 0], forces[0, 0])
    np.testing.assert_allclose(found[0, 1], STRONGEST * 0.002 * np.array([0.6, 0.8, 0.0]))
