"""How well folds of cloths from limp to stiff are replayed: ``python benchmarks/folds.py``.

Nuno's own engine folds each cloth on a finer mesh and with a shorter step than the replay's; true masks are compared.
One line a fold: the bending rigidity, the mean overlap of the best limp preset and of the best of all materials.
With ``--cases DIR``, folders as `nuno.read_fold_case` reads them, which have true masks (mask_NNN.png by frame).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from generated_cases import REST_HEIGHT, looking_at
from processes import in_processes

import nuno
from nuno.camera.image import read_image
from nuno.estimate.fold import MATERIALS

CELL = 0.0165  # [m] about; a replay has 0.02 and more
SUBSTEPS = 30
TOP = 0.72  # [m]
HALF = (0.45, 0.6)  # [m]
EVERY = 6  # frames of 1/30 s between two that are compared


def hand_paths(size: np.ndarray, reach: float, seconds: float) -> list[nuno.HandPath]:
    """Two hands that carry the corners at -x over by a share of the cloth's length, and let go then."""
    times = np.arange(0.0, seconds + 0.9, 1 / 30)
    s = np.clip(times / seconds, 0.0, 1.0)
    angle = np.pi * s**3 * (10.0 + s * (6.0 * s - 15.0))
    radius = 0.5 * reach * size[0]
    x, z = -size[0] / 2 + radius * (1.0 - np.cos(angle)), radius * np.sin(angle) + 0.006 * s
    return [
        nuno.HandPath(
            times, np.stack([x, np.full_like(x, y), TOP + REST_HEIGHT + z], axis=1), times < seconds + 0.15
        )
        for y in (-size[1] / 2, size[1] / 2)
    ]  # fmt: skip


def one_fold(seed: tuple[int, int], rigidity: float, device: str) -> dict[str, Any]:
    """Fold one cloth and replay it."""
    wp.config.log_level = wp.LOG_ERROR
    rng = np.random.default_rng(seed)
    size = np.array([rng.uniform(0.4, 0.55), rng.uniform(0.3, 0.38)])
    material = {
        "bending_rigidity": rigidity, "area_density": float(rng.uniform(0.15, 0.35)),
        "friction": float(rng.uniform(0.25, 0.65)), "air_drag": float(rng.uniform(0.8, 4.0)),
    }  # fmt: skip
    hands = hand_paths(size, float(rng.uniform(0.7, 1.0)), float(rng.uniform(1.3, 1.9)))
    eye = np.array([rng.uniform(-0.95, -0.8), rng.uniform(-0.15, 0.15), TOP + rng.uniform(0.5, 0.7)])
    camera = looking_at(eye, np.array([0.0, 0.0, TOP]), rng.uniform(450, 550))
    world = nuno.World(device=device, substeps=SUBSTEPS)
    world.add(nuno.box((2 * HALF[0], 2 * HALF[1], 0.04), name="table", position=(0, 0, TOP - 0.02)))
    cells = tuple(int(n) for n in np.round(size / CELL))
    cloth = world.add(nuno.sheet(size, cells=cells, position=(0, 0, TOP + REST_HEIGHT)))
    first = world.masks(camera, cloth).numpy()
    world.attach(cloth, nuno.Cloth(stretch_stiffness=3000.0, thickness=2 * REST_HEIGHT, **material))
    corners = [int((cloth.vertices[:, :2] @ (1.0, sign)).argmin()) for sign in (1.0, -1.0)]
    held = [
        world.grip(cloth, [corner], to=nuno.Path(hand.times, hand.positions))
        for corner, hand in zip(corners, hands, strict=True)
    ]
    masks = {}
    for k, t in enumerate(hands[0].times):
        if held and not hands[0].held[k]:
            for grip in held:
                grip.release()
            held = []
        world.run(max(t - world.time, 0.0), progress=False)
        if k % EVERY == 0:
            masks[k] = world.masks(camera, cloth).numpy()
    result = nuno.replay_fold(
        None, hands, camera=camera, table_height=TOP, table_half_extents=HALF, table_centre=(0, 0), first_mask=first,
        masks=masks, hand_radius=0.0, device=device, progress=False,
    )  # fmt: skip
    limp = max(score for name, score in result.scores.items() if name.split(",")[0] in MATERIALS)
    return material | {
        "limp": round(limp, 3), "all": round(max(result.scores.values()), 3), "kept": result.material_name,
        "warnings": result.warnings,
    }  # fmt: skip


def one_case(folder: Path, device: str) -> dict[str, Any]:
    """Replay a folder's fold, and compare it with the true masks."""
    case = nuno.read_fold_case(folder)
    result = case.replay(device=device, progress=False)
    overlaps = {}
    for k, mask in enumerate(result.masks):
        path = folder / f"mask_{k:03d}.png"
        if path.is_file():
            true = read_image(path)[..., 0] > 127
            overlaps[k] = float((true & mask).sum() / max((true | mask).sum(), 1))
    values = list(overlaps.values())
    return {
        "case": folder.name, "frames": len(values), "mean": float(np.mean(values)), "last": values[-1],
        "lowest": min(values), "kept": result.material_name, "warnings": result.warnings,
    }  # fmt: skip


def main() -> None:
    """Fold and replay."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10, help="folds, from 1e-5 to 1e-3 N m in even steps of the log")
    parser.add_argument("--seed", type=int, default=40)
    parser.add_argument("--cases", type=Path, help="folder of folders with true masks, in place of folds made here")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each on one core")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    rows = []
    if options.cases:
        for folder in sorted(p for p in options.cases.iterdir() if (p / "input.json").is_file()):
            rows.append(one_case(folder, options.device))
            print(rows[-1], flush=True)
            if options.json:
                options.json.write_text(json.dumps(rows, indent=1))
        return
    rigidities = np.geomspace(1e-5, 1e-3, options.count).tolist()
    parts = [((options.seed, k), rigidity, options.device) for k, rigidity in enumerate(rigidities)]
    for row in in_processes(one_fold, parts, options.jobs):
        rows.append(row)
        told = f"limp {row['limp']:.3f}, all {row['all']:.3f} ({row['kept']})"
        print(f"{row['bending_rigidity']:.1e} N m: {told}", flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))
    best = np.array([row["all"] for row in rows])
    print(f"{(best >= 0.95).sum()} of {len(best)} at 0.95 or more; mean {best.mean():.3f}, least {best.min():.3f}")


if __name__ == "__main__":
    main()
