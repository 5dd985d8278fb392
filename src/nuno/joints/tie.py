"""Ties between bodies that both move, and holds of rigid bodies: the numbers that a step needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, apply, compose, invert
from nuno.shapes.path import Path
from nuno.shapes.surface import chosen_points, closest_points
from nuno.validation import as_array, finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip, GripWorld


MAX_FORCE = 1e4
"""[N] The most that a grip or weld bears where nothing else is asked for: ten times what a person lifts."""
MAX_ACCELERATION = 1e3
"""[m/s2] What a grip or weld can give the heaviest of the rigid bodies that it holds, at least: 100 g."""


@dataclass(frozen=True, eq=False)
class TieSpec:
    """Points of a cloth or soft body that stay on points of another body that moves.

    Attributes:
        corners: (worlds, k, 3) int32, the vertices of each point, -1 for no point in this world.
        weights: (worlds, k, 3) float64, the vertices' weights.
        other_corners: Likewise of the other body where that is a cloth or soft body, or None.
        other_weights: Likewise.
        places: (worlds, k, 3) float64 [m] in the other body's frame where that is rigid, or None.
        compliance: [m/N], 0 is stiff.
        max_force: (worlds,) float64 [N], the most that each point bears.
    """

    corners: np.ndarray
    weights: np.ndarray
    other_corners: np.ndarray | None
    other_weights: np.ndarray | None
    places: np.ndarray | None
    compliance: float
    max_force: np.ndarray | float = np.inf


@dataclass(frozen=True, eq=False)
class HoldSpec:
    """A rigid body whose frame follows key poses, or another body's frame.

    Attributes:
        times: (m,) float64 [s] of the world's clock.
        positions: (worlds, m, 3) float64 [m], of the body's frame; in a dynamic leader's frame where it has one. Of a
            static leader, the last frame's start and end, once it has led one.
        quaternions: (worlds, m, 4) float64, likewise.
        interpolation: "linear" or "minimum_jerk".
        free: (3,) float64, the direction along which the body slides freely, of length 1, or None.
        compliance: [m/N], and [1/(N m)] for turns; 0 is stiff.
        max_force: (worlds,) float64 [N], the most that it bears; of turns as much [N m].
        ignored: Keys of the bodies that the held one passes through.
        held: (worlds,) bool, in which worlds it holds; None is in all.
    """

    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    interpolation: str
    free: np.ndarray | None
    compliance: float
    max_force: np.ndarray | float = np.inf
    ignored: tuple[str, ...] = ()
    held: np.ndarray | None = None

    def at(self, time: float) -> Pose:
        """Return positions (worlds, 3) and quaternions (worlds, 4) at a time [s]."""
        path = Path(self.times, self.positions, self.quaternions, self.interpolation)  # type: ignore[arg-type]
        return path.at(time), path.quaternion_at(time)

    def pose_at(self, key: int) -> Pose:
        """Return positions (worlds, 3) and quaternions (worlds, 4) at a key."""
        return self.positions[:, key], self.quaternions[:, key]


def batched_spec(spec: Any, batched: Any) -> Any:
    """Return a grip's, tie's or hold's numbers with ``batched`` applied to each array that has a world axis."""
    names = (
        "vertices", "corners", "barycentric", "weights", "other_corners", "other_weights", "places", "positions",
        "quaternions", "place", "turn", "other_place", "other_turn", "drives",
    )  # fmt: skip
    changed = {name: batched(getattr(spec, name)) for name in names if hasattr(spec, name)}
    if getattr(spec, "held", None) is not None:
        changed["held"] = batched(spec.held)
    limit = getattr(spec, "max_force", None)
    return replace(spec, **changed, **({"max_force": batched(limit)} if isinstance(limit, np.ndarray) else {}))


def force_limit(asked: Any, worlds: int, *bodies: Body | None) -> np.ndarray:
    """Return (worlds,) float64 [N], what a grip or weld of some bodies bears at most.

    Args:
        asked: What the caller gave: one value, (worlds,), or None.
        worlds: Worlds in the batch.
        bodies: Those that are held, by whose mass a limit is chosen where None is asked for.

    Raises:
        InvalidInputError: a limit that is not positive, or of another shape.
    """
    if asked is not None:
        if as_array("max_force", asked).shape == () and asked == np.inf:
            return np.full(worlds, np.inf)
        limit = np.broadcast_to(finite_array("max_force", asked, (), (worlds,)), (worlds,)).copy()
        if (limit <= 0.0).any():
            raise InvalidInputError(f"max_force must be positive, got {asked!r}")
        return limit
    rigid: list[Any] = [b._dynamics for b in bodies if b is not None and b._dynamics is not None]
    masses = [np.asarray(dynamics.mass) for dynamics in rigid if dynamics.is_rigid]
    return np.max([np.full(worlds, MAX_FORCE), *(MAX_ACCELERATION * mass for mass in masses)], axis=0)


def make_tie(body: Body, where: Any, other: Body, compliance: float, world: GripWorld) -> TieSpec:
    """Return what ties points of ``body`` to the nearest points of ``other``, where both are now.

    Raises:
        InvalidInputError: points that the body does not have.
    """
    worlds = world.world_count
    vertices, corners, weights = chosen_points(where, body.vertices.shape[-2], body.faces, worlds)
    if vertices is not None:
        corners, weights = _single(vertices)
    assert corners is not None and weights is not None
    return _tie_of(body, corners, weights, other, compliance, worlds)


