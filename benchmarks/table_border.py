"""How well a table's border tells a camera or a height that is told wrongly: ``python benchmarks/table_border.py``.

Scenes of ``varied_cases.py`` (ordinary, clutter, checks, dark, a low camera) are drawn by Nuno's renderer, a flat cloth
on the table; nothing is simulated. Each is told as it is, with errors that are ordinary, and with one mistake: a camera
that is tilted, rolled, of another focal length, a table of another height, or of other extents. Judged by what is taken
for wrong, and by how far points on the table and 0.2 m above are seen from where they are (root mean square), before
and after.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import warp as wp
from processes import in_processes
from varied_cases import Scene, make_look, make_scene, photograph

from nuno.camera.camera import Camera
from nuno.camera.camera_of_table import corrected, view_of_table
from nuno.camera.table import Table

KINDS = ("ordinary", "clutter", "checks", "dark", "ordinary", "low_camera")
TOLD = ("as it is", "ordinary errors", "tilt", "roll", "height", "focal", "extents")
TURN = (1.0, 3.0)  # [degrees] of a camera that is tilted or rolled
HEIGHT = (0.01, 0.03)  # [m] of a table that is told too high or low
FOCAL = (0.05, 0.1)
EXTENTS = (0.02, 0.04)  # [m] of half extents, both of which are told too large or too small
ORDINARY = {"turn": 0.25, "focal": 0.008, "height": 0.004, "extents": 0.005}  # [degrees], [m]: standard deviations


def told(scene: Scene, what: str, rng: np.random.Generator) -> tuple[Camera, Table]:
    """Camera and table as they are told."""
    camera, table, sign = scene.camera, scene.table, float(rng.choice((-1.0, 1.0)))
    turn, focal, height, extents = np.zeros(3), 0.0, 0.0, np.zeros((2, 2))
    if what in ("tilt", "roll"):
        turn[0 if what == "tilt" else 2] = sign * rng.uniform(*TURN)
    elif what == "height":
        height = sign * rng.uniform(*HEIGHT)
    elif what == "focal":
        focal = sign * rng.uniform(*FOCAL)
    elif what == "extents":
        extents[0] = sign * rng.uniform(*EXTENTS, 2)
    elif what == "ordinary errors":
        turn, focal = rng.normal(0, ORDINARY["turn"], 3), rng.normal(0, ORDINARY["focal"])
        height, extents = rng.normal(0, ORDINARY["height"]), rng.normal(0, ORDINARY["extents"], (2, 2))
    pose = camera.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.deg2rad(turn))[0]
    half, middle = np.asarray(table.half_extents) + extents[0], np.asarray(table.centre) + extents[1]
    ratio = 1.0 + focal
    return (
        replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio, camera_to_world=pose),
        Table(table.height + height, (float(half[0]), float(half[1])), (float(middle[0]), float(middle[1]))),
    )


def away(scene: Scene, camera: Camera, table: Table) -> float:
    """Root mean square distance [px] of where points over the table are seen from where they are taken to be."""
    axes = np.linspace(-0.2, 0.3, 4), np.linspace(-0.3, 0.3, 4), np.array([0.0, 0.2])
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    up = np.array([0.0, 0.0, 1.0])
    true, taken = (c.project(points + t.height * up) for c, t in ((scene.camera, scene.table), (camera, table)))
    return float(np.sqrt(((true - taken) ** 2).sum(axis=-1).mean()))


def judged(number: int, seed: int) -> list[dict[str, Any]]:
    """The lines of a scene."""
    wp.config.log_level = wp.LOG_ERROR
    logging.disable(logging.WARNING)
    rng = np.random.default_rng((seed, number))
    kind = KINDS[number % len(KINDS)]
    scene = make_scene(rng, kind)
    corners = scene.rectangle.corners
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    vertices = np.array([corners[0] + along * i / 2 + across * j / 2 for j in range(3) for i in range(3)])
    image = photograph(scene, make_look(rng, kind, scene), vertices, (2, 2), None, int(rng.integers(2**31)))
    rows = []
    for what in TOLD:
        camera, table = told(scene, what, rng)
        clock = time.process_time()
        view = view_of_table(image, camera, table)
        row = {"scene": number, "kind": kind, "told": what, "cpu_s": time.process_time() - clock}
        before = away(scene, camera, table)
        taken = (camera, table) if view is None else corrected(camera, table, view.errors)
        names = "not seen" if view is None else " and ".join(view.mistakes) or "nothing"
        if view is not None and not view.is_clear:
            names += " or else"
        rows.append(row | {"taken": names, "before_px": before, "after_px": away(scene, *taken)})
    return rows


def main() -> None:
    """Draw, ask, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=30, help="scenes")
    parser.add_argument("--seed", type=int, default=700, help="constants were chosen on 600")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each on one core")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for found in in_processes(judged, [(k, options.seed) for k in range(options.count)], options.jobs):
        rows += found
    print("| told | scenes | taken for wrong | px before: mean, worst | after: mean, worst | CPU s |")
    print("|---|---|---|---|---|---|")
    for what in TOLD:
        of = [r for r in rows if r["told"] == what]
        seen = [r for r in of if r["taken"] != "not seen"] or of
        counts = "; ".join(f"{name} {n}" for name, n in Counter(r["taken"] for r in of).most_common())
        before, after = ([r[f"{when}_px"] for r in seen] for when in ("before", "after"))
        figures = f"{np.mean(before):.1f}, {max(before):.1f} | {np.mean(after):.1f}, {max(after):.1f}"
        print(f"| {what} | {len(of)} | {counts} | {figures} | {np.mean([r['cpu_s'] for r in of]):.2f} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
