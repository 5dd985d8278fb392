"""Grips: points of a body that follow a path or another body, or stay in place."""

from __future__ import annotations

import uuid
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from nuno.bodies.body_protocols import WorldSettings
from nuno.errors import BodyStateError
from nuno.shapes.coordinates import Pose, apply, compose
from nuno.shapes.path import Path

if TYPE_CHECKING:
    from nuno.bodies.body import Body


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
        # when it was restored [s], and what it bore in the frame before, (worlds, 6) [N, N m]
        self.borne: tuple[float, np.ndarray] | None = None
        self._world: GripWorld | None = None
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
        mean over the last frame, also of one before ``save``, ``imagine`` or ``adopt``; zero before the first.

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
        self.release_in(None)

    def release_in(self, worlds: np.ndarray | None) -> None:
        """Let go in all worlds, or in some of a batch (worlds,) bool; in the others nothing changes, to the bit.

        Raises:
            BodyStateError: a joint, in some worlds.
        """
        world = self._world
        if world is not None:
            with world.lock:
                world._check_between_frames("release")
                if self._world is not None:
                    world._drop_grip(self, worlds)

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


class LeaderSchedule(Protocol):
    """The places of static leaders in a run: `nuno.tables.kinematic_motion.Schedule` as grips see it."""

    @property
    def times(self) -> np.ndarray:
        """(k,) float [s]: the run's start, and the middle and the end of each frame."""

    @property
    def poses(self) -> dict[str, Pose]:
        """By body key, where each is at those times."""

    def frame_at(self, time: float) -> int | None:
        """Return which of ``times`` is the start of the frame at ``time`` [s]."""

    def in_frame(self, key: str, k: int) -> tuple[Pose, Pose]:
        """Return where a body is at the start and at the end of a frame."""


class GripEngine(Protocol):
    """An engine as grips and joints see it; `nuno.engines.engine.Engine` says what each member is."""

    def allow_grip(self, spec: Any, on_moving: bool) -> None:
        """Refuse what the engine lacks."""

    def drives_changed(self, joint: Grip) -> None:
        """Be told that a joint's drives are others now."""

    def velocity_at(self, body: Body | None, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity [m/s] of a body's point, and its spin [rad/s], (worlds, 3) each."""

    def effort(self, joint: Grip) -> np.ndarray:
        """Return (worlds,), what a joint's drives do."""


class GripWorld(WorldSettings, Protocol):
    """A world as its grips and joints see it; the members are those of `nuno.world.simulation.Simulation`."""

    @property
    def lock(self) -> AbstractContextManager[Any]:
        """The lock that is held while the world is read."""

    @property
    def engine(self) -> GripEngine:
        """The engine that moves what is dynamic."""

    @property
    def _schedule(self) -> LeaderSchedule | None:
        """The schedule of kinematic bodies in the present run."""

    def _change(self, what: str) -> AbstractContextManager[None]:
        """Hold the lock for a call that changes the world."""

    def _check_between_frames(self, what: str) -> None:
        """Refuse a change in the midst of a run."""

    def _wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and torque [N m], (worlds, 3) each, that an active grip bears."""

    def _drop_grip(self, grip: Grip, worlds: np.ndarray | None) -> None:
        """Let a grip go, in all worlds or in some (worlds,) bool."""