def _tie_of(
    body: Body, corners: np.ndarray, weights: np.ndarray, other: Body, compliance: float, worlds: int
) -> TieSpec:
    """Return what ties points of ``body`` to ``other``: see `TieSpec` for the points."""
    dynamics = other._dynamics
    assert dynamics is not None
    own = np.broadcast_to(body.vertices, (worlds, *body.vertices.shape[-2:]))
    rows = np.arange(worlds)[:, None, None]
    held = np.einsum("wkc,wkcx->wkx", np.where(corners >= 0, weights, 0.0), own[rows, np.maximum(corners, 0)])
    if dynamics.is_rigid:
        places = np.broadcast_to(apply(invert(other.pose()), held), held.shape)
        return TieSpec(corners.astype(np.int32), np.array(weights), None, None, np.array(places), compliance)
    # four particles in all: one of this body, three of the other
    heaviest = np.argmax(weights, axis=-1)[..., None]
    single = np.take_along_axis(corners, heaviest, axis=-1)
    corners = np.concatenate([single, np.full_like(single, -1), np.full_like(single, -1)], axis=-1)
    theirs, faces = np.broadcast_to(other.vertices, (worlds, *other.vertices.shape[-2:])), other.faces
    found = [closest_points(own[w, np.maximum(single[w, :, 0], 0)], theirs[w], faces) for w in range(worlds)]
    return TieSpec(
        corners.astype(np.int32), np.broadcast_to([1.0, 0.0, 0.0], corners.shape).copy(),
        np.stack([faces[f.faces] for f in found]).astype(np.int32), np.stack([f.barycentric for f in found]), None,
        compliance,
    )  # fmt: skip


def make_hold(
    body: Body, to: Any, target: Body | None, free: Any, compliance: float, world: GripWorld
) -> tuple[HoldSpec, Pose | None]:
    """Return what holds a rigid body, and its pose in the frame of a static leader.

    Raises:
        InvalidInputError: a target that cannot be used.
    """
    worlds = world.world_count
    place, turn = (np.broadcast_to(a, (worlds, a.shape[-1])) for a in body.pose())
    axis = None
    if free is not None:
        axis = finite_array("free", free, (3,))
        if np.linalg.norm(axis) < 1e-9:
            raise InvalidInputError(f"free must be a direction (3,) of some length, got {free!r}")
        axis = axis / np.linalg.norm(axis)
    now = np.array([world.time])
    if target is not None:
        place, turn = (np.broadcast_to(a, (worlds, a.shape[-1])) for a in compose(invert(target.pose()), (place, turn)))
        spec = HoldSpec(now, place[:, None].copy(), turn[:, None].copy(), "linear", axis, compliance)
        return spec, None if target.is_dynamic else (place.copy(), turn.copy())
    if isinstance(to, Path):
        if to.world_count not in (None, worlds):
            raise InvalidInputError(f"the path is for {to.world_count} worlds, but there are {worlds}")
        m = len(to.times)
        positions = np.broadcast_to(to.positions, (worlds, m, 3))
        turns = np.broadcast_to(turn[:, None], (worlds, m, 4))
        if to.quaternions is not None:
            # the body keeps its present turn against the path's
            start = np.broadcast_to(to.quaternion_at(world.time), (worlds, 4))
            turns = quat.multiply(
                np.broadcast_to(to.quaternions, (worlds, m, 4)), quat.multiply(quat.inverse(start), turn)[:, None]
            )
        return HoldSpec(to.times, positions.copy(), turns.copy(), str(to.interpolation), axis, compliance), None
    goal = np.broadcast_to(finite_array("to, where it is no Path or Body,", to, (3,), (worlds, 3)), (worlds, 3))
    return HoldSpec(now, goal[:, None].copy(), turn[:, None].copy(), "linear", axis, compliance), None


def corners_of(spec: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (worlds, k, 3) of each point that a grip or tie holds, -1 for none, and their weights."""
    if isinstance(spec, TieSpec):
        return spec.corners, spec.weights
    if spec.corners is not None:
        return spec.corners, spec.barycentric
    return _single(spec.vertices)


def _single(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (worlds, k) as points, see `corners_of`."""
    corners = np.stack([vertices, *2 * [np.full_like(vertices, -1)]], axis=-1)
    return corners, np.broadcast_to([1.0, 0.0, 0.0], corners.shape)


def check_leader(leader: Body, deforms: bool, grips: Sequence[Grip]) -> None:
    """Check that a static body can be given dynamics while it leads what it holds.

    Raises:
        BodyStateError: it would deform, and holds a rigid body.
    """
    held = [grip.body.name for grip in grips if grip.target is leader and isinstance(grip.spec, HoldSpec)]
    if deforms and held:
        raise BodyStateError(
            f"{leader.name!r} would deform, but holds {held[0]!r}, which is rigid; release that grip first"
        )


def tie_to_leader(grip: Grip, worlds: int) -> None:
    """Let a grip by a static body be one by a dynamic body, which that has become: it bears the force from now on."""
    leader, spec = grip.target, grip.spec
    dynamics = None if leader is None else leader._dynamics
    assert leader is not None and dynamics is not None
    if isinstance(spec, HoldSpec):
        # its places are in the leader's frame already
        grip.offsets = grip.followed = None
        return
    tie = _tie_of(grip.body, *corners_of(spec), leader, spec.compliance, worlds)
    if spec.max_force is not None:
        tie = replace(tie, max_force=spec.max_force)
    # at the very places where the leader held them
    grip.spec = replace(tie, places=grip.offsets) if dynamics.is_rigid else tie
    grip.offsets = None


def check_weld(a: Body, b: Body) -> None:
    """Check that two bodies can be welded.

    Raises:
        BodyStateError: one of them is static.
    """
    for body in (a, b):
        if not body.is_dynamic:
            raise BodyStateError(
                f"{body.name!r} is static; weld joins two dynamic bodies, grip holds one to a static body"
            )
