"""Reading images, and checking that they fit their camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.errors import ImageError
from nuno.validation import as_array


def read_image(path: str | Path) -> np.ndarray:
    """Read an image file.

    Args:
        path: A file that OpenCV can decode (PNG, JPEG, BMP, TIFF ...).

    Returns:
        (h, w, 3) uint8, RGB.

    Raises:
        ImageError: there is no such file, or it holds no image that can be decoded.
    """
    import cv2

    path = Path(path)
    # imdecode instead of imread: imread prints its own warning and cannot open every path on Windows.
    try:
        if not path.is_file():
            raise ImageError(f"no image file at {path}")
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise ImageError(f"an image file cannot be read: {error}") from error
    try:
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error as error:
        raise ImageError(f"{path} ({data.size} bytes) cannot be decoded: {error.err or error}") from error
    if image is None:
        raise ImageError(f"{path} ({data.size} bytes) holds no image that OpenCV can decode (PNG, JPEG, TIFF ...)")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def check_image(image: ArrayLike, camera: Camera, name: str = "image") -> np.ndarray:
    """Return the image as an array if it is RGB, uint8 and of the camera's size.

    Args:
        image: (h, w, 3) uint8, RGB.
        camera: The camera that took it.
        name: What to call it in a message.

    Raises:
        ImageError: it is not.
    """
    array = as_array(name, image, ImageError)
    expected = (camera.height, camera.width, 3)
    if array.shape != expected or array.dtype != np.uint8:
        raise ImageError(
            f"{name} must be RGB uint8 of shape {expected} to fit its camera, got {array.dtype} of shape {array.shape}"
        )
    return array


def check_any_size(image: ArrayLike, name: str = "image", *, grey: bool = True) -> np.ndarray:
    """Return the image as an array if it is RGB or grey, uint8 and not empty, of whatever size.

    Args:
        image: (h, w, 3) uint8 RGB, or (h, w) uint8.
        name: What to call it in a message.
        grey: Take grey images, too.

    Raises:
        ImageError: it is not.
    """
    array = as_array("image", image, ImageError)
    has_channels = (grey and array.ndim == 2) or (array.ndim == 3 and array.shape[2] == 3)
    if array.dtype != np.uint8 or not has_channels or not array.size:
        shapes = "uint8 (h, w, 3) or (h, w)" if grey else "RGB uint8 (h, w, 3)"
        raise ImageError(f"{name} must be {shapes}, got {array.dtype} of shape {array.shape}")
    return array


def check_mask(mask: ArrayLike, camera: Camera, name: str = "mask") -> np.ndarray:
    """Return the mask as bool (h, w) if it is of the camera's size.

    Args:
        mask: (h, w) bool, or numbers of which those over half of the largest count as set (0 and 255 in
            files); the largest real number is 1 or 255.
        camera: The camera whose image it masks.
        name: What to call it in a message.

    Raises:
        ImageError: it is of another shape, or of real numbers of another range.
    """
    array = as_array(name, mask, ImageError)
    expected = (camera.height, camera.width)
    if array.shape != expected:
        raise ImageError(f"{name} must have shape {expected} to fit its camera, got {array.shape}")
    if array.dtype.kind not in "biuf":
        raise ImageError(f"{name} must be bool or numbers, got {array.dtype}")
    if array.dtype == bool:
        return array
    if array.dtype.kind == "f" and not (array.min() >= 0.0 and array.max() in (0.0, 1.0, 255.0)):
        raise ImageError(
            f"{name} has real numbers from {array.min():.3g} to {array.max():.3g}, not from 0 to 1 or 255: of "
            f"probabilities or what a network gives, pass {name} > 0.5, say"
        )
    return array > 0.5 * max(float(array.max()), 1e-9)
