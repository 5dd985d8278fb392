"""A Newton model of a world: its particles, hinges, tetrahedra, bodies and shapes, for all worlds of a batch."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.body_parts import parts_of
from nuno.engines.array_dynamics import ArrayParticles
from nuno.engines.newton.hinges import mesh_hinges, sheet_hinges
from nuno.engines.newton.newton_shapes import add_part
from nuno.engines.world_view import dynamics_of, rules_of
from nuno.joints.grip import GripSpec
from nuno.materials import Cloth, Soft
from nuno.shapes.shape import Plane, Sheet
from nuno.tables.kinematic_motion import is_kinematic
from nuno.topology.soft_topology import moduli

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld

logger = logging.getLogger(__name__)

PARTICLE_STIFFNESS, SHAPE_STIFFNESS = 5e3, 4e5
"""[N/m] of contacts: a particle's with a shape has the mean of both, two particles' the first, two shapes' the second.
A box of 1 kg on four corners sinks in by 6 um. At 2e4 N/m a box slid 2 % too far down an incline."""
SHAPE_DAMPING = 100.0
"""[N s/m] of contacts of shapes: a box of 1 kg that falls by 0.25 m bounces back by 0.03 m, without by 0.05 m."""
MAX_POISSON = 0.3
"""The membrane's largest Poisson ratio: Newton's is isotropic, and a softer shear than this leaves is not met."""


@dataclass
class NewtonModel:
    """A model, and which of its rows are whose.

    Attributes:
        model: Newton's.
        origin: (3,) [m], where its own coordinates begin.
        particles: By body's key, the first particle of each world (worlds,) int.
        bodies: By body's key, the index of its rigid body in each world (worlds,) int.
        driven_bodies: The keys of rigid bodies that paths or grips move.
        touching: The distance [m] at which layers of cloth touch, or None where nothing touches itself.
    """

    model: Any
    origin: np.ndarray
    particles: dict[str, np.ndarray] = field(default_factory=dict)
    bodies: dict[str, np.ndarray] = field(default_factory=dict)
    driven_bodies: list[str] = field(default_factory=list)
    touching: float | None = None


def membrane(material: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return the Lame parameters (mu, lambda) [N/m] of a plane membrane as stiff as a cloth.

    Its stretch stiffness 4 mu (lambda + mu) / (lambda + 2 mu) is the cloth's. Its shear stiffness mu is too, where that
    leaves a Poisson ratio from 0 to `MAX_POISSON`.
    """
    stretch = float(np.sqrt(material["stretch_stiffness_warp"] * material["stretch_stiffness_weft"]).flat[0])
    shear = float(material["shear_stiffness"].flat[0])
    poisson = min(max(stretch / (2.0 * shear) - 1.0, 0.0), MAX_POISSON)
    mu = stretch / (2.0 * (1.0 + poisson))
    return mu, stretch * poisson / (1.0 - poisson**2)


def build_model(world: EngineWorld) -> NewtonModel:
    """Return the model of a world's bodies, in the shapes that they have at rest and where static ones are now."""
    import newton

    bodies = list(world.bodies)
    moving = [body for body in bodies if body.is_dynamic]
    deforming = [body for body in moving if isinstance(dynamics_of(body), ArrayParticles)]
    centres = [dynamics_of(body).pose(body)[0].reshape(-1, 3).mean(axis=0) for body in moving]
    origin = np.round(np.mean(centres, axis=0) * 16) / 16 if centres else np.zeros(3)
    down: Any = tuple(float(g) for g in world.gravity)
    scene = newton.ModelBuilder(gravity=down)
    scene.rigid_gap = 0.005
    made = NewtonModel(None, origin)
    _warn_of_exceptions(world, deforming, bodies)
    shapes: dict[str, list[list[int]]] = {body.key: [] for body in bodies}
    for index in range(world.world_count):
        scene.begin_world()
        for body in deforming:
            made.particles.setdefault(body.key, np.zeros(world.world_count, int))[index] = len(scene.particle_q)
            _add_particles(scene, body, index, world)
        for body in bodies:
            if body not in deforming:
                _add_shapes(scene, body, index, made, shapes[body.key], world)
        _filter(scene, world, bodies, shapes, index)
        scene.end_world()
    scene.color(include_bending=True)
    model: Any = scene.finalize(device=str(world.device))
    frictions = [float(np.mean(dynamics_of(body).friction)) for body in deforming]
    if frictions and np.ptp(frictions) > 1e-9:
        logger.warning("newton: all deformable bodies have one coefficient of friction, the mean of theirs")
    model.soft_contact_ke, model.soft_contact_kd = PARTICLE_STIFFNESS, 0.0
    model.soft_contact_mu = float(np.mean(frictions)) if frictions else 0.5
    itself = [body for body in deforming if rules_of(world).touches_itself(body) and isinstance(_of(body), Cloth)]
    if itself or len(deforming) > 1:
        made.touching = max((_thickness(body) for body in deforming), default=0.0) or 1e-3
    made.model = model
    return made


