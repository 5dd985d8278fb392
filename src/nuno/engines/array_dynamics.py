"""Dynamics whose state is NumPy arrays on the host: what engines other than Nuno's own give a body.

An engine reads them before a step and writes them after it, so that what it compiles may change at any time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body_motion import BodyMotion, motion_of_particles, motion_of_rigid
from nuno.bodies.given_velocity import GivenVelocity
from nuno.bodies.shape_topology import element_count, topology_of
from nuno.constraints.compliances import vertex_masses
from nuno.dynamics.dynamics import Dynamics, State, check_material, rigid_vertices
from nuno.engines.world_view import dynamics_of
from nuno.materials import Material, Rigid, Soft
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, apply, compose, invert

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.body_protocols import MovedBody
    from nuno.engines.world_view import EngineWorld


class ArrayDynamics(Dynamics):
    """Dynamics with arrays of state.

    Attributes:
        values: The state by name, (worlds, ...) float64 each; those of `NEUTRAL`, and of the engine's own.
        substeps: Substeps of a frame; what the engine takes.

    Args:
        body: The body, still static, or as it was recorded.
        material: Its material.
        friction: The body's coefficient, a number or (worlds,).
        world: Its world.
        values: The state that it begins with.
    """

    NEUTRAL: tuple[str, ...] = ()

    def __init__(self, body: Body, material: Material, friction: Any, world: EngineWorld, values: State) -> None:
        check_material(body.shape, material, world.world_count)
        super().__init__(material, friction, world)
        self.shape = body.shape
        self.substeps = 1
        self._engine = world.engine
        self.values: State = {}
        self.load_state(values)

    def state(self) -> State:
        """Return copies of all that the next step depends on."""
        return {name: array.copy() for name, array in self.values.items()}

    def load_state(self, state: State) -> None:
        """Set the state that `state` or `Engine.neutral_state` gave; what is not in it begins anew."""
        self.values = {name: np.array(array, dtype=np.float64) for name, array in state.items()}

    def load_worlds(self, worlds: np.ndarray, state: State) -> None:
        """Set some worlds (k,) to the state (k, ...) of them; the others keep every bit."""
        for name, array in state.items():
            if name not in self.values:
                self.values[name] = np.zeros((self.world_count, *np.shape(array)[1:]))
            self.values[name][worlds] = array

    def finite(self) -> np.ndarray:
        """Return (worlds,) bool, whether all numbers of the state are finite."""
        rows = [np.isfinite(array).reshape(self.world_count, -1).all(axis=1) for array in self.values.values()]
        return np.logical_and.reduce(rows)

    def prepare(self, time: float, frame: float) -> None:
        """Do nothing: the engine reads grips and pushes as it steps."""

    def release(self) -> None:
        """Tell the engine that the body moves no more."""
        self._engine.changed()


class ArrayParticles(ArrayDynamics):
    """Dynamics of a cloth or soft body: "positions" [m] and "velocities" [m/s], (worlds, n, 3).

    Attributes:
        mass: (worlds, n) [kg].
    """

    NEUTRAL = ("positions", "velocities")

    def __init__(self, body: Body, material: Any, friction: Any, world: EngineWorld, values: State) -> None:
        super().__init__(body, material, friction, world, values)
        self.topology = topology_of(body.shape)
        values_of = material.resolved(world.world_count, element_count(body.shape))
        if isinstance(material, Soft):
            self.mass = np.asarray(self.topology.masses(values_of["density"]), dtype=np.float64)
        else:
            self.mass = np.asarray(vertex_masses(self.topology, values_of["area_density"]), dtype=np.float64)
        self.mass = np.broadcast_to(self.mass, (world.world_count, self.mass.shape[-1]))

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""
        places = self.values["positions"]
        return places if some is None else np.take_along_axis(places, some[..., None], axis=1)

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s]."""
        return self.values["velocities"].copy()

    def pose(self, body: MovedBody) -> Pose:
        """Return the mean of the vertices, and the orientation that the body was last given."""
        centre = self.values["positions"].mean(axis=-2)
        return centre[0] if len(centre) == 1 else centre, body._quaternion

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere as a whole, in its shape; velocities turn along."""
        self.place_worlds(body, position, quaternion, np.arange(self.world_count))

    def place_worlds(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray, worlds: np.ndarray) -> None:
        """Put the body elsewhere as a whole in some worlds (k,); velocities turn along."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        turned = quat.rotate(motion[1][..., None, :], self.values["velocities"])
        self.set_vertices(apply(motion, self.values["positions"]), turned, worlds)

    def set_vertices(self, vertices: np.ndarray, velocities: np.ndarray, worlds: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s] (worlds, n, 3), in some worlds (k,); other values begin anew."""
        own = self.values
        own["positions"][worlds], own["velocities"][worlds] = vertices[worlds], velocities[worlds]
        for name in own.keys() - set(self.NEUTRAL):
            own[name][worlds] = 0.0

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves as a whole: the motion of its vertices' masses."""
        return motion_of_particles(self.mass, self.values["positions"], self.values["velocities"])

    def set_velocity(self, body: MovedBody, given: GivenVelocity, worlds: np.ndarray | None = None) -> None:
        """Give the vertices velocities, in all worlds or some (k,); they stay where they are."""
        velocities = given.vertices
        if velocities is None:
            velocities = given.at(self.values["positions"], self.motion(body).centre)
        chosen = np.arange(self.world_count) if worlds is None else worlds
        self.values["velocities"][chosen] = velocities[chosen]

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J], what the deformation stores by Nuno's own measure of it."""
        measures: Any
        if isinstance(self.material, Soft):
            from nuno.bodies import soft_measures as measures
        else:
            from nuno.bodies import cloth_measures as measures
        return np.asarray(
            measures.elastic_energy(self.topology, self.values["positions"], self.material, self.world_count)
        )


