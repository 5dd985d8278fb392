"""Snapshots: everything that a world is at one instant, copied out of it.

Save, restore, imagine and adopt are the same three steps: ``capture`` a world, spread or pick its worlds, and
``apply`` the result to the same world or another.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.dynamics import Dynamics, Push, State
from nuno.bodies.make_dynamics import make_dynamics
from nuno.errors import InvalidInputError
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.joint import Joint, JointSpec
from nuno.joints.tie import HoldSpec, TieSpec, batched_spec
from nuno.materials import Material
from nuno.shapes.coordinates import Pose, compose, invert
from nuno.shapes.path import Path
from nuno.shapes.shape import Shape
from nuno.tables.kinematic_motion import GroupPath, of_world
from nuno.validation import checked, number
from nuno.world.rigid_layout import RigidLayout, bring_static, layout_of, scene_for, settle

if TYPE_CHECKING:
    from nuno.world.simulation import Simulation


@dataclass(frozen=True, eq=False)
class DynamicsRecord:
    """The dynamics of one body; the arrays of the solver's state are (worlds, ...) each."""

    material: Material
    friction: Any
    state: State
    pushes: tuple[Push, ...]


@dataclass(frozen=True, eq=False)
class BodyRecord:
    """One body. The pose is relative to the parent where that is a body of the world, else to the world."""

    key: str
    name: str
    shape: Shape
    color: Any
    friction: Any
    thickness: Any
    group: int
    collides_with: int
    position: np.ndarray
    quaternion: np.ndarray
    parent: str | None
    deformed: np.ndarray | None  # (worlds, n, 3) [m], with the pose that they belong to
    deformed_position: np.ndarray | None
    deformed_quaternion: np.ndarray | None
    dynamics: DynamicsRecord | None
    path: Path | None = None  # that the body follows
    # relative to a frame that is no body of the world, which the body follows
    relative: Pose | None = field(default=None, metadata={"file": False})

    @property
    def deformation(self) -> tuple[np.ndarray, Pose] | None:
        """Return a deformed body's vertices, and the pose that they belong to; None where it is not deformed."""
        if self.deformed is None:
            return None
        assert self.deformed_position is not None and self.deformed_quaternion is not None
        return self.deformed, (self.deformed_position, self.deformed_quaternion)


