"""Synthetic pairs of images of a cloth, flat and then lifted, with exact masks.

A room by ray casting (table, floor, wall, each with its texture), a flat patterned cloth, a lifted one as a
shaded triangle mesh of a tent with folds, its cast shadow, the hand's dark sphere, gains, blur and noise. The
lifted shape is geometry, not physics: it is here to be seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.table import Table, plane_coordinates, table_margin

REST_HEIGHT = 0.0025
HAND_RADIUS = 0.014
_AMBIENT = 0.42


@dataclass(frozen=True)
class Look:
    """A cloth's and a table's colours (RGB), the cloth's pattern and its second colour."""

    name: str
    cloth: tuple[int, int, int]
    table: tuple[int, int, int]
    pattern: str = "plain"
    second: tuple[int, int, int] | None = None
    grain: float = 0.12


LOOKS = (
    Look("red on brown", (200, 45, 40), (160, 105, 65)),
    Look("brown-red on brown", (150, 75, 55), (150, 102, 66)),
    Look("brown on grey", (120, 85, 60), (130, 130, 135)),
    Look("light grey on grey", (185, 185, 182), (140, 142, 145), grain=0.08),
    Look("dark grey on grey", (95, 96, 98), (140, 142, 145), grain=0.08),
    Look("white on light grey", (238, 236, 230), (185, 187, 190), grain=0.06),
    Look("blue stripes on wood", (80, 90, 165), (175, 115, 70), "stripes", (110, 115, 150)),
    Look("red and white stripes on wood", (190, 50, 50), (170, 120, 80), "stripes", (235, 230, 225)),
    Look("green checks on grey", (50, 120, 60), (120, 125, 130), "checks", (220, 225, 215)),
    Look("grey checks on brown", (225, 222, 215), (150, 100, 65), "checks", (175, 172, 168)),
    Look("black on wood", (35, 35, 38), (165, 115, 75)),
    Look("yellow on white", (225, 200, 90), (215, 213, 208), grain=0.05),
    Look("beige on wood", (205, 180, 145), (165, 120, 80)),
    Look("navy on dark grey", (40, 45, 90), (85, 88, 92)),
    Look("orange checks on brown", (215, 120, 50), (140, 95, 60), "checks", (180, 90, 40)),
    Look("teal on green", (45, 130, 125), (85, 120, 80)),
)


@dataclass(frozen=True)
class Pair:
    """Two images and their truth.

    Attributes:
        camera: The camera of both.
        table: The table, with its extents.
        before: (h, w, 3) uint8.
        after: (h, w, 3) uint8.
        mask_before: (h, w) bool.
        mask_after: (h, w) bool, the hand occludes.
        hand: (3,) float [m].
        corners: (4, 3) float [m], around the cloth.
        size: Long and short side [m].
    """

    camera: Camera
    table: Table
    before: np.ndarray
    after: np.ndarray
    mask_before: np.ndarray
    mask_after: np.ndarray
    hand: np.ndarray
    corners: np.ndarray
    size: tuple[float, float]


