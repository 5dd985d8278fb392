"""Bodies that touch or are tied, as the solver of their contacts takes them, and what it tells of their forces."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.joints.grip import Grip, GripSpec
from nuno.joints.joint import Joint
from nuno.joints.make_grip import warn_unmet
from nuno.joints.tie import HoldSpec
from nuno.shapes import quaternion as quat
from nuno.solvers.coupling import Coupling
from nuno.tables.joint_tables import CoupledJoints
from nuno.world.coupled_tables import CoupledTables

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

UNMET_FRAMES = 6
"""Frames one after the other after which it is told that a grip or joint is not met: an impact is over by then."""


class CoupledBodies(CoupledTables):
    """A group of bodies, stepped together.

    Args:
        world: Whose they are.
        group: The bodies, in the world's order.
        ties: The grips that join them or hold rigid ones.

    Attributes:
        kept: Of each body, in which worlds (worlds,) bool the last frame is this group's.
    """

    def __init__(self, world: Simulation, group: list[Body], ties: tuple[Grip, ...]) -> None:
        super().__init__(world, group, ties)
        self.kept: dict[Body, np.ndarray] = {}
        self._dynamics: list[Any] = [body._dynamics for body in self.bodies]
        self._held = [grip.spec for grip in self._frame_holds]
        solvers = [body._dynamics.solver for body in self.particles]  # type: ignore[union-attr]
        scene = world._rigid
        elements = self._make_surfaces()
        slots = [body._dynamics.slot for body in self.rigid]  # type: ignore[union-attr]
        rigid = scene.solver if scene is not None and slots else None
        self._capacity = 0 if rigid is None else int(rigid.state.capacity)
        self._joints = CoupledJoints(
            [grip for grip in ties if isinstance(grip, Joint)], self.bodies, world.world_count, world.device,
            world._rigid,
        )  # fmt: skip
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
        """Return True if solvers and holds still are those that the tables speak of."""
        same = all(body._dynamics is own for body, own in zip(self.bodies, self._dynamics, strict=True))
        same = same and all(grip.spec is own for grip, own in zip(self._frame_holds, self._held, strict=True))
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

    def joint_loads(self) -> tuple[dict[Grip, int], np.ndarray, np.ndarray]:
        """Return where joints are in what follows: wrenches (worlds, joints, 6), and efforts (worlds, joints)."""
        force, torque, axial = self.coupling.joint_wrenches()
        return {joint: k for k, joint in enumerate(self._joints.joints)}, -np.concatenate([force, torque], -1), axial

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

    def impulses(self, bodies: Sequence[Body]) -> dict[int, dict[str, np.ndarray]]:
        """Return what contacts with each of the others gave bodies in the last frame, (worlds, 3) [N s], by name.

        By the bodies' places among those; bodies that are not coupled are left out.
        """
        own = {body: k for k, body in enumerate(bodies)}
        rows = [k for k, body in enumerate(self.bodies) if body in own]
        if not rows:
            return {}
        found = {}
        for row, given in self.coupling.impulses(rows).items():
            body = self.bodies[row]
            kept = {k: np.where(self.kept[body][:, None], impulse, 0.0) for k, impulse in given.items()}
            found[own[body]] = {self.bodies[k].name: impulse for k, impulse in kept.items() if impulse.any()}
        return found

    def shape_contacts(self, body: Body) -> tuple[np.ndarray, list[tuple[int, int, int, np.ndarray, np.ndarray]]]:
        """Return what shapes did to the particles of a body that others pressed on: see `Coupling.shape_contacts`."""
        known, found = self.coupling.shape_contacts(self.particles.index(body))
        kept = self.kept[body]
        return known & kept[:, None], [row for row in found if kept[row[0]]]

    # -- what leads them in a frame

    def _lead_ties(self, time: float, duration: float) -> None:
        """Tell where the points of grips with a limit are to be when the frame begins and ends."""
        specs: list[Any] = [grip.spec for grip in self._point_ties]
        if any(isinstance(spec, GripSpec) for spec in specs):
            times, worlds = np.array([time, time + duration]), self._world.world_count
            nowhere = [np.zeros((worlds, count, 2, 3)) for count in self._tie_counts]
            places = [
                spec.at(times) if isinstance(spec, GripSpec) else none
                for spec, none in zip(specs, nowhere, strict=True)
            ]
            self.coupling.tie_places = np.concatenate(places, axis=1)

    def _lead_holds(self, time: float, duration: float) -> None:
        """Tell where the held bodies' centres of mass are to be when the frame begins and ends."""
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
