"""By which point is a garment held? How well that is told, on generated cases: ``python benchmarks/holds.py --help``.

A case is a garment that was lifted from a table by one layer and hangs free, seen by one camera or by two at a right
angle. Nuno makes it with other measures (up to 3 % off), other cells and steps, and a material, a layer and a point at
random; the estimator imagines the garment of nominal measures falling in the air. Edges of masks are displaced by
smooth noise, as in ``generated_cases``. With --mujoco, cases are made with MuJoCo's flex, where it is installed.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from generated_cases import HAND_RADIUS, displaced, looking_at
from processes import in_processes

import nuno
from nuno.camera.camera import Camera
from nuno.estimate.hold_views import hold_masks
from nuno.estimate.imagined_holds import HoldGuess, Holds, begin

GARMENTS = ("sock", "t-shirt", "trousers")
CELL = {"t-shirt": 0.055, "trousers": 0.06, "sock": 0.025, "skirt": 0.04, "pullover": 0.045, "apron": 0.045}
"""[m] Of the estimator's garments; cases have 0.8 of it."""
SPACING = {"sock": 0.05}
USUAL_SPACING = 0.12
OFF = 0.03
HAND = np.array((0.0, 0.0, 1.4))
SUBSTEPS = 24


@dataclass
class HoldCase:
    """What an estimator may see, and the truth: the place in the flat garment and the layer."""

    garment: str
    cameras: list[Camera]
    masks: list[np.ndarray]
    place: np.ndarray
    layer: int


def two_cameras(rng: np.random.Generator, size: float) -> list[Camera]:
    """Two cameras at a right angle about the hand, from about the height of what hangs."""
    yaw, found = rng.uniform(0, 2 * np.pi), []
    for turn in (0.0, np.pi / 2):
        away = 1.9 * size * rng.uniform(0.9, 1.1)
        target = HAND - (0.0, 0.0, 0.42 * size)
        way = np.array((away * np.cos(yaw + turn), away * np.sin(yaw + turn), rng.uniform(-0.1, 0.35) * size))
        eye = target + way
        found.append(looking_at(eye, target, 480.0))
    return found


def varied(name: str, rng: np.random.Generator, cell: float) -> nuno.Garment:
    """The garment with other cells, its measures a little off."""
    usual = nuno.garment(name).measures
    return nuno.garment(name, cell=cell, **{key: v * rng.uniform(1 - OFF, 1 + OFF) for key, v in usual.items()})


