"""Dynamics: what a body has while it is attached, around the solver that moves it.

`ParticleDynamics` moves cloth and soft bodies, `nuno.dynamics.rigid_dynamics.RigidDynamics` rigid ones.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.bodies.body_motion import BodyMotion, motion_of_particles
from nuno.bodies.given_velocity import GivenVelocity
from nuno.bodies.resolution import Resolution
from nuno.bodies.shape_topology import element_count, topology_of
from nuno.dynamics.push import Push
from nuno.errors import InvalidInputError
from nuno.joints.grip import Grip
from nuno.materials import Cloth, Material, Rigid, Soft
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, apply, compose, invert
from nuno.shapes.shape import Plane, Shape
from nuno.solvers.held_memory import hold_memory

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.body_protocols import MovedBody, WorldSettings
    from nuno.bodies.contact_rules import ContactRules


logger = logging.getLogger(__name__)

State = dict[str, np.ndarray]  # of a solver: "local" and "origin", which add up to positions, "velocities" ...
SOON = 1e-9  # [s], below which two instants are the same


class Dynamics:
    """The dynamics of an attached body, whatever its kind.

    Attributes:
        material: Its material.
        friction: The body's coefficient, a number or (worlds,).
        world_count: Worlds in the batch.
        grips: What holds it.
        pushes: What pushes it.
        substeps: Substeps of a frame.
        is_rigid: Whether it is that of a rigid body.
        copies_vertices: Whether ``vertices`` returns an array that nobody else has.
    """

    is_rigid: ClassVar[bool] = False
    copies_vertices: ClassVar[bool] = False

    def __init__(self, material: Material, friction: Any, world: WorldSettings) -> None:
        self.material, self.friction, self.world_count = material, friction, world.world_count
        self.grips: list[Grip] = []
        self.pushes: list[Push] = []
        self.grips_changed, self.collider_version = False, -1
        self.grips_before: tuple[list[Grip], np.ndarray] | None = None  # see `note_grips`

    substeps: int

    @property
    def resolution(self) -> Resolution | None:
        """Return what the substeps make of the material, or None where there is nothing to say."""
        return None

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m], of all vertices or of ``some``, (worlds, n) int."""
        raise NotImplementedError

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s] of the vertices."""
        raise NotImplementedError

    def pose(self, body: MovedBody) -> Pose:
        """Return where the body is."""
        raise NotImplementedError

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere as a whole; velocities turn along."""
        raise NotImplementedError

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves as a whole."""
        raise NotImplementedError

    def set_velocity(self, body: MovedBody, given: GivenVelocity, worlds: np.ndarray | None = None) -> None:
        """Give the body velocities, in all worlds or some (k,); it stays where it is."""
        raise NotImplementedError

    def place_worlds(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray, worlds: np.ndarray) -> None:
        """Put the body elsewhere as a whole in some worlds (k,); velocities turn along."""
        raise NotImplementedError

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J], what the body's deformation stores."""
        raise NotImplementedError

    def state(self) -> State:
        """Return copies of all that the next step depends on."""
        raise NotImplementedError

    def load_state(self, state: State) -> None:
        """Set the state that `state` gave."""
        raise NotImplementedError

    def load_worlds(self, worlds: np.ndarray, state: State) -> None:
        """Set some worlds (k,) to the state (k, ...) that `state` gave of them; the others keep every bit."""
        raise NotImplementedError

    def prepare(self, time: float, frame: float) -> None:
        """Bring what acts on the body from ``time`` [s] on, once for each run or ``frame`` [s]."""
        raise NotImplementedError

    def finite(self) -> np.ndarray:
        """Return (worlds,) bool, whether all numbers of the state are finite."""
        raise NotImplementedError

    def release(self) -> None:
        """Give back what the world holds for the body."""

    def add_push(self, push: Push) -> None:
        """Add a push; one without an end takes the place of the last such push.

        One with an end that is nothing here may be something in other worlds of a batch, whose frame it ends, too.
        """
        kept = [other for other in self.pushes if push.end is not None or other.end is not None]
        self.pushes = [*kept, push] if push.end is not None or push.force.any() else kept

    def pushing(self, time: float) -> tuple[Push, ...]:
        """Return the pushes that act from ``time`` [s] on."""
        return tuple(push for push in self.pushes if push.end is None or push.end > time + SOON)

    def point_grips(self) -> list[Grip]:
        """Return the grips of its points that its solver knows: no ties."""
        return [grip for grip in self.grips if not grip.is_tie]

    def note_grips(self, worlds: np.ndarray | None) -> None:
        """Be told that grips change, in all worlds or in some (worlds,) bool; in others those of before are known."""
        known = self.grips_before if self.grips_changed else (self.point_grips(), np.zeros(self.world_count, bool))
        self.grips_changed = True
        self.grips_before = None if known is None or worlds is None else (known[0], known[1] | worlds)

    def fits(self, material: Material, world_count: int, friction: Any) -> bool:
        """Return True if this can take a state of the given material, worlds and friction."""
        same_friction = np.array_equal(friction, self.friction)
        return same_friction and self.world_count == world_count and self.material.same_as(material)


