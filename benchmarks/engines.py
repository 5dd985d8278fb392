"""The same twelve scenes on each engine, by turns in one process: figures against closed forms, time, pictures.

    python benchmarks/engines.py --engines nuno mujoco newton --json engines.json --pictures docs/images/engines

A row is a scene. "prepare" is what passes until the first frame is done (building the engine's model; where kernels
are compiled, that too, so it is told of the last round); CPU and wall seconds are those of all other frames, the median
of the rounds. What an engine lacks or fails at is told in its place. An engine that has no CUDA runs on the CPU where
``--device`` asks for CUDA.

A run that was interrupted goes on where it ended when the same command is given again: ``--json`` has each round of
each scene that is done.
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
    if device.startswith("cuda") and "cuda" not in nuno.engine_capabilities(engine):
        device = "cpu"
    row: dict[str, Any] = {"scene": name, "engine": engine, "device": device}
    try:
        begin = time.perf_counter()
        world = nuno.World(device=device, engine=engine)
        measure = scene.build(world)
        world.run(1.0 / world.frame_rate)
        wait(device)
        prepared = time.perf_counter() - begin
        wall, cpu = time.perf_counter(), time.process_time()
        world.run(scene.seconds - 1.0 / world.frame_rate)
        wait(device)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        value = measure()
        row |= {
            "figure": value, "unit": scene.unit, "expected": scene.expected,
            "off": (value - scene.expected) / scene.scale, "prepare_s": prepared, "wall_s": wall, "cpu_s": cpu,
            "simulated_s": scene.seconds - 1.0 / world.frame_rate,
        }  # fmt: skip
        return row, picture(world, scene, engine) if look else None
    except Exception as error:  # the other engines and scenes go on
        return row | {"failed": f"{type(error).__name__}: {error}"}, None


def wait(device: str) -> None:
    """Wait until a GPU is done."""
    if device.startswith("cuda"):
        import warp as wp

        wp.synchronize_device(device)


def picture(world: nuno.World, scene: EngineScene, title: str) -> np.ndarray:
    """Return a labelled picture (h, w, 3) uint8 of a world."""
    import cv2

    camera = nuno.Camera.look_at(scene.eye, scene.target, np.radians(45.0), width=WIDTH, height=HEIGHT)
    image = nuno.take_picture(world, camera, samples=3).color.numpy().copy()
    return cv2.putText(image, title, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (20, 20, 20), 1, cv2.LINE_AA)


def told(row: dict[str, Any]) -> str:
    """Return a run in a line."""
    if "failed" in row:
        return str(row["failed"])
    return f"{_figure(row)}, CPU {row['cpu_s']:.2f} s, wall {row['wall_s']:.2f} s, prepare {row['prepare_s']:.2f} s"


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
    print(f"\n| CPU s; wall s; prepare s | {' | '.join(engines)} |\n|{'---|' * (1 + len(engines))}")
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
    if row is None or "failed" in row:
        return "no" if row else ""
    return f"{row['cpu_s']:.2f}; {row['wall_s']:.2f}; {row['prepare_s']:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["nuno", "mujoco", "newton"])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--json", type=Path, help="write the figures there, and go on with those that are there")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="write a picture of each scene there")
    given = parser.parse_args()
    settings = {
        "machine": {"cpu": platform.machine(), "python": platform.python_version(), "nuno": nuno.__version__},
        "engines": given.engines, "device": given.device,
    }  # fmt: skip
    runs = done(given.json, settings)
    turns = [(turn, name) for turn in range(given.rounds) for name in given.scenes]
    with tqdm(total=len(turns) * len(given.engines), file=sys.stderr, disable=None) as bar:
        for turn, name in turns:
            last = turn == given.rounds - 1
            path = given.pictures / f"{name.replace(' ', '-')}.webp" if last and given.pictures else None
            if any(row["round"] == turn and row["scene"] == name for row in runs) and (path is None or path.exists()):
                bar.update(len(given.engines))
                continue
            rows, parts = [], []
            for engine in given.engines:
                row, image = run(name, engine, given.device, look=path is not None)
                rows.append(row | {"round": turn})
                parts += [] if image is None else [image]
                tqdm.write(f"round {turn + 1}, {name} on {engine}: {told(row)}", file=sys.stderr)
                bar.update()
            runs = [row for row in runs if (row["round"], row["scene"]) != (turn, name)] + rows
            if given.json:
                write(given.json, settings, runs)
            if path is not None and parts:
                path.parent.mkdir(parents=True, exist_ok=True)
                save(np.hstack(parts), path)
    show(merged(runs), given.engines)


def done(path: Path | None, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of all rounds that a file has, where it was written with the same settings."""
    if path is None or not path.exists():
        return []
    found = json.loads(path.read_text())
    if any(found.get(key) != value for key, value in settings.items()):
        sys.exit(f"{path} is of another machine, device or other engines; name another file")
    rows: list[dict[str, Any]] = found["runs"]
    return rows


def write(path: Path, settings: dict[str, Any], runs: list[dict[str, Any]]) -> None:
    """Write the figures as JSON: "rows" for all rounds, "runs" each for itself."""
    whole = path.with_name(path.name + ".part")
    whole.write_text(json.dumps(settings | {"rows": merged(runs), "runs": runs}, indent=1))
    whole.replace(path)


def merged(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for all rounds of each scene and engine: median times, figures of the last."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in sorted(runs, key=lambda row: row["round"]):
        found.setdefault((row["scene"], row["engine"]), []).append(row)
    return [_median(found[key]) for key in sorted(found, key=lambda key: list(SCENES).index(key[0]))]


def _median(rows: list[dict[str, Any]]) -> dict[str, Any]:
    last = rows[-1]
    if any("failed" in row for row in rows):
        return last
    return last | {key: statistics.median(row[key] for row in rows) for key in ("wall_s", "cpu_s")}


def save(image: np.ndarray, path: Path) -> None:
    """Write an image as WebP, small enough for the documentation."""
    from PIL import Image

    Image.fromarray(image).save(path, quality=80, method=6)


if __name__ == "__main__":
    main()
