"""Picked cloths of any outline, made with Nuno's own engine on triangles of another size and with another step.

A scene is one flat cloth cut as a garment's front, an L, or a towel with round corners, on one table before one camera.
Masks only, their edges displaced by smooth noise as in ``generated_cases``. Garments may have both layers, of which the
upper one is picked. ``python benchmarks/outline_cases.py --help`` tells how well they are estimated.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import json
import logging
import time
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from generated_cases import HAND_RADIUS, REST_HEIGHT, displaced, looking_at
from pick_stages import NAMES, stages_named
from processes import in_processes

from nuno import Cloth, Path, World, box, cloth_mesh, estimate_pick, garment, plane
from nuno.camera.camera import Camera
from nuno.camera.table import Table
from nuno.mesh.triangulated import triangulate

SHAPES = ("t-shirt", "trousers", "sock", "apron", "L", "towel")
OTHERS = ("pullover", "skirt")
SUBSTEPS = 35
SCALE = {
    "t-shirt": 0.8, "trousers": 0.7, "sock": 1.2, "apron": 0.75, "L": 1.0, "towel": 0.9, "pullover": 0.7, "skirt": 0.8,
}  # fmt: skip
RIGIDITIES = {"usual": (2e-5, 1e-3), "wide": (5e-6, 3e-3)}
"""Least and largest bending rigidity [N m]."""
DENSITIES = {"usual": (0.1, 0.3), "wide": (0.08, 0.4)}
"""The same of the area density [kg/m2]."""


@dataclass
class OutlineCase:
    """One pick: what an estimator may see, and the truth."""

    shape: str
    camera: Camera
    table: Table
    hand: np.ndarray
    mask_before: np.ndarray
    mask_after: np.ndarray
    picked: np.ndarray
    """(3,) where the picked point was [m]."""
    area: float


def cut(shape: str, rng: np.random.Generator, layers: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (n, 3), faces (m, 3) and rest (n, 3) of a flat cloth around the origin, upper vertices first."""
    size = SCALE[shape] * scale
    if shape == "L":
        a, b, c, d = 0.5 * size, 0.45 * size, 0.2 * size, 0.18 * size
        points, faces, _ = triangulate(np.array([(0, 0), (a, 0), (a, c), (d, c), (d, b), (0, b)]), 0.023 * size)
        flat = np.pad(points - points.mean(axis=0), ((0, 0), (0, 1)))
        return flat, faces, flat
    usual = garment(shape)
    sizes = {
        name: value * (1.0 if name == "slope" else size * rng.uniform(0.93, 1.07))
        for name, value in usual.measures.items()
    }
    made = garment(shape, cell=0.027 * size**0.5, **sizes)
    if layers == 2 or made.layers == 1:
        return made.vertices, made.faces, made.rest
    front = made.faces[made.face_layer == 0]
    used = np.unique(front)
    number = np.zeros(len(made.rest), dtype=int)
    number[used] = np.arange(len(used))
    return made.rest[used], number[front], made.rest[used]


def generate(
    shapes: tuple[str, ...], picks: int, seed: int, device: str = "cpu", layers: int = 1, materials: str = "usual"
) -> list[OutlineCase]:
    """Make ``picks`` cases of each shape; the same seed makes the same cases on one device."""
    cases: list[OutlineCase] = []
    for k, shape in enumerate(shapes):
        rng = np.random.default_rng((seed, k))
        made: list[OutlineCase] = []
        while not made:
            made = _scene(shape, rng, picks, device, layers, materials)
        cases += made
    return cases


