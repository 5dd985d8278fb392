"""Grips: points of a body that follow a path or another body, or stay in place."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.tie import force_limit, make_hold, make_tie
from nuno.mesh.memory_limit import check_host_memory
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, apply, compose, invert
from nuno.shapes.path import Path
from nuno.shapes.surface import chosen_points
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation


log = logging.getLogger(__name__)

KEY_BYTES = 40
"""Of each coordinate of a key of a grip's path, while it is made: five doubles."""
SHORTEST = 1.0e-5
"""[m] That a grip leads points at once unsaid in any case: edges are longer."""


@dataclass(frozen=True, eq=False)
class GripSpec:
    """A grip as solvers take it. Either ``vertices`` is given, or ``corners`` and ``barycentric``.

    Attributes:
        vertices: (worlds, k) int32, -1 for no point in this world.
        corners: (worlds, k, 3) int32, the vertices of the point's face, -1 for no point in this world.
        barycentric: (worlds, k, 3) float64, the corners' weights.
        times: (m,) float64 [s] of the world's clock.
        positions: (worlds, k, m, 3) float64 [m], where each point is at each time.
        interpolation: "linear" or "minimum_jerk", between the times; before and after them the point is held.
        compliance: [m/N], 0 is stiff.
        max_force: (worlds,) float64 [N], the most that each point bears, or None: no limit. With one, the grip is
            solved beside the body's contacts, as a tie.
    """

    vertices: np.ndarray | None
    corners: np.ndarray | None
    barycentric: np.ndarray | None
    times: np.ndarray
    positions: np.ndarray
    interpolation: str
    compliance: float
    max_force: np.ndarray | None = None

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return where the points are to be at ``times`` (n,) [s]: (worlds, k, n, 3) float64 [m]."""
        worlds, k, m = self.positions.shape[:3]
        path = object.__new__(Path)  # its numbers were checked when the grip was made: this runs every tick
        keys = self.positions.reshape(worlds * k, m, 3)
        path.__dict__.update(times=self.times, positions=keys, quaternions=None, interpolation=self.interpolation)
        return path.at(times).reshape(worlds, k, len(times), 3)


class Grip:
    """A hold on a body's points or on a rigid body, made by ``World.grip``, or a weld of two bodies.

    Attributes:
        key: The same for the copies of the grip in imagined worlds and in files.
        body: The body that is held.
        target: The body that leads it or that it is tied to, or None.
    """

    noun: ClassVar[str] = "grip"

    def __init__(
        self,
        body: Body,
        spec: Any,
        target: Body | None = None,
        offsets: Any = None,
    ) -> None:
        self.key = uuid.uuid4().hex
        self.body, self.target = body, target
        # for solvers: what they are given, and where a leader took it; not for users, who read the properties
        self.spec: Any = spec
        # in a leading static body's frame: (worlds, k, 3) [m] of points, or place and turn of a rigid body
        self.offsets = offsets
        # of a rigid body with a static leader: when a frame began [s], and where it was led from and to in that frame;
        # not a number in worlds of a batch where it was not led yet
        self.followed: tuple[float, Pose, Pose] | None = None
        self._world: Simulation | None = None
        self.unmet_frames = 0  # in so many frames one after the other it was not met; -1: that was told

    def __repr__(self) -> str:
        return f"<grip on {self.body.name!r}, {'active' if self.active else 'released'}>"

    @property
    def active(self) -> bool:
        """Return True if the points are held."""
        return self._world is not None

    @property
    def compliance(self) -> float:
        """[m/N]; 0 is stiff."""
        return float(self.spec.compliance)

    @property
    def max_force(self) -> Any:
        """[N], the most that it bears, a number or (worlds,); of a rigid body's turns as much [N m].

        Infinite for points that follow a path, a place or a static body, unless a limit was asked for; each point
        bears it.
        """
        given = getattr(self.spec, "max_force", None)
        limit = np.atleast_1d(np.inf if given is None else given)
        return float(limit[0]) if len(limit) == 1 else limit.copy()

    @property
    def ignored(self) -> tuple[str, ...]:
        """Keys of the bodies that a held rigid body passes through while it is held."""
        return tuple(getattr(self.spec, "ignored", ()))

    @property
    def is_tie(self) -> bool:
        """Return True if it joins moving bodies, holds a rigid body or has a limit: it is then solved with contacts."""
        return not isinstance(self.spec, GripSpec) or self.spec.max_force is not None

    @property
    def wrench(self) -> tuple[np.ndarray, np.ndarray]:
        """The force [N] and the torque [N m] that the grip bears: what the body does to whatever holds it.

        (3,) each, in a batch (worlds, 3); the torque is about the mean of the held points, or the origin of the held
        rigid body. A held towel at rest gives its weight, downwards. Of a weld, what ``body`` does to the other. The
        mean over the last frame; zero before the first.

        Raises:
            BodyStateError: the grip was released.
        """
        world = self._world
        if world is None:
            raise BodyStateError(f"the grip on {self.body.name!r} was released and bears nothing")
        with world.lock:
            force, torque = world._wrench(self)
        return (force[0], torque[0]) if world.world_count == 1 else (force, torque)

    def release(self) -> None:
        """Let go. Nothing happens where the grip was released before, or the body detached or removed."""
        world = self._world
        if world is not None:
            with world.lock:
                world._check_between_frames("release")
                if self._world is not None:
                    world._drop_grip(self)

    def spec_for(self, time: float, frame: float) -> GripSpec:
        """Return the keys for a run from ``time`` on; a leading body's last move takes one ``frame`` [s]."""
        if self.target is None or self.offsets is None:
            return self.spec
        schedule = None if self._world is None else self._world._schedule
        last = self.spec.positions[:, :, -1]
        if schedule is not None and self.target.key in schedule.poses:
            way = apply(schedule.poses[self.target.key], self.offsets[:, None])
            way = np.broadcast_to(way, (len(self.offsets), len(schedule.times), *self.offsets.shape[1:]))
            way = np.moveaxis(way, 1, 2).copy()
            way[:, :, 0] = last
            # two frames of where it led before, which tell how what it holds accelerates
            kept = (self.spec.times < time - 0.1 * frame) & (self.spec.times > time - 2.1 * frame)
            keys = {
                "times": np.append(self.spec.times[kept], schedule.times),
                "positions": np.concatenate([self.spec.positions[:, :, kept], way], axis=2),
            }
            self.spec = GripSpec(**{**self.spec.__dict__, **keys})
            return self.spec
        now = np.broadcast_to(apply(self.target.pose(), self.offsets), self.offsets.shape)
        keys = {"times": np.array([time]), "positions": now[:, :, None].copy()}
        if not np.array_equal(last, now):
            keys = {"times": np.array([time, time + frame]), "positions": np.stack([last, now], axis=2)}
        # The keys become the grip's own, so that the next run starts from where this one led.
        self.spec = GripSpec(**{**self.spec.__dict__, **keys})
        return self.spec

    def lead(self, time: float, worlds: int) -> tuple[Pose, Pose]:
        """Return from where to where a static leader takes a held rigid body in the frame from ``time`` [s] on.

        It starts where the body was led last, also where the leader has jumped since.
        """
        assert self.target is not None and self._world is not None
        schedule, start = self._world._schedule, self.target.pose()
        end = start
        k = None if schedule is None else schedule.frame_at(time)
        if schedule is not None and k is not None and self.target.key in schedule.poses:
            start, end = schedule.in_frame(self.target.key, k)

        def held(leader: Pose) -> Pose:
            place, turn = compose(leader, self.offsets)
            return np.broadcast_to(place, (worlds, 3)), np.broadcast_to(turn, (worlds, 4))

        goal = held(end)
        if self.followed is None:
            before = held(start)
        else:
            # a frame that it goes through twice starts in the same place
            place, turn = self.followed[1] if self.followed[0] == time else self.followed[2]
            begins = np.isnan(place).any(axis=-1, keepdims=True)  # in worlds that were reset to before it led
            before = (place, turn)
            if begins.any():
                first = held(start)
                before = np.where(begins, first[0], place), np.where(begins, first[1], turn)
        self.followed = time, before, goal
        return before, goal


