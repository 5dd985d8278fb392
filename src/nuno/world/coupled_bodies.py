"""Bodies that touch or are tied, as the solver of their contacts takes them, and what it tells of their forces."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.bodies.dynamics import ParticleDynamics, touches_itself
from nuno.bodies.rigid_dynamics import RigidDynamics
from nuno.contact.particle.distances import BOX, CAPSULE, CYLINDER, SOLID_MESH, SPHERE
from nuno.coupled.tie_constraints import Holds, Ties
from nuno.joints.grip import Grip, GripSpec, warn_unmet
from nuno.joints.joint import Joint
from nuno.joints.tie import HoldSpec, TieSpec, corners_of
from nuno.rigid.convex import BOX_PART, CAPSULE_PART, CYLINDER_PART, HULL, SPHERE_PART
from nuno.rigid.ridges import Ridges, ridges_of
from nuno.shapes import quaternion as quat
from nuno.solvers.coupling import Coupling
from nuno.state.cloth_state import THICKNESS
from nuno.tables.coupled_surfaces import RigidPart, SurfaceOfParticles, SurfaceOfRigid, joined_particles, make_elements
from nuno.tables.joint_tables import CoupledJoints

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
UNMET_FRAMES = 6
"""Frames one after the other after which it is told that a grip or joint is not met: an impact is over by then."""
RIM_POINTS = 16
"""Corners that stand for the rim of a cylinder, at least: as many as leave the skin's thickness between it and them."""


