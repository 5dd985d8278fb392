"""Tables of bodies that touch or are tied, for the solver of their contacts: surfaces, ties, which of them touch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.contact.particle.distances import BOX, CAPSULE, CYLINDER, SOLID_MESH, SPHERE
from nuno.coupled.tie_constraints import Holds, Ties
from nuno.dynamics.dynamics import ParticleDynamics, touches_itself
from nuno.dynamics.rigid_dynamics import RigidDynamics
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.held_points import holding
from nuno.joints.tie import HoldSpec, TieSpec, corners_of
from nuno.rigid.convex import BOX_PART, CAPSULE_PART, CYLINDER_PART, HULL, SPHERE_PART
from nuno.rigid.ridges import Ridges, ridges_of
from nuno.shapes import quaternion as quat
from nuno.state.cloth_state import THICKNESS
from nuno.tables.coupled_surfaces import RigidPart, SurfaceOfParticles, SurfaceOfRigid, joined_particles, make_elements

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

KINDS = {SPHERE_PART: SPHERE, BOX_PART: BOX, CAPSULE_PART: CAPSULE, CYLINDER_PART: CYLINDER, HULL: SOLID_MESH}
SKIN = 5e-4
"""[m] How far from the surface of a soft body others stay: edges that meet at no distance at all have no side."""
PRESSED = 5e5
"""[Pa] Young's modulus of a cloth across its thickness. Fabrics give ten times as easily, rubber as much. Between two
hard fingers a cloth that gives nothing is held by whichever few corners and vertices happen to be nearest, by µm; one
that gives spreads the load: between 2e5 and 1e6 Pa what holds is 2 mu N."""
RIM_POINTS = 16
"""Corners that stand for the rim of a cylinder, at least: as many as leave the skin's thickness between it and them."""