@dataclass(frozen=True, eq=False)
class GripRecord:
    """One active grip, on the body with the key ``body``, led by the one with the key ``target``, if any."""

    key: str
    body: str
    spec: GripSpec | TieSpec | HoldSpec | JointSpec
    target: str | None
    offsets: Any  # of points an array, of a rigid body a place and a turn, or None
    followed: tuple[float, Pose, Pose] | None = None  # see ``Grip``


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything that a world is at one instant; made by ``World.save``, taken by ``World.restore``."""

    time: float
    gravity: tuple[float, float, float]
    frame_rate: float
    substeps: int | None
    world_count: int
    family: str  # worlds that were imagined from each other share it
    bodies: tuple[BodyRecord, ...]
    grips: tuple[GripRecord, ...]
    pair_friction: tuple[tuple[str, str, Any], ...]
    ignored: tuple[tuple[str, str], ...]
    rigid: RigidLayout | None = None
    summed: tuple[str, ...] = ()
    clock_shift: np.ndarray | None = None  # (worlds,) [s], what each world's own clock is behind ``time``
    from_file: bool = field(default=False)
    drivers: tuple[tuple[Any, Any], ...] = field(default=(), metadata={"file": False})  # and what each saved

    def __repr__(self) -> str:
        batch = f", {self.world_count} worlds" if self.world_count > 1 else ""
        dynamic = sum(body.dynamics is not None for body in self.bodies)
        return f"<Snapshot at t = {self.time:.3f} s, {len(self.bodies)} bodies, {dynamic} of them dynamic{batch}>"

    @checked
    def spread(self, world_count: int) -> Snapshot:
        """Return a batch of equal copies of this one world."""

        def repeated(array: Any) -> Any:
            return None if array is None else np.repeat(array, world_count, axis=0)

        return self._mapped(repeated, lambda value, _: value, lambda material: material, lambda path: path, world_count)

    @checked
    def pick(self, world: int) -> Snapshot:
        """Return one world of a batch."""
        if self.world_count == 1:
            return self

        def one(array: Any) -> Any:
            return None if array is None else array[world : world + 1]

        def chosen(value: Any, axes: int) -> Any:
            return value[world] if value is not None and np.ndim(value) > axes else value

        def of_one(path: Path | None) -> Path | None:
            return None if path is None else of_world(path, world)

        return self._mapped(one, chosen, lambda material: material.of_world(world, self.world_count), of_one, 1)

    def _mapped(self, batched: Any, single: Any, material: Any, path: Any, world_count: int) -> Snapshot:
        """Map arrays that have a world axis, values that may (beside ``axes`` others), materials and paths."""
        bodies = []
        for body in self.bodies:
            dynamics = body.dynamics
            if dynamics is not None:
                dynamics = DynamicsRecord(
                    material(dynamics.material), _plain(single(dynamics.friction, 0)),
                    {name: batched(array) for name, array in dynamics.state.items()},
                    tuple(Push(batched(p.force), p.end) for p in dynamics.pushes),
                )  # fmt: skip
            bodies.append(replace(
                body, friction=_plain(single(body.friction, 0)), thickness=_plain(single(body.thickness, 0)),
                position=single(body.position, 1), quaternion=single(body.quaternion, 1),
                deformed=batched(body.deformed), deformed_position=single(body.deformed_position, 1),
                deformed_quaternion=single(body.deformed_quaternion, 1), dynamics=dynamics, path=path(body.path),
                relative=None if body.relative is None else tuple(single(part, 1) for part in body.relative),
            ))  # fmt: skip
        grips = [
            replace(
                grip,
                offsets=tuple(map(batched, grip.offsets)) if isinstance(grip.offsets, tuple) else batched(grip.offsets),
                spec=batched_spec(grip.spec, batched),
                followed=_mapped_lead(grip.followed, batched),
            )
            for grip in self.grips
        ]
        friction = tuple((a, b, _plain(single(mu, 0))) for a, b, mu in self.pair_friction)
        rigid = self.rigid
        if rigid is not None:
            listing = {name: batched(array) for name, array in rigid.listing.items()}
            rigid = replace(rigid, origin=batched(rigid.origin), listing=listing)
        return replace(
            self, bodies=tuple(bodies), grips=tuple(grips), pair_friction=friction, world_count=world_count,
            rigid=rigid, drivers=(), clock_shift=batched(self.clock_shift),
        )  # fmt: skip  # a driver moves the one world that it is in

    def at(self, time: float) -> Snapshot:
        """Return the same at another reading of the world's clock: paths and the ends of pushes go along with it.

        Args:
            time: What ``World.time`` is then [s].

        Raises:
            InvalidInputError: a time that is not finite.
        """
        later = number("time", time) - self.time
        if later == 0.0:
            return self
        bodies = [
            replace(
                body,
                path=None if body.path is None else Path(
                    body.path.times + later, body.path.positions, body.path.quaternions, body.path.interpolation
                ),
                dynamics=body.dynamics and replace(
                    body.dynamics,
                    pushes=tuple(Push(p.force, None if p.end is None else p.end + later) for p in body.dynamics.pushes),
                ),
            )
            for body in self.bodies
        ]  # fmt: skip
        grips = [
            replace(
                grip,
                spec=_later(grip.spec, later),
                followed=grip.followed and (grip.followed[0] + later, *grip.followed[1:]),
            )
            for grip in self.grips
        ]
        shift = np.zeros(self.world_count) if self.clock_shift is None else self.clock_shift
        return replace(
            self, time=self.time + later, bodies=tuple(bodies), grips=tuple(grips), clock_shift=shift + later
        )


def capture(world: Simulation) -> Snapshot:
    """Return everything that ``world`` is; arrays are copies or never written to."""
    rules = world._rules
    ignored = sorted((min(pair), max(pair)) for pair in rules.ignored)
    pairs = [(min(pair), max(pair), mu) for pair, mu in rules.friction.items()]
    return Snapshot(
        time=world.time, gravity=world.gravity, frame_rate=world.frame_rate, substeps=world.substeps,
        world_count=world.world_count, family=world._family,
        bodies=tuple(_body_record(body, world) for body in world._bodies.values()),
        grips=tuple(_grip_record(grip) for dynamics in world._attached() for grip in dynamics.grips),
        pair_friction=tuple(sorted(pairs, key=lambda pair: pair[:2])),
        ignored=tuple(ignored), rigid=layout_of(world), summed=tuple(sorted(rules.summed)),
        drivers=tuple((driver, driver.save()) for driver in world.drivers), clock_shift=world._clock_shift,
    )  # fmt: skip


def apply(snapshot: Snapshot, world: Simulation) -> None:
    """Make ``world`` what the snapshot is. Body and Grip objects that it still knows keep their identity.

    Solvers are made before anything changes, so that a failure leaves the world as it was.
    """
    bodies = {record.key: _known_body(record, snapshot, world) for record in snapshot.bodies}
    before = (world.gravity, world.frame_rate, world.substeps, world.world_count)
    same_settings = before[:3] == (snapshot.gravity, snapshot.frame_rate, snapshot.substeps)
    world.gravity, world.frame_rate, world.substeps = snapshot.gravity, snapshot.frame_rate, snapshot.substeps
    world.world_count = snapshot.world_count
    scene = world._rigid
    try:
        world._rigid = scene_for(snapshot, bodies, world)
        made = {
            record.key: _dynamics_for(record, record.dynamics, bodies[record.key], world, same_settings)
            for record in snapshot.bodies if record.dynamics is not None
        }  # fmt: skip
    except BaseException:
        world.gravity, world.frame_rate, world.substeps, world.world_count = before
        world._rigid = scene
        raise
    _take_apart(world, list(made.values()))
    world._time, world._clock_shift = snapshot.time, snapshot.clock_shift
    world._stepping.last = []  # what contacts and ties gave in the last frame was in another past
    for record in snapshot.bodies:
        _fill(bodies[record.key], record)
        world._register(bodies[record.key])
    for record in snapshot.bodies:
        body = bodies[record.key]
        if record.parent is not None:
            body._parent = bodies[record.parent]
            body._parent._children.append(body)
        if record.dynamics is not None:
            body._dynamics = made[record.key]
            body._dynamics.pushes = list(record.dynamics.pushes)
    bring_static(snapshot.rigid, bodies, world)
    for record in snapshot.bodies:
        if record.dynamics is not None:
            made[record.key].load_state(record.dynamics.state)
    for grip in snapshot.grips:
        _restore_grip(grip, bodies, world)
    world._rules.friction = {frozenset((a, b)): mu for a, b, mu in snapshot.pair_friction}
    world._rules.ignored = {frozenset(pair) for pair in snapshot.ignored}
    world._rules.summed = set(snapshot.summed)
    if snapshot.from_file:
        _rename_keys(world, bodies)
    world._colliders_changed()
    settle(snapshot.rigid, world)
    for driver, state in snapshot.drivers:
        if driver in world.drivers:
            driver.load(state)


def _body_record(body: Body, world: Simulation) -> BodyRecord:
    dynamics = None
    if body._dynamics is not None:
        own = body._dynamics
        dynamics = DynamicsRecord(own.material, own.friction, own.state(), tuple(own.pushes))
    parent = body._parent if isinstance(body._parent, Body) and body._parent._world is world else None
    pose = (body._position, body._quaternion) if parent or body._dynamics else body.pose()
    deformed, base = body._deformed if body._deformed is not None else (None, (None, None))
    return BodyRecord(
        key=body.key, name=body.name, shape=body.shape, color=body.color, friction=body.friction,
        thickness=body.thickness, group=body.group, collides_with=body.collides_with, position=pose[0],
        quaternion=pose[1], parent=None if parent is None else parent.key, deformed=deformed,
        deformed_position=base[0], deformed_quaternion=base[1], dynamics=dynamics,
        path=body._path.as_it_is() if isinstance(body._path, GroupPath) else body._path,
        relative=None if body._parent is None or parent else body.relative_pose,
    )  # fmt: skip


def _grip_record(grip: Grip) -> GripRecord:
    target = None if grip.target is None else grip.target.key
    return GripRecord(grip.key, grip.body.key, grip.spec, target, grip.offsets, grip.followed)


def _known_body(record: BodyRecord, snapshot: Snapshot, world: Simulation) -> Body:
    known = world._known_bodies.get(record.key)
    if known is not None and known._world in (None, world):
        return known
    if snapshot.from_file:
        # A file of another process: the body that the program has made anew under the same name.
        twin = next((b for b in world._bodies.values() if b.name == record.name), None)
        if (
            twin is not None
            and twin.key not in {r.key for r in snapshot.bodies}
            and same_shape(twin.shape, record.shape)
        ):
            return twin
    body = Body(record.shape)
    body.key = record.key
    return body


def same_shape(a: Shape, b: Shape) -> bool:
    """Return whether two shapes are equal, number for number."""
    if type(a) is not type(b):
        return False
    if a == b:
        return True
    return all(
        np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y
        for x, y in zip(a.__dict__.values(), b.__dict__.values(), strict=True)
    )


def _dynamics_for(
    record: BodyRecord, own: DynamicsRecord, body: Body, world: Simulation, same_settings: bool
) -> Dynamics:
    current: Any = body._dynamics
    if current is not None and same_settings and current.fits(own.material, world.world_count, own.friction):
        if not current.is_rigid or current.scene is world._rigid:
            return current
    as_recorded = Body(record.shape)
    as_recorded.key = body.key
    _fill(as_recorded, record)
    return make_dynamics(as_recorded, own.material, own.state, own.friction, world)


def _take_apart(world: Simulation, kept: list[Dynamics]) -> None:
    for body in list(world._bodies.values()):
        if body._dynamics is not None:
            for grip in body._dynamics.grips:
                grip._world = None
            body._dynamics.grips = []
            body._dynamics.grips_changed = True
        if isinstance(body._parent, Body):
            parent = body._parent
            parent._children = [child for child in parent._children if child is not body]
            body._parent = None
        if body._dynamics is not None and body._dynamics not in kept:
            body._dynamics.release()
        body._dynamics = body._path = body._world = None
    world._bodies.clear()


def _fill(body: Body, record: BodyRecord) -> None:
    # A frame that is no body is not part of a snapshot: a body that follows one goes on following it.
    pose = (record.position, record.quaternion)
    outside = body._parent is not None and record.parent is None and record.dynamics is None
    # nor does it begin to follow a body that was its parent meanwhile, and left the world
    outside = outside and (record.relative is not None or not isinstance(body._parent, Body))
    if body._parent is not None and not outside:
        body._parent._children = [child for child in body._parent._children if child is not body]
        body._parent = None
    if body._parent is not None:
        frame = body._parent.pose()
        kept = record.relative
        # rounding would move it where the frame has not
        same = kept is not None and all(map(np.array_equal, compose(frame, kept), pose))
        pose = kept if kept is not None and same else compose(invert(frame), pose)
    body._position, body._quaternion = pose
    body._name, body._shape, body.color = record.name, record.shape, record.color
    body._friction, body._thickness = record.friction, record.thickness
    body._group, body._collides_with = record.group, record.collides_with
    body._path = record.path
    body._deformed = record.deformation


def _restore_grip(record: GripRecord, bodies: dict[str, Body], world: Simulation) -> None:
    grip = world._known_grips.get(record.key)
    target = None if record.target is None else bodies[record.target]
    spec = _with_own_keys(record.spec, bodies)
    if grip is None:
        made = Joint if isinstance(spec, JointSpec) else Grip
        grip = made(bodies[record.body], spec, target, record.offsets)
        grip.key = record.key
    grip.body, grip.target, grip.spec = bodies[record.body], target, spec
    grip.offsets, grip.followed = record.offsets, record.followed
    world._hold(grip)


def _with_own_keys(spec: Any, bodies: dict[str, Body]) -> Any:
    """Let a grip's spec name bodies by their own keys, which differ where a file named them by others."""
    ignored = getattr(spec, "ignored", ())
    return replace(spec, ignored=tuple(bodies[key].key for key in ignored if key in bodies)) if ignored else spec