class CoupledBodies:
    """A group of bodies, stepped together.

    Args:
        world: Whose they are.
        group: The bodies, in the world's order.
        ties: The grips that join them or hold rigid ones.

    Attributes:
        kept: Of each body, in which worlds (worlds,) bool the last frame is this group's.
    """

    def __init__(self, world: Simulation, group: list[Body], ties: tuple[Grip, ...]) -> None:
        self._world, self._ties = world, ties
        self.particles = [body for body in group if isinstance(body._dynamics, ParticleDynamics)]
        self.rigid = [body for body in group if isinstance(body._dynamics, RigidDynamics)]
        self.bodies = [*self.particles, *self.rigid]
        self.kept: dict[Body, np.ndarray] = {}
        self._dynamics: list[Any] = [body._dynamics for body in self.bodies]
        solvers = [body._dynamics.solver for body in self.particles]  # type: ignore[union-attr]
        scene = world._rigid
        self._first: dict[Body, int] = {}
        total = 0
        for body, solver in zip(self.particles, solvers, strict=True):
            self._first[body] = total
            total += solver.particle_count
        self._meshes: list[Any] = []
        surfaces = [
            SurfaceOfParticles(
                solver.particle_count,
                np.asarray(body.faces),
                *_surface_rules(body, solver),
                solid=body.is_solid,
                joined=joined_particles(solver.topology.tets) if touches_itself(world, body) else None,
            )
            for body, solver in zip(self.particles, solvers, strict=True)
        ]
        elements = make_elements(
            surfaces, [self._surface(body) for body in self.rigid], *self._rules(), str(world.device)
        )
        self._point_ties = [grip for grip in ties if isinstance(grip.spec, TieSpec | GripSpec)]
        self._frame_holds = [grip for grip in ties if isinstance(grip.spec, HoldSpec)]
        slots = [body._dynamics.slot for body in self.rigid]  # type: ignore[union-attr]
        rigid = scene.solver if scene is not None and slots else None
        self._capacity = 0 if rigid is None else int(rigid.state.capacity)
        self._joints = CoupledJoints(world, [grip for grip in ties if isinstance(grip, Joint)], self.bodies)
        self.coupling = Coupling(
            solvers,
            rigid,
            slots,
            elements,
            self._make_ties(),
            self._make_holds(),
            self._joints.table,
            self._joints.trees,
        )

    def is_current(self) -> bool:
        """Return whether the solvers still are those that the tables speak of."""
        same = all(body._dynamics is own for body, own in zip(self.bodies, self._dynamics, strict=True))
        rigid = self._world._rigid
        return same and (not self.rigid or (rigid is not None and rigid.solver.state.capacity == self._capacity))

    def run_frame(
        self, time: float, duration: float, substeps: tuple[int, int], island: dict[Body, np.ndarray],
        kept: dict[Body, np.ndarray],
    ) -> None:  # fmt: skip
        """Advance by ``duration`` [s], at most a frame.

        Args:
            time: The world's time [s].
            duration: [s].
            substeps: In how many substeps, and how many a whole frame has.
            island: Of each body in each world (worlds,), the first of those that it goes with, in the group's numbers.
            kept: See the attribute.
        """
        self.kept = kept
        self._lead_holds(time, duration)
        self._lead_ties(time, duration)
        self._joints.bring()
        if self.rigid and self._world._rigid is not None:
            self.coupling.kinematic = self._world._rigid.lead(self._world, time, duration)
        # the group's numbers are those of the world's order, the coupling's have rigid bodies last
        number = np.empty(len(self.bodies), dtype=int)
        number[[list(island).index(body) for body in self.bodies]] = np.arange(len(self.bodies))
        first = number[np.stack([island[body] for body in self.bodies])]
        self.coupling.run_frame(time, duration, substeps, first)
        self._warn_unmet(time + duration, substeps[0])

    def _warn_unmet(self, time: float, substeps: int) -> None:
        """Say once of each grip that it was not met in most substeps of some frames one after the other."""
        if not self._ties:
            return
        ties, holds, joints = self.coupling.unmet()
        starts = np.cumsum([0, *self._tie_counts])
        counts = [
            *(ties[:, a:b].max(axis=1, initial=0) for a, b in itertools.pairwise(starts)),
            *holds.T,
            *joints.T,
        ]
        grips = [*self._point_ties, *self._frame_holds, *self._joints.joints]
        for grip, unmet in zip(grips, counts, strict=True):
            unmet = np.where(self.kept[grip.body], unmet, 0)
            if grip.unmet_frames >= 0:
                grip.unmet_frames = grip.unmet_frames + 1 if 2 * unmet.max() > substeps else 0
                if grip.unmet_frames == UNMET_FRAMES:
                    grip.unmet_frames = -1
                    warn_unmet(grip, time)

    def wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray] | None:
        """Force [N] and torque [N m] (worlds, 3) of a tie or hold over the last frame; None if it is not of these."""
        if grip in self._point_ties:
            forces = self.coupling.tie_forces()  # (worlds, ties, 3), on the body's points
            before = sum(self._tie_counts[: self._point_ties.index(grip)])
            own = -forces[:, before : before + self._tie_counts[self._point_ties.index(grip)]]
            points = self._tie_points(grip)
            arms = points - points.mean(axis=1, keepdims=True)
            return own.sum(axis=1), np.cross(arms, own).sum(axis=1)
        if grip in self._frame_holds:
            force, torque = self.coupling.hold_wrenches()
            k = self._frame_holds.index(grip)
            held: Any = grip.body._dynamics
            # from the centre of mass to the origin of the body's frame
            arm = quat.rotate(held.solver.pose(held.slot)[1], np.broadcast_to(held.centre, force[:, k].shape))
            return -force[:, k], -torque[:, k] - np.cross(arm, force[:, k])
        if grip in self._joints.joints:
            force, torque, _ = self.coupling.joint_wrenches()
            k = self._joints.joints.index(grip)
            return -force[:, k], -torque[:, k]
        return None

    def effort(self, joint: Joint) -> np.ndarray | None:
        """(worlds,), what acted along a joint's free direction in the last frame; None if it is not of these."""
        if joint not in self._joints.joints:
            return None
        return self.coupling.joint_wrenches()[2][:, self._joints.joints.index(joint)]

    def contacts(self, body: Body, itself: bool = False) -> list[tuple[Any, ...]]:
        """Rows (point, normal, force, name of the other, world) of a body's contacts in the last substep.

        Those with ``itself`` are two rows each, one for either side.
        """
        if body not in self.bodies:
            return []
        own, found = self.bodies.index(body), []
        for world, pair, point, normal, force in self.coupling.contacts():
            if own in pair and pair[0] != pair[1] and self.kept[body][world]:
                sign = 1.0 if pair[0] == own else -1.0
                other = self.bodies[pair[1] if pair[0] == own else pair[0]]
                found.append((point, sign * normal, sign * force, other.name, world))
            elif itself and pair == (own, own) and self.kept[body][world]:
                found += [(point, sign * normal, sign * force, body.name, world) for sign in (1.0, -1.0)]
        return found

    def impulses(self, body: Body) -> dict[str, np.ndarray]:
        """Return what contacts with each of the others gave a body in the last frame, (worlds, 3) [N s], by name."""
        if body not in self.bodies:
            return {}
        given = np.where(self.kept[body][:, None, None], self.coupling.impulses()[:, self.bodies.index(body)], 0.0)
        return {other.name: given[:, k] for k, other in enumerate(self.bodies) if given[:, k].any()}

    def shape_contacts(self, body: Body) -> tuple[np.ndarray, list[tuple[int, int, int, np.ndarray, np.ndarray]]]:
        """Return what shapes did to the particles of a body that others pressed on: see `Coupling.shape_contacts`."""
        known, found = self.coupling.shape_contacts(self.particles.index(body))
        kept = self.kept[body]
        return known & kept[:, None], [row for row in found if kept[row[0]]]

    # -- tables

    def _rules(self) -> tuple[np.ndarray, np.ndarray]:
        rules, count, worlds = self._world._rules, len(self.bodies), self._world.world_count
        touch = np.zeros((count, count), dtype=bool)
        friction = np.zeros((worlds, count, count))
        for a, one in enumerate(self.bodies):
            for b, other in enumerate(self.bodies):
                if a == b:
                    touch[a, b] = touches_itself(self._world, one)
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

    def _lead_ties(self, time: float, duration: float) -> None:
        """Return where the points of grips with a limit are led when the frame begins and ends."""
        specs: list[Any] = [grip.spec for grip in self._point_ties]
        if any(isinstance(spec, GripSpec) for spec in specs):
            times, worlds = np.array([time, time + duration]), self._world.world_count
            nowhere = [np.zeros((worlds, count, 2, 3)) for count in self._tie_counts]
            places = [
                spec.at(times) if isinstance(spec, GripSpec) else none
                for spec, none in zip(specs, nowhere, strict=True)
            ]
            self.coupling.tie_places = np.concatenate(places, axis=1)

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
        most = np.stack([_limits(grip, worlds) for grip in self._frame_holds] or [np.zeros(worlds)], axis=1)
        holds.limit = wp.array(most.astype(np.float32).ravel(), dtype=float, device=device)
        return holds

    def _lead_holds(self, time: float, duration: float) -> None:
        """Return where the held bodies' centres of mass are to be when the frame begins and ends."""
        if not self._frame_holds:
            return
        worlds, holds = self._world.world_count, self.coupling.holds
        place = np.zeros((worlds, len(self._frame_holds), 2, 3))
        turn = np.zeros((worlds, len(self._frame_holds), 2, 4))
        for k, grip in enumerate(self._frame_holds):
            spec: HoldSpec = grip.spec
            own: Any = grip.body._dynamics
            if grip.offsets is not None and grip.target is not None:
                poses: Any = grip.lead(time, worlds)
            else:
                poses = spec.at(time), spec.at(time + duration)
            leads = int(holds.leader.numpy()[k]) >= 0
            for end, (p, q) in enumerate(poses):
                centre = quat.rotate(q, np.broadcast_to(own.centre, p.shape))
                place[:, k, end] = p + centre
                if leads:
                    place[:, k, end] -= grip.target._dynamics.centre  # type: ignore[union-attr]
                else:
                    place[:, k, end] -= own.solver.origin
                turn[:, k, end] = q
        device = str(self._world.device)
        holds.place.assign(wp.array(place.reshape(-1, 3).astype(np.float32), dtype=wp.vec3, device=device))
        turns = np.roll(turn.reshape(-1, 4), -1, axis=-1).astype(np.float32)
        holds.turn.assign(wp.array(turns, dtype=wp.quat, device=device))


def _limits(grip: Grip, worlds: int) -> np.ndarray:
    """(worlds,) [N], what a tie or hold bears at most."""
    return np.broadcast_to(np.asarray(grip.spec.max_force, dtype=float), (worlds,))


def _surface_rules(body: Body, solver: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance (worlds,) [m] that others keep from a body's triangles, and its contact compliance [m/N]."""
    half = 0.5 * np.asarray(solver._scalars[:, THICKNESS])
    if body.is_solid:  # which gives by itself
        return np.maximum(half, SKIN), np.zeros_like(half)
    # as half the thickness of a cell's area does
    return half, half / (PRESSED * solver._cell_size**2)
