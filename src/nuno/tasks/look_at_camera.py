"""A look-at camera: a camera anywhere in a room that looks at a point, for pictures of what robots do."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError
from nuno.validation import finite_array


def look_at_camera(eye: ArrayLike, target: ArrayLike, width: int, height: int, focal: float) -> Camera:
    """Return a camera whose picture is upright, with the target in its middle.

    Args:
        eye: (3,) [m], where the camera is.
        target: (3,) [m], what it looks at, neither straight above nor straight below.
        width: [px].
        height: [px].
        focal: Focal length [px].

    Raises:
        InvalidInputError: a target that is straight above or below the camera, or where it is.
    """
    place = finite_array("eye", eye, (3,))
    ahead = finite_array("target", target, (3,)) - place
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    if not right.any():
        raise InvalidInputError(f"target must be beside the camera, got {target!r} for a camera at {eye!r}")
    z, x = ahead / np.linalg.norm(ahead), right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), place
    return Camera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1), camera_to_world=pose)