class ParticleDynamics(Dynamics):
    """An attached cloth's or soft body's solver, material, grips and pushes.

    Args:
        shape: Its shape.
        material: Its material.
        positions: (worlds, n, 3) [m].
        velocities: (worlds, n, 3) [m/s]; None leaves all at zero until ``load_state``, and of ``positions`` takes the
            shape only.
        friction: The body's coefficient, a number or (worlds,).
        world: The world whose batch, device, gravity and frame rate are used.

    Raises:
        InvalidInputError: the shape has no dynamics, or the material does not fit the shape or the batch.
    """

    copies_vertices: ClassVar[bool] = True

    def __init__(
        self,
        shape: Shape,
        material: Material,
        positions: np.ndarray,
        velocities: np.ndarray | None,
        friction: Any,
        world: WorldSettings,
    ) -> None:
        check_material(shape, material, world.world_count)
        super().__init__(material, friction, world)
        self.solver = _solver_class(material)(
            topology_of(shape), material, positions, velocities, device=world.device, gravity=world.gravity,
            frame_rate=world.frame_rate, substeps=world.substeps, friction=friction,
        )  # fmt: skip
        hold_memory(self.solver, world.device, self.solver.memory_bytes)
        self.acting: tuple[Push, ...] = ()

    @property
    def substeps(self) -> int:  # type: ignore[override]
        """Substeps of a frame, the solver's own."""
        return int(self.solver.substeps)

    @property
    def resolution(self) -> Resolution:
        """Return what the substeps make of the material."""
        found: Resolution = self.solver.resolution
        return found

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""
        return self.solver.positions(some)

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s]."""
        return np.stack(self.solver.velocities_apart(), axis=-1, dtype=np.float64)

    def pose(self, body: MovedBody) -> Pose:
        """Return the mean of the vertices, and the orientation that the body was last given."""
        centre = self.vertices(body).mean(axis=-2)
        return centre[0] if len(centre) == 1 else centre, body._quaternion

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere as a whole, in its shape; velocities turn along."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        turned = quat.rotate(motion[1][..., None, :], self.velocities(body))
        self.solver.set_state(apply(motion, self.vertices(body)), turned.astype(np.float32))

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves as a whole: the motion of its vertices' masses."""
        return motion_of_particles(self.solver.mass, self.vertices(body), self.velocities(body))

    def set_velocity(self, body: MovedBody, given: GivenVelocity, worlds: np.ndarray | None = None) -> None:
        """Give the vertices velocities, in all worlds or some (k,); they stay where they are, to the bit."""
        from nuno.state.cloth_state import SPEED

        velocities = given.vertices
        if velocities is None:
            velocities = given.at(self.vertices(body), self.motion(body).centre)
        state = self.solver.save_state()
        state["velocities"] = velocities.astype(np.float32)
        state["notes"][:, SPEED] = (velocities**2).sum(axis=-1).max(axis=-1)  # which bounds what pairs are listed
        if worlds is None:
            self.solver.load_state(state)
        else:
            self.load_worlds(worlds, {name: array[worlds] for name, array in state.items()})

    def place_worlds(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray, worlds: np.ndarray) -> None:
        """Put the body elsewhere as a whole in some worlds (k,); velocities turn along."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        turned = quat.rotate(motion[1][..., None, :], self.velocities(body))
        self.set_vertices(apply(motion, self.vertices(body)), turned, worlds)

    def set_vertices(self, vertices: np.ndarray, velocities: np.ndarray, worlds: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s] (worlds, n, 3), in some worlds (k,)."""
        from nuno.solvers.particle_state import state_from

        self.load_worlds(worlds, state_from(vertices[worlds], velocities[worlds]))

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J], what the body's deformation stores."""
        measures: Any
        if isinstance(self.material, Soft):
            from nuno.bodies import soft_measures as measures
        else:
            from nuno.bodies import cloth_measures as measures
        energy: np.ndarray = measures.elastic_energy(
            topology_of(body.shape), self.vertices(body), self.material, self.world_count
        )
        return energy

    def set_self_contact(self, touching: bool) -> None:
        """Let the body touch itself or not, from the next step on."""
        if isinstance(self.material, Cloth) and touching != self.solver.self_contact:
            self.solver.self_contact = touching
            self.solver.load_state(self.solver.save_state())  # which forgets the list of pairs: it is out of date

    def prepare(self, time: float, frame: float) -> None:
        """Bring the grips and pushes of a span from ``time`` on; a leading body's last move takes a ``frame`` [s]."""
        grips = self.point_grips()
        for grip in self.grips:
            if grip.is_tie and grip.offsets is not None:
                grip.spec_for(time, frame)
        if self.grips_changed or any(grip.target is not None for grip in grips):
            self.solver.set_grips([grip.spec_for(time, frame) for grip in grips])
            self.grips_changed, self.grips_before = False, None
        pushing = self.pushing(time)
        if pushing != self.acting:
            self.solver.set_forces(np.sum([p.force for p in pushing], axis=0) if pushing else None)
            self.acting = pushing

    def shape_impulses(self) -> dict[str, np.ndarray]:
        """Return what static bodies gave this one in the last frame, (worlds, 3) [N s], by key, where it is summed."""
        return {} if self.solver.sums is None else dict(self.solver.sums.given())

    def sum_impulses(self, on: bool) -> None:
        """Sum up what shapes give the body, from the next frame on, or no more. The motion keeps its bits."""
        if on != (self.solver.sums is not None):
            from nuno.solvers.shape_impulses import ShapeImpulses

            self.solver.sums = ShapeImpulses(self.solver) if on else None

    def _forget_impulses(self) -> None:
        if self.solver.sums is not None:
            self.solver.sums.set_given({})

    def keep(self) -> Any:
        """Return what `put_back` takes: as `state`, but where the solver has it."""
        return self.solver.keep()

    def put_back(self, kept: Any) -> None:
        """Set the state that `keep` kept."""
        self.solver.put_back(kept)
        self._forget_impulses()

    def state(self) -> State:
        """Return copies of all that the next step depends on."""
        return self.solver.save_state()

    def load_state(self, state: State) -> None:
        """Set the state that `state` gave; what shapes gave before that was in another past."""
        if self.grips_changed:  # others come before the next frame
            self.solver.forget_grips()
        self.solver.load_state(state)
        self._forget_impulses()

    def load_worlds(self, worlds: np.ndarray, state: State) -> None:
        """Set some worlds (k,) to the state (k, ...) that `state` gave of them; the others keep every bit."""
        from nuno.solvers.some_worlds import load_particles

        load_particles(self.solver, worlds, state)

    def finite(self) -> np.ndarray:
        """Return (worlds,) bool, whether all positions and velocities are finite."""
        return self.solver.finite()

    def make_room(self, body: MovedBody) -> bool:
        """Make lists longer that were too short in the last run; return whether that must be gone through again."""
        known, longer = bool(self.solver.missed.any()), bool(self.solver.make_room())
        if longer:
            logger.info("%r touches itself at more places than expected: made room for them", body.name)
        elif not known and self.solver.missed.any():
            logger.warning(
                "%r touches itself at more places than there is memory for: some contacts are passed over, now and "
                "later, and %r.missed_contacts says in which worlds; coarser or thinner cloth has fewer",
                body.name, body.name,
            )  # fmt: skip
        return longer


