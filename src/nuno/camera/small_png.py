"""Small PNG of images, as notebooks show pictures."""

from __future__ import annotations

import numpy as np

MAX_SIDE = 640
"""[px] the longer side, at most."""

WORLDS = 36
"""So many images of a batch are shown, at most."""


def small_png(colors: np.ndarray) -> bytes:
    """Return a PNG of an image (h, w, 3) uint8, or of the first ones of (n, h, w, 3) in rows, made smaller to fit."""
    import cv2

    images = colors.reshape(-1, *colors.shape[-3:])[:WORLDS]
    count, height, width, _ = images.shape
    columns = int(np.ceil(np.sqrt(count)))
    rows = -(-count // columns)
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for k, image in enumerate(images):
        row, column = divmod(k, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = image
    scale = MAX_SIDE / max(sheet.shape[:2])
    if scale < 1.0:
        sheet = cv2.resize(sheet, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".png", sheet[..., ::-1])[1])