def _scene(
    shape: str, rng: np.random.Generator, picks: int, device: str, layers: int, materials: str
) -> list[OutlineCase]:
    table = Table(rng.uniform(0.70, 0.76), (0.5, 0.65), (0.1, 0.0))
    eye = np.array([rng.uniform(-1.0, -0.8), rng.uniform(-0.12, 0.14), table.height + rng.uniform(0.55, 0.75)])
    camera = looking_at(eye, np.array([0.1, 0.0, table.height + 0.1]), rng.uniform(430, 520))
    vertices, faces, rest = cut(shape, rng, layers, rng.uniform(0.9, 1.05))
    yaw = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    low = table.height + REST_HEIGHT - vertices[:, 2].min()
    placed = vertices @ turn.T + (rng.uniform(0.02, 0.12), rng.uniform(-0.05, 0.05), low)
    pixels = camera.project(placed)
    if pixels.min() < 10 or (pixels > (629, 469)).any():
        return []
    world = World(device=device, substeps=SUBSTEPS)
    logging.getLogger("nuno").setLevel(logging.ERROR)  # it tells that these steps make a stiff cloth softer
    world.add(box((1.0, 1.3, table.thickness), name="table", position=(0.1, 0.0, table.height - table.thickness / 2)))
    world.add(plane(name="floor"))
    cloth = world.add(cloth_mesh(placed, faces, rest, name="cloth"))
    before = world.masks(camera, cloth).numpy()
    futures = world.imagine(picks)
    body = futures.find("cloth")
    material = dict(
        bending_rigidity=np.exp(rng.uniform(*np.log(RIGIDITIES[materials]), picks)),
        area_density=rng.uniform(*DENSITIES[materials], picks), friction=rng.uniform(0.2, 0.8, picks),
        thickness=rng.uniform(0.002, 0.0045, picks), air_drag=rng.uniform(0.5, 3.0, picks),
    )  # fmt: skip
    futures.find("table").friction = futures.find("floor").friction = material["friction"]
    futures.attach(body, Cloth(**material))
    upper = np.flatnonzero(placed[:, 2] > placed[:, 2].max() - 0.004)
    vertex = rng.choice(upper, picks, replace=False)
    begin = placed[vertex]
    angle, reach = rng.uniform(0, 2 * np.pi, picks), rng.uniform(0.0, 0.12, picks)
    hand = begin + np.stack([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.3, 0.5, picks)], axis=1)
    futures.grip(body, vertex[:, None], to=Path((0.1, 1.6), np.stack([begin, hand], axis=1), None, "minimum_jerk"))
    futures.run(1.6 + rng.uniform(1.5, 2.5), progress=False)
    after = futures.masks(camera, body).numpy().reshape(picks, camera.height, camera.width)
    area = 0.5 * np.linalg.norm(np.cross(*(rest[faces[:, k]] - rest[faces[:, 0]] for k in (1, 2))), axis=1).sum()
    cases = []
    for k in range(picks):
        u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        centre, radius = camera.project(hand[k]), HAND_RADIUS * camera.fx / camera.depth_of(hand[k])
        cover = (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= radius**2
        rim = np.concatenate([after[k][0], after[k][-1], after[k][:, 0], after[k][:, -1]])
        if rim.any() or after[k].sum() < 300:
            continue
        cases.append(OutlineCase(
            shape, camera, table, hand[k], displaced(before, rng), displaced(after[k] & ~cover, rng, cover), begin[k],
            float(area),
        ))  # fmt: skip
    return cases


def judged(case: OutlineCase, device: str, stages: str) -> dict[str, Any]:
    """One case's line: how far the answer, the best of three and the nearest candidate are from the truth [m]."""
    gc.collect()  # what the case before left takes a gigabyte before Python looks for it
    clock, others = time.process_time(), stages_named(stages)
    result = estimate_pick(
        None, None, camera=case.camera, table_height=case.table.height, table_half_extents=case.table.half_extents,
        table_centre=case.table.centre, hand=case.hand, before_mask=case.mask_before, after_mask=case.mask_after,
        shape="outline", device=device, progress=False, **({} if others is None else {"discretisations": others}),
    )  # fmt: skip
    places = result.rectangle.world_positions(result.fractions)  # type: ignore[attr-defined]
    away = np.linalg.norm(places - case.picked, axis=1)[result.order]
    return {
        "shape": case.shape, "stages": stages, "candidates": len(away), "distance": float(away[0]),
        "of_three": float(away[:3].min()), "nearest": float(away.min()), "rank": int(away.argmin()) + 1,
        "confidence": result.confidence, "cpu_s": round(time.process_time() - clock, 1),
    }  # fmt: skip


def scene(
    shape: str, picks: int, seed: int, device: str, layers: int, materials: str, stages: list[str]
) -> list[dict[str, Any]]:
    """The lines of a scene's cases, each by all the stages by turns."""
    made = generate((shape,), picks, seed, device, layers, materials)
    return [judged(case, device, name) | {"seed": seed} for case in made for name in stages]


def main() -> None:
    """Make cases, estimate, print a line of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", nargs="+", default=list(SHAPES), choices=SHAPES + OTHERS)
    parser.add_argument("--scenes", type=int, default=4, help="of each shape")
    parser.add_argument("--picks", type=int, default=1, help="of each scene")
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--layers", type=int, default=1, choices=[1, 2], help="of garments that have two")
    parser.add_argument("--materials", choices=list(RIGIDITIES), default="usual", help="how far they differ")
    parser.add_argument("--stages", nargs="+", choices=NAMES, default=["now"], help="of pick_stages.py")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each on one core")
    parser.add_argument("--json", type=FilePath)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    parts = [
        (shape, options.picks, options.seed + k, options.device, options.layers, options.materials, options.stages)
        for k in range(options.scenes)
        for shape in options.shapes
    ]
    for found in in_processes(scene, parts, options.jobs):
        rows += found
        for row in found:
            print(row, flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))
    for name, shape in itertools.product(options.stages, (*options.shapes, None)):
        of = [r for r in rows if r["stages"] == name and shape in (None, r["shape"])]
        if of:
            print({"stages": name, "shape": shape or "all", **summary(of)})


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts and means over cases."""
    sure = [r for r in rows if r["confidence"] >= 0.8]
    return {
        "cases": len(rows), "nearest_first": sum(r["rank"] == 1 for r in rows),
        "nearest_in_three": sum(r["rank"] <= 3 for r in rows),
        "within_5_cm": sum(r["distance"] <= 0.05 for r in rows),
        "of_three_within_5_cm": sum(r["of_three"] <= 0.05 for r in rows),
        "sure": len(sure), "sure_within_5_cm": sum(r["distance"] <= 0.05 for r in sure),
        "mean_confidence": round(float(np.mean([r["confidence"] for r in rows])), 2),
        "median_distance_m": round(float(np.median([r["distance"] for r in rows])), 3),
        "median_cpu_s": round(float(np.median([r["cpu_s"] for r in rows])), 1),
    }  # fmt: skip


if __name__ == "__main__":
    main()
