"""Picked cloths that leave the ordinary setting, one departure a case: ``python benchmarks/varied_cases.py DIR``.

Nuno's own engine makes them, on a mesh and with a step that no estimator uses, or MuJoCo's flexible bodies or Newton's
VBD (``--engine mujoco`` or ``newton``, where that package is installed). Every case is a folder as `nuno.read_case`
reads it, with a truth.json, so ``python benchmarks/picks.py cases --cases DIR`` judges an estimator on them. The same
seed makes the same cases.
"""

from __future__ import annotations

import argparse
import colorsys
import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import warp as wp
from generated_cases import HAND_RADIUS, REST_HEIGHT, labelled_rectangle, looking_at

from nuno.camera.camera import Camera
from nuno.camera.lamp import Lamp
from nuno.camera.picture import Chequer, take_picture
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table

ONE_SCENE = (
    "ordinary", "sideways", "up_first", "over_edge", "stiff", "limp", "hand_off", "focal_off", "checks", "clutter",
    "dark", "bright", "hand_noise", "table_off", "tilt_off",
)  # fmt: skip
"""What departs in a case whose cloth, table and camera are ordinary."""
OWN_SCENE = ("small", "large", "square", "low_camera", "close_camera")
"""What departs in the cloth's size or the camera."""
KINDS = (*ONE_SCENE, *OWN_SCENE)
FAR = (0.15, 0.35)  # [m] how far sideways a hand goes that goes far
NEAR = (0.0, 0.1)  # [m] and one that does not
LIFT_SECONDS = 1.5
WRONG_HEIGHT = 0.05  # [m] of a hand whose height is told wrongly
WRONG_FOCUS = 0.1  # of a focal length that is told wrongly
WRONG_TABLE = 0.03  # [m] of a table whose height is told wrongly
WRONG_TILT = 2.0  # [degrees] of a camera whose tilt is told wrongly
HAND_NOISE = 0.01  # [m] standard deviation along each axis of a hand that is measured as hands are


@dataclass
class Scene:
    """A cloth on a table before a camera."""

    camera: Camera
    table: Table
    rectangle: ClothRectangle


@dataclass
class Pick:
    """One pick of a scene: what departs, and the truth."""

    kind: str
    ij: tuple[int, int]
    path: np.ndarray
    """(k, 3) float [m], of the hand at even times from the beginning of the lift to its end."""
    material: dict[str, float]


def make_scene(rng: np.random.Generator, kind: str) -> Scene:
    """A scene that departs from the ordinary by its kind; drawn anew until all of the cloth is well in the image."""
    while True:
        table = Table(
            rng.uniform(0.70, 0.76), (rng.uniform(0.36, 0.48), rng.uniform(0.56, 0.66)), (rng.uniform(0.08, 0.13), 0.0)
        )
        above = rng.uniform(0.24, 0.32) if kind == "low_camera" else rng.uniform(0.5, 0.73)
        eye = np.array([rng.uniform(-1.0, -0.78), rng.uniform(-0.12, 0.14), table.height + above])
        if kind == "close_camera":
            eye[:2] = rng.uniform(-0.62, -0.55), rng.uniform(-0.08, 0.08)
        focal = rng.uniform(300, 340) if kind in ("close_camera", "large") else rng.uniform(400, 560)
        target = np.array([0.1, 0.0, table.height + 0.12]) + rng.normal(0, 0.02, 3)
        long_m = {"small": 0.35, "large": 1.0}.get(kind, rng.uniform(0.42, 0.7))
        share = rng.uniform(0.93, 0.97) if kind == "square" else rng.uniform(0.6, 0.85)
        short_m = min(long_m * share, 2.0 * table.half_extents[0] - 0.1)
        yaw = rng.uniform(0, 2 * np.pi)
        if kind == "large":  # along the table, or it would hang over it
            yaw = 0.5 * np.pi + rng.uniform(-0.06, 0.06)
        centre = np.array([rng.uniform(0.04, 0.1), rng.uniform(-0.05, 0.05), table.height + REST_HEIGHT])
        camera = looking_at(eye, target, focal)
        rectangle = labelled_rectangle(camera, centre, np.array([long_m, short_m]), yaw)
        pixels = camera.project(rectangle.corners)
        near = np.sort(np.linalg.norm(pixels, axis=1))
        half, middle = np.asarray(table.half_extents), np.asarray(table.centre)
        on_table = (np.abs(rectangle.corners[:, :2] - middle) < half - 0.01).all()
        inside = pixels.min() > 12 and (pixels < (627, 467)).all()
        if on_table and inside and near[1] - near[0] > 12 and np.linalg.norm(pixels[1] - pixels[0]) > 80:
            return Scene(camera, table, rectangle)


