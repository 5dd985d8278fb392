"""The place of a marker of known size, by one image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.calibration_board import DICTIONARIES
from nuno.camera.camera import Camera
from nuno.camera.image import check_image
from nuno.errors import BoardNotFoundError
from nuno.validation import checked, choice, count, finite_array, number


@checked
def find_marker(
    image: ArrayLike, camera: Camera, marker: int, size: float, *, dictionary: str = "4X4_50",
    offset: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray, float]:  # fmt: skip
    """Return a point of an ArUco marker of known size, by one image; `nuno.locate_marker` needs two, and no size.

    Along the camera's axis it is known worst: a marker of s pixels whose corners are known to 0.2 px is known to some
    0.3 / s of its distance.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: The camera.
        marker: The marker's number.
        size: Its side [m], of the black square.
        dictionary: Of the markers, as "4X4_50".
        offset: (3,) of the point from the marker's middle [m]: to its right, up its page, and out of it.

    Returns:
        The point (3,) [m]; the marker's four corners (4, 2) [px]; and the root mean square distance of these from where
        a square of that size would be seen [px].

    Raises:
        ImageError: the image does not fit the camera.
        BoardNotFoundError: it does not show that marker.
    """
    side = number("size [m]", size, low=0.001, high=2.0)
    name = choice("dictionary", dictionary, DICTIONARIES)
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))
    wanted = count("marker", marker, low=0, high=int(name.split("_")[1]) - 1)
    apart = finite_array("offset", offset, (3,))
    rgb = check_image(image, camera, "the image of the marker")
    rules = cv2.aruco.DetectorParameters()
    rules.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    corners, numbers, _ = cv2.aruco.ArucoDetector(known, rules).detectMarkers(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
    seen = [] if numbers is None else np.ravel(numbers).tolist()
    if wanted not in seen:
        raise BoardNotFoundError(
            f"the image does not show marker {wanted} of {name} (it shows {sorted(seen) or 'none'}): turn it to the "
            "camera, show all of its white rim, or print it larger; or give the hand's position"
        )
    pixels = np.asarray(corners[seen.index(wanted)], dtype=float).reshape(4, 2)
    square = 0.5 * side * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
    distortion = np.zeros(5) if camera.distortion is None else camera.distortion
    _, turn, shift = cv2.solvePnP(square, pixels, camera.matrix, distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    local = cv2.Rodrigues(turn)[0] @ apart + shift.ravel()
    drawn = cv2.projectPoints(square, turn, shift, camera.matrix, distortion)[0].reshape(4, 2)
    error = float(np.sqrt(((drawn - pixels) ** 2).sum(axis=1).mean()))
    return camera.camera_to_world[:3, :3] @ local + camera.camera_to_world[:3, 3], pixels, error
