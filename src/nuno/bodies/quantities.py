"""Quantities: a body's mass, velocities, momenta and energies, in one world or in each of a batch."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body_motion import BodyMotion
    from nuno.bodies.body_protocols import BodyDynamics, BodyWorld


class Quantities:
    """Mass, momenta and energies of a body as a whole. In a batch every quantity has a leading axis (worlds,).

    A static body has no mass to tell of. Its velocities, momenta and energies are zero, also where it follows a path.
    """

    _name: str
    _dynamics: BodyDynamics | None
    _world: BodyWorld | None

    def _guard(self) -> AbstractContextManager[Any]:
        raise NotImplementedError

    @property
    def mass(self) -> Any:
        """The mass [kg], a float or (worlds,).

        Raises:
            BodyStateError: the body is static.
        """
        return self._of_worlds(self._motion("mass").mass)

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) or (worlds, 3) [m], in the world.

        Raises:
            BodyStateError: the body is static.
        """
        return self._of_worlds(self._motion("centre of mass").centre)

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3) or (worlds, 3, 3) [kg m2], about the centre of mass, along the world's axes.

        Of a cloth or soft body, that of its vertices' masses.

        Raises:
            BodyStateError: the body is static.
        """
        return self._of_worlds(self._motion("inertia").inertia)

    @property
    def velocity(self) -> np.ndarray:
        """(3,) or (worlds, 3) [m/s], of the centre of mass; ``velocities`` are those of the vertices."""
        return self._moving("velocity", (3,))

    @property
    def angular_velocity(self) -> np.ndarray:
        """(3,) or (worlds, 3) [rad/s], along the world's axes.

        Of a cloth or soft body that of the rigid rotation nearest to its motion, I^-1 L.
        """
        return self._moving("angular_velocity", (3,))

    @property
    def momentum(self) -> np.ndarray:
        """(3,) or (worlds, 3) [kg m/s]."""
        return self._moving("momentum", (3,))

    def angular_momentum(self, about: ArrayLike | None = None) -> np.ndarray:
        """Return the angular momentum, (3,) or (worlds, 3) [kg m2/s], along the world's axes.

        Args:
            about: (3,) or (worlds, 3) [m], a point of the world; None is the centre of mass.

        Raises:
            InvalidInputError: a point that is not finite, or of another shape.
        """
        worlds = self._world_count()
        point = None if about is None else finite_array("about", about, (3,), (worlds, 3))
        if self._dynamics is None or point is None:
            return self._moving("angular_momentum", (3,))
        return self._of_worlds(self._motion("angular momentum").angular_momentum_about(point))

    @property
    def kinetic_energy(self) -> Any:
        """[J], a float or (worlds,); of a cloth or soft body, that of all its vertices' motion."""
        return self._moving("kinetic_energy", ())

    @property
    def elastic_energy(self) -> Any:
        """[J], a float or (worlds,): what the deformation stores, zero in the shape at rest.

        Of a cloth that of stretch, shear and bending, of a soft body the integral of its energy density; a rigid body
        stores none. Contacts and compliant grips are not counted.
        """
        with self._guard():
            if self._dynamics is None:
                return self._still(())
            return self._of_worlds(self._dynamics.elastic_energy(self))  # type: ignore[arg-type]

    def _motion(self, asked: str) -> BodyMotion:
        with self._guard():
            if self._dynamics is None:
                raise BodyStateError(f"{self._name!r} is static and has no {asked}; attach it")
            return self._dynamics.motion(self)  # type: ignore[arg-type]

    def _moving(self, name: str, shape: tuple[int, ...]) -> Any:
        """A quantity of the motion, zero while the body is static."""
        with self._guard():
            return self._still(shape) if self._dynamics is None else self._of_worlds(getattr(self._motion(name), name))

    def _still(self, shape: tuple[int, ...]) -> Any:
        return self._of_worlds(np.zeros((self._world_count(), *shape)))

    def _of_worlds(self, values: np.ndarray) -> Any:
        """One world's own value, or a copy of all worlds' (worlds, ...)."""
        if len(values) > 1:
            return np.array(values)
        return float(values[0]) if values.ndim == 1 else np.array(values[0])

    def _world_count(self) -> int:
        return 1 if self._world is None else self._world.world_count