def make_pick(rng: np.random.Generator, kind: str, scene: Scene) -> Pick:
    """A pick of a scene; drawn anew until the hand is in the image."""
    lows = {"stiff": 2e-3, "limp": 1e-6}
    highs = {"stiff": 5e-3, "limp": 1e-5}
    material = {
        "bending_rigidity": float(np.exp(rng.uniform(np.log(lows.get(kind, 2e-5)), np.log(highs.get(kind, 1e-3))))),
        "area_density": float(rng.uniform(0.3, 0.4) if kind == "stiff" else rng.uniform(0.1, 0.3)),
        "friction": float(rng.uniform(0.2, 0.7)), "thickness": float(rng.uniform(0.003, 0.006)),
        "air_drag": float(rng.uniform(0.8, 2.5)),
    }  # fmt: skip
    while True:
        ij = (int(rng.integers(6)), int(rng.integers(6)))
        begin = scene.rectangle.grid_points(6, 6)[ij]
        reach = rng.uniform(*(FAR if kind in ("sideways", "up_first", "over_edge") else NEAR))
        angle = np.pi + rng.uniform(-0.3, 0.3) if kind == "over_edge" else rng.uniform(0, 2 * np.pi)
        lift = np.array([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.25, 0.45)])
        keys = [begin, begin + lift] if kind != "up_first" else [begin, begin + lift * (0, 0, 1), begin + lift]
        pixel = scene.camera.project(begin + lift)
        if (pixel > 25).all() and (pixel < (614, 454)).all():
            return Pick(kind, ij, led_along(np.array(keys)), material)


def led_along(keys: np.ndarray, count: int = 31) -> np.ndarray:
    """(count, 3) float [m], places at even times on the straight lines between keys, from rest to rest at each."""
    t = np.linspace(0.0, len(keys) - 1.0, count)
    at = np.minimum(t.astype(int), len(keys) - 2)
    s = t - at
    s = s**3 * (10.0 + s * (6.0 * s - 15.0))
    return keys[at] + s[:, None] * (keys[at + 1] - keys[at])


@dataclass
class Thing:
    """Something that stands on the table, as high as it is wide."""

    kind: str
    size: float
    position: tuple[float, ...]
    colour: tuple[float, ...]


@dataclass
class Look:
    """Colours and light of a case."""

    lamp: Lamp
    patterns: dict[str, Chequer]
    cloth: tuple[float, ...]
    table: tuple[float, ...]
    things: list[Thing]


def make_look(rng: np.random.Generator, kind: str, scene: Scene) -> Look:
    """A cloth's and a table's colours, the light, and the things on the table."""
    hue = rng.uniform()
    cloth = colorsys.hsv_to_rgb(hue, rng.uniform(0.45, 0.8), rng.uniform(0.55, 0.9))
    table = colorsys.hsv_to_rgb((hue + rng.uniform(0.35, 0.65)) % 1.0, rng.uniform(0.05, 0.25), rng.uniform(0.35, 0.8))
    share = {"dark": 0.3, "bright": 1.3}.get(kind, 1.0)
    place = (rng.uniform(-1.0, 1.0), rng.uniform(-1.5, 1.5), rng.uniform(2.5, 4.0))
    lamp = Lamp(place, 0.55 * share, 0.4 * share)
    other = colorsys.hsv_to_rgb((hue + rng.uniform(-0.1, 0.1)) % 1.0, 0.3, 0.95)
    patterns = {"cloth": Chequer(float(rng.uniform(0.03, 0.09)), other)} if kind == "checks" else {}
    things: list[Thing] = []
    if kind == "clutter":
        reach = 0.5 * float(np.hypot(scene.rectangle.long_m, scene.rectangle.short_m))
        half, middle = np.asarray(scene.table.half_extents), np.asarray(scene.table.centre)
        while len(things) < 6:
            spot = middle + rng.uniform(-1, 1, 2) * (half - 0.05)
            if np.linalg.norm(spot - scene.rectangle.centre[:2]) < reach + 0.07:
                continue
            size = rng.uniform(0.03, 0.07)
            position = (*spot, scene.table.height + size / 2)
            colour = colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(0, 0.9), rng.uniform(0.2, 0.9))
            things.append(Thing("box" if rng.uniform() < 0.5 else "cylinder", float(size), position, colour))
    return Look(lamp, patterns, cloth, table, things)


def photograph(
    scene: Scene, look: Look, vertices: np.ndarray, cells: tuple[int, int], hand: np.ndarray | None, seed: int
) -> np.ndarray:
    """(h, w, 3) uint8, the cloth at vertices (n, 3) [m] in its scene; with a dark ball where a hand is."""
    from nuno import Cloth, World, box, cylinder, plane, sheet, sphere

    world = World()
    table, rectangle = scene.table, scene.rectangle
    size = (2 * table.half_extents[0], 2 * table.half_extents[1], table.thickness)
    position = (*table.centre, table.height - table.thickness / 2)
    world.add(box(size, name="table", position=position, color=look.table))
    world.add(plane(name="floor", color=(0.4, 0.38, 0.36)))
    for k, thing in enumerate(look.things):
        options = dict(name=f"thing {k}", position=thing.position, color=thing.colour)
        size = thing.size
        world.add(box((size,) * 3, **options) if thing.kind == "box" else cylinder(size / 2, size, **options))
    cloth = sheet(
        (rectangle.long_m, rectangle.short_m), cells=cells, name="cloth", position=(0, 0, 3), color=look.cloth
    )
    world.add(cloth)
    world.attach(cloth, Cloth())
    world.set_vertices(cloth, vertices)
    if hand is not None:
        world.add(sphere(HAND_RADIUS, name="hand", position=hand, color=(0.08, 0.08, 0.09)))
    picture = take_picture(
        world, scene.camera, lamp=look.lamp, patterns=look.patterns, samples=2, noise=3.0, seed=seed
    )  # fmt: skip
    return picture.color.numpy()