def touches_itself(rules: ContactRules, body: Body) -> bool:
    """Return True if contacts of a soft body with itself are looked for, which takes it through a frame by parts."""
    return isinstance(body.material, Soft) and body.material.self_contact and rules.touches_itself(body)


def rigid_vertices(body: MovedBody, pose: Pose, world_count: int, some: np.ndarray | None = None) -> np.ndarray:
    """Return (worlds, n, 3) float64 [m] of a rigid body at a pose, of all vertices or of ``some``, (worlds, n) int."""
    vertices = body._rigid_vertices(pose)
    vertices = np.broadcast_to(vertices, (world_count, *vertices.shape[-2:]))
    return vertices if some is None else np.take_along_axis(vertices, some[..., None], axis=1)


def dynamics_of(body: Body) -> Dynamics | None:
    """Return the dynamics of a body, None while it is static."""
    own = body._dynamics
    return own if isinstance(own, Dynamics) else None


def default_material(body: Body) -> Material:
    """Return the material that a body gets when none is named: its kind's, with the body's friction."""
    if body.shape.is_cloth:
        return Cloth(friction=body.friction)
    if body.shape.is_soft:
        return Soft(friction=body.friction)
    return Rigid(friction=body.friction)


def check_material(shape: Shape, material: Any, world_count: int) -> None:
    """Check that a shape can have a material.

    Raises:
        InvalidInputError: the shape has no such dynamics, it is no material, or it fits neither shape nor batch.
    """
    valid = "Cloth or Rigid" if shape.is_cloth else "Soft or Rigid" if shape.is_soft else "Rigid"
    if isinstance(shape, Plane):
        raise InvalidInputError("a plane is endless and cannot be dynamic; take a box")
    kinds = (Rigid, Cloth) if shape.is_cloth else (Rigid, Soft) if shape.is_soft else (Rigid,)
    if not isinstance(material, kinds):
        raise InvalidInputError(f"a {shape.kind} needs a {valid} material, got {type(material).__name__}")
    material.resolved(world_count, 1 if isinstance(material, Rigid) else element_count(shape))


def backend() -> tuple[Any, Any]:
    """Return the classes of the cloth solver and of static shapes' tables; imported on first use."""
    from nuno.solvers.cloth_solver import ClothSolver
    from nuno.tables.colliders import Colliders

    return ClothSolver, Colliders


def make_colliders(bodies: list[Body], pair_friction: dict[str, Any], world: WorldSettings) -> Any:
    """Return what solvers need of the static bodies that they touch; ``pair_friction`` is by name."""
    return backend()[1].from_bodies(bodies, world.world_count, world.device, pair_friction=pair_friction)


def _solver_class(material: Material) -> Any:
    if isinstance(material, Soft):
        from nuno.solvers.soft_solver import SoftSolver

        return SoftSolver
    return backend()[0]
