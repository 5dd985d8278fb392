"""Velocities that a body is given: a rigid motion, one of each vertex, or those that it had as another kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body


@dataclass(frozen=True, eq=False)
class GivenVelocity:
    """Velocities that a body is given.

    Attributes:
        linear: (worlds, 3) [m/s], at ``about``.
        angular: (worlds, 3) [rad/s].
        about: (worlds, 3) [m], a point of the world; None is the body's centre of mass.
        vertices: (worlds, n, 3) [m/s], which a cloth or soft body takes instead; None for those of the rigid motion.
    """

    linear: np.ndarray
    angular: np.ndarray
    about: np.ndarray | None = None
    vertices: np.ndarray | None = None

    def at(self, points: np.ndarray, centre: np.ndarray) -> np.ndarray:
        """Return the rigid motion's velocity [m/s] at points (worlds, n, 3) [m] of a body.

        Args:
            points: (worlds, n, 3) [m].
            centre: (worlds, 3) [m], the body's centre of mass.
        """
        arms = points - (centre if self.about is None else self.about)[:, None]
        return self.linear[:, None] + np.cross(self.angular[:, None], arms)


def given_velocity(
    body: Body, is_rigid: bool, velocity: ArrayLike | None, angular_velocity: ArrayLike | None, worlds: int
) -> GivenVelocity:
    """Return velocities that were asked for; None is zero.

    Args:
        body: The body.
        is_rigid: Whether it is rigid, or will be.
        velocity: (3,) or (worlds, 3) [m/s] of the centre of mass; of a cloth or soft body also of its vertices, (n, 3)
            or (worlds, n, 3). Where worlds = n, two axes mean vertices.
        angular_velocity: (3,) or (worlds, 3) [rad/s].
        worlds: Worlds in the batch.

    Raises:
        InvalidInputError: not finite, of another shape, or an angular velocity on top of those of vertices.
    """
    n = len(body._shape.mesh()[0])
    spin = finite_array("angular_velocity", np.zeros(3) if angular_velocity is None else angular_velocity,
                        (3,), (worlds, 3))  # fmt: skip
    shapes: list[tuple[int, ...]] = [(3,), (worlds, 3)]
    if not is_rigid:
        shapes += [(n, 3), (worlds, n, 3)]
    given = finite_array("velocity", np.zeros(3) if velocity is None else velocity, *shapes)
    angular = np.broadcast_to(spin, (worlds, 3))
    of_vertices = not is_rigid and (given.ndim == 3 or given.shape == (n, 3))
    if not of_vertices:
        return GivenVelocity(np.broadcast_to(given, (worlds, 3)), angular)
    if angular_velocity is not None:
        raise InvalidInputError(f"velocities of the vertices of {body.name!r} leave no room for an angular_velocity")
    return GivenVelocity(np.zeros((worlds, 3)), angular, vertices=np.broadcast_to(given, (worlds, n, 3)))


def present_velocity(body: Body) -> GivenVelocity:
    """Return the velocities of a dynamic body, for another kind of itself.

    What deforms takes those of the vertices; what is rigid the velocity of the centre of mass and I^-1 L, the rigid
    motion with the momentum and the angular momentum that the body has.
    """
    dynamics = body._dynamics
    assert dynamics is not None
    motion = dynamics.motion(body)
    return GivenVelocity(motion.velocity, motion.angular_velocity, motion.centre, dynamics.velocities(body))
