"""WorldReader: what bears on a robot, read of one world, or once for all worlds of a batch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.world.world import World

Contact = tuple[np.ndarray, np.ndarray, str]
"""A point (3,) [m], the force on the body (3,) [N], and the name of the other body."""


class WorldReader:
    """Vertices, grips and contacts of a world's bodies.

    Of a batch each is read once for all worlds, and kept until ``renew``: most of it lies beside that of other worlds.

    Args:
        world: A world or a batch.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._arrays: dict[Body, tuple[Any, list[np.ndarray]]] = {}  # places and velocities of vertices, by solver
        self._read: dict[tuple[str, Any], Any] = {}

    def renew(self) -> None:
        """Forget what was read: time went on, or something changed."""
        self._read.clear()

    def rows(self, body: Body, solver: Any, index: int) -> np.ndarray:
        """Return places [m] and velocities [m/s] of a body's vertices in a world, (6, n) float, coordinates by rows."""
        if self.world.world_count > 1:
            found: np.ndarray = self._once("rows", body, lambda: _rows_of_batch(solver))[index].copy()
        else:
            solver_before, arrays = self._arrays.get(body, (None, []))
            if solver_before is not solver:
                arrays = [array.numpy() for array in solver.arrays.values()]
                if solver.device == "cpu":  # where that is the solver's own memory, and no copy
                    self._arrays[body] = (solver, arrays)
            found = np.array(arrays, dtype=float)
        found[:3] += solver.origin[index][:, None]
        return found

    def places(self, body: Body, index: int) -> np.ndarray:
        """Return where the vertices of a dynamic body are in a world, (3, n) float [m], coordinates by rows."""
        x = self._once("places", body, body._vertices)
        return (x[index if len(x) > 1 else 0] if x.ndim == 3 else x).T

    def wrench(self, grip: Grip, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the force [N] and the torque [N m] (3,) that a grip bears in a world."""
        force, torque = self._once("wrench", grip, lambda: grip.wrench)
        return (force[index], torque[index]) if force.ndim == 2 else (force, torque)

    def contacts(self, body: Body, index: int) -> list[Contact]:
        """Return what the solver says of a body's contacts in a world."""
        found = self._once("contacts", body, lambda: self.world.contacts(body))
        rows = zip(found.points, found.forces, found.others, found.worlds, strict=True)
        return [(point, force, name) for point, force, name, world in rows if world == index]

    def keep_only(self, bodies: list[Body]) -> None:
        """Forget other bodies' arrays."""
        for body in [body for body in self._arrays if body not in bodies]:
            del self._arrays[body]

    def _once(self, what: str, of: Any, read: Any) -> Any:
        if self.world.world_count == 1:
            return read()
        found = self._read.get((what, of))
        if found is None:
            found = self._read[what, of] = read()
        return found


def of_world(value: Any, index: int) -> Any:
    """Return what holds in one world of a batch, of a value for all worlds or an array with one for each."""
    values = np.atleast_1d(value)
    return values[index if len(values) > 1 else 0]


def _rows_of_batch(solver: Any) -> np.ndarray:
    """Return places relative to the worlds' origins and velocities, (worlds, 6, n) float."""
    arrays = [solver.download(array, solver.particle_count) for array in solver.arrays.values()]
    return np.array(arrays, dtype=float).swapaxes(0, 1)
