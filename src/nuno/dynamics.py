"""Dynamics: what a body has while it is attached, around the solver that moves it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.grip import Grip
from nuno.materials import Cloth
from nuno.shape import ClothMesh, Shape, Sheet
from nuno.validation import finite_array, number

if TYPE_CHECKING:
    from nuno.body import Body
    from nuno.simulation import Simulation


State = dict[str, np.ndarray]  # of a solver: "local" and "origin", which add up to positions, "velocities" ...
SOON = 1e-9  # [s], below which two instants are the same


@dataclass(frozen=True, eq=False)
class Push:
    """A force on a body's vertices.

    Attributes:
        force: (worlds, n, 3) float32 [N].
        end: The world's time [s] at which it ends, or None.
    """

    force: np.ndarray
    end: float | None


class Dynamics:
    """One attached body's solver, material, grips and pushes.

    Args:
        shape: A cloth's shape.
        material: Its material.
        positions: (worlds, n, 3) [m].
        velocities: (worlds, n, 3) [m/s].
        friction: The body's coefficient, a number or (worlds,).
        world: The world whose batch, device, gravity and frame rate are used.

    Raises:
        InvalidInputError: the shape has no dynamics, or the material does not fit the shape or the batch.
    """

    def __init__(
        self,
        shape: Shape,
        material: Cloth,
        positions: np.ndarray,
        velocities: np.ndarray,
        friction: Any,
        world: Simulation,
    ) -> None:
        check_material(shape, material, world.world_count)
        solver_class, topology_class, _ = backend()
        self.material, self.friction, self.world_count = material, friction, world.world_count
        self.grips: list[Grip] = []
        self.pushes: list[Push] = []
        self.solver = solver_class(
            _topology(shape, topology_class), material,
            positions.astype(np.float32), velocities.astype(np.float32),
            device=world.device, gravity=world.gravity, frame_rate=world.frame_rate, substeps=world.substeps,
            friction=friction,
        )  # fmt: skip
        self.solver.set_state(positions, velocities)  # once more, in float64: it may keep an origin of its own
        self.grips_changed = False
        self.collider_version = -1
        self._pushing: tuple[Push, ...] = ()

    def set_self_contact(self, touching: bool) -> None:
        """Let the body touch itself or not, from the next step on."""
        if touching != self.solver.self_contact:
            self.solver.self_contact = touching
            self.solver.load_state(self.solver.save_state())  # which forgets the list of pairs: it is out of date

    def run(self, time: float, duration: float, frame: float) -> None:
        """Advance from ``time`` by ``duration`` [s], with the grips and pushes of that span."""
        if self.grips_changed or any(grip.target is not None for grip in self.grips):
            self.solver.set_grips([grip._spec_for(time, frame) for grip in self.grips])
            self.grips_changed = False
        pushing = tuple(push for push in self.pushes if push.end is None or push.end > time + SOON)
        if pushing != self._pushing:
            self.solver.set_forces(np.sum([p.force for p in pushing], axis=0) if pushing else None)
            self._pushing = pushing
        self.solver.run(time, duration)

    def add_push(self, push: Push) -> None:
        """Add a push; one without an end takes the place of the last such push."""
        kept = [other for other in self.pushes if push.end is not None or other.end is not None]
        self.pushes = [*kept, push] if push.force.any() else kept

    def fits(self, material: Cloth, world_count: int, friction: Any) -> bool:
        """Return whether this solver can take a state of the given material, worlds and friction."""
        same_friction = np.array_equal(friction, self.friction)
        return same_friction and self.world_count == world_count and self.material.same_as(material)

    def state(self) -> State:
        """Return copies of all that the next step depends on."""
        return self.solver.save_state()


def check_material(shape: Shape, material: Any, world_count: int) -> None:
    """Check that a shape can have a material.

    Raises:
        InvalidInputError: the shape has no dynamics, it is no material, or it fits neither shape nor batch.
    """
    if not shape.is_cloth:
        raise InvalidInputError(
            f"no material makes a {shape.kind} dynamic in this version; shapes that can be attached: sheet, cloth_mesh"
        )
    if not isinstance(material, Cloth):
        raise InvalidInputError(f"a {shape.kind} needs a Cloth material, got {type(material).__name__}")
    material.resolved(world_count, element_count(shape))


def make_push(shape: Shape, force: ArrayLike, duration: float | None, world: Simulation) -> Push:
    """Return a push from now on; see ``World.push``.

    Raises:
        InvalidInputError: a force that is not finite or of another shape, or a duration that is not positive.
    """
    share, worlds = vertex_areas(shape), world.world_count
    n = len(share)
    given = finite_array("force", force, (3,), (n, 3), (worlds, 3), (worlds, n, 3))
    if given.shape in ((3,), (worlds, 3)) and given.shape != (n, 3):
        given = given[..., None, :] * (share / share.sum())[:, None]
    end = None if duration is None else world.time + number("duration", duration, above=0.0)
    return Push(np.array(np.broadcast_to(given, (worlds, n, 3)), dtype=np.float32), end)


def element_count(shape: Shape) -> int:
    """Return how many elements a material may tell apart: a sheet's cells, a cloth mesh's faces."""
    return shape.cells[0] * shape.cells[1] if isinstance(shape, Sheet) else len(shape.mesh()[1])


def vertex_areas(shape: Shape) -> np.ndarray:
    """Return (n,) float [m2], a third of the area at rest of the faces around each vertex."""
    vertices, faces = shape.mesh()
    if isinstance(shape, ClothMesh) and shape.rest is not None:
        vertices = np.pad(shape.rest, ((0, 0), (0, 3 - shape.rest.shape[1])))
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(faces.ravel(), np.repeat(area / 3.0, 3), minlength=len(vertices))


def backend() -> tuple[Any, Any, Any]:
    """Return the classes of the solver, of its topology and of its colliders; imported on first use."""
    from nuno.scene.cloth import ClothTopology
    from nuno.scene.colliders import Colliders
    from nuno.solver.cloth_solver import ClothSolver

    return ClothSolver, ClothTopology, Colliders


def make_colliders(bodies: list[Body], pair_friction: dict[str, Any], world: Simulation) -> Any:
    """Return what solvers need of the static bodies that they touch; ``pair_friction`` is by name."""
    return backend()[2].from_bodies(bodies, world.world_count, world.device, pair_friction=pair_friction)


@lru_cache(maxsize=64)
def _topology(shape: Shape, topology_class: Any) -> Any:
    if isinstance(shape, Sheet):
        return topology_class.sheet(shape.cells, shape.size)
    assert isinstance(shape, ClothMesh)
    return topology_class.mesh(shape.rest, shape.faces)
