"""The picked body: what a page says of it, and the values of it that can be plotted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import dynamics_of
from nuno.errors import InvalidInputError
from nuno.world.contact_points import contact_points

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

KEPT = 600  # values of a plot


def of_world(array: Any, index: int, axes: int = 1) -> np.ndarray:
    """Return one world's part of an array that has a first axis of worlds where it has more than ``axes`` axes."""
    values = np.asarray(array, dtype=float)
    return np.asarray(values[index if len(values) > 1 else 0] if values.ndim > axes else values)


def state_rows(world: Simulation, body: Body, index: int) -> list[tuple[str, str]]:
    """Return what a page says of a body, as (label, text); the caller holds the world's lock."""
    dynamics = dynamics_of(body)
    kind = "static" if dynamics is None else f"dynamic, {type(dynamics.material).__name__}"
    x, y, z = of_world(body.pose()[0] if dynamics is None or dynamics.is_rigid else body.centre_of_mass, index)
    rows = [("shape", body.shape.kind), ("state", kind), ("place", f"{x:.3f}, {y:.3f}, {z:.3f} m")]
    if dynamics is not None:
        u, v, w = of_world(body.velocity, index)
        rows += [
            ("velocity", f"{u:.3f}, {v:.3f}, {w:.3f} m/s"), ("mass", f"{float(of_world(body.mass, index, 0)):.4g} kg"),
            ("grips", str(len(dynamics.grips))),
        ]  # fmt: skip
    elif body._path is not None:
        rows.append(("path", "followed"))
    if world.world_count > 1:
        rows.append(("world", str(index)))
    return rows


def height(world: Simulation, body: Body, index: int) -> float:
    """Return how high a body's centre is [m]."""
    return float(of_world(body._vertices(), index, 2)[:, 2].mean())


def speed(world: Simulation, body: Body, index: int) -> float:
    """Return the speed of a body's centre of mass [m/s]; 0 while it is static."""
    return 0.0 if not body.is_dynamic else float(np.linalg.norm(of_world(body.velocity, index)))


def contact_force(world: Simulation, body: Body, index: int) -> float:
    """Return the size of the sum of the contact forces on a body [N]; 0 while it is static."""
    if not body.is_dynamic:
        return 0.0
    contacts = contact_points(world, body)
    return float(np.linalg.norm(contacts.forces[contacts.worlds == index].sum(axis=0)))


PLOTTED: dict[str, tuple[str, Callable[[Any, Any, int], float]]] = {
    "height": ("m", height), "speed": ("m/s", speed), "contact force": ("N", contact_force),
}  # fmt: skip
"""The values of a picked body that a page can plot: unit, and how each is read."""


class Plot:
    """A value over time.

    Args:
        name: What the value is called.
        unit: Its unit, or an empty string.
        read: Returns the value; called under the world's lock.
    """

    def __init__(self, name: str, unit: str, read: Callable[[], Any]) -> None:
        self.name, self.unit, self._read = name, unit, read
        self.times: deque[float] = deque(maxlen=KEPT)
        self.values: deque[float] = deque(maxlen=KEPT)

    def sample(self, time: float) -> bool:
        """Take the value at a time [s] in, and return whether that is new; an earlier time begins anew.

        Raises:
            InvalidInputError: the value is not a number.
        """
        if self.times and time == self.times[-1]:
            return False
        if self.times and time < self.times[-1]:
            self.times.clear()
            self.values.clear()
        value = np.asarray(self._read(), dtype=float)
        if value.size != 1:
            raise InvalidInputError(f"the plot {self.name!r} needs one number, got an array of shape {value.shape}")
        self.times.append(time)
        self.values.append(float(value.reshape(())))
        return True

    def content(self) -> dict[str, Any]:
        """Return what a page needs."""
        return {
            "name": self.name, "unit": self.unit, "times": np.array(self.times, np.float32),
            "values": np.array(self.values, np.float32),
        }  # fmt: skip
