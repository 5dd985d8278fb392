"""Setting velocities, vertices and poses, in all worlds of a batch or in some."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.bodies.given_velocity import given_velocity
from nuno.dynamics.dynamics import ParticleDynamics, dynamics_of
from nuno.errors import BodyStateError
from nuno.shapes import quaternion as quat
from nuno.tables.kinematic_motion import arrive
from nuno.validation import finite_array
from nuno.world.reading import Reading
from nuno.world.reset import checked_worlds


class Setting(Reading):
    """A simulation with the verbs that set states; worlds that are not named keep every bit."""

    def set_velocity(
        self, body: Body | str, velocity: ArrayLike | None = None, angular_velocity: ArrayLike | None = None,
        *, worlds: Any = None,
    ) -> None:  # fmt: skip
        """Give a dynamic body a velocity in place of the one that it has; it stays where it is.

        Every vertex of a cloth or soft body takes the velocity of the rigid motion. What a grip holds goes on with the
        grip.

        Args:
            body: The body.
            velocity: (3,) or (worlds, 3) [m/s] of the centre of mass; of a cloth or soft body also of every vertex,
                (n, 3) or (worlds, n, 3). Where worlds = n, two axes mean vertices. None is zero.
            angular_velocity: (3,) or (worlds, 3) [rad/s], along the world's axes; None is zero.
            worlds: Worlds of a batch in which it is set, indices or a mask (worlds,) bool; None is all.

        Raises:
            BodyStateError: the body is static.
            InvalidInputError: not finite, of another shape, an angular velocity on top of those of vertices, or worlds
                that there are not.
        """
        with self._change("set_velocity"):
            own, dynamics = self._own_dynamics(body, "attach it with a velocity")
            given = given_velocity(own, dynamics.is_rigid, velocity, angular_velocity, self.world_count)
            chosen = None if worlds is None else checked_worlds(worlds, self.world_count)
            dynamics.set_velocity(own, given, chosen)

    def set_vertices(
        self, body: Body | str, vertices: ArrayLike, velocities: ArrayLike | None = None, *, worlds: Any = None
    ) -> None:
        """Put the vertices of a dynamic cloth or soft body elsewhere.

        Args:
            body: The body.
            vertices: (n, 3) or (worlds, n, 3) [m], in the world frame.
            velocities: (n, 3) or (worlds, n, 3) [m/s]; None is at rest.
            worlds: Worlds of a batch in which they are set, indices or a mask (worlds,) bool; None is all.

        Raises:
            BodyStateError: the body is static or rigid: ``set_pose`` and ``set_velocity`` are for those.
            InvalidInputError: not finite, of another shape, or worlds that there are not.
        """
        with self._change("set_vertices"):
            own, count = self._own(body), self.world_count
            dynamics = own._dynamics
            if dynamics is None or dynamics.is_rigid:
                raise BodyStateError(f"{own.name!r} does not move as cloth or soft; see set_pose")
            n = len(own.shape.mesh()[0])
            places = finite_array("vertices", vertices, (n, 3), (count, n, 3))
            speeds = finite_array("velocities", np.zeros(3) if velocities is None else velocities,
                                  (3,), (n, 3), (count, n, 3))  # fmt: skip
            chosen = checked_worlds(np.arange(count) if worlds is None else worlds, count)
            shape = (count, n, 3)
            cast(ParticleDynamics, dynamics).set_vertices(
                np.broadcast_to(places, shape), np.broadcast_to(speeds, shape), chosen
            )

    def set_pose(
        self, body: Body | str, position: ArrayLike | None = None, quaternion: ArrayLike | None = None,
        *, worlds: Any = None,
    ) -> None:  # fmt: skip
        """Put a body elsewhere as a whole, static or dynamic; velocities turn along.

        Args:
            body: The body.
            position: (3,) or (worlds, 3) [m]; None is where it is.
            quaternion: (4,) or (worlds, 4), (w, x, y, z); None is as it is turned.
            worlds: Worlds of a batch in which it is put there, indices or a mask (worlds,) bool; None is all.

        Raises:
            BodyStateError: in some worlds only a body that follows a path or a frame.
            InvalidInputError: not finite, of another shape, or worlds that there are not.
        """
        with self._change("set_pose"):
            own, count = self._own(body), self.world_count
            now = own.pose()
            place = now[0] if position is None else finite_array("position", position, (3,), (count, 3))
            turn = now[1] if quaternion is None else quat.unit("quaternion", quaternion, (4,), (count, 4))
            if worlds is None or count == 1:
                if worlds is None or len(checked_worlds(worlds, count)):
                    own._place(place, turn)
                return
            chosen = checked_worlds(worlds, count)
            if own._path is not None or own._parent is not None:
                raise BodyStateError(f"{own.name!r} follows a path or frame in all worlds; end that first")
            rows = self._rigid_rows(chosen)
            new = [np.array(np.broadcast_to(part, (count, part.shape[-1]))) for part in (place, turn)]
            old = [np.array(np.broadcast_to(part, (count, part.shape[-1]))) for part in now]
            for kept, given in zip(old, new, strict=True):
                kept[chosen] = given[chosen]
            dynamics = dynamics_of(own)
            if dynamics is None:
                own._position, own._quaternion = old
            else:
                dynamics.place_worlds(own, old[0], old[1], chosen)
                own._quaternion = old[1]
            own._moved()
            arrive(self._kinematic_bodies(), self._time)
            self._bring_rigid()
            if rows is not None:
                rows.settle(None, chosen)

    def _rigid_rows(self, worlds: np.ndarray) -> Any:
        """Return what keeps the listing of pairs of other worlds, None where there is nothing rigid."""
        if self._rigid is None:
            return None
        from nuno.solvers.rigid_rows import RigidRows

        self._bring_rigid()
        return RigidRows(self._rigid.solver, worlds)
