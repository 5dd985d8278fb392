"""A USB camera, by OpenCV."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from nuno.camera.image_quality import image_quality
from nuno.errors import ImageError
from nuno.validation import checked, count

_SETTLING = 10
"""Frames that are thrown away first: cameras set their exposure with them."""


class UsbCamera:
    """A camera that OpenCV opens by its number; close it, or use it in a ``with`` statement.

    Focus, exposure and size are the camera's own; switch its autofocus off, or the lens of one image is not that of
    another.

    Args:
        number: Of the camera, 0 is the first one.
        width: Of the images [px]; None is what the camera gives.
        height: Likewise.

    Raises:
        ImageError: there is no such camera, or it gives no images.
    """

    @checked
    def __init__(self, number: int = 0, *, width: int | None = None, height: int | None = None) -> None:
        self.number = count("number", number, low=0, high=63)
        self._source: Any = cv2.VideoCapture(self.number)
        if not self._source.isOpened():
            self._source.release()
            raise ImageError(
                f"camera {self.number} cannot be opened: is it plugged in, may this user read it "
                f"(/dev/video{self.number} on Linux), and has no other program opened it?"
            )
        for key, value in ((cv2.CAP_PROP_FRAME_WIDTH, width), (cv2.CAP_PROP_FRAME_HEIGHT, height)):
            if value is not None:
                self._source.set(key, count("width and height", value))
        try:
            for _ in range(_SETTLING):
                self._read()
        except ImageError:
            self.close()
            raise

    def take(self, frames: int = 5) -> np.ndarray:
        """Return the sharpest of the next few frames, (h, w, 3) uint8 RGB.

        Raises:
            ImageError: the camera gives no more images.
        """
        for _ in range(_SETTLING):  # what the driver kept while nobody looked
            self._read()
        taken = [self._read() for _ in range(count("frames", frames, high=1000))]
        return min(taken, key=lambda image: image_quality(image).blur)

    def close(self) -> None:
        """Give the camera back; more than once does nothing."""
        self._source.release()

    def _read(self) -> np.ndarray:
        good, frame = self._source.read()
        if not good or frame is None:
            raise ImageError(f"camera {self.number} gives no images: is it still plugged in?")
        if frame.ndim == 2:
            return cv2.cvtColor(frame, cv2.COLOR_GRAY2RGB)
        return cv2.cvtColor(frame, cv2.COLOR_BGR2RGB)

    def __enter__(self) -> UsbCamera:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
