"""Masks of polygons that lie on a plane, as a camera sees them."""

import cv2
import numpy as np

HEIGHT = 0.7  # [m]
L = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.2), (0.2, 0.2), (0.2, 0.5), (0.0, 0.5)]) - 0.2  # 0.16 m2
BOX = np.array([(-0.25, -0.15), (0.25, -0.15), (0.25, 0.15), (-0.25, 0.15)])


def mask_of(polygon, camera):
    """A pixel is of the mask where its middle is in the polygon's image, by OpenCV's fill at 1/16 px."""
    pixels = camera.project(np.column_stack([polygon, np.full(len(polygon), HEIGHT)]))
    mask = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillPoly(mask, [np.round(pixels * 16).astype(np.int32)], 1, lineType=cv2.LINE_8, shift=4)
    return mask.astype(bool)