def make_cases(rounds: int, seed: int, engine: str, device: str, kinds: tuple[str, ...] = KINDS) -> Iterator[Any]:
    """Make cases of every kind in each round, of (name, input.json, truth.json, image before, image after).

    Args:
        rounds: How often.
        seed: Of everything that is drawn at random.
        engine: "nuno", "mujoco" or "newton".
        device: Where Nuno or Newton simulates.
        kinds: What departs.
    """
    simulate = import_module(f"{engine}_picks").simulate
    for k in range(rounds):
        rng = np.random.default_rng((seed, k))
        together = [kind for kind in kinds if kind in ONE_SCENE]
        groups = [("ordinary", together)] if together else []
        groups += [(kind, [kind]) for kind in kinds if kind in OWN_SCENE]
        for scene_kind, members in groups:
            scene = make_scene(rng, scene_kind)
            picks = [make_pick(rng, kind, scene) for kind in members]
            hold = float(rng.uniform(2.0, 3.0))
            before, after, cells = simulate(scene, picks, hold, device)
            for n, pick in enumerate(picks):
                look = make_look(rng, pick.kind, scene)
                hand = pick.path[-1]
                shot = int(rng.integers(2**31))
                images = (
                    photograph(scene, look, before, cells, None, shot),
                    photograph(scene, look, after[n], cells, hand, shot + 1),
                )
                sign = float(rng.choice((-1.0, 1.0)))
                yield f"{engine}-{seed}-{k}-{pick.kind}", *_described(scene, pick, sign), *images


def _described(scene: Scene, pick: Pick, sign: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """What an estimator is told, wrongly where that is what departs, and the truth."""
    camera, hand, table = scene.camera, pick.path[-1].copy(), scene.table
    focal = camera.fx * (1.0 + (sign * WRONG_FOCUS if pick.kind == "focal_off" else 0.0))
    height = table.height + (sign * WRONG_TABLE if pick.kind == "table_off" else 0.0)
    pose = camera.camera_to_world.copy()
    if pick.kind == "tilt_off":
        tilt = np.deg2rad(sign * WRONG_TILT)
        c, s = np.cos(tilt), np.sin(tilt)
        pose[:3, :3] = pose[:3, :3] @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    if pick.kind == "hand_off":
        hand[2] += sign * WRONG_HEIGHT
    if pick.kind == "hand_noise":
        hand += HAND_NOISE * np.random.default_rng(int(1e6 * abs(hand).sum())).standard_normal(3)
    told = {
        "camera": {
            "width": camera.width, "height": camera.height, "fx": focal, "fy": focal, "cx": camera.cx,
            "cy": camera.cy, "camera_to_world": pose.tolist(),
        },
        "image_before": "before.png", "image_after": "after.png", "table_height_m": height,
        "table_half_extents_xy_m": list(table.half_extents), "table_centre_xy_m": list(table.centre),
        "table_thickness_m": table.thickness, "hand_position_m": hand.tolist(),
    }  # fmt: skip
    truth = {
        "true_ij": list(pick.ij), "kind": pick.kind, "material": pick.material, "hand_path_m": pick.path.tolist(),
        "corners_m": scene.rectangle.corners.tolist(), "long_m": scene.rectangle.long_m,
        "short_m": scene.rectangle.short_m,
    }  # fmt: skip
    return told, truth


def write_cases(folder: Path, cases: Iterator[Any]) -> int:
    """Write case folders, and return how many."""
    count = 0
    for name, told, truth, before, after in cases:
        path = folder / name
        path.mkdir(parents=True, exist_ok=True)
        (path / "input.json").write_text(json.dumps(told, indent=1))
        (path / "truth.json").write_text(json.dumps(truth, indent=1))
        for file, image in (("before.png", before), ("after.png", after)):
            cv2.imwrite(str(path / file), image[..., ::-1])
        print(path, flush=True)
        count += 1
    return count


def main() -> None:
    """Make cases in a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rounds", type=int, default=1, help=f"each makes {len(KINDS)} cases, one of a kind")
    parser.add_argument("--seed", type=int, default=8000)
    parser.add_argument("--engine", choices=["nuno", "mujoco", "newton"], default="nuno")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    cases = make_cases(options.rounds, options.seed, options.engine, options.device, tuple(options.kinds))
    print(write_cases(options.folder, cases), "cases")


if __name__ == "__main__":
    main()