class ArrayRigid(ArrayDynamics):
    """Dynamics of a rigid body: "place" [m] and "turn" (w, x, y, z) of its frame, "velocity" [m/s] and "spin" [rad/s].

    The velocity is that of the centre of mass; all are (worlds, 3 or 4), along the world's axes.

    Attributes:
        mass: (worlds,) [kg].
        inertia: (worlds, 3, 3) [kg m2], about the centre of mass, in the body's frame.
        centre: (3,) [m], the centre of mass in the body's frame.
        parts: The convex parts that it is made of, in its frame.
    """

    NEUTRAL = ("place", "turn", "velocity", "spin")
    is_rigid = True

    def __init__(self, body: Body, material: Any, friction: Any, world: EngineWorld, values: State) -> None:
        from nuno.dynamics.body_parts import mass_of, parts_of

        super().__init__(body, material, friction, world, values)
        self.parts = parts_of(body, moves=True)
        density = material.resolved(world.world_count)["density"][:, 0]
        self.mass, self.inertia, self.centre = mass_of(body, material, density)

    def pose(self, body: MovedBody) -> Pose:
        """Return where the body's frame is, (3,) and (4,), in a batch (worlds, 3) and (worlds, 4)."""
        place, turn = self.values["place"].copy(), self.values["turn"].copy()
        return (place[0], turn[0]) if self.world_count == 1 else (place, turn)

    def middle(self) -> np.ndarray:
        """Return (worlds, 3) [m], the centre of mass in the world."""
        turn = self.values["turn"]
        return self.values["place"] + quat.rotate(turn, np.broadcast_to(self.centre, (len(turn), 3)))

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""
        return rigid_vertices(body, self.pose(body), self.world_count, some)

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s] of the vertices."""
        arms = self.vertices(body) - self.middle()[:, None]
        return self.values["velocity"][:, None] + np.cross(self.values["spin"][:, None], arms)

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere; its velocities turn along."""
        self.place_worlds(body, position, quaternion, np.arange(self.world_count))

    def place_worlds(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray, worlds: np.ndarray) -> None:
        """Put the body elsewhere in some worlds (k,); its velocities turn along there."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        turn = np.broadcast_to(motion[1], (self.world_count, 4))
        new = {
            "place": np.broadcast_to(position, (self.world_count, 3)),
            "turn": np.broadcast_to(quaternion, (self.world_count, 4)),
            "velocity": quat.rotate(turn, self.values["velocity"]),
            "spin": quat.rotate(turn, self.values["spin"]),
        }
        for name, array in new.items():
            self.values[name][worlds] = array[worlds]

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves."""
        own = self.values
        return motion_of_rigid(self.mass, self.middle(), self.inertia, own["turn"], own["velocity"], own["spin"])

    def set_velocity(self, body: MovedBody, given: GivenVelocity, worlds: np.ndarray | None = None) -> None:
        """Give the body a velocity and an angular velocity, in all worlds or some (k,)."""
        middle = self.middle()
        chosen = np.arange(self.world_count) if worlds is None else worlds
        self.values["velocity"][chosen] = given.at(middle[:, None], middle)[:, 0][chosen]
        self.values["spin"][chosen] = given.angular[chosen]

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J]: none, for it does not deform."""
        return np.zeros(self.world_count)


def state_at_rest(body: Body, material: Material, worlds: int) -> State:
    """Return the state that dynamics begin with in which a static body is as it is now, at rest."""
    if isinstance(material, Rigid):
        place, turn = (np.broadcast_to(part, (worlds, part.shape[-1])) for part in body.pose())
        still = np.zeros((worlds, 3))
        return {"place": place, "turn": turn, "velocity": still, "spin": still}
    positions = np.broadcast_to(body.vertices, (worlds, *body.vertices.shape[-2:]))
    return {"positions": positions, "velocities": np.zeros(positions.shape)}


def make_arrays(body: Body, material: Material, state: State, friction: Any, world: EngineWorld) -> ArrayDynamics:
    """Return the dynamics of a body's kind, which has copies of the arrays of a state."""
    kind = ArrayRigid if isinstance(material, Rigid) else ArrayParticles
    return kind(body, material, friction, world, state)


def motions_of(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return places, turns, velocities and spins of rigid bodies' frames, (worlds, n, 3 or 4) each."""
    own: list[Any] = [dynamics_of(body) for body in bodies]
    values = {name: np.stack([made.values[name] for made in own], axis=1) for name in ArrayRigid.NEUTRAL}
    arms = np.stack([made.values["place"] - made.middle() for made in own], axis=1)
    velocities = values["velocity"] + np.cross(values["spin"], arms)
    return values["place"], values["turn"], velocities, values["spin"]