def look_at(position: np.ndarray, target: np.ndarray, focal: float, width: int = 640, height: int = 480) -> Camera:
    """A camera at a position [m] that looks at a target [m], level."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = position
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, pose)


def make_pair(look: Look, seed: int, *, noise: float = 3.0, lift: bool = True, cloth: bool = True) -> Pair:
    """Draw a pair of images of one look; the seed chooses camera, table, size, pose, pick and light.

    Args:
        look: Colours and patterns.
        seed: Of the random numbers.
        noise: Standard deviation of the noise [levels].
        lift: Draw the lifted cloth after; else the bare room.
        cloth: Draw the flat cloth before; else the bare room.
    """
    rng = np.random.default_rng(seed)
    table_height = rng.uniform(0.65, 0.8)
    table = Table(table_height, (rng.uniform(0.38, 0.5), rng.uniform(0.55, 0.7)), (0.1, 0.0))
    position = np.array([rng.uniform(-1.0, -0.8), rng.uniform(-0.2, 0.2), table_height + rng.uniform(0.5, 0.75)])
    camera = look_at(position, np.array([0.15, rng.uniform(-0.08, 0.08), table_height + 0.1]), rng.uniform(480, 560))
    short = rng.uniform(0.3, 0.45)
    size = (short * rng.uniform(1.1, 1.5), short)
    yaw = rng.uniform(0, 2 * np.pi)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    room = np.array(table.half_extents) - 0.5 * np.abs(axes.T) @ np.array(size) - 0.02
    centre = np.array([0.1, 0.0]) + rng.uniform(-0.7, 0.7, 2) * np.maximum(room, 0.0)
    corners = centre + (np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * size) @ axes
    corners = np.column_stack([corners, np.full(4, table_height + REST_HEIGHT)])

    room_image = _room(camera, table, look, rng)
    to_light = np.array([rng.uniform(-0.7, 0.3), rng.uniform(-0.7, 0.7), 1.0])
    to_light /= np.linalg.norm(to_light)
    flat_light = _AMBIENT + (1 - _AMBIENT) * to_light[2]

    before = room_image.copy()
    plane = plane_coordinates(camera, table_height + REST_HEIGHT)
    local = (np.nan_to_num(plane, nan=1e6) - centre) @ axes.T
    mask_before = (np.abs(local) <= 0.5 * np.array(size)).all(axis=-1)
    mask_before &= cloth
    before[mask_before] = _pattern(local[mask_before], look)

    after, mask_after, hand = room_image.copy(), np.zeros_like(mask_before), np.zeros(3)
    if lift:
        rest, faces = _grid(size, 56, 44)
        pick = np.array([rng.choice([-0.5, -0.3, -0.1, 0.1, 0.3, 0.5]) for _ in range(2)]) * size
        travel = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(0.25, 0.45)])
        vertices = _tent(rest, pick, travel, rng) @ np.block([[axes, np.zeros((2, 1))], [np.zeros((1, 2)), 1.0]])
        vertices += np.array([*centre, table_height + REST_HEIGHT])
        hand = np.array([*(centre + pick @ axes), table_height + REST_HEIGHT]) + np.array(
            [*(travel[:2] @ axes), travel[2]]
        )
        _cast_shadow(after, vertices, faces, to_light, camera, table)
        index = _rasterise(vertices, faces, camera)
        mask_after = index >= 0
        colours = _pattern(rest[faces].mean(axis=1), look) * _shade(vertices, faces, to_light, camera)[:, None]
        after[mask_after] = colours[index[mask_after]] / flat_light
        sphere = _sphere(camera, hand, HAND_RADIUS)
        after[sphere] = (28, 28, 32)
        mask_after &= ~sphere
    images = []
    for picture in (before, after):
        gains = rng.uniform(0.96, 1.04) * rng.uniform(0.985, 1.015, 3)
        picture = cv2.GaussianBlur((picture * gains).astype(np.float32), (0, 0), 0.5)
        picture = picture + rng.normal(0.0, noise, picture.shape)
        images.append(np.clip(np.round(picture), 0, 255).astype(np.uint8))
    return Pair(camera, table, images[0], images[1], mask_before, mask_after, hand, corners, size)


def _room(camera: Camera, table: Table, look: Look, rng: np.random.Generator) -> np.ndarray:
    """(h, w, 3) float, the table, floor and wall, lit from above with a soft falloff."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = camera.rays(np.stack([u, v], axis=-1))
    origin = camera.camera_to_world[:3, 3]
    image = np.empty((camera.height, camera.width, 3))
    wall_x = 1.6
    with np.errstate(divide="ignore", invalid="ignore"):
        wall = np.where(rays[..., 0] > 0, (wall_x - origin[0]) / rays[..., 0], np.inf)
        floor = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
    image[:] = np.array([rng.uniform(140, 200)] * 3) * rng.uniform(0.97, 1.03, 3)
    ground = origin[:2] + np.where(np.isfinite(floor), floor, 0)[..., None] * rays[..., :2]
    tiles = (np.floor(ground / 0.3).sum(axis=-1) % 2)[..., None]
    image = np.where((floor < wall)[..., None], (1 + 0.25 * tiles) * rng.uniform(50, 90, 3), image)
    for height, shade in ((table.height - table.thickness, 0.55), (table.height, 1.0)):
        xy = plane_coordinates(camera, height)
        on = table_margin(table, xy) > 0
        grain = 1.0 + look.grain * _texture(np.nan_to_num(xy), rng)
        image = np.where(on[..., None], np.array(look.table) * (shade * grain)[..., None], image)
    x, y = u / camera.width * 2 - 1, v / camera.height * 2 - 1
    a, b, c = rng.uniform(-0.06, 0.06, 3)
    return image * (1.0 + a * x + b * y - 0.04 * (x * x + y * y) + 0.05 * c * x * y)[..., None]