def held_vertices(body: Body) -> list[tuple[Any, np.ndarray]]:
    """Return a deformable body's grips with the vertices (worlds, k) that each leads, -1 for none."""
    found = []
    for grip in dynamics_of(body).grips:
        spec = grip.spec
        if not isinstance(spec, GripSpec):
            continue
        vertices = spec.vertices
        if vertices is None:
            assert spec.corners is not None and spec.barycentric is not None
            best = spec.barycentric.argmax(axis=-1)
            vertices = np.take_along_axis(spec.corners, best[..., None], axis=-1)[..., 0]
        found.append((grip, vertices))
    return found


def _of(body: Body) -> Any:
    return dynamics_of(body).material


def _thickness(body: Body) -> float:
    """Return a cloth's contact diameter [m], at most half a cell as in Nuno's own engine; a soft body has none."""
    material = _of(body)
    if not isinstance(material, Cloth):
        return 0.0
    return min(float(np.max(material.thickness)), 0.5 * dynamics_of(body).topology.cell_size)


def _add_particles(scene: Any, body: Body, index: int, world: EngineWorld) -> None:
    import warp as wp

    dynamics: Any = dynamics_of(body) if body.is_dynamic else None
    topology, first = dynamics.topology, len(scene.particle_q)
    rest = np.asarray(topology.rest, float)
    own = dynamics.material.of_world(index, world.world_count)
    mass = dynamics.mass[index].astype(float)
    held = np.zeros(len(mass), bool)
    for _, vertices in held_vertices(body):
        held[vertices[index][vertices[index] >= 0]] = True
    mass = np.where(held, 0.0, mass)
    radius = 0.5 * float(np.max(own.thickness)) if isinstance(own, Cloth) else 0.0
    still = [wp.vec3(0.0, 0.0, 0.0)] * len(rest)
    scene.add_particles([wp.vec3(*p) for p in rest], still, mass.tolist(), radius=[radius] * len(rest))
    faces = topology.faces + first
    if isinstance(own, Soft):
        mu, second = moduli(own.resolved(1, len(topology.tets)))
        share = topology.fraction
        mus = np.broadcast_to(mu[0] * share, len(topology.tets))
        lames = np.broadcast_to((second - mu)[0] * share, len(topology.tets))
        # Newton's damping is of the rate of C = F^T F, whose stress is 4 times that of the strain's
        damping = float(np.max(own.damping))
        for tet, m, lame in zip(topology.tets + first, mus.tolist(), lames.tolist(), strict=True):
            scene.add_tetrahedron(*tet.tolist(), k_mu=m, k_lambda=lame, k_damp=0.5 * damping * m)
        nothing = [0.0] * len(faces)
        scene.add_triangles(*faces.T, tri_ke=nothing, tri_ka=nothing, tri_kd=nothing)
        hinges, stiffness = mesh_hinges(rest, topology.faces, 0.0)
    else:
        values = own.resolved(1, topology.element_count)
        mu_, lame_ = membrane(values)
        count = len(faces)
        scene.add_triangles(*faces.T, tri_ke=[mu_] * count, tri_ka=[lame_] * count, tri_kd=[0.0] * count)
        rigidity = float(np.sqrt(values["bending_rigidity_warp"] * values["bending_rigidity_weft"]).flat[0])
        if isinstance(body.shape, Sheet):
            hinges, stiffness = sheet_hinges(body.shape, rigidity)
        else:
            hinges, stiffness = mesh_hinges(rest, topology.faces, rigidity)
    damped = stiffness * float(np.max(own.damping)) if isinstance(own, Cloth) else np.zeros(len(stiffness))
    whole = np.where(hinges >= 0, hinges + first, -1)
    scene.add_edges(*whole.T, edge_ke=stiffness.tolist(), edge_kd=damped.tolist())