class CoupledTables:
    """The members of a group of bodies, and the tables of them.

    Args:
        world: Whose they are.
        group: The bodies, in the world's order.
        ties: The grips that join them or hold rigid ones.

    Attributes:
        particles: Bodies of particles.
        rigid: Rigid bodies.
        bodies: All of them, rigid ones last.
    """

    def __init__(self, world: Simulation, group: list[Body], ties: tuple[Grip, ...]) -> None:
        self._world, self._ties = world, ties
        self.particles = [body for body in group if isinstance(body._dynamics, ParticleDynamics)]
        self.rigid = [body for body in group if isinstance(body._dynamics, RigidDynamics)]
        self.bodies = [*self.particles, *self.rigid]
        self._first: dict[Body, int] = {}  # of a body's particles, among all
        total = 0
        for body in self.particles:
            self._first[body] = total
            total += body._dynamics.solver.particle_count  # type: ignore[union-attr]
        self._meshes: list[Any] = []
        self._point_ties = [grip for grip in ties if isinstance(grip.spec, TieSpec | GripSpec)]
        self._frame_holds = [grip for grip in ties if isinstance(grip.spec, HoldSpec)]

    def _make_surfaces(self) -> Any:
        """The bodies' surfaces, and which of them may touch."""
        surfaces = [
            SurfaceOfParticles(
                solver.particle_count,
                np.asarray(body.faces),
                *_surface_rules(body, solver),
                solid=body.is_solid,
                joined=joined_particles(solver.topology.tets) if touches_itself(self._world._rules, body) else None,
            )
            for body in self.particles
            for solver in [body._dynamics.solver]  # type: ignore[union-attr]
        ]
        rigid = [self._surface(body) for body in self.rigid]
        return make_elements(surfaces, rigid, *self._rules(), str(self._world.device))

    def _rules(self) -> tuple[np.ndarray, np.ndarray]:
        rules, count, worlds = self._world._rules, len(self.bodies), self._world.world_count
        touch = np.zeros((count, count), dtype=bool)
        friction = np.zeros((worlds, count, count))
        for a, one in enumerate(self.bodies):
            for b, other in enumerate(self.bodies):
                if a == b:
                    touch[a, b] = touches_itself(self._world._rules, one)
                elif not (one in self.rigid and other in self.rigid):
                    touch[a, b] = rules.touch(one, other)
                mu = rules.friction.get(frozenset((one.key, other.key)))
                mean = np.sqrt(np.asarray(one.friction) * np.asarray(other.friction))
                friction[:, a, b] = mean if mu is None else mu
        return touch, friction

    def _surface(self, body: Body) -> SurfaceOfRigid:
        own: Any = body._dynamics
        parts, points, radii, ridges = [], [], [], []
        for part in own.parts:
            place = (np.zeros(3) if part.position is None else part.position) - own.centre
            turn = quat.IDENTITY if part.quaternion is None else part.quaternion
            kind, mesh, corners, round_by = KINDS[part.kind], None, np.zeros((0, 3)), 0.0
            radius, rim_points = float(np.linalg.norm(np.maximum(np.abs(part.low), np.abs(part.high)))), 0
            if kind == BOX:
                signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
                corners = signs * part.half
            elif kind == CYLINDER:
                rim_points = max(RIM_POINTS, int(np.ceil(np.pi * np.sqrt(0.5 * part.half[0] / SKIN))))
                angle = np.arange(rim_points) * (2 * np.pi / rim_points)
                rim = np.stack([np.cos(angle) * part.half[0], np.sin(angle) * part.half[0]], axis=-1)
                corners = np.concatenate([np.insert(rim, 2, z, axis=1) for z in (-part.half[1], part.half[1])])
            elif kind == SOLID_MESH:
                corners = part.corners
                mesh = self._hull_mesh(part)
            else:
                # balls along the axis of a capsule, so near that what touches between two is a 32nd of the radius off
                round_by, along = part.half[0], part.half[1] if kind == CAPSULE else 0.0
                corners = np.zeros((1 + int(np.ceil(4 * along / round_by)), 3))
                corners[:, 2] = np.linspace(-along, along, len(corners))
            parts.append(RigidPart(kind, part.half, place, turn, radius, mesh))
            points.append(place + quat.rotate(turn, corners))
            radii.append(np.full(len(corners), round_by))
            ridges.append(ridges_of(part, rim_points).placed(place, turn))
        return SurfaceOfRigid(
            own.slot, tuple(parts), np.concatenate(points), np.concatenate(radii), Ridges.joined(ridges)
        )

    def _hull_mesh(self, part: Any) -> Any:
        faces = np.concatenate([np.stack([np.full(len(r) - 2, r[0]), r[1:-1], r[2:]], axis=1) for r in part.loops])
        device = str(self._world.device)
        mesh = wp.Mesh(
            points=wp.array(part.corners.astype(np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(faces.astype(np.int32).ravel(), dtype=int, device=device),
        )
        self._meshes.append(mesh)
        return mesh

    def _make_ties(self) -> Ties:
        worlds, device = self._world.world_count, str(self._world.device)
        corners, weights, slots, points, kinematic, compliance = [], [], [], [], [], []
        self._tie_counts: list[int] = []
        for grip in self._point_ties:
            spec: TieSpec | GripSpec = grip.spec
            own_corners, own_weights = corners_of(spec)
            k = own_corners.shape[1]
            self._tie_counts.append(k)
            first = self._first[grip.body]
            four = np.full((worlds, k, 4), -1, dtype=np.int32)
            share = np.zeros((worlds, k, 4))
            own = own_corners >= 0
            kinematic.append(np.full(k, isinstance(spec, GripSpec)))
            if isinstance(spec, GripSpec) or spec.places is not None:
                four[..., :3] = np.where(own, own_corners + first, -1)
                share[..., :3] = np.where(own, own_weights, 0.0)
            if isinstance(spec, GripSpec):
                slots.append(np.full((worlds, k), -1))
                points.append(np.zeros((worlds, k, 3)))
            elif spec.places is not None:
                other: Any = grip.target._dynamics  # type: ignore[union-attr]
                slots.append(np.full((worlds, k), other.slot))
                points.append(spec.places - other.centre)
            else:
                assert spec.other_corners is not None and spec.other_weights is not None
                four[..., :1] = np.where(own, own_corners + first, -1)[..., :1]
                share[..., 0] = 1.0
                four[..., 1:] = spec.other_corners + self._first[grip.target]  # type: ignore[index]
                share[..., 1:] = -spec.other_weights
                slots.append(np.full((worlds, k), -1))
                points.append(np.zeros((worlds, k, 3)))
            corners.append(four)
            weights.append(share)
            compliance.append(np.full(k, spec.compliance))
        ties = Ties()
        ties.count = sum(self._tie_counts)

        def put(values: list[np.ndarray], dtype: Any, columns: int = 0) -> wp.array:
            kind = np.int32 if dtype in (int, wp.vec4i) else np.float32
            empty = np.zeros((1, columns) if columns else 1)
            joined = np.concatenate(values, axis=min(1, values[0].ndim - 1)) if values else empty
            joined = joined.reshape(-1, columns) if columns else joined.ravel()
            return wp.array(np.ascontiguousarray(joined, dtype=kind), dtype=dtype, device=device)

        ties.corners, ties.weights = put(corners, wp.vec4i, 4), put(weights, wp.vec4, 4)
        ties.slot, ties.point, ties.compliance = put(slots, int), put(points, wp.vec3, 3), put(compliance, float)
        ties.kinematic = put(kinematic, int)
        ties.place = wp.zeros(max(1, 2 * worlds * ties.count), dtype=wp.vec3, device=device)
        owners = np.repeat([self.bodies.index(grip.body) for grip in self._point_ties], self._tie_counts)
        ties.body = wp.array(owners.astype(np.int32) if ties.count else np.zeros(1, np.int32), dtype=int, device=device)
        for name, kind in (("pull", wp.vec3), ("total", wp.vec3), ("unmet", int)):
            setattr(ties, name, wp.zeros(max(1, worlds * ties.count), dtype=kind, device=device))
        most = [
            np.repeat(_limits(grip, worlds)[:, None], n, axis=1)
            for grip, n in zip(self._point_ties, self._tie_counts, strict=True)
        ]
        ties.limit = put(most, float)
        return ties

    def _tie_points(self, grip: Grip) -> np.ndarray:
        """(worlds, k, 3), where the points of the body are now."""
        corners, weights = corners_of(grip.spec)
        worlds = self._world.world_count
        own = np.broadcast_to(grip.body._vertices(), (worlds, *grip.body._vertices().shape[-2:]))
        rows = np.arange(worlds)[:, None, None]
        weights = np.where(corners >= 0, weights, 0.0)
        return np.einsum("wkc,wkcx->wkx", weights, own[rows, np.maximum(corners, 0)])

    def _make_holds(self) -> Holds:
        worlds, device, count = self._world.world_count, str(self._world.device), len(self._frame_holds)
        holds = Holds()
        holds.count = count
        slots = [grip.body._dynamics.slot for grip in self._frame_holds]  # type: ignore[union-attr]
        leaders = [
            -1
            if grip.target is None or not isinstance(grip.target._dynamics, RigidDynamics)
            else grip.target._dynamics.slot
            for grip in self._frame_holds
        ]
        holds.slot = wp.array(np.array(slots or [0], np.int32), dtype=int, device=device)
        owners = [self.bodies.index(grip.body) for grip in self._frame_holds]
        holds.body = wp.array(np.array(owners or [0], np.int32), dtype=int, device=device)
        holds.leader = wp.array(np.array(leaders or [-1], np.int32), dtype=int, device=device)
        compliance = [grip.compliance for grip in self._frame_holds] or [0.0]
        holds.compliance = wp.array(np.array(compliance, np.float32), dtype=float, device=device)
        axes = [np.zeros(3) if grip.spec.free is None else grip.spec.free for grip in self._frame_holds]
        axes = axes or [np.zeros(3)]
        holds.free = wp.array(np.tile(np.array(axes, np.float32), (worlds, 1)), dtype=wp.vec3, device=device)
        room = max(1, worlds * count)
        holds.place = wp.zeros(2 * room, dtype=wp.vec3, device=device)
        holds.turn = wp.zeros(2 * room, dtype=wp.quat, device=device)
        for name in ("pull", "twist", "total", "total_twist"):
            setattr(holds, name, wp.zeros(room, dtype=wp.vec3, device=device))
        holds.unmet = wp.zeros(room, dtype=int, device=device)
        limits = [np.where(holding(grip.spec, worlds), _limits(grip, worlds), -1.0) for grip in self._frame_holds]
        most = np.stack(limits or [np.zeros(worlds)], axis=1)
        holds.limit = wp.array(most.astype(np.float32).ravel(), dtype=float, device=device)
        return holds


def _limits(grip: Grip, worlds: int) -> np.ndarray:
    """(worlds,) [N], what a tie or hold bears at most."""
    return np.broadcast_to(np.asarray(grip.spec.max_force, dtype=float), (worlds,))


def _surface_rules(body: Body, solver: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance (worlds,) [m] that others keep from a body's triangles, and its contact compliance [m/N]."""
    half = 0.5 * np.asarray(solver.scalars[:, THICKNESS])
    if body.is_solid:  # which gives by itself
        return np.maximum(half, SKIN), np.zeros_like(half)
    # as half the thickness of a cell's area does
    return half, half / (PRESSED * solver.cell_size**2)
