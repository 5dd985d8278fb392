"""The points that a grip holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.tie import HoldSpec
from nuno.shapes.coordinates import compose

if TYPE_CHECKING:
    from nuno.joints.grip import Grip


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
