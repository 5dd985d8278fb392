"""Loads: what the bodies of a world do to a robot's links, by grips and by contact."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno import quaternion as quat
from nuno.body import Body
from nuno.coordinates import Pose
from nuno.dynamics import ParticleDynamics
from nuno.held_points import held_points
from nuno.materials import Cloth
from nuno.robot.ground import moment

if TYPE_CHECKING:
    from nuno.robot.links import Links

NEAR = 4e-3
"""[m] Beside the thickness, how far from a shape's box a vertex counts as near: more than a substep's way."""


@dataclass(frozen=True, eq=False)
class Load:
    """What a body does to a link.

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
class _Motion:
    """A body's momentum (3,), its moment about the world's origin (3,), and mass times place (3,), at a time [s]."""

    time: float
    momentum: np.ndarray
    spin: np.ndarray
    moment: np.ndarray


class _TurnedBox:
    """A box in a frame, and the one around it along the world's axes.

    Args:
        pose: Of the frame.
        middle: (3,) float [m], of the box in the frame.
        half: (3,) float [m], half its sides.
    """

    def __init__(self, pose: Pose, middle: np.ndarray, half: np.ndarray) -> None:
        self.key = _key(pose)
        self._place, self._matrix, self._middle, self._half = pose[0], quat.to_matrix(pose[1]), middle, half
        centre, reach = pose[0] + self._matrix @ middle, np.abs(self._matrix) @ half
        self._low, self._high = centre - reach, centre + reach

    def overlaps(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Whether it may have points in common with the box between two corners (3,) [m]."""
        return bool((self._low <= high).all() and (self._high >= low).all())

    def has_any(self, x: np.ndarray, margin: float) -> bool:
        """Whether any of points (n, 3) [m] is in it or within a margin [m]."""
        away = np.abs((x - self._place) @ self._matrix - self._middle)
        return bool((away <= self._half + margin).all(axis=1).any())


def _key(pose: Pose) -> tuple[float, ...]:
    return (*pose[0].tolist(), *pose[1].tolist())


class LinkLoads:
    """The loads on a robot's links, read once a frame.

    A grip tells what it bears. What a cloth or soft body does by contact is what is missing in the balance of its
    momentum over the last frame, as long as links of one group are all that it is near to; else the solver is asked for
    the force of each contact, which takes some milliseconds. Rigid bodies' contacts are always asked for.

    Args:
        links: The links.
        groups: Of each of the links' bodies; forces on a group are told as if on the one of its links that was touched
            and is nearest to the base. None are links that one joint carries.
    """

    def __init__(self, links: Links, groups: Sequence[Hashable] | None = None) -> None:
        self._world = links.world
        self._groups: Sequence[Hashable] = links._joints.tolist() if groups is None else groups
        self._index = {body: k for k, body in enumerate(links.bodies)}
        self._joints = links._joints
        self._read_at: tuple[float, tuple[str, ...]] | None = None
        self._loads: tuple[Load, ...] = ()
        self._motions: dict[Body, _Motion] = {}
        self._contacts: dict[Body, list[Load]] = {}
        self._turned: dict[int, _TurnedBox] = {}  # by number among the static bodies
        self._static: tuple[int, list[Body], np.ndarray, np.ndarray, np.ndarray] | None = None

    def read(self) -> tuple[Load, ...]:
        """Return all loads, those of the last frame."""
        world = self._world
        with world.lock:
            moving: list[Any] = [body for body in world._bodies.values() if body._dynamics is not None]
            now = (world.time, tuple(grip.key for body in moving for grip in body._dynamics.grips))
            if now != self._read_at:
                self._loads = tuple(load for body in moving for load in self._of(body))
                for kept in (self._motions, self._contacts):
                    for body in [body for body in kept if body not in moving]:
                        del kept[body]  # type: ignore[attr-defined]
                self._read_at = now
        return self._loads

    def _of(self, body: Body) -> list[Load]:
        dynamics: Any = body._dynamics
        x = _places(body)
        motion = before = None
        if isinstance(dynamics, ParticleDynamics) and not any(grip.is_tie for grip in dynamics.grips):
            before, motion = self._motions.get(body), _motion_of(dynamics, x, self._world.time)
            self._motions[body] = motion
        held_by = [self._index.get(grip.target) for grip in dynamics.grips if grip.target is not None]
        step = 0.0 if motion is None or before is None else motion.time - before.time
        known = 0.0 < step < 1.5 / self._world.frame_rate
        known = known and not any(body in coupled.bodies for coupled in self._world._stepping.last)
        holding = {None if k is None else self._groups[k] for k in held_by}
        all_held = len(held_by) == len(dynamics.grips)
        near = self._near(body, x, holding.pop() if known and all_held and len(holding) == 1 else None)
        touched = [self._index[other] for other in near if other in self._index]
        bearing = touched + [k for k in held_by if k is not None]
        if not bearing:
            self._contacts.pop(body, None)
            return []
        known = known and len(touched) == len(near)
        if known and motion is not None and before is not None:
            missing = _missing(dynamics, body, x, before, motion, np.array(self._world.gravity))
            if all_held and len({self._groups[k] for k in bearing}) == 1:
                # all that bears it is of one group: what it does there is all that is missing
                self._contacts[body] = []
                return [self._one(bearing, missing)]
        loads, force, torque = [], np.zeros(3), np.zeros(3)
        for grip in dynamics.grips:
            link = None if grip.target is None else self._index.get(grip.target)
            if link is not None or known:
                own_force, own_torque = grip.wrench
                point = held_points(grip, 0, x).mean(axis=0)
                force, torque = force + own_force, torque + own_torque + moment(point, own_force)
                if link is not None:
                    loads.append(Load(link, point, own_force, own_torque))
        if known and len({self._groups[k] for k in touched}) <= 1:
            found = [self._one(touched, (missing[0] + force, missing[1] + torque))] if touched else []
        elif body in self._contacts and step == 0.0 and motion is not None:
            found = self._contacts[body]  # only a grip has changed since
        else:
            found = self._asked(body) if touched else []
        self._contacts[body] = found
        return loads + found

    def _one(self, links: list[int], missing: tuple[np.ndarray, np.ndarray]) -> Load:
        """All of a force and torque that a body lacks, on the one of some links that is nearest to the base."""
        return Load(min(links, key=lambda k: int(self._joints[k])), np.zeros(3), -missing[0], -missing[1])

    def _asked(self, body: Body) -> list[Load]:
        """What the solver says of the body's contacts with links."""
        names = {other.name: k for other, k in self._index.items()}
        found = self._world.contacts(body)
        nothing = np.zeros(3)
        return [
            Load(names[name], point, -force, nothing)
            for point, force, name in zip(found.points, found.forces, found.others, strict=True)
            if name in names
        ]

    def _near(self, body: Body, x: np.ndarray, holding: Hashable | None) -> list[Body]:
        """The static bodies whose boxes have a vertex of the body in them or near, of those that it touches.

        Where one group holds the body and no others come into question, those are not looked at closer: what the group
        bears is told as a whole.
        """
        bodies, _, _, radii = self._boxes()
        if not bodies:
            return []
        margin = 0.5 * body.thickness + NEAR
        poses = [(b._position, b._quaternion) if b._parent is None else b._pose() for b in bodies]
        places = np.array([place for place, _ in poses])
        low, high = x.min(axis=0), x.max(axis=0)
        gap = np.maximum(np.maximum(low - places, places - high), 0.0)
        close = np.flatnonzero((gap * gap).sum(axis=1) < (radii + margin) ** 2).tolist()
        close = [k for k in close if self._world._rules.touch(body, bodies[k])]
        held = [k for k in close if holding is not None and self._group_of(bodies[k]) == holding]
        others = [k for k in close if k not in held]
        if body._dynamics is None or not body._dynamics.is_rigid:  # a large face of those may touch where no corner is
            low, high = low - margin, high + margin
            others = [k for k in others if self._box_at(k, poses[k]).overlaps(low, high)]
            others = [k for k in others if self._turned[k].has_any(x, margin)]
        return [bodies[k] for k in (*held, *others)]

    def _box_at(self, k: int, pose: Pose) -> _TurnedBox:
        """Return the box of the k-th static body where that is now; it is kept while the body rests."""
        kept = self._turned.get(k)
        if kept is None or kept.key != _key(pose):
            _, middles, halves, _ = self._boxes()
            kept = self._turned[k] = _TurnedBox(pose, middles[k], halves[k])
        return kept

    def _group_of(self, body: Body) -> Hashable | None:
        k = self._index.get(body)
        return None if k is None else self._groups[k]

    def _boxes(self) -> tuple[list[Body], np.ndarray, np.ndarray, np.ndarray]:
        """All static bodies, middles and half sides (m, 3) of their boxes in their own frames, radii [m]."""
        version = self._world._collider_version
        if self._static is None or self._static[0] != version:
            bodies = [b for b in self._world._bodies.values() if b._dynamics is None and b.group]
            corners = np.array([_box(body) for body in bodies]).reshape(-1, 2, 3)
            halves = 0.5 * (corners[:, 1] - corners[:, 0])
            middles = corners[:, 0] + halves
            radii = np.linalg.norm(np.abs(middles) + halves, axis=1)
            self._static = (version, bodies, middles, halves, radii)
            self._turned.clear()
        return self._static[1:]


def _box(body: Body) -> tuple[np.ndarray, np.ndarray]:
    if body.shape.kind == "plane":  # endless, and all below it
        return np.array([-1e3, -1e3, -1e3]), np.array([1e3, 1e3, 0.0])
    vertices = body.local_vertices().reshape(-1, 3)
    return vertices.min(axis=0), vertices.max(axis=0)


def _places(body: Body) -> np.ndarray:
    """Return the vertices (n, 3) [m] of a dynamic body."""
    dynamics = body._dynamics
    if not isinstance(dynamics, ParticleDynamics):
        x = body._vertices()
        return x[0] if x.ndim == 3 else x
    arrays = dynamics.solver.arrays
    rows = np.array(
        [arrays[axis].numpy() for axis in "xyz"], dtype=float
    )  # one after the other: quickly made and summed
    rows += dynamics.solver.origin[0][:, None]
    return rows.T


def _motion_of(dynamics: ParticleDynamics, x: np.ndarray, time: float) -> _Motion:
    mass, arrays = dynamics.solver.mass[0], dynamics.solver.arrays
    # all sums at once: (x, y, z, 1) of each vertex times (momentum, mass)
    places, masses = np.ones((4, len(x))), np.empty((4, len(x)))
    places[:3] = x.T
    for row, name in zip(masses, ("vx", "vy", "vz"), strict=False):
        np.multiply(arrays[name].numpy(), mass, out=row)
    masses[3] = mass
    sums = places @ masses.T
    return _Motion(time, sums[3, :3], _moment_of(sums), sums[:3, 3])


def _moments(x: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the sum (3,) of x times forces, (n, 3) each."""
    return _moment_of(x.T @ forces)


def _moment_of(products: np.ndarray) -> np.ndarray:
    """Return the sum (3,) of x times f, of the sums of their components' products (3, 3) or more."""
    x, y, z = products.tolist()[:3]
    return np.array([y[2] - z[1], z[0] - x[2], x[1] - y[0]])


def _missing(
    dynamics: ParticleDynamics, body: Body, x: np.ndarray, before: _Motion, now: _Motion, gravity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the force (3,) and torque (3,) that a body's motion took beside its weight, the air and pushes.

    The torque is about the world's origin, and both are means between two times.
    """
    step = now.time - before.time
    drag = float(np.mean(dynamics.material.air_drag)) if isinstance(dynamics.material, Cloth) else 0.0
    mean = 0.5 * (now.momentum + before.momentum), 0.5 * (now.spin + before.spin)
    force = (now.momentum - before.momentum) / step + drag * mean[0] - dynamics.solver.mass[0].sum() * gravity
    torque = (now.spin - before.spin) / step + drag * mean[1] - moment(0.5 * (now.moment + before.moment), gravity)
    for push in dynamics.pushing(before.time):
        force, torque = force - push.force[0].sum(axis=0), torque - _moments(x, push.force[0])
    return force, torque
