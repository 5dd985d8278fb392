"""Picked cloths made with Nuno's own engine, at a resolution and step that no estimator uses.

A scene is one cloth on one table before one camera; each of its picks has a material of its own. Ranges are those of
the benchmark's description in docs/reports/performance.md. Masks only: their edges are displaced by smooth noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.futures import is_turned, table_world
from nuno.materials import Cloth
from nuno.shapes.path import Path

EDGE_NOISE = 2.0  # [px] standard deviation of the edge's displacement
NOISE_LENGTH = 4.0  # [px] over which it is smooth
HAND_RADIUS = 0.014  # [m]
REST_HEIGHT = 0.0025  # [m]
CELL = 0.0165  # [m] about; estimators use 0.02 and more
SUBSTEPS = 45
SIDEWAYS = (0.0, 0.1)  # [m] how far from above the picked point the hand ends


@dataclass
class Case:
    """One pick: what an estimator may see, and the truth."""

    camera: Camera
    table: Table
    hand: np.ndarray
    mask_before: np.ndarray
    mask_after: np.ndarray
    rectangle: ClothRectangle
    true_ij: tuple[int, int]
    material: dict[str, float]


def looking_at(eye: np.ndarray, target: np.ndarray, focal: float) -> Camera:
    """A 640 x 480 camera without roll."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = eye
    return Camera(640, 480, focal, focal, 319.5, 239.5, pose)


def labelled_rectangle(camera: Camera, centre: np.ndarray, size: np.ndarray, yaw: float) -> ClothRectangle:
    """The rectangle with its corners in the order of the label rule."""
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    corners = np.concatenate([centre[:2] + (signs * size) @ axes, np.full((4, 1), centre[2])], axis=1)
    first = int(np.argmin(np.linalg.norm(camera.project(corners), axis=1)))
    ring = corners[[first, (first + 1) % 4, (first + 2) % 4, (first + 3) % 4]]
    if np.linalg.norm(ring[1] - ring[0]) < np.linalg.norm(ring[3] - ring[0]):
        ring = ring[[0, 3, 2, 1]]
    along = ring[1] - ring[0]
    sides = np.linalg.norm(along), np.linalg.norm(ring[3] - ring[0])
    angle = float(np.arctan2(along[1], along[0]))
    return ClothRectangle(ring, float(sides[0]), float(sides[1]), ring.mean(axis=0), angle, 0.0)


def displaced(mask: np.ndarray, rng: np.random.Generator, ignore: np.ndarray | None = None) -> np.ndarray:
    """The mask with its edge displaced by smooth noise of ``EDGE_NOISE`` pixels."""
    import cv2

    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    noise = cv2.GaussianBlur(rng.standard_normal(mask.shape), (0, 0), NOISE_LENGTH)
    moved = inside - outside + noise * (EDGE_NOISE / noise.std()) > 0
    return moved if ignore is None else moved & ~ignore


def hand_pixels(camera: Camera, hand: np.ndarray) -> np.ndarray:
    """(h, w) bool: the pixels of the hand's sphere, by its circle."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centre, radius = camera.project(hand), HAND_RADIUS * camera.fx / camera.depth_of(hand)
    return (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= radius**2


def generate(scenes: int, picks: int, seed: int, device: str, sideways: tuple[float, float] = SIDEWAYS) -> list[Case]:
    """Make ``scenes`` x ``picks`` cases; the same seed makes the same cases on one device.

    Args:
        scenes: Number of scenes.
        picks: Picks of each.
        seed: Of everything that is drawn at random.
        device: Where to simulate.
        sideways: How far sideways the hand goes at least and at most [m].
    """
    rng = np.random.default_rng(seed)
    cases: list[Case] = []
    while len(cases) < scenes * picks:
        cases += _scene(rng, picks, device, sideways)
    return cases


def _scene(rng: np.random.Generator, picks: int, device: str, sideways: tuple[float, float]) -> list[Case]:
    table = Table(
        rng.uniform(0.70, 0.76), (rng.uniform(0.36, 0.48), rng.uniform(0.56, 0.66)), (rng.uniform(0.08, 0.13), 0.0)
    )
    eye = np.array([rng.uniform(-1.0, -0.78), rng.uniform(-0.12, 0.14), table.height + rng.uniform(0.5, 0.73)])
    camera = looking_at(eye, np.array([0.1, 0.0, table.height + 0.12]) + rng.normal(0, 0.02, 3), rng.uniform(400, 600))
    long_m = rng.uniform(0.40, 0.80)
    size = np.array([long_m, rng.uniform(max(0.35, 0.55 * long_m), min(0.97 * long_m, 0.6))])
    centre = np.array([rng.uniform(0.0, 0.1), rng.uniform(-0.06, 0.06), table.height + REST_HEIGHT])
    rectangle = labelled_rectangle(camera, centre, size, rng.uniform(0, 2 * np.pi))
    pixels = camera.project(rectangle.corners)
    if pixels.min() < 12 or (pixels > (627, 467)).any():
        return []
    near = np.sort(np.linalg.norm(pixels, axis=1))
    if near[1] - near[0] < 12:  # the label must not hang on a pixel
        return []
    steps = 5 * np.maximum(np.round(np.array([rectangle.long_m, rectangle.short_m]) / CELL / 5).astype(int), 3)
    cells = (int(steps[0]), int(steps[1]))
    material = dict(
        bending_rigidity=np.exp(rng.uniform(np.log(2e-5), np.log(2e-3), picks)),
        area_density=rng.uniform(0.1, 0.4, picks), friction=rng.uniform(0.2, 0.8, picks),
        thickness=rng.uniform(0.002, 0.006, picks), air_drag=rng.uniform(0.5, 3.0, picks),
    )  # fmt: skip
    ij = rng.integers(0, 6, (picks, 2))
    start = rectangle.grid_points(6, 6)[ij[:, 0], ij[:, 1]]
    angle, reach = rng.uniform(0, 2 * np.pi, picks), rng.uniform(*sideways, picks)
    lift = np.stack([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.3, 0.5, picks)], axis=1)
    hand = start + lift
    world, cloth = table_world(rectangle, table, cells, device=device, substeps=SUBSTEPS)
    before = world.masks(camera, cloth).numpy()
    futures = world.imagine(picks)
    body = futures.find(cloth.name)
    futures.find("table").friction = futures.find("floor").friction = material["friction"]
    futures.attach(body, Cloth(**material))
    row = ij[:, 1] * cells[1] // 5
    row = cells[1] - row if is_turned(rectangle) else row
    vertex = row * (cells[0] + 1) + ij[:, 0] * cells[0] // 5
    held = np.asarray(body.vertices)[0][vertex]
    futures.grip(body, vertex[:, None], to=Path((0.1, 1.6), np.stack([held, hand], axis=1), None, "minimum_jerk"))
    futures.run(1.6 + rng.uniform(2.0, 3.5), progress=False)
    after = futures.masks(camera, body).numpy()
    cases = []
    for k in range(picks):
        tip = camera.project(hand[k])
        rim = np.concatenate([after[k][0], after[k][-1], after[k][:, 0], after[k][:, -1]])
        if not np.isfinite(tip).all() or rim.any() or after[k].sum() < 500:
            continue
        cover = hand_pixels(camera, hand[k])
        cases.append(
            Case(
                camera, table, hand[k], displaced(before, rng), displaced(after[k] & ~cover, rng, cover), rectangle,
                (int(ij[k, 0]), int(ij[k, 1])), {name: float(value[k]) for name, value in material.items()},
            )
        )  # fmt: skip
    return cases
