"""Images of a table as a camera sees it, and cameras and tables that are told wrongly.

Corners are projected and polygons filled at four times the resolution, so edges are true to about 0.1 px, which is far
below the noise that is taken for lines (1 px).
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.table import Table

TABLE = Table(0.72, (0.42, 0.6), (0.1, 0.0))
TRUE = Camera.look_at((-0.9, 0.05, 1.33), (0.1, 0.0, 0.84), 2.0 * np.arctan(240.0 / 470.0))
FINE = 4


def filled(image: np.ndarray, points: np.ndarray, colour: tuple[int, ...], camera: Camera) -> None:
    """Fill a convex polygon (k, 3) [m]."""
    cv2.fillConvexPoly(image, np.round(camera.project(points) * 16).astype(np.int32), colour, cv2.LINE_8, shift=4)


def drawn(camera: Camera = TRUE, table: Table = TABLE, face=(90, 70, 55), finer: int = FINE) -> np.ndarray:
    """(h, w, 3) uint8, a table with a front face of a colour, a cloth on it, a line on the wall behind, and noise."""
    fine = camera.scaled(finer)
    image = np.full((fine.height, fine.width, 3), (70, 66, 62), np.uint8)
    image[: int(0.2 * fine.height)] = 150, 160, 170
    (x, y), (a, b), z = table.centre or (0.0, 0.0), table.half_extents or (1.0, 1.0), table.height
    low = z - table.thickness
    front = np.array([(x - a, y - b, z), (x - a, y + b, z), (x - a, y + b, low), (x - a, y - b, low)])
    top = np.array([(x - a, y - b, z), (x + a, y - b, z), (x + a, y + b, z), (x - a, y + b, z)])
    cloth = np.array([(-0.1, -0.2, z), (0.2, -0.25, z), (0.25, 0.15, z), (-0.05, 0.2, z)])
    for points, colour in ((front, face), (top, (150, 120, 95)), (cloth, (60, 150, 60))):
        filled(image, points, colour, fine)
    image = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0.0, 3.0, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def told(focal: float = 1.0, turn: tuple[float, float, float] = (0.0, 0.0, 0.0), height: float = 0.0):
    """Camera and table as they may be told: a factor of the focal length, turns [degrees] and a height added [m]."""
    pose = TRUE.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.deg2rad(turn))[0]
    camera = replace(TRUE, fx=TRUE.fx * focal, fy=TRUE.fy * focal, camera_to_world=pose)
    return camera, replace(TABLE, height=TABLE.height + height)
