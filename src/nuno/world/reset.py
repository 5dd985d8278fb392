"""Reset: some worlds of a batch become what a snapshot is, and all others keep every bit.

The bodies, materials and rules must be those of the batch. So nothing is made anew: rows of states, poses, grips, paths
and pushes are written over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import ParticleDynamics, dynamics_of
from nuno.dynamics.push import Push
from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.rows_of_worlds import SOON, WorldRows, merge_path
from nuno.shapes.coordinates import Pose
from nuno.shapes.path import Path
from nuno.tables.kinematic_motion import arrive
from nuno.validation import as_array, index_array
from nuno.world.capture import same_shape
from nuno.world.reset_grips import merged_grips, set_merged_grips
from nuno.world.rigid_layout import RigidLayout
from nuno.world.snapshot import Snapshot
from nuno.world.snapshot_records import BodyRecord

if TYPE_CHECKING:
    from nuno.world.advancing import Advancing
    from nuno.world.simulation import Simulation


def checked_worlds(worlds: Any, world_count: int) -> np.ndarray:
    """Return indices (k,) of worlds of a batch, each once, from a number, indices, or a mask (worlds,) bool.

    Raises:
        InvalidInputError: not whole numbers, out of range, or one twice.
    """
    given = as_array("worlds", worlds)
    if given.dtype == bool:
        if given.shape != (world_count,):
            raise InvalidInputError(f"a mask of worlds must have shape ({world_count},), got {given.shape}")
        return np.flatnonzero(given)
    if not given.size:
        return np.zeros(0, dtype=int)
    found = index_array("worlds", np.atleast_1d(given), ("k",), low=0, high=world_count).astype(int)
    if len(np.unique(found)) != len(found):
        raise InvalidInputError(f"worlds must name each world once, got {found.tolist()}")
    return found


def reset_worlds(world: Advancing, worlds: np.ndarray, snapshot: Snapshot) -> None:
    """Make some worlds of a batch what a snapshot is.

    Args:
        world: The batch.
        worlds: (k,) int, the worlds.
        snapshot: Of a single world, which all become; or of as many worlds as the batch, each of which becomes its own.

    Raises:
        BodyStateError: the snapshot has other bodies, dynamics, materials, rules or settings than the batch, or a
            path or push in it is under way at another time.
        InvalidInputError: a snapshot of another number of worlds.
    """
    count = world.world_count
    if snapshot.world_count not in (1, count):
        raise InvalidInputError(
            f"reset takes a snapshot of one world or of {count}, as the batch has; this one has "
            f"{snapshot.world_count}: snapshot.pick(k) is one of them"
        )
    if not len(worlds):
        return
    taken = np.zeros_like(worlds) if snapshot.world_count == 1 else worlds
    shift = np.zeros(snapshot.world_count) if snapshot.clock_shift is None else snapshot.clock_shift
    clocks = np.zeros(count) if world._clock_shift is None else world._clock_shift.copy()
    clocks[worlds] = world.time - snapshot.time + shift[taken]
    if snapshot.engine != world.engine.name:
        raise BodyStateError(f"reset takes a snapshot of the engine {world.engine.name!r}, not {snapshot.engine!r}")
    snapshot = snapshot.at(world.time)
    at = WorldRows(worlds, taken, (count, snapshot.world_count), world.time)
    records = _matched(world, snapshot, at)
    statics = {body: _static_rows(body, record, at) for body, record in records.items() if record.dynamics is None}
    grips, held = merged_grips(world, snapshot, records, at)
    pushes = _pushes(world, records, at)
    friction = _pair_friction(world, snapshot, at)
    world._bring_rigid()  # what is listed anew in any case, so that no world is for the sake of others
    _check_layout(world, snapshot.rigid)

    listing = _listing(world, snapshot.rigid)
    moved = _set_statics(world, statics)
    scene, rigid = world._rigid, None
    if scene is not None and snapshot.rigid is not None:
        from nuno.solvers.rigid_rows import RigidRows

        rigid = RigidRows(scene.solver, worlds)
        origin = at.merged(scene.solver.origin, snapshot.rigid.origin, 1)
        if origin is not scene.solver.origin:
            scene.solver.origin = origin
            for place in scene.static.values():
                place.where = None
            moved = True
    order = {record.key: k for k, record in enumerate(snapshot.bodies)}
    own = {key: k for k, key in enumerate(world._bodies)}
    renumbered = np.array([own[key] for key in order] + [-1])
    for body, record in records.items():
        if record.dynamics is None:
            continue
        dynamics: Any = body._dynamics
        state = {name: at.of_rows(np.asarray(v), np.ndim(v) - 1) for name, v in record.dynamics.state.items()}
        if "partner_slot" in state:
            state["partner_slot"] = renumbered[state["partner_slot"]]
        dynamics.load_worlds(worlds, state)
        if isinstance(dynamics, ParticleDynamics):
            dynamics.solver.missed[worlds] = False
        body._quaternion = at.merged(body._quaternion, record.quaternion, 1)
        dynamics.pushes = pushes[body]
    set_merged_grips(world, grips, held, worlds)
    if friction:
        world._rules.friction |= friction
    if moved or friction:
        world._colliders_changed()
        world._bring_rigid()
    if rigid is not None:
        rigid.settle(listing, taken)
    world._resting = None
    world._clock_shift = clocks if clocks.any() else None
    for coupled in world._stepping.last:
        coupled.kept = {body: _but(worlds, kept, count) for body, kept in coupled.kept.items()}


def _but(worlds: np.ndarray, kept: np.ndarray, count: int) -> np.ndarray:
    """Return ``kept`` (worlds,) bool without some worlds."""
    left = np.array(np.broadcast_to(kept, (count,)))
    left[worlds] = False
    return left


def _matched(world: Simulation, snapshot: Snapshot, at: WorldRows) -> dict[Body, BodyRecord]:
    """Return the snapshot's record of each body of the batch.

    Raises:
        BodyStateError: they are not of the same bodies, dynamics, rules and settings.
    """
    names = ("gravity", "frame_rate", "substeps")
    changed = [name for name in names if getattr(world, name) != getattr(snapshot, name)]
    if changed:
        raise BodyStateError(f"the snapshot has another {changed[0]} than the batch; restore takes it as a whole")
    records = {record.key: record for record in snapshot.bodies}
    if set(records) != set(world._bodies):
        extra = [body.name for key, body in world._bodies.items() if key not in records]
        lacking = [record.name for key, record in records.items() if key not in world._bodies]
        raise BodyStateError(
            f"reset needs the bodies of the batch: the snapshot lacks {extra}, the batch lacks {lacking}; save after "
            "bodies have come and gone, or restore the batch as a whole"
        )
    found = {}
    for key, body in world._bodies.items():
        record = records[key]
        _check_same(body, record, at)
        found[body] = record
    rules = world._rules
    if rules.ignored != {frozenset(pair) for pair in snapshot.ignored} or rules.summed != set(snapshot.summed):
        raise BodyStateError("the snapshot has other rules of which bodies touch than the batch; save after a change")
    if rules.friction.keys() != {frozenset((a, b)) for a, b, _ in snapshot.pair_friction}:
        raise BodyStateError("other pairs have a friction of their own in the snapshot than in the batch")
    return found


def _check_same(body: Body, record: BodyRecord, at: WorldRows) -> None:
    from nuno.dynamics.rigid_dynamics import RigidDynamics

    dynamics = dynamics_of(body)

    what = None
    parent = body._parent.key if isinstance(body._parent, Body) and body._parent._world is body._world else None
    if body.shape is not record.shape and not same_shape(body.shape, record.shape):
        what = "shape"
    elif (body.group, body.collides_with) != (record.group, record.collides_with):
        what = "collision group"
    elif parent != record.parent:
        what = "parent"
    elif (dynamics is None) != (record.dynamics is None):
        what = "state: it is static in one and dynamic in the other"
    elif dynamics is None or record.dynamics is None:
        # a rigid solver that is told of them anew forgets what touches the body, in all worlds
        if at.merged(body._friction, record.friction, 0) is not body._friction:
            what = "friction (a snapshot of the batch keeps each world's own)"
        elif body._thickness != record.thickness or not _same_deformation(body._deformed, record.deformation, at):
            what = "deformed shape"
    elif not _same_material(dynamics.material, record.dynamics.material, at):
        what = "material (a snapshot of the batch keeps each world's own)"
    elif at.merged(dynamics.friction, record.dynamics.friction, 0) is not dynamics.friction:
        what = "friction (a snapshot of the batch keeps each world's own)"
    elif isinstance(dynamics, RigidDynamics) and (
        dynamics.thickness != record.thickness or not _same_deformation(dynamics.deformed, record.deformation, at)
    ):
        what = "deformed shape"
    if what is not None:
        raise BodyStateError(f"{body.name!r} has another {what} in the snapshot; restore takes it as a whole")


def _same_material(own: Any, other: Any, at: WorldRows) -> bool:
    if own is other or own.same_as(other):
        return True
    return all(
        own.of_world(int(k), at.world_count).same_as(other.of_world(int(r), at.source_count))
        for k, r in zip(at.worlds, at.rows, strict=True)
    )


def _check_layout(world: Simulation, layout: RigidLayout | None) -> None:
    scene = world._rigid
    if layout is None:
        return
    places = {} if scene is None else {key: known.slot for key, known in scene.static.items()}
    for body in world._bodies.values():
        if body._dynamics is not None and body._dynamics.is_rigid:
            places[body.key] = body._dynamics.slot  # type: ignore[attr-defined]
    for place in layout.places:
        if place.key not in world._bodies:
            continue  # of a body that has gone
        rows = () if scene is None or place.key not in places else scene.solver.part_rows[places[place.key]]
        if places.get(place.key) != place.slot or tuple(rows) != tuple(place.rows):
            raise BodyStateError("rigid bodies came and went since the snapshot: save after that, or restore the batch")


def _listing(world: Simulation, layout: RigidLayout | None) -> Any:
    """Return when a snapshot lists pairs; None where it is to list them anew."""
    return layout.listing if layout is not None and layout.is_current else None


def _static_rows(body: Body, record: BodyRecord, at: WorldRows) -> tuple[Pose, Path | None]:
    """Return where a static body is, and the path that it follows."""
    outside = body._parent is not None and record.parent is None
    own, there = (body._position, body._quaternion), (record.position, record.quaternion)
    pose = own if outside else tuple(at.merged(a, b, 1) for a, b in zip(own, there, strict=True))
    path = merge_path(body._path, record.path, own, there, at, body.name)
    return pose, path  # type: ignore[return-value]


def _same_deformation(own: Any, other: Any, at: WorldRows) -> bool:
    if own is None or other is None:
        return own is other
    pairs = [(own[0], other[0], 2), *((a, b, 1) for a, b in zip(own[1], other[1], strict=True))]
    return all(at.merged(a, b, axes) is a for a, b, axes in pairs)


def _set_statics(world: Simulation, statics: dict[Body, tuple[Pose, Path | None]]) -> bool:
    """Put static bodies where they belong; return whether any has changed."""
    changed = False
    for body, (pose, path) in statics.items():
        now, then = (body._position, body._quaternion, body._path), (*pose, path)
        if all(a is b for a, b in zip(now, then, strict=True)):
            continue
        changed = True
        body._position, body._quaternion, body._path = then
        world._kinematic = None
    if changed:
        arrive(world._kinematic_bodies(), world.time)  # where a path leads by world, the body is by world
    return changed


def _pair_friction(world: Simulation, snapshot: Snapshot, at: WorldRows) -> dict[frozenset[str], Any]:
    changed = {}
    for a, b, mu in snapshot.pair_friction:
        own = world._rules.friction[frozenset((a, b))]
        merged = at.merged(own, mu, 0)
        if merged is not own:
            changed[frozenset((a, b))] = merged
    return changed


def _pushes(world: Simulation, records: dict[Body, BodyRecord], at: WorldRows) -> dict[Body, list[Push]]:
    """Return the pushes of each dynamic body.

    Raises:
        BodyStateError: one ends between the frames of the others, which would be cut there.
    """
    frame = 1.0 / world.frame_rate
    found = {}
    for body, record in records.items():
        dynamics = dynamics_of(body)
        if record.dynamics is None or dynamics is None:
            continue
        own, other = list(dynamics.pushes), list(record.dynamics.pushes)
        if own == other and not own:
            found[body] = own
            continue
        for push in [*own, *other]:
            if push.end is not None and abs(np.round((push.end - at.time) / frame) * frame + at.time - push.end) > SOON:
                raise BodyStateError(
                    f"a push on {body.name!r} ends within a frame, {push.end - at.time:.6f} s from now, which would "
                    "cut that frame in all worlds: let pushes last whole frames, or reset when they have ended"
                )
        merged = []
        for push in own:
            force = push.force.copy()
            force[at.worlds] = 0.0
            merged.append(Push(force, push.end))
        shape = (at.world_count, *np.shape((own or other)[0].force)[1:])
        for push in other:
            force = np.zeros(shape, dtype=np.float32)
            force[at.worlds] = at.of_rows(push.force, len(shape) - 1)
            endless = next((k for k, p in enumerate(merged) if p.end is None and push.end is None), None)
            if endless is None:
                merged.append(Push(force, push.end))
            else:
                merged[endless] = Push(merged[endless].force + force, None)
        found[body] = [push for push in merged if push.force.any()]
    return found
