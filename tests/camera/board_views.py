"""Images of a printed board as a known camera sees it: rays through every pixel, two by two of them."""

import cv2
import numpy as np

import nuno

LENS = nuno.Camera(640, 480, 560.0, 555.0, 325.0, 236.0, distortion=[-0.22, 0.09, 0.001, -0.0015])
"""A webcam's: barrel distortion of some 12 px in the corners."""
BOARD = nuno.CalibrationBoard()
_SAMPLES = 2


def quads(camera, image, corners, picture, rim=60):
    """Draw a picture (h, w) in a white rim [px] on a parallelogram, given by three of its corners (3, 3) [m]."""
    framed = cv2.copyMakeBorder(picture, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=235).astype(np.float32)
    origin, right, down = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(right, down)
    total, count = np.zeros(image.shape[:2]), np.zeros(image.shape[:2])
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    eye = camera.camera_to_world[:3, 3]
    for a in range(_SAMPLES):
        for b in range(_SAMPLES):
            pixels = np.stack([u + (a + 0.5) / _SAMPLES - 0.5, v + (b + 0.5) / _SAMPLES - 0.5], axis=-1)
            rays = camera.rays(pixels)
            distance = ((origin - eye) @ normal) / (rays @ normal)
            there = eye + distance[..., None] * rays - origin
            x = (there @ right) / (right @ right) * picture.shape[1] - 0.5 + rim
            y = (there @ down) / (down @ down) * picture.shape[0] - 0.5 + rim
            inside = (distance > 0) & (x > 0) & (y > 0) & (x < framed.shape[1] - 1) & (y < framed.shape[0] - 1)
            value = cv2.remap(framed, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
            total += np.where(inside, value, 0.0)
            count += inside
    share = (count / _SAMPLES**2)[..., None]
    drawn = total[..., None] / np.maximum(count, 1)[..., None]
    return share * drawn + (1.0 - share) * image


def room(camera, seed=0):
    """Return a grey room with some texture (h, w, 3) float: smooth blotches and sharp discs."""
    rng = np.random.default_rng(seed)
    image = np.full((camera.height, camera.width, 3), 120.0)
    for _ in range(40):
        centre = rng.integers((0, 0), (camera.width, camera.height))
        cv2.circle(image, tuple(int(c) for c in centre), int(rng.integers(3, 12)), rng.uniform(70, 170, 3).tolist(), -1)
    return image


def exposed(image, seed=0, noise=1.5):
    """Return an image (h, w, 3) uint8 with noise."""
    rng = np.random.default_rng(seed)
    return np.clip(np.round(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)


def board_view(camera, centre, turn, board=BOARD, seed=0):
    """The board with its middle at (3,) [m] before the camera, turned by a rotation vector (3,)."""
    rotation = cv2.Rodrigues(np.asarray(turn, dtype=float))[0]
    width, height = board.size
    local = np.array([[-width / 2, -height / 2, 0], [width / 2, -height / 2, 0], [-width / 2, height / 2, 0]])
    corners = local @ rotation.T + centre
    pose = camera.camera_to_world
    corners = corners @ pose[:3, :3].T + pose[:3, 3]
    return exposed(quads(camera, room(camera), corners, 0.82 * board.picture(100) + 20), seed)


PLACES = (
    (-0.12, -0.08),
    (0.12, -0.08),
    (-0.12, 0.08),
    (0.12, 0.08),
    (0.0, 0.0),
    (-0.07, 0.0),
    (0.07, 0.02),
    (0.0, -0.05),
)


def board_views(camera=LENS, board=BOARD, count=8):
    """Boards held everywhere, tilted by 20 to 40 degrees every way."""
    views = []
    for k in range(count):
        x, y = PLACES[k % len(PLACES)]
        tilt = np.radians(20 + 5 * (k % 5))
        angle = 2.0 * np.pi * k / count
        centre = np.array([x, y, 0.42 + 0.03 * (k % 3)])
        views.append(
            board_view(camera, centre, (tilt * np.cos(angle), tilt * np.sin(angle), 0.1 * (k % 4 - 1.5)), board, k)
        )
    return views
