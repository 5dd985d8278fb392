"""ImaginedSensors: what the sensors of a robot's copies tell in a batch of imagined worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.loads import LinkLoads
from nuno.robot.robot_state import RobotState
from nuno.robot.sensors import Readings, Sensors
from nuno.robot.world_reader import WorldReader

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.world.world import World


@dataclass(frozen=True, eq=False)
class ImaginedReadings:
    """Readings of the sensors of a robot's copies, by the names that ``Readings`` has, over worlds.

    Attributes:
        time: [s], of the batch, when they were read: no sensor is late.
        positions: (worlds, n) float [rad; m for slides], of the joints in the order of ``joint_names``.
        velocities: (worlds, n) float [rad/s; m/s].
        torques: (worlds, n) float [N m; N], of the motors.
        orientation: (worlds, 4) float, (w, x, y, z), of the inertial unit in the world; NaN without one.
        angular_velocity: (worlds, 3) float [rad/s], in the unit's own axes.
        specific_force: (worlds, 3) float [m/s2], likewise.
        wrenches: By sensor, force and torque (worlds, 6) float [N, N m] of what is beyond it on what is before it, in
            its axes and about its origin.
        contacts: By foot, (worlds,) bool, whether it presses on the ground.
        zero_moment_point: (worlds, 2) float [m] on the ground, NaN where nothing presses on it.
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    torques: np.ndarray
    orientation: np.ndarray
    angular_velocity: np.ndarray
    specific_force: np.ndarray
    wrenches: Mapping[str, np.ndarray]
    contacts: Mapping[str, np.ndarray]
    zero_moment_point: np.ndarray


class ImaginedSensors(Sensors):
    """Exact sensors of a robot's copies, one in each world of a batch.

    Args:
        robot: The robot.
        links: Its own links.
        world: The batch.
        bodies: The links' copies there, in their order.
        ground: Height of the ground [m].
    """

    def __init__(self, robot: Humanoid, links: Links, world: World, bodies: Sequence[Body], ground: float) -> None:
        super().__init__(robot, links, ground=ground)
        self._world = world
        self._reader, groups = WorldReader(world), self._groups()
        self._of_worlds = [
            LinkLoads(links, groups, reader=self._reader, bodies=bodies, index=k) for k in range(world.world_count)
        ]

    def forget(self, worlds: np.ndarray) -> None:
        """Read anew in some worlds (worlds,) bool, where something is held otherwise than before."""
        for k in np.flatnonzero(worlds).tolist():
            self._of_worlds[k].forget()

    def read_worlds(self, states: Sequence[RobotState], time: float) -> ImaginedReadings:
        """Return what the sensors tell of each world's robot.

        Args:
            states: How it moves, in each world.
            time: [s], that the batch has now.
        """
        self._reader.renew()
        found: list[Readings] = []
        for state, loads in zip(states, self._of_worlds, strict=True):
            self._loads = loads
            found.append(self.read(state))
        self._reader.renew()  # which frees what was read of all worlds
        first = found[0]
        over = {
            name: np.array([getattr(own, name) for own in found])
            for name in (
                "positions", "velocities", "torques", "orientation", "angular_velocity", "specific_force",
                "zero_moment_point",
            )
        }  # fmt: skip
        wrenches = {name: np.array([own.wrenches[name] for own in found]) for name in first.wrenches}
        contacts = {name: np.array([own.contacts[name] for own in found]) for name in first.contacts}
        return ImaginedReadings(time=time, wrenches=wrenches, contacts=contacts, **over)