def _rename_keys(world: Simulation, bodies: dict[str, Body]) -> None:
    """Let the rules speak of the bodies' own keys, where a file named a body of this process by another."""
    new = {key: body.key for key, body in bodies.items()}
    rules = world._rules
    # rules also speak of bodies that were removed, and may come back
    rules.friction = {frozenset(new.get(key, key) for key in pair): mu for pair, mu in rules.friction.items()}
    rules.ignored = {frozenset(new.get(key, key) for key in pair) for pair in rules.ignored}
    rules.summed = {new.get(key, key) for key in rules.summed}


def _mapped_lead(followed: tuple[float, Pose, Pose] | None, batched: Any) -> tuple[float, Pose, Pose] | None:
    if followed is None:
        return None
    time, start, end = followed
    return time, (batched(start[0]), batched(start[1])), (batched(end[0]), batched(end[1]))


def _later(spec: Any, seconds: float) -> Any:
    """Return a grip's numbers with its keys so much later."""
    return replace(spec, times=spec.times + seconds) if hasattr(spec, "times") else spec


def _plain(value: Any) -> Any:
    return float(value) if isinstance(value, np.generic) else value


def check_world_index(k: Any, world_count: int, name: str = "k") -> int:
    """Return ``k`` as an index of one world of a batch.

    Raises:
        InvalidInputError: not a whole number, or out of range.
    """
    if isinstance(k, bool) or not isinstance(k, int | np.integer) or not 0 <= k < world_count:
        raise InvalidInputError(f"{name} must be a whole number in [0, {world_count - 1}], got {k!r}")
    return int(k)