def _add_shapes(
    scene: Any, body: Body, index: int, made: NewtonModel, shapes: list[list[int]], world: EngineWorld
) -> None:
    dynamics: Any = dynamics_of(body) if body.is_dynamic else None
    kinematic = is_kinematic(body) if dynamics is None else bool(dynamics.grips)
    worlds = world.world_count
    number, place, turn = -1, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    pose = body.pose() if dynamics is None else dynamics.pose(body)
    where = [np.broadcast_to(part, (worlds, part.shape[-1]))[index] for part in pose]
    if dynamics is not None or (kinematic and not isinstance(body.shape, Plane)):
        options: dict[str, Any] = {"mass": 1.0, "inertia": np.eye(3).tolist(), "com": (0.0, 0.0, 0.0)}
        if dynamics is not None:
            options = {
                "mass": float(dynamics.mass[index]), "inertia": dynamics.inertia[index].tolist(),
                "com": tuple(dynamics.centre.tolist()),
            }  # fmt: skip
        options["inertia"] = _matrix(options["inertia"])
        number = scene.add_link(xform=_transform(where[0] - made.origin, where[1]), lock_inertia=True,
                                is_kinematic=kinematic, **options)  # fmt: skip
        scene.add_articulation([scene.add_joint_free(child=number)])
        made.bodies.setdefault(body.key, np.zeros(worlds, int))[index] = number
        if kinematic and body.key not in made.driven_bodies:
            made.driven_bodies.append(body.key)
    else:
        place, turn = where[0] - made.origin, where[1]
    friction = np.broadcast_to(body.friction if dynamics is None else dynamics.friction, worlds)[index]
    parts = parts_of(body, moves=True) if dynamics is not None else parts_of(body, moves=False)
    config = scene.ShapeConfig(density=0.0, ke=SHAPE_STIFFNESS, kd=SHAPE_DAMPING, mu=float(friction), gap=0.005)
    shapes.append([add_part(scene, part.placed(place, turn), number, config, index) for part in parts])


def _matrix(rows: Any) -> Any:
    import warp as wp

    return wp.mat33(*np.asarray(rows, float).ravel().tolist())


def _transform(place: np.ndarray, turn: np.ndarray) -> Any:
    import warp as wp

    return wp.transform(wp.vec3(*place.tolist()), wp.quat(*turn[[1, 2, 3, 0]].tolist()))


def _filter(scene: Any, world: EngineWorld, bodies: list[Body], shapes: dict[str, list[list[int]]], index: int) -> None:
    """Keep shapes of bodies from touching that are to pass through each other."""
    with_shapes = [body for body in bodies if shapes[body.key]]
    for a, b in combinations(with_shapes, 2):
        if not rules_of(world).touch(a, b):
            for one, other in product(shapes[a.key][index], shapes[b.key][index]):
                scene.add_shape_collision_filter_pair(one, other)


def _warn_of_exceptions(world: EngineWorld, deforming: list[Body], bodies: list[Body]) -> None:
    for a in deforming:
        passed = [b.name for b in bodies if b is not a and not rules_of(world).touch(a, b)]
        if passed:
            logger.warning(
                "newton: %r touches %s all the same, as no pair with a deformable body can be left out",
                a.name, ", ".join(map(repr, passed)),
            )  # fmt: skip
