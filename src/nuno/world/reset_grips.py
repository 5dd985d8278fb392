"""The grips of a batch some worlds of which are reset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import BodyStateError
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.joint import Joint
from nuno.joints.rows_of_worlds import WorldRows, merge_spec
from nuno.world.snapshot import Snapshot
from nuno.world.snapshot_records import BodyRecord, GripRecord

if TYPE_CHECKING:
    from nuno.world.simulation import Simulation


def merged_grips(
    world: Simulation, snapshot: Snapshot, records: dict[Body, BodyRecord], at: WorldRows
) -> tuple[list[tuple[Grip, Any, Any, Any, Any]], list[tuple[GripRecord, Any, Any]]]:
    """Return what the batch's grips become, (grip, spec, offsets, followed, borne), and grips that come back.

    Raises:
        BodyStateError: a grip that cannot be there in some worlds and not in others, or holds in another way.
    """
    saved = {record.key: record for record in snapshot.grips}
    by_key = {body.key: body for body in records}
    changed, back = [], []
    for dynamics in world._attached():
        for grip in dynamics.grips:
            record = saved.pop(grip.key, None)
            name = grip.body.name
            if record is None:
                spec = merge_spec(grip.spec, None, at, name, None)
                changed.append((grip, spec, grip.offsets, grip.followed, _borne(grip, None, at)))
                continue
            target = None if grip.target is None else grip.target.key
            if (grip.body.key, target) != (record.body, record.target) or (grip.offsets is None) != (
                record.offsets is None
            ):
                raise BodyStateError(f"the grip on {name!r} leads it in another way than in the snapshot")
            origin = _origin(records[grip.body], at)
            end = None if grip.is_tie else _end_of(origin)
            spec = merge_spec(grip.spec, record.spec, at, name, end)
            offsets = _merged_parts(grip.offsets, record.offsets, at)
            changed.append((grip, spec, offsets, _followed(grip, record, at), _borne(grip, record, at)))
    for record in saved.values():
        body = by_key[record.body]
        back.append((record, merge_spec(None, record.spec, at, body.name, None), _borne(None, record, at)))
        if record.offsets is not None:
            raise BodyStateError(f"the grip on {body.name!r} by another body was released; grip it again in all worlds")
    return changed, back


def _origin(record: BodyRecord, at: WorldRows) -> np.ndarray:
    assert record.dynamics is not None
    return np.asarray(record.dynamics.state.get("origin", np.zeros((1, 3))), dtype=np.float64)


def _end_of(origin: np.ndarray) -> Any:
    """Return what gives the places where an ended path holds its points, to the bit of the kernel that leads them."""

    def end(spec: GripSpec) -> np.ndarray:
        local = (spec.positions - origin[:, None, None]).astype(np.float32)
        last = local[:, :, -1]
        if spec.positions.shape[2] > 1:
            last = local[:, :, -2] + (local[:, :, -1] - local[:, :, -2])
        return last.astype(np.float64) + origin[:, None]

    return end


def _merged_parts(own: Any, other: Any, at: WorldRows) -> Any:
    if own is None:
        return None
    if isinstance(own, tuple):
        return tuple(at.merged(a, b, np.ndim(a) - 1) for a, b in zip(own, other, strict=True))
    return at.merged(own, other, np.ndim(own) - 1)


def _followed(grip: Grip, record: GripRecord, at: WorldRows) -> Any:
    own, other = grip.followed, record.followed
    if own is None and other is None:
        return None
    # in worlds where it has led nothing yet: not a number
    nowhere = [(np.full((1, 3), np.nan), np.full((1, 4), np.nan))] * 2
    mine, theirs = (nowhere if way is None else way[1:] for way in (own, other))
    poses = (tuple(map(at.merged, x, y, (1, 1))) for x, y in zip(mine, theirs, strict=True))
    return at.time - 1.0 if own is None else own[0], *poses


def _borne(grip: Grip | None, record: GripRecord | None, at: WorldRows) -> Any:
    """Return when, and what a grip bore in its last frame, (time, (worlds, 6)); None where nobody knows."""
    if isinstance(grip, Joint) or (record is not None and record.borne is None):
        return None
    mine = np.zeros((at.world_count, 6)) if grip is None else np.atleast_2d(np.concatenate(grip.wrench, axis=-1))
    return at.time, at.merged(mine, np.zeros((1, 6)) if record is None else record.borne, 1)


def set_merged_grips(
    world: Simulation, changed: list[tuple[Grip, Any, Any, Any, Any]], back: list[tuple[GripRecord, Any, Any]],
    worlds: np.ndarray,
) -> None:  # fmt: skip
    """Let grips be what `merged_grips` gave."""
    from nuno.solvers.some_worlds import set_grips

    moved_grips: dict[Any, list[Grip]] = {}
    for grip, spec, offsets, followed, borne in changed:
        if not grip.is_tie and (spec is not grip.spec or offsets is not grip.offsets):
            moved_grips.setdefault(grip.body._dynamics, []).append(grip)
        grip.spec, grip.offsets, grip.followed, grip.borne = spec, offsets, followed, borne
    for record, spec, borne in back:
        grip = world._grips_by_key.get(record.key) or Grip(world._bodies[record.body], spec)
        grip.key, grip.body = record.key, world._bodies[record.body]
        grip.target = None if record.target is None else world._bodies[record.target]
        grip.spec, grip.offsets, grip.followed, grip.borne = spec, record.offsets, record.followed, borne
        world._hold(grip)
    for dynamics in moved_grips:
        if not dynamics.grips_changed:
            set_grips(dynamics.solver, [grip.spec for grip in dynamics.grips if not grip.is_tie], worlds)
