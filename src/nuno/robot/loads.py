"""Loads: what the bodies of a world do to a robot's links, by grips and by contact."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.body import Body
from nuno.dynamics import ParticleDynamics
from nuno.materials import Cloth
from nuno.robot.ground import moment

if TYPE_CHECKING:
    from nuno.grip import Grip
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
        x = body._vertices()
        x = x[0] if x.ndim == 3 else x
        motion = before = None
        if isinstance(dynamics, ParticleDynamics) and not any(grip.is_tie for grip in dynamics.grips):
            before, motion = self._motions.get(body), _motion_of(dynamics, x, self._world.time)
            self._motions[body] = motion
        near = self._near(body, x)
        held_by = [self._index.get(grip.target) for grip in dynamics.grips if grip.target is not None]
        touched = [self._index[other] for other in near if other in self._index]
        bearing = touched + [k for k in held_by if k is not None]
        if not bearing:
            self._contacts.pop(body, None)
            return []
        step = 0.0 if motion is None or before is None else motion.time - before.time
        known = 0.0 < step < 1.5 / self._world.frame_rate and len(touched) == len(near)
        known = known and not any(body in coupled.bodies for coupled in self._world._stepping.last)
        if known and motion is not None and before is not None:
            missing = _missing(dynamics, body, x, before, motion, np.array(self._world.gravity))
            if len({self._groups[k] for k in bearing}) == 1 and len(held_by) == len(dynamics.grips):
                self._contacts[
                    body
                ] = []  # all that bears it is of one group: what it does there is all that is missing
                return [self._one(bearing, missing)]
        loads, force, torque = [], np.zeros(3), np.zeros(3)
        for grip in dynamics.grips:
            link = None if grip.target is None else self._index.get(grip.target)
            if link is not None or known:
                own_force, own_torque = grip.wrench
                point = _held_point(grip, x)
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

    def _near(self, body: Body, x: np.ndarray) -> list[Body]:
        """The static bodies whose boxes have a vertex of the body in them or near, of those that it touches."""
        bodies, middles, halves, radii = self._boxes()
        if not bodies:
            return []
        margin = 0.5 * body.thickness + NEAR
        poses = [(b._position, b._quaternion) if b._parent is None else b._pose() for b in bodies]
        places = np.array([place for place, _ in poses])
        gap = np.maximum(np.maximum(x.min(axis=0) - places, places - x.max(axis=0)), 0.0)
        close = np.flatnonzero((gap * gap).sum(axis=1) < (radii + margin) ** 2)
        close = np.array([k for k in close.tolist() if self._world._rules.touch(body, bodies[k])], dtype=int)
        if len(close) and not (body._dynamics is not None and body._dynamics.is_rigid):
            # of a rigid body, a large face may touch where no corner is
            turns = _matrices(np.array([poses[k][1] for k in close.tolist()]))  # (k, 3, 3)
            centres = np.einsum("kj,kji->ki", places[close], turns) + middles[close]
            away = np.abs(x @ turns.transpose(1, 0, 2).reshape(3, -1) - centres.ravel()).reshape(len(x), -1, 3)
            beyond = away - (halves[close] + margin)
            close = close[np.maximum(np.maximum(beyond[..., 0], beyond[..., 1]), beyond[..., 2]).min(axis=0) <= 0.0]
        return [bodies[k] for k in close.tolist()]

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
        return self._static[1:]


def _box(body: Body) -> tuple[np.ndarray, np.ndarray]:
    if body.shape.kind == "plane":  # endless, and all below it
        return np.array([-1e3, -1e3, -1e3]), np.array([1e3, 1e3, 0.0])
    vertices = body.local_vertices().reshape(-1, 3)
    return vertices.min(axis=0), vertices.max(axis=0)


def _matrices(q: np.ndarray) -> np.ndarray:
    """Return rotation matrices (k, 3, 3) of quaternions (k, 4)."""
    twice = 2.0 * q[:, :, None] * q[:, None]  # of all pairs of (w, x, y, z)
    made = twice[:, 1:, 1:].copy()
    made[:, [0, 1, 2], [0, 1, 2]] += twice[:, 0, 0, None] - 1.0
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        made[:, a, b] -= twice[:, 0, 1 + c]
        made[:, b, a] += twice[:, 0, 1 + c]
    return made


def _held_point(grip: Grip, x: np.ndarray) -> np.ndarray:
    """Return the point (3,) [m] that a grip's torque is about."""
    spec: Any = grip._spec
    if hasattr(spec, "quaternions"):  # a rigid body as a whole
        return np.asarray(grip.body._pose()[0])
    if getattr(spec, "vertices", None) is not None:
        held = spec.vertices[0]
        return x[held[held >= 0]].mean(axis=0)
    corners, weights = spec.corners[0], spec.barycentric[0] if hasattr(spec, "barycentric") else spec.weights[0]
    used = corners[:, 0] >= 0
    return np.einsum("kc,kcx->kx", weights[used], x[np.maximum(corners[used], 0)]).mean(axis=0)


def _motion_of(dynamics: ParticleDynamics, x: np.ndarray, time: float) -> _Motion:
    mass = dynamics.solver.mass[0]
    momentum = mass[:, None] * dynamics.solver.velocities()[0]
    return _Motion(time, momentum.sum(axis=0), _moments(x, momentum), mass @ x)


def _moments(x: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the sum (3,) of x times forces, (n, 3) each."""
    c = x.T @ forces
    return np.array([c[1, 2] - c[2, 1], c[2, 0] - c[0, 2], c[0, 1] - c[1, 0]])


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
