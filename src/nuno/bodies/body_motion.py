"""The motion of a body as a whole: mass, inertia, velocities, momenta and kinetic energy, in all worlds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.shapes import quaternion as quat

FLATTEST = 1e-10
"""Of the largest moment of inertia, the least that counts: one below is that of a line or a point, by rounding."""


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """The motion of a body as a whole; axes are the world's.

    Attributes:
        mass: (worlds,) [kg].
        centre: (worlds, 3) [m], the centre of mass.
        inertia: (worlds, 3, 3) [kg m2], about the centre of mass.
        velocity: (worlds, 3) [m/s], of the centre of mass.
        angular_velocity: (worlds, 3) [rad/s].
        angular_momentum: (worlds, 3) [kg m2/s], about the centre of mass.
        kinetic_energy: (worlds,) [J].
    """

    mass: np.ndarray
    centre: np.ndarray
    inertia: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    angular_momentum: np.ndarray
    kinetic_energy: np.ndarray

    @property
    def momentum(self) -> np.ndarray:
        """(worlds, 3) [kg m/s]."""
        return self.mass[:, None] * self.velocity

    def angular_momentum_about(self, point: np.ndarray) -> np.ndarray:
        """Return the angular momentum (worlds, 3) [kg m2/s] about a point (3,) or (worlds, 3) [m]."""
        return self.angular_momentum + np.cross(self.centre - point, self.momentum)


def motion_of_particles(mass: np.ndarray, positions: np.ndarray, velocities: np.ndarray) -> BodyMotion:
    """Return the motion of point masses.

    The angular velocity is I^-1 L, that of the rigid motion which has their angular momentum; among all rigid motions
    it is the one nearest to the velocities, in the mean of squares weighted by mass. Where all masses lie on a line
    there is no telling how they spin about it, and that part is zero.

    Args:
        mass: (worlds, n) [kg].
        positions: (worlds, n, 3) [m].
        velocities: (worlds, n, 3) [m/s].
    """
    total = mass.sum(axis=1)
    share = mass / total[:, None]
    centre = np.einsum("wn,wnx->wx", share, positions)
    velocity = np.einsum("wn,wnx->wx", share, velocities)
    arms, relative = positions - centre[:, None], velocities - velocity[:, None]
    second = np.einsum("wn,wnx,wny->wxy", mass, arms, arms)
    inertia = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    spin = np.einsum("wn,wnx->wx", mass, np.cross(arms, relative))
    turning = np.einsum("wxy,wy->wx", np.linalg.pinv(inertia, rcond=FLATTEST, hermitian=True), spin)
    energy = 0.5 * np.einsum("wn,wnx,wnx->w", mass, velocities, velocities)
    return BodyMotion(total, centre, inertia, velocity, turning, spin, energy)


def motion_of_rigid(
    mass: np.ndarray, centre: np.ndarray, inertia: np.ndarray, turn: np.ndarray, velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> BodyMotion:  # fmt: skip
    """Return the motion of a rigid body.

    Args:
        mass: (worlds,) [kg].
        centre: (worlds, 3) [m], the centre of mass.
        inertia: (worlds, 3, 3) [kg m2], about it, along the body's own axes.
        turn: (worlds, 4), quaternion (w, x, y, z) of those axes.
        velocity: (worlds, 3) [m/s].
        angular_velocity: (worlds, 3) [rad/s].
    """
    axes = quat.to_matrix(turn)
    turned = axes @ inertia @ np.swapaxes(axes, -1, -2)
    spin = np.einsum("wxy,wy->wx", turned, angular_velocity)
    energy = 0.5 * (mass * (velocity**2).sum(axis=1) + (angular_velocity * spin).sum(axis=1))
    return BodyMotion(mass, centre, turned, velocity, angular_velocity, spin, energy)
