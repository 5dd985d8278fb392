"""Loads: what the bodies of a world do to a robot's links, by grips and by contact."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import ParticleDynamics, dynamics_of
from nuno.joints.held_points import held_points, holds_in
from nuno.materials import Cloth
from nuno.robot.ground import moment
from nuno.robot.static_boxes import StaticBoxes
from nuno.robot.world_reader import WorldReader, of_world

if TYPE_CHECKING:
    from nuno.joints.grip import Grip
    from nuno.robot.links import Links

NEAR = 4e-3
"""[m] Beside the thickness, how far from a shape's box a vertex counts as near: more than a substep's way."""


@dataclass(frozen=True, eq=False)
class Load:
    """The load of a body on a link.

    Attributes:
        link: Which of the links' bodies bears it.
        point: (3,) float [m], where in the world.
        force: (3,) float [N].
        torque: (3,) float [N m], about the point.
    """

    link: int
    point: np.ndarray
    force: np.ndarray
    torque: np.ndarray


@dataclass(frozen=True, eq=False)
class BodyLoads:
    """The loads of one body on links in a frame.

    Attributes:
        body: Its key.
        grips: Keys of the grips that held it.
        loads: All of them; what grips and contacts do may be in one.
        contacts: Those of its contacts, as far as they are known by themselves.
    """

    body: str
    grips: tuple[str, ...]
    loads: tuple[Load, ...]
    contacts: tuple[Load, ...]


@dataclass(frozen=True, eq=False)
class _Motion:
    """The motion of a body at a time [s].

    Attributes:
        time: [s].
        momentum: (6,) float [kg m/s], and its moment about the world's origin [kg m2/s].
        moment: (3,) float [kg m], mass times place.
        mass: [kg].
    """

    time: float
    momentum: np.ndarray
    moment: np.ndarray
    mass: float


class LinkLoads:
    """The loads on a robot's links, read once a frame.

    A grip tells what it bears. What a cloth or soft body does by contact is what is missing in the balance of its
    momentum over the last frame, as long as links of one group are all that it is near to; else the solver is asked for
    the force of each contact, which takes some milliseconds. Rigid bodies' contacts are always asked for.

    Args:
        links: The links.
        groups: Of each of the links' bodies; forces on a group are told as if on the one of its links that was touched
            and is nearest to the base. None are links that one joint carries.
        reader: What reads the world; of a batch, of whose worlds each has its loads, it is shared by them and renewed
            by whoever made it. None reads the links' own world.
        bodies: The links' copies in that batch.
        index: Which of its worlds.
    """

    def __init__(
        self, links: Links, groups: Sequence[Hashable] | None = None, *, reader: WorldReader | None = None,
        bodies: Sequence[Body] = (), index: int = 0,
    ) -> None:  # fmt: skip
        self._reader = WorldReader(links.world) if reader is None else reader
        self._world, self._k = self._reader.world, index
        self._groups: Sequence[Hashable] = links.joints if groups is None else groups
        self._index = {body: k for k, body in enumerate(bodies or links.bodies)}
        self._joints = links.joints
        self._read_at: tuple[float, tuple[str, ...]] | None = None
        self._version: int | None = None
        self._of_bodies: dict[Body, tuple[Load, ...]] = {}
        self._loads: tuple[Load, ...] = ()
        self._motions: dict[Body, _Motion] = {}
        self._noted: dict[Body, _Motion] = {}
        self._contacts: dict[Body, list[Load]] = {}
        self._boxes = StaticBoxes(self._world, index)
        self._static_groups: list[Hashable | None] = []

    def read(self) -> tuple[Load, ...]:
        """Return all loads, those of the last frame."""
        world = self._world
        with world.lock:
            self._follow()
            moving = self._moving()
            now = (world.time, tuple(grip.key for own in moving.values() for grip in self._grips_of(own)))
            if now != self._read_at:
                self._of_bodies = {body: tuple(self._of(body, dynamics)) for body, dynamics in moving.items()}
                self._loads = tuple(load for own in self._of_bodies.values() for load in own)
                self._reader.keep_only(list(moving))
                of_bodies: tuple[dict[Body, Any], ...] = (self._motions, self._contacts)
                for kept in of_bodies:
                    for body in [body for body in kept if body not in moving]:
                        del kept[body]
                self._read_at = now
        return self._loads

    def of_frame(self) -> list[BodyLoads]:
        """Return the loads of the frame that began with ``note`` by the body that does it.

        So they depend on nothing from before that frame.
        """
        with self._world.lock:
            noted = self._noted
            self.forget()
            self._follow()
            self._noted = noted
            self.read()
            return [
                BodyLoads(body.key, self._grip_keys(body), loads, tuple(self._contacts.get(body, ())))
                for body, loads in self._of_bodies.items() if loads
            ]  # fmt: skip

    def of_now(self, before: BodyLoads) -> tuple[Load, ...]:
        """Return the loads of a body in the last frame, less those of grips that have let go since."""
        found = [(body, dynamics) for body, dynamics in self._moving().items() if body.key == before.body]
        if not found:
            return ()
        body, dynamics = found[0]
        held = self._grip_keys(body)
        if all(key in held for key in before.grips):
            return before.loads
        particles = isinstance(dynamics, ParticleDynamics)
        x = self._reader.rows(body, dynamics.solver, self._k)[:3] if particles else self._reader.places(body, self._k)
        kept = [grip for grip in self._grips_of(dynamics) if grip.key in before.grips and grip.target in self._index]
        return (*(self._of_grip(grip, x) for grip in kept), *before.contacts)

    def _of_grip(self, grip: Grip, x: np.ndarray) -> Load:
        """Return what a grip bears of a body whose vertices are at x (3, n) [m]."""
        force, torque = self._reader.wrench(grip, self._k)
        assert grip.target is not None
        return Load(self._index[grip.target], held_points(grip, self._k, x.T).mean(axis=0), force, torque)

    def _grip_keys(self, body: Body) -> tuple[str, ...]:
        return tuple(grip.key for grip in self._grips_of(dynamics_of(body)))

    def note(self) -> None:
        """Take note of how bodies move now, for a reading in the next frame; what bears on links is not worked out."""
        with self._world.lock:
            self._follow()
            self._noted = {}
            for body, dynamics in self._moving().items():
                if isinstance(dynamics, ParticleDynamics) and self._has_momentum(dynamics):
                    self._noted[body] = self._motion_of(dynamics, self._reader.rows(body, dynamics.solver, self._k))

    def forget(self) -> None:
        """Forget what was, before the next reading: something is held otherwise in this world than before."""
        self._version = None

    def _follow(self) -> None:
        """Forget what was, where bodies may have been put elsewhere, or the world restored, since it was read."""
        version = self._world._collider_version
        if version != self._version:
            self._version, self._read_at = version, None
            self._motions, self._noted, self._contacts = {}, {}, {}

    def _moving(self) -> dict[Body, Any]:
        """Return all bodies with dynamics but the links, and their dynamics."""
        bodies = [body for body in self._world.bodies if body.is_dynamic and body not in self._index]
        return {body: dynamics_of(body) for body in bodies}

    def _grips_of(self, dynamics: Any) -> list[Grip]:
        """Return the grips that hold a body in this world."""
        return [grip for grip in dynamics.grips if holds_in(grip.spec, self._k)]

    def _has_momentum(self, dynamics: ParticleDynamics) -> bool:
        """Return True if a body's momentum tells what bears it: what it is tied to has some of it else."""
        return not any(grip.is_tie for grip in self._grips_of(dynamics))

    def _motion_of(self, dynamics: ParticleDynamics, rows: np.ndarray) -> _Motion:
        return _motion_of(rows, of_world(dynamics.solver.mass, self._k), self._world.time)

    def _of(self, body: Body, dynamics: Any) -> list[Load]:
        motion = before = None
        if isinstance(dynamics, ParticleDynamics):
            rows = self._reader.rows(body, dynamics.solver, self._k)
            x = rows[:3]
            if self._has_momentum(dynamics):
                motion = self._motion_of(dynamics, rows)
                before, self._motions[body] = self._motions.get(body), motion
                noted = self._noted.pop(body, None)
                if noted is not None and noted.time != motion.time:
                    before = noted
        else:
            x = self._reader.places(body, self._k)
        grips = self._grips_of(dynamics)
        held_by = [self._index.get(grip.target) for grip in grips if grip.target is not None]
        step = 0.0 if motion is None or before is None else motion.time - before.time
        known = 0.0 < step < 1.5 / self._world.frame_rate
        known = known and not any(body in coupled.bodies for coupled in self._world._stepping.last)
        holding = {None if k is None else self._groups[k] for k in held_by}
        all_held = len(held_by) == len(grips)
        near = self._near(body, dynamics, x, holding.pop() if known and all_held and len(holding) == 1 else None)
        supports = [self._index[other] for other in near if other in self._index]
        bearing = supports + [k for k in held_by if k is not None]
        if not bearing:
            self._contacts.pop(body, None)
            return []
        known = known and len(supports) == len(near)
        if known and motion is not None and before is not None:
            missing = _missing(dynamics, x, before, motion, np.array(self._world.gravity), self._k)
            if all_held and len({self._groups[k] for k in bearing}) == 1:
                # all that bears it is of one group: what it does there is all that is missing
                self._contacts[body] = []
                return [self._one(bearing, missing)]
        loads, borne = [], np.zeros(6)
        for grip in grips:
            link = None if grip.target is None else self._index.get(grip.target)
            if link is not None or known:
                own_force, own_torque = self._reader.wrench(grip, self._k)
                point = held_points(grip, self._k, x.T).mean(axis=0)
                borne[:3] += own_force
                borne[3:] += own_torque + moment(point, own_force)
                if link is not None:
                    loads.append(Load(link, point, own_force, own_torque))
        if known and len({self._groups[k] for k in supports}) <= 1:
            found = [self._one(supports, missing + borne)] if supports else []
        elif body in self._contacts and step == 0.0 and motion is not None:
            found = self._contacts[body]  # only a grip has changed since
        else:
            found = self._asked(body) if supports else []
        self._contacts[body] = found
        return loads + found

    def _one(self, links: list[int], missing: np.ndarray) -> Load:
        """All of a force and torque (6,) that a body lacks, on the one of some links that is nearest to the base."""
        return Load(min(links, key=self._joints.__getitem__), np.zeros(3), -missing[:3], -missing[3:])

    def _asked(self, body: Body) -> list[Load]:
        """Return what the solver says of the body's contacts with links."""
        names = {other.name: k for other, k in self._index.items()}
        found, nothing = self._reader.contacts(body, self._k), np.zeros(3)
        return [Load(names[name], point, -force, nothing) for point, force, name in found if name in names]

    def _near(self, body: Body, dynamics: Any, x: np.ndarray, holding: Hashable | None) -> list[Body]:
        """The static bodies whose boxes have a vertex of the body in them or near, of those that it touches.

        Where one group holds the body and no others come into question, those are not looked at closer: what the group
        bears is told as a whole.
        """
        boxes = self._boxes
        if boxes.follow():
            links = [self._index.get(other) for other in boxes.bodies]
            self._static_groups = [None if k is None else self._groups[k] for k in links]
        material = body.material
        thickness = of_world(material.thickness, self._k) if isinstance(material, Cloth) else body.thickness
        margin = 0.5 * thickness + NEAR
        low, high = x.min(axis=1), x.max(axis=1)
        close = boxes.close_to(low, high, margin)
        close = [k for k in close if self._world._rules.touch(body, boxes.bodies[k], self._k)]
        held = [k for k in close if holding is not None and self._static_groups[k] == holding]
        others = [k for k in close if k not in held]
        if not dynamics.is_rigid:  # a large face of those may touch where no corner is
            others = [k for k in others if boxes.hold_any(k, x, low, high, margin)]
        return [boxes.bodies[k] for k in (*held, *others)]