def warn_unmet(grip: Grip, time: float) -> None:
    """Warn that a grip cannot be met, at a time [s]: it bears its limit, or does not come to where it leads."""
    other = "" if grip.target is None else f" to {grip.target.name!r}"
    log.warning(
        "the %s of %r%s is not met at t = %.3f s: a contact, a grip or a joint holds against it, and it bears %s N at "
        "most (max_force). Lead it elsewhere, release what contradicts it, let the bodies' contact be ignored, or give "
        "a grip a compliance",
        grip.noun, grip.body.name, other, time, f"{np.max(grip.max_force):.4g}",
    )  # fmt: skip


def warn_shared(grip: Grip) -> None:
    """Warn where a new stiff grip holds vertices that another one holds stiffly: only one can lead them."""
    mine = _stiff_vertices(grip)
    if mine is None or grip.body._dynamics is None:
        return
    for other in grip.body._dynamics.grips:
        theirs = _stiff_vertices(other)
        if theirs is None:
            continue
        both = (mine[:, :, None] == theirs[:, None, :]) & (mine >= 0)[:, :, None]
        if both.any():
            log.warning(
                "vertices %s of %r are held by two stiff grips: one of them leads, and what the two bear is not what "
                "acts. Release the other grip, or give one a compliance",
                sorted({int(k) for k in mine[both.any(axis=2)]}), grip.body.name,
            )  # fmt: skip


def _tell_jump(body: Body, jump: float) -> None:
    """Warn where a stiff grip leads points farther at once [m] than edges are long in the first world."""
    if jump < SHORTEST:
        return
    vertices, faces = body.surface()
    corners = vertices.reshape(-1, *vertices.shape[-2:])[0][faces]
    edge = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).mean())
    if jump > edge:
        log.warning(
            "the grip on %r leads its points %.4g m at once, in its first substep, and edges are %.4g m long: that is "
            "a blow. Begin the path where the mean of the points is, or give the grip a compliance",
            body.name, jump, edge,
        )  # fmt: skip


