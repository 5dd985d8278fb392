"""The points that a grip holds, and in which worlds it holds any."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import BodyStateError
from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.tie import HoldSpec, corners_of
from nuno.shapes.coordinates import compose
from nuno.shapes.surface import SurfacePoints

if TYPE_CHECKING:
    from nuno.joints.grip import Grip


def holding(spec: Any, worlds: int) -> np.ndarray:
    """Return (worlds,) bool, where a grip, tie or hold of these numbers holds anything; joints do everywhere."""
    return np.array(np.broadcast_to(_held(spec), (worlds,)))


def holds_in(spec: Any, index: int) -> bool:
    """Return True if a grip, tie or hold of these numbers holds anything in one world of a batch."""
    held = _held(spec)
    return bool(held[index if len(held) > 1 else 0])


def _held(spec: Any) -> np.ndarray:
    """Return where they hold anything, (worlds,) bool, or (1,) for all worlds."""
    if isinstance(spec, HoldSpec | JointSpec):
        held = getattr(spec, "held", None)
        return np.ones(1, dtype=bool) if held is None else held
    own = getattr(spec, "vertices", None)
    rows = corners_of(spec)[0][..., 0] if own is None else own
    return np.asarray(rows.max(axis=1, initial=-1) >= 0)


def released(spec: Any, worlds: np.ndarray) -> Any:
    """Return a grip's, tie's or hold's numbers where it holds nothing in some worlds (worlds,) bool.

    Raises:
        BodyStateError: they are a joint's, which joins in all worlds or in none.
    """
    if isinstance(spec, JointSpec):
        raise BodyStateError("a joint joins in all worlds or in none: release it in all")
    if isinstance(spec, HoldSpec):
        return replace(spec, held=holding(spec, len(worlds)) & ~worlds)
    name = "corners" if getattr(spec, "vertices", None) is None else "vertices"
    values = np.array(getattr(spec, name))
    values[worlds] = -1
    return replace(spec, **{name: values})


def places_on_body(grip: Grip) -> np.ndarray | SurfacePoints | None:
    """Return where on its body a grip of one world holds it, as ``World.grip`` takes that; None of a rigid body."""
    if isinstance(grip.spec, HoldSpec):
        return None
    corners, weights = (own[0] for own in corners_of(grip.spec))
    there = corners[:, 0] >= 0
    corners, weights = corners[there], weights[there]
    if (corners[:, 1] < 0).all():
        return np.array(corners[:, 0])
    faces = [int(np.flatnonzero((grip.body.faces == own).all(axis=1))[0]) for own in corners]
    return SurfacePoints(np.array(faces), weights)


def held_points(grip: Grip, index: int = 0, vertices: np.ndarray | None = None) -> np.ndarray:
    """Return the points that a grip holds, (k, 3) float [m]; of a rigid body, the origin of its frame.

    Args:
        grip: An active grip; the caller holds its world's lock.
        index: Which world of a batch.
        vertices: (n, 3) [m] of the body in that world, where they are known already.
    """
    spec: Any = grip.spec
    if isinstance(spec, HoldSpec):
        place = grip.body.pose()[0]
        return np.atleast_2d(place[index] if place.ndim == 2 else place)
    if isinstance(spec, JointSpec):
        return compose(grip.body.pose(), (spec.place, spec.turn))[0][index : index + 1]
    if vertices is None:
        own = grip.body._vertices()
        vertices = own[index if len(own) > 1 else 0] if own.ndim == 3 else own
    if isinstance(spec, GripSpec):
        if spec.vertices is not None:
            chosen = spec.vertices[index]
            return vertices[chosen[chosen >= 0]]
        corners, weights = spec.corners, spec.barycentric
    else:
        corners, weights = spec.corners, spec.weights
    assert corners is not None and weights is not None
    valid = corners[index][:, 0] >= 0
    return np.einsum("kc,kcx->kx", weights[index][valid], vertices[np.maximum(corners[index][valid], 0)])