def _motion_of(rows: np.ndarray, mass: np.ndarray, time: float) -> _Motion:
    weighted = rows * mass
    sums = weighted.sum(axis=1)
    momentum = np.empty(6)
    momentum[:3], momentum[3:] = sums[3:], _moments(rows[:3], weighted[3:])
    return _Motion(time, momentum, sums[:3], float(mass.sum()))


def _moments(x: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the sum (3,) of x times forces, (3, n) each, coordinates by rows."""
    return (x[[1, 2, 0]] * forces[[2, 0, 1]] - x[[2, 0, 1]] * forces[[1, 2, 0]]).sum(axis=1)


def _missing(
    dynamics: ParticleDynamics, x: np.ndarray, before: _Motion, now: _Motion, gravity: np.ndarray, index: int = 0
) -> np.ndarray:
    """Return the force and torque (6,) that a body's motion took beside its weight, the air and pushes.

    The torque is about the world's origin, and both are means between two times, in one of the worlds of a batch.
    """
    missing = (now.momentum - before.momentum) / (now.time - before.time)
    drag: Any = dynamics.material
    missing += 0.5 * of_world(drag.air_drag, index) * (now.momentum + before.momentum)
    missing[:3] -= now.mass * gravity
    missing[3:] -= moment(0.5 * (now.moment + before.moment), gravity)
    for push in dynamics.pushing(before.time):
        force = of_world(push.force, index)
        missing[:3] -= force.sum(axis=0)
        missing[3:] -= _moments(x, force.T)
    return missing
