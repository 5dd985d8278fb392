"""Making grips: the points that are held, where they are led, and what is told of a grip that cannot be right."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.tie import force_limit, make_hold, make_tie
from nuno.mesh.memory_limit import check_host_memory
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import apply, invert
from nuno.shapes.path import Path
from nuno.shapes.surface import chosen_points
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import GripWorld

log = logging.getLogger(__name__)

KEY_BYTES = 40
"""Of each coordinate of a key of a grip's path, while it is made: five doubles."""
SHORTEST = 1.0e-5
"""[m] That a grip leads points at once unsaid in any case: edges are longer."""


def make_grip(
    body: Body, where: Any, to: Any, compliance: float, target: Body | None, free: Any, world: GripWorld,
    *, max_force: Any = None, ignored: Sequence[Body] | None = None,
) -> Grip:  # fmt: skip
    """Return a grip on ``body``, not yet active; see ``World.grip``.

    Raises:
        InvalidInputError: points or a target that cannot be used.
    """
    worlds = world.world_count
    dynamics = body._dynamics
    assert dynamics is not None
    if ignored is not None and not dynamics.is_rigid:
        raise InvalidInputError(f"ignore is for rigid bodies only; {body.name!r} touches what holds its points")
    if dynamics.is_rigid:
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
    if target is not None and target.is_dynamic:
        tie = make_tie(body, where, target, compliance, world)
        return Grip(body, replace(tie, max_force=force_limit(max_force, worlds, body, target)), target)
    limits = None if max_force is None else force_limit(max_force, worlds)
    vertices, corners, weights = chosen_points(where, len(body.shape.mesh()[0]), body.faces, worlds)
    if vertices is not None:
        held, valid = dynamics.vertices(body, vertices), vertices >= 0
    else:
        assert corners is not None and weights is not None
        places = dynamics.vertices(body, corners.reshape(worlds, -1)).reshape(*corners.shape, 3)
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
    keys = keys if keys.base is None else np.array(keys)  # along a path they are a grip's own already
    spec = GripSpec(vertices, corners, weights, times, keys, interpolation, compliance, limits)
    return Grip(body, spec, target, local)


def _along(path: Path, offsets: np.ndarray, world: GripWorld) -> tuple[np.ndarray, np.ndarray, str]:
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


def warn_unmet(grip: Grip, time: float) -> None:
    """Warn that a grip cannot be met, at a time [s]: it bears its limit, or does not come to where it leads."""
    other = "" if grip.target is None else f" to {grip.target.name!r}"
    log.warning(
        "the %s of %r%s is not met at t = %.3f s: a contact, a grip or a joint holds against it, and it bears %s N at "
        "most (max_force). Lead it elsewhere, release what contradicts it, let the bodies' contact be ignored, or give "
        "a grip a compliance",
        grip.noun, grip.body.name, other, time, f"{np.max(grip.max_force):.4g}",
    )  # fmt: skip


def warn_shared(grip: Grip, others: Sequence[Grip]) -> None:
    """Warn where a new stiff grip holds vertices that another one holds stiffly: only one can lead them."""
    mine = _stiff_vertices(grip)
    if mine is None:
        return
    for other in others:
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
