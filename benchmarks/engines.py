"""The same twelve scenes on each engine, by turns in one process: figures against closed forms, time, pictures.

    python benchmarks/engines.py --engines nuno mujoco newton --json engines.json --pictures docs/images/engines

A row is a scene. "prepare" is what passes until the first frame is done (building the engine's model; where kernels
are compiled, that too, so it is told of the last round); CPU and wall seconds are those of all other frames, the median
of the rounds. What an engine lacks or fails at is told in its place.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from engine_scenes import SCENES, EngineScene
from tqdm import tqdm

import nuno

WIDTH, HEIGHT = 240, 200  # [px] of an engine's part of a picture


def run(name: str, engine: str, device: str, look: bool) -> tuple[dict[str, Any], np.ndarray | None]:
    """Run a scene on an engine; the row, and a picture of its end."""
    scene = SCENES[name]
    try:
        begin = time.perf_counter()
        world = nuno.World(device=device, engine=engine)
        measure = scene.build(world)
        world.run(1.0 / world.frame_rate)
        prepared = time.perf_counter() - begin
        wall, cpu = time.perf_counter(), time.process_time()
        world.run(scene.seconds - 1.0 / world.frame_rate)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        value = measure()
    except nuno.NunoError as error:
        return {"scene": name, "engine": engine, "failed": f"{type(error).__name__}: {error}"}, None
    row = {
        "scene": name, "engine": engine, "figure": value, "unit": scene.unit, "expected": scene.expected,
        "off": (value - scene.expected) / scene.scale, "prepare_s": prepared, "wall_s": wall, "cpu_s": cpu,
        "simulated_s": scene.seconds - 1.0 / 60.0,
    }  # fmt: skip
    return row, picture(world, scene, engine) if look else None


def picture(world: nuno.World, scene: EngineScene, title: str) -> np.ndarray:
    """Return a labelled picture (h, w, 3) uint8 of a world."""
    import cv2

    camera = nuno.Camera.look_at(scene.eye, scene.target, np.radians(45.0), width=WIDTH, height=HEIGHT)
    image = nuno.take_picture(world, camera, samples=3).color.numpy().copy()
    return cv2.putText(image, title, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (20, 20, 20), 1, cv2.LINE_AA)


def show(rows: list[dict[str, Any]], engines: list[str]) -> None:
    """Print a table of figures and one of times."""
    by = {(row["scene"], row["engine"]): row for row in rows}
    names = list(dict.fromkeys(row["scene"] for row in rows))
    print(f"\n| scene | figure | closed form | {' | '.join(engines)} |\n|{'---|' * (3 + len(engines))}")
    for name in names:
        scene = SCENES[name]
        unit = "" if scene.unit == "1" else f" {scene.unit}"
        cells = [_figure(by.get((name, engine))) for engine in engines]
        print(f"| {name} | {scene.figure} | {scene.expected:.3g}{unit}: {scene.source} | {' | '.join(cells)} |")
    print(f"\n| CPU s for s simulated; prepare | {' | '.join(engines)} |\n|{'---|' * (1 + len(engines))}")
    for name in names:
        cells = [_seconds(by.get((name, engine))) for engine in engines]
        print(f"| {name} ({SCENES[name].seconds:g} s) | {' | '.join(cells)} |")
    failures = [row for row in rows if "failed" in row]
    for row in failures:
        print(f"\n{row['scene']} on {row['engine']}: {row['failed']}")


def _figure(row: dict[str, Any] | None) -> str:
    if row is None or "failed" in row:
        return "no" if row else ""
    return f"{row['figure']:.3g} ({100 * row['off']:+.1f} %)"


def _seconds(row: dict[str, Any] | None) -> str:
    return "no" if row is None or "failed" in row else f"{row['cpu_s']:.2f}; {row['prepare_s']:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["nuno", "mujoco", "newton"])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--json", type=Path, help="write the figures there")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="write a picture of each scene there")
    given = parser.parse_args()
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    turns = [(turn, name, engine) for turn in range(given.rounds) for name in given.scenes for engine in given.engines]
    parts: dict[str, list[np.ndarray]] = {}
    for turn, name, engine in tqdm(turns, file=sys.stderr, disable=None):
        last = turn == given.rounds - 1
        row, image = run(name, engine, given.device, look=last and given.pictures is not None)
        found.setdefault((name, engine), []).append(row)
        if image is not None:
            parts.setdefault(name, []).append(image)
        if given.json:  # as far as it is, for a run that is ended early
            write(given.json, given.rounds, [merged(these) for these in found.values()])
        if name in parts:
            given.pictures.mkdir(parents=True, exist_ok=True)
            save(np.hstack(parts[name]), given.pictures / f"{name.replace(' ', '-')}.webp")
    rows = [merged(these) for these in found.values()]
    show(rows, given.engines)


def write(path: Path, rounds: int, rows: list[dict[str, Any]]) -> None:
    """Write the figures as JSON."""
    machine = {"cpu": platform.machine(), "python": platform.python_version(), "nuno": nuno.__version__}
    path.write_text(json.dumps({"machine": machine, "rounds": rounds, "rows": rows}, indent=1))


def merged(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a row for all rounds: median times, figures of the last."""
    last = rows[-1]
    if "failed" in last:
        return last
    return last | {key: statistics.median(row[key] for row in rows) for key in ("wall_s", "cpu_s")}


def save(image: np.ndarray, path: Path) -> None:
    """Write an image as WebP, small enough for the documentation."""
    from PIL import Image

    Image.fromarray(image).save(path, quality=80, method=6)


if __name__ == "__main__":
    main()
