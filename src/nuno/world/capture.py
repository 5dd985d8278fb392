"""Worlds into snapshots and back: what a world is, copied out of it, and a world made what a snapshot is."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import Dynamics, dynamics_of
from nuno.joints.grip import Grip
from nuno.joints.joint import Joint, JointSpec
from nuno.shapes.coordinates import compose, invert
from nuno.shapes.shape import Shape
from nuno.tables.path_batch import GroupPath
from nuno.world.rigid_layout import bring_static, layout_of, scene_for, settle
from nuno.world.snapshot import NEUTRAL, Snapshot
from nuno.world.snapshot_records import BodyRecord, DynamicsRecord, GripRecord

if TYPE_CHECKING:
    from nuno.world.advancing import Advancing
    from nuno.world.simulation import Simulation


def capture(world: Simulation, engine: str | None = None) -> Snapshot:
    """Return everything that ``world`` is; arrays are copies or never written to.

    Args:
        world: The world.
        engine: For a world of which engine; for another's than its own, states are neutral.
    """
    neutral = engine is not None and engine != world.engine.name
    rules = world._rules
    ignored = sorted((min(pair), max(pair)) for pair in rules.ignored)
    pairs = [(min(pair), max(pair), mu) for pair, mu in rules.friction.items()]
    return Snapshot(
        time=world.time, gravity=world.gravity, frame_rate=world.frame_rate, substeps=world.substeps,
        world_count=world.world_count, family=world._family, engine=NEUTRAL if neutral else world.engine.name,
        bodies=tuple(_body_record(body, world, neutral) for body in world._bodies.values()),
        grips=tuple(_grip_record(grip, world, neutral) for own in world._attached() for grip in own.grips),
        pair_friction=tuple(sorted(pairs, key=lambda pair: pair[:2])),
        ignored=tuple(ignored), rigid=None if neutral else layout_of(world), summed=tuple(sorted(rules.summed)),
        drivers=tuple((driver, driver.save()) for driver in world.drivers), clock_shift=world._clock_shift,
    )  # fmt: skip


def apply(snapshot: Snapshot, world: Advancing) -> None:
    """Make ``world`` what the snapshot is. Body and Grip objects that it still knows keep their identity.

    Solvers are made before anything changes, so that a failure leaves the world as it was.

    Raises:
        EngineCapabilityError: the world's engine lacks something that is in the snapshot.
    """
    if snapshot.engine not in (NEUTRAL, world.engine.name):
        snapshot = _neutral(snapshot, world)
    neutral = snapshot.engine == NEUTRAL
    _check_engine(snapshot, world)
    bodies = {record.key: _recorded_body(record, snapshot, world) for record in snapshot.bodies}
    before, count = (world.gravity, world.frame_rate, world.substeps), world.world_count
    same_settings = before == (snapshot.gravity, snapshot.frame_rate, snapshot.substeps)
    take_settings = world._take_settings
    take_settings(snapshot.gravity, snapshot.frame_rate, snapshot.substeps)
    world.world_count = snapshot.world_count
    scene = world._rigid
    try:
        world._rigid = scene_for(snapshot.rigid, snapshot.bodies, bodies, world)
        made = {
            record.key: _dynamics_for(record, record.dynamics, bodies[record.key], world, same_settings, neutral)
            for record in snapshot.bodies if record.dynamics is not None
        }  # fmt: skip
    except BaseException:
        take_settings(*before)
        world.world_count = count
        world._rigid = scene
        raise
    _take_apart(world, list(made.values()))
    world._time, world._clock_shift = snapshot.time, snapshot.clock_shift
    # what contacts and ties gave in the last frame, and the ways of what led, were in another past
    world._stepping.last, world._schedule = [], None
    for record in snapshot.bodies:
        _set_up(bodies[record.key], record)
        world._register(bodies[record.key])
    for record in snapshot.bodies:
        body = bodies[record.key]
        if record.parent is not None:
            body._parent = bodies[record.parent]
            body._parent._children.append(body)
        if record.dynamics is not None:
            body._dynamics = dynamics = made[record.key]
            dynamics.pushes = list(record.dynamics.pushes)
    bring_static(snapshot.rigid, bodies, world)
    for record in snapshot.bodies:
        if record.dynamics is not None:
            world.engine.load(bodies[record.key], record.dynamics.state, neutral)
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


def _check_engine(snapshot: Snapshot, world: Simulation) -> None:
    """Refuse a snapshot of what the world's engine lacks; dynamics are looked at as they are made."""
    engine = world.engine
    moving = {record.key for record in snapshot.bodies if record.dynamics is not None}
    for grip in snapshot.grips:
        engine.allow_grip(grip.spec, grip.target in moving)
    if any(record.path is not None for record in snapshot.bodies):
        engine.require("moving shapes")
    if snapshot.pair_friction:
        engine.require("pair friction")
    if snapshot.summed:
        engine.require("impulses")
    if snapshot.world_count > 1:
        engine.require("batch")