def _stiff_vertices(grip: Grip) -> np.ndarray | None:
    spec = grip.spec
    return spec.vertices if isinstance(spec, GripSpec) and not grip.is_tie and spec.compliance == 0.0 else None


def make_grip(
    body: Body, where: Any, to: Any, compliance: float, target: Body | None, free: Any, world: Simulation,
    *, max_force: Any = None, ignored: Sequence[Body] | None = None,
) -> Grip:  # fmt: skip
    """Return a grip on ``body``, not yet active; see ``World.grip``.

    Raises:
        InvalidInputError: points or a target that cannot be used.
    """
    worlds = world.world_count
    assert body._dynamics is not None
    if ignored is not None and not body._dynamics.is_rigid:
        raise InvalidInputError(f"ignore is for rigid bodies only; {body.name!r} touches what holds its points")
    if body._dynamics.is_rigid:
        if where is not None:
            raise InvalidInputError(f"{body.name!r} is rigid and is gripped as a whole: where must be None")
        hold, local_pose = make_hold(body, to, target, free, compliance, world)
        passed = ([] if target is None else [target]) if ignored is None else ignored
        passed_by = tuple(other.key for other in passed if other is not body)
        limit = force_limit(max_force, worlds, body, target)
        return Grip(body, replace(hold, max_force=limit, ignored=passed_by), target, local_pose)
    if free is not None:
        raise InvalidInputError("free is for rigid bodies only")
    if where is None:
        raise InvalidInputError(f"where must say which points of {body.name!r} to grip")
    if target is not None and target._dynamics is not None:
        tie = make_tie(body, where, target, compliance, world)
        return Grip(body, replace(tie, max_force=force_limit(max_force, worlds, body, target)), target)
    limits = None if max_force is None else force_limit(max_force, worlds)
    vertices, corners, weights = chosen_points(where, len(body.shape.mesh()[0]), body.faces, worlds)
    if vertices is not None:
        held, valid = body._dynamics.vertices(body, vertices), vertices >= 0
    else:
        assert corners is not None and weights is not None
        places = body._dynamics.vertices(body, corners.reshape(worlds, -1)).reshape(*corners.shape, 3)
        held = np.einsum("wkc,wkcx->wkx", weights, places)
        valid = corners[..., 0] >= 0
    number = np.maximum(valid.sum(axis=1), 1)[:, None]
    mean = np.where(valid[..., None], held, 0.0).sum(axis=1) / number
    offsets = np.where(valid[..., None], held - mean[:, None], 0.0)

    interpolation, local, jump = "linear", None, np.zeros(3)
    if target is not None:
        local = np.broadcast_to(apply(invert(target.pose()), held), held.shape).copy()
        times, keys = np.array([world.time]), held[:, :, None]
    elif isinstance(to, Path):
        if to.world_count not in (None, worlds):
            raise InvalidInputError(f"the path is for {to.world_count} worlds, but there are {worlds}")
        times, keys, interpolation = _along(to, offsets, world)
        jump = to.at(world.time) - mean
    else:
        goal = finite_array("to, where it is no Path or Body,", to, (3,), (worlds, 3))
        times = np.array([world.time])
        keys = (np.broadcast_to(goal, (worlds, 3))[:, None] + offsets)[:, :, None]
        jump = goal - mean
    if compliance == 0.0 and limits is None:
        jumps = np.linalg.norm(np.where(valid.any(axis=1, keepdims=True), jump, 0.0), axis=-1)
        _tell_jump(body, float(jumps.max()))
    spec = GripSpec(vertices, corners, weights, times, np.array(keys), interpolation, compliance, limits)
    return Grip(body, spec, target, local)


def _along(path: Path, offsets: np.ndarray, world: Simulation) -> tuple[np.ndarray, np.ndarray, str]:
    """Return times, keys (worlds, k, m, 3) and interpolation of points that keep their offsets on a path."""
    times, interpolation = path.times, str(path.interpolation)
    if path.quaternions is None:
        centres = path.positions
        around = offsets[:, :, None]
    else:
        # Straight lines between turned keys would cut the arc of the offsets: a key a frame follows it.
        frames = (times[-1] - times[0]) * world.frame_rate
        check_host_memory(
            f"a grip along a path that turns for {times[-1] - times[0]:g} s", int(KEY_BYTES * frames * offsets.size),
            "a key a frame is made of it: grip with shorter paths, one after the other",
        )  # fmt: skip
        steps = np.arange(times[0], times[-1], 1.0 / world.frame_rate)
        times, interpolation = np.union1d(times, steps), "linear"
        centres = path.at(times)
        start = path.quaternion_at(world.time)
        turn = quat.multiply(path.quaternion_at(times), quat.inverse(start)[..., None, :])
        turn = np.broadcast_to(turn, (len(offsets), len(times), 4))
        around = quat.rotate(turn[:, None], offsets[:, :, None])
    centres = np.broadcast_to(centres, (len(offsets), len(times), 3))
    return times, centres[:, None] + around, interpolation