def _texture(xy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Speckle or streaks with zero mean and values of about -1 ... 1 at points (h, w, 2) [m]."""
    stretch = rng.choice([1.0, 3.0, 8.0])
    noise = rng.normal(size=(256, 256)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 1.2, borderType=cv2.BORDER_REFLECT)
    soft /= soft.std()
    speckle = np.where(soft > 1.0, -1.5, 0.2) if rng.random() < 0.5 else soft * 0.7
    index = np.floor(xy / (0.006, 0.006 * stretch)).astype(int) % 256
    return speckle[index[..., 0], index[..., 1]]


def _pattern(local: np.ndarray, look: Look) -> np.ndarray:
    """(n, 3) float colours at points (n, 2) of the cloth [m]."""
    first = np.array(look.cloth, dtype=float)
    second = np.array(look.second or look.cloth, dtype=float)
    if look.pattern == "stripes":
        share = (np.mod(local[:, 1], 0.1) < 0.03).astype(float)
    elif look.pattern == "checks":
        share = (np.mod(local, 0.06) < 0.03).mean(axis=-1)
    else:
        share = np.zeros(len(local))
    return first + share[:, None] * (second - first)


def _grid(size: tuple[float, float], n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.linspace(-0.5, 0.5, n) * size[0], np.linspace(-0.5, 0.5, m) * size[1]
    rest = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    k = np.arange(n * m).reshape(n, m)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return rest, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def _tent(rest: np.ndarray, pick: np.ndarray, travel: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lift the picked point of a flat cloth: the cloth falls from it in folds, the rest stays flat."""
    away = rest - pick
    distance = np.linalg.norm(away, axis=1)
    angle = np.arctan2(away[:, 1], away[:, 0])
    steep = rng.uniform(0.75, 0.95)
    fall = np.minimum(distance * steep, travel[2] - 0.002)
    flat = np.sqrt(np.maximum(distance**2 - fall**2, 0.0))
    folds = rng.uniform(0.0, 0.2) * (np.sin(rng.integers(3, 7) * angle + rng.uniform(0, 6)) - 1.0)  # never stretched
    radius = flat * (1 + folds * fall / travel[2])
    xy = pick + away / np.maximum(distance, 1e-9)[:, None] * radius[:, None] + travel[:2]
    return np.column_stack([xy, travel[2] - fall])


def _shade(vertices: np.ndarray, faces: np.ndarray, to_light: np.ndarray, camera: Camera) -> np.ndarray:
    """(f,) float brightness of the side that the camera sees: lit if it faces the light, else ambient."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    facing = ((camera.camera_to_world[:3, 3] - a) * normal).sum(axis=1, keepdims=True)
    normal *= np.where(facing < 0, -1.0, 1.0)
    return _AMBIENT * (0.7 + 0.3 * normal[:, 2]) + (1 - _AMBIENT) * np.maximum(normal @ to_light, 0.0)


def _draw(points: np.ndarray, faces: np.ndarray, camera: Camera) -> np.ndarray:
    """(h, w) int32, the last of the faces drawn that covers each pixel's centre, or -1."""
    fine = 3  # the middle one of 3 x 3 samples: fillConvexPoly also paints the samples that an edge touches
    pixels = camera.project(points)
    if not np.isfinite(pixels).all():
        return np.full((camera.height, camera.width), -1, dtype=np.int32)
    corners = np.round((pixels * fine + (fine - 1) / 2) * 16).astype(np.int32)[faces]
    canvas = np.full((camera.height * fine, camera.width * fine), -1, dtype=np.int32)
    for index, corner in enumerate(corners):
        cv2.fillConvexPoly(canvas, corner, index, lineType=cv2.LINE_8, shift=4)
    return canvas[fine // 2 :: fine, fine // 2 :: fine]


def _rasterise(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> np.ndarray:
    order = np.argsort(-camera.depth_of(vertices[faces].mean(axis=1)))
    drawn = _draw(vertices, faces[order], camera)
    return np.where(drawn >= 0, order[np.maximum(drawn, 0)], -1)


def _cast_shadow(
    image: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    to_light: np.ndarray,
    camera: Camera,
    table: Table,
) -> None:
    on_table = table_margin(table, plane_coordinates(camera, table.height)) > 0
    for height, where in ((table.height, on_table), (0.0, ~on_table)):
        points = vertices - to_light * ((vertices[:, 2] - height) / to_light[2])[:, None]
        if height == table.height:
            caught = (table_margin(table, points[faces][..., :2]) > 0).any(axis=1)
        drawn = faces if height == table.height else faces[~caught]  # the table keeps its shadow from the floor
        shadow = (_draw(points, drawn, camera) >= 0) & where
        if height == 0.0:
            shadow &= plane_coordinates(camera, 0.0)[..., 0] < 1.6
        image[shadow] *= _AMBIENT / (_AMBIENT + (1 - _AMBIENT) * to_light[2])


def _sphere(camera: Camera, centre: np.ndarray, radius: float) -> np.ndarray:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = camera.rays(np.stack([u, v], axis=-1))
    to = centre - camera.camera_to_world[:3, 3]
    along = rays @ to / np.linalg.norm(rays, axis=-1)
    return (to @ to - along**2 < radius**2) & (along > 0)