def as_seen(name: str, garment: nuno.Garment, hanging: np.ndarray, vertices: np.ndarray, rng: Any) -> list[HoldCase]:
    """Cases of garments that hang from (0, 0, 0), (k, n, 3), held by vertices (k,)."""
    size = float(np.ptp(garment.rest[:, :2], axis=0).max())
    finite = np.isfinite(hanging).all(axis=(1, 2))[None]
    holds = Holds(garment, vertices, (HoldGuess(1e-4),), hanging[None].astype(np.float32), finite, "cpu")
    cases = []
    for k, vertex in enumerate(vertices):
        cameras, masks = two_cameras(rng, size), []
        for camera in cameras:
            mask = hold_masks(holds, [(0, k)], [0.0], camera, HAND)[0]
            u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
            centre, reach = camera.project(HAND), HAND_RADIUS * camera.fx / camera.depth_of(HAND)
            cover = (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= reach**2
            masks.append(displaced(mask & ~cover, rng, cover))
        cases.append(HoldCase(name, cameras, masks, garment.rest[vertex, :2], int(garment.layer[vertex])))
    return cases


def from_nuno(name: str, count: int, seed: int, device: str) -> list[HoldCase]:
    """Garments lifted from a table by Nuno, each by one layer, which lies above."""
    rng = np.random.default_rng((seed, *name.encode()))
    garment = varied(name, rng, 0.8 * CELL[name])
    vertices = rng.choice(len(garment.vertices), count, replace=False)
    world = nuno.World(device=device, substeps=SUBSTEPS)
    logging.getLogger("nuno").setLevel(logging.ERROR)  # it tells that these steps make the cloth softer
    world.add(nuno.plane(name="table", friction=0.4))
    body = world.add(garment.body())
    futures = world.imagine(count)
    cloth = futures.find(body.name)
    futures.attach(cloth, nuno.Cloth(
        bending_rigidity=np.exp(rng.uniform(np.log(1.5e-5), np.log(4e-4), count)),
        area_density=rng.uniform(0.12, 0.3, count), friction=rng.uniform(0.2, 0.7, count),
        thickness=rng.uniform(0.002, 0.004, count), air_drag=rng.uniform(1.0, 3.0, count),
    ))  # fmt: skip
    start = np.stack([begin(garment, int(v), False) for v in vertices])
    start[..., 2] += 0.0025 - start[..., 2].min(axis=1, keepdims=True)
    futures.set_vertices(cloth, start)
    held = start[np.arange(count), vertices]
    lift = float(np.ptp(garment.rest[:, :2], axis=0).max()) * 1.35
    way = np.stack([held, held + np.array((0.0, 0.0, lift))], axis=1)
    futures.grip(cloth, vertices[:, None], to=nuno.Path((0.0, 2.0), way, None, "minimum_jerk"))
    futures.run(4.0, progress=False)
    hanging = np.asarray(cloth.vertices)
    hanging = hanging - hanging[np.arange(count), vertices][:, None]
    return as_seen(name, garment, hanging, vertices, rng)


def from_mujoco(name: str, count: int, seed: int) -> list[HoldCase]:
    """Garments that fall in the air by MuJoCo's flex, pinned at one vertex, from lying flat."""
    from mujoco_garment import hang

    rng = np.random.default_rng((seed, 7, *name.encode()))
    garment = varied(name, rng, 1.05 * CELL[name])
    vertices = rng.choice(len(garment.vertices), count, replace=False)
    hanging = np.stack([hang(garment, int(v), rng) for v in vertices])
    return as_seen(name, garment, hanging, vertices, rng)


def judged(case: HoldCase, images: int, holds: Holds) -> dict[str, Any]:
    """One case's line: ranks of the candidate nearest to the truth, and distances on the garment."""
    garment = holds.garment
    result = nuno.estimate_hold(
        garment, case.masks[:images], case.cameras[:images], HAND, holds=holds, hand_radius=HAND_RADIUS
    )  # fmt: skip
    true = garment.nearest(case.place, case.layer)

    def to_nearest(vertex: int) -> np.ndarray:
        """How far candidates are from the nearest point that symmetries make of a vertex."""
        orbit = np.unique([one[vertex] for one in garment.symmetries])
        return garment.distances(orbit).min(axis=0)[holds.candidates]

    exact, alike = garment.distances(true)[holds.candidates], to_nearest(true)
    # whichever layer: that of the point at the same place in the other one
    other = true if garment.layers == 1 or case.layer == 2 else garment.nearest(case.place, 1 - case.layer)
    either = np.minimum(alike, to_nearest(other))
    order = result.order
    firsts = [int(group[np.argmax(result.probabilities[group])]) for group in result.groups]
    step = SPACING.get(case.garment, USUAL_SPACING)
    return {
        "garment": case.garment, "images": images, "rank": int(np.flatnonzero(order == exact.argmin())[0]) + 1,
        "rank_up_to_symmetry": next(k for k, g in enumerate(result.groups) if alike.argmin() in g) + 1,
        "distance": float(exact[order[0]]), "up_to_symmetry": float(alike[order[0]]),
        "either_layer": float(either[order[0]]),
        "top3_up_to_symmetry": float(alike[firsts[:3]].min()), "top3_either_layer": float(either[firsts[:3]].min()),
        "confidence": result.confidence_up_to_symmetry, "overlap": result.overlap, "step": step,
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts over cases: right is within one spacing of candidates on the cloth."""
    within = {
        name: sum(r[name] <= r["step"] for r in rows)
        for name in ("distance", "up_to_symmetry", "either_layer", "top3_up_to_symmetry", "top3_either_layer")
    }
    return {
        "cases": len(rows), "nearest_candidate_first": sum(r["rank_up_to_symmetry"] == 1 for r in rows),
        "nearest_candidate_in_three": sum(r["rank_up_to_symmetry"] <= 3 for r in rows),
        **{f"within_a_spacing_{name}": n for name, n in within.items()},
        "median_distance_m": round(float(np.median([r["up_to_symmetry"] for r in rows])), 3),
        "median_either_layer_m": round(float(np.median([r["either_layer"] for r in rows])), 3),
        "mean_overlap": round(float(np.mean([r["overlap"] for r in rows])), 3),
    }  # fmt: skip


def main() -> None:
    """Make the cases, estimate, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--garments", nargs="+", default=list(GARMENTS), choices=list(CELL))
    parser.add_argument("--count", type=int, default=60, help="cases in all")
    parser.add_argument("--images", type=int, nargs="+", default=[1, 2], choices=[1, 2])
    parser.add_argument("--seed", type=int, default=9000, help="settings were chosen on seeds below 100")
    parser.add_argument("--mujoco", action="store_true", help="cases by MuJoCo's flex in place of Nuno's")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--chunks", type=int, default=1, help="of each garment's cases: other measures each")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each on one core")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    each = max(1, options.count // len(options.garments) // options.chunks)
    parts = [
        (name, each, options.seed + k, options.images, options.mujoco, options.device)
        for k in range(options.chunks)
        for name in options.garments
    ]
    rows: list[dict[str, Any]] = []
    for found, told in in_processes(chunk, parts, options.jobs):
        rows += found
        print(told, flush=True)
        report = {
            f"{name}, {n} images": summary(of)
            for name in (*options.garments, "all")
            for n in options.images
            if (of := [r for r in rows if r["images"] == n and name in ("all", r["garment"])])
        }
        if options.json:
            options.json.write_text(json.dumps(report | {"rows": rows}, indent=1))
    print(json.dumps(report, indent=1))


def chunk(
    name: str, count: int, seed: int, images: list[int], mujoco: bool, device: str
) -> tuple[list[dict[str, Any]], str]:
    """The lines of some cases of a garment, and the CPU seconds that they took."""
    clock = time.process_time()
    cases = from_mujoco(name, count, seed) if mujoco else from_nuno(name, count, seed, device)
    made = time.process_time() - clock
    garment = nuno.garment(name, cell=CELL[name])
    clock = time.process_time()
    holds = nuno.imagine_holds(garment, spacing=SPACING.get(name, USUAL_SPACING), device=device)
    imagined = time.process_time() - clock
    clock = time.process_time()
    rows = [judged(case, n, holds) for n in images for case in cases]
    each = (time.process_time() - clock) / max(len(rows), 1)
    told = f"{name}: CPU s: {len(cases)} cases {made:.0f}, {len(holds.candidates)} candidates {imagined:.0f}"
    return rows, f"{told}, an estimate {each:.2f}"


if __name__ == "__main__":
    main()