def _neutral(snapshot: Snapshot, world: Advancing) -> Snapshot:
    """Return a snapshot of another engine's world with neutral states, by way of such a world."""
    other = type(world)(device=world._device, engine=snapshot.engine)
    apply(snapshot, other)
    return replace(
        capture(other, world.engine.name), family=snapshot.family, from_file=snapshot.from_file,
        drivers=snapshot.drivers,
    )  # fmt: skip


def _body_record(body: Body, world: Simulation, neutral: bool = False) -> BodyRecord:
    dynamics = None
    own = dynamics_of(body)
    if own is not None:
        state = world.engine.neutral_state(body) if neutral else own.state()
        dynamics = DynamicsRecord(own.material, own.friction, state, tuple(own.pushes))
    parent = body._parent if isinstance(body._parent, Body) and body._parent._world is world else None
    pose = (body._position, body._quaternion) if parent or own else body.pose()
    deformed, base = body._deformed if body._deformed is not None else (None, (None, None))
    return BodyRecord(
        key=body.key, name=body.name, shape=body.shape, color=body.color, friction=body.friction,
        thickness=body.thickness, group=body.group, collides_with=body.collides_with, position=pose[0],
        quaternion=pose[1], parent=None if parent is None else parent.key, deformed=deformed,
        deformed_position=base[0], deformed_quaternion=base[1], dynamics=dynamics,
        path=body._path.as_it_is() if isinstance(body._path, GroupPath) else body._path,
        relative=None if body._parent is None or parent else body.relative_pose,
    )  # fmt: skip


def _grip_record(grip: Grip, world: Simulation, neutral: bool) -> GripRecord:
    target, borne = None if grip.target is None else grip.target.key, None
    if world.engine.is_builtin and not neutral and not isinstance(grip, Joint):
        borne = np.atleast_2d(np.concatenate(grip.wrench, axis=-1))
    return GripRecord(grip.key, grip.body.key, grip.spec, target, grip.offsets, grip.followed, borne)


def _recorded_body(record: BodyRecord, snapshot: Snapshot, world: Simulation) -> Body:
    known = world._bodies_by_key.get(record.key)
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


def same_shape(a: Any, b: Any) -> bool:
    """Return True if two shapes are equal, number for number, part by part."""
    if isinstance(a, Shape):
        named: Any = fields(a)  # type: ignore[arg-type]  # every shape is a dataclass; what it caches is no field
        return type(a) is type(b) and all(same_shape(getattr(a, own.name), getattr(b, own.name)) for own in named)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same_shape, a, b))
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else bool(a == b)


def _dynamics_for(
    record: BodyRecord, own: DynamicsRecord, body: Body, world: Simulation, same_settings: bool, neutral: bool
) -> Dynamics:
    current: Any = body._dynamics
    if current is not None and same_settings and current.fits(own.material, world.world_count, own.friction):
        if world.engine.keeps(current):
            return current
    as_recorded = Body(record.shape)
    as_recorded.key = body.key
    _set_up(as_recorded, record)
    world.engine.allow_dynamics(as_recorded, own.material)
    return world.engine.make(as_recorded, own.material, own.state, own.friction, neutral)


def _take_apart(world: Simulation, kept: list[Dynamics]) -> None:
    for body in list(world._bodies.values()):
        if (dynamics := dynamics_of(body)) is not None:
            for grip in dynamics.grips:
                grip._world = None
            dynamics.grips = []
            dynamics.grips_changed = True
        if isinstance(body._parent, Body):
            parent = body._parent
            parent._children = [child for child in parent._children if child is not body]
            body._parent = None
        if (dynamics := dynamics_of(body)) is not None and dynamics not in kept:
            dynamics.release()
        body._dynamics = body._path = body._world = None
    world._bodies.clear()


def _set_up(body: Body, record: BodyRecord) -> None:
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
    grip = world._grips_by_key.get(record.key)
    target = None if record.target is None else bodies[record.target]
    spec = _with_own_keys(record.spec, bodies)
    if grip is None:
        made = Joint if isinstance(spec, JointSpec) else Grip
        grip = made(bodies[record.body], spec, target, record.offsets)
        grip.key = record.key
    grip.body, grip.target, grip.spec = bodies[record.body], target, spec
    grip.offsets, grip.followed = record.offsets, record.followed
    grip.borne = None if record.borne is None else (world.time, record.borne)
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
