"""How well a cloth is followed through images, beside physics without images and a tracker without physics.

The truth is made by engines (``moving_cloths.py``) and seen as depth and masks with noise, or as masks alone, at 10 Hz
(``--rate``). The follower begins 4 mm and 0.7 degrees off, with another material, mesh and substep, and knows the
hands' paths with an error of 2 mm. "hidden": for a second a board that its world does not have hides half of the cloth.

Run: python benchmarks/following.py [--engines nuno mujoco newton] [--motions fold ...] [--device cuda:0] [--strip FILE]
With ``--unseen 11 12 13`` (seeds) cloths, hands and the camera's place are drawn anew: sequences on which nothing was
chosen.
Trackers: "follow", "masks" (the same without depth), "futures" (six materials in a batch), "open loop", and "cpd"
(coherent point drift, Myronenko and Song 2010, by the package pycpd: pip install pycpd), from frame to frame.
"""

from __future__ import annotations

import argparse
import itertools
import json
import logging
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
from moving_cloths import CELLS, ENGINES, MOTIONS, RADIUS, TOP, Motion, motion, resampled, truth
from processes import in_processes

import nuno

OWN_CELLS = (16, 12)
HIDDEN = (1.3, 2.3)  # [s] when a board hides half of the cloth
NOISE = 0.002  # [m] of the depth at one metre, growing with its square
OFFSET, TURN, HAND_ERROR = (0.006, -0.005), 0.02, (0.0012, -0.0012, 0.001)
CAMERA = nuno.Camera.look_at((-0.15, -0.7, TOP + 0.75), (0.0, 0.0, TOP + 0.1), 0.75, width=320, height=240)
TRACKERS = ("follow", "masks", "futures", "open loop", "cpd")
GUESSES = tuple(
    nuno.Cloth(bending_rigidity=bending, area_density=density)
    for bending in (1e-5, 5e-5, 2e-4)
    for density in (0.2, 0.3)
)


def camera_of(seed: int | None) -> nuno.Camera:
    """Return the camera; with a seed, where it draws it."""
    if seed is None:
        return CAMERA
    x, y, z, turn = np.random.default_rng([seed, 99]).uniform((-0.1, 0.6, 0.6, -1.0), (0.1, 0.85, 0.95, 1.0))
    eye = np.array((np.sin(turn) * y + x, -np.cos(turn) * y, TOP + z))
    return nuno.Camera.look_at(eye, (0.0, 0.0, TOP + 0.1), 0.85, width=320, height=240)


def seen(engine: str, name: str, hidden: bool, seed: int | None = None, rate: int = 10) -> dict[str, Any]:
    """Return the truth of a sequence at the images' times, and the images: masks, depths [m] and what is hidden."""
    times, vertices = truth(engine, name, seed)
    hands_, camera = motion(name, seed), camera_of(seed)
    every = round((len(times) - 1) / times[-1] / rate)
    times, vertices = times[::every], vertices[::every]
    world = nuno.World(device="cpu")
    world.add(nuno.box((1.2, 1.2, 0.04), name="table", position=(0, 0, TOP - 0.02)))
    cells = CELLS[engine]
    towel = world.add(nuno.sheet(hands_.size, cells, name="towel", position=(0, 0, TOP + RADIUS[engine])))
    order = np.argsort(_order(towel, vertices[0].reshape(-1, 3)))
    world.attach(towel)
    hands = add_hands(world, hands_, RADIUS[engine], np.zeros(3), follow=False)
    board = world.add(nuno.box((0.4, 0.005, 0.3), name="board", position=(0, 0, -5.0)))
    rng = np.random.default_rng(7)
    masks, depths = [], []
    for time, shape in zip(times, vertices, strict=True):
        world.set_vertices(towel, shape.reshape(-1, 3)[order])
        for body, start, move in zip(hands[0], hands[1], hands_.at(time), strict=True):
            body.locate(start + move)
        if hidden:
            middle = shape.reshape(-1, 3).mean(axis=0)
            eye = camera.camera_to_world[:3, 3]
            at = middle + 0.3 * (eye - middle) + (0.2, 0.0, 0.0)
            board.locate(at if HIDDEN[0] <= time < HIDDEN[1] else (0.0, 0.0, -5.0))
        mask = world.masks(camera, towel).numpy()
        edge = mask ^ _shifted(mask)
        masks.append(mask ^ (edge & (rng.random(mask.shape) < 0.3)))
        depth = world.depth(camera).numpy()
        depth[~np.isfinite(depth)] = np.nan
        depth = depth + NOISE * depth**2 * rng.standard_normal(depth.shape)
        depth[rng.random(depth.shape) < 0.02] = np.nan
        depths.append(depth)
    mine = resampled(vertices, OWN_CELLS)
    covered = np.array([hidden and HIDDEN[0] <= time < HIDDEN[1] for time in times])
    boards = _board_masks(world, board, times, vertices, hidden, camera)
    return {"times": times, "masks": masks, "depths": depths, "truth": mine, "covered": covered, "engine": engine,
            "motion": hands_, "camera": camera, "board_mask": boards}  # fmt: skip


def _board_masks(world: Any, board: Any, times: Any, vertices: Any, hidden: bool, camera: Any) -> list[Any]:
    """Return where the board is in each image, for masks alone, which do not tell it from the table."""
    found = []
    for time, shape in zip(times, vertices, strict=True):
        if not (hidden and HIDDEN[0] <= time < HIDDEN[1]):
            found.append(None)
            continue
        middle, eye = shape.reshape(-1, 3).mean(axis=0), camera.camera_to_world[:3, 3]
        board.locate(middle + 0.3 * (eye - middle) + (0.2, 0.0, 0.0))
        found.append(world.masks(camera, board).numpy())
    return found


def _shifted(mask: np.ndarray) -> np.ndarray:
    return np.roll(mask, 1, axis=0) & np.roll(mask, 1, axis=1) & np.roll(mask, -1, axis=0) & np.roll(mask, -1, axis=1)


def _order(towel: Any, points: np.ndarray) -> np.ndarray:
    """Return which vertex of a flat sheet each of the points (n, 3) is."""
    return np.linalg.norm(towel.vertices[None, :, :2] - points[:, None, :2], axis=-1).argmin(axis=1)


def add_hands(
    world: Any, hands: Motion, radius: float, error: np.ndarray, follow: bool
) -> tuple[list[Any], np.ndarray]:
    """Put balls into a world where the hands of a motion begin; on their paths, if they follow them."""
    starts = add_starts(hands, radius) + error
    balls = []
    for k, start in enumerate(starts):
        ball = world.add(nuno.sphere(0.014, name=f"hand_{k}", position=start))
        if follow:
            world.move(ball, nuno.Path(hands.times, start + hands.moves[k]))
        balls.append(ball)
    return balls, starts


def own_world(hands: Motion, radius: float, blind: bool = False, device: str = "cpu") -> tuple[nuno.World, nuno.Body]:
    """Return the world that a follower has: the table, the hands on their paths, and the cloth about where it is.

    A blind one knows of no hands.
    """
    world = nuno.World(device=device)
    world.add(nuno.box((1.2, 1.2, 0.04), name="table", position=(0, 0, TOP - 0.02)))
    towel = world.add(nuno.sheet(hands.size, OWN_CELLS, name="towel", position=(*OFFSET, TOP + 0.002)))
    towel.rotate(TURN, "z", wrt="world")
    world.attach(towel)
    if blind:
        return world, towel
    balls, starts = add_hands(world, hands, radius, np.array(HAND_ERROR), follow=True)
    for ball, start, way in zip(balls, starts, hands.moves, strict=True):
        world.ignore_contact(towel, ball)
        world.grip(towel, towel.closest(start), to=nuno.Path(hands.times, start + way))
    return world, towel


def track(
    tracker: str, case: dict[str, Any], blind: bool = False, device: str = "cpu", **options: Any
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Return the vertices (k, n, 3) [m] that a tracker tells at the images' times, and its seconds an image.

    Seconds are the CPU's, or by the clock where another device works.
    """
    if tracker == "cpd":
        return _drift(case)
    world, towel = own_world(case["motion"], RADIUS[case["engine"]], blind, device)
    if tracker == "futures":
        options = {"materials": GUESSES, "iterations": 1, **options}
    follower = nuno.follow(world, towel, case["camera"], **options)
    found, spent = [], []
    seconds = clock.process_time if device == "cpu" else clock.perf_counter
    for time, mask, depth, board in zip(case["times"], case["masks"], case["depths"], case["board_mask"], strict=True):
        begin = seconds()
        if tracker == "open loop":
            follower.update(time)
        elif tracker == "masks":
            follower.update(time, mask, hidden=board)
        else:
            follower.update(time, mask, depth)
        spent.append(seconds() - begin)
        found.append(towel.vertices)
    return np.array(found), float(np.mean(spent[1:]))


def _drift(case: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Return what coherent point drift makes of the points of each image, from what it made of the one before."""
    from pycpd import DeformableRegistration

    _, towel = own_world(case["motion"], RADIUS[case["engine"]])
    now, found, spent = towel.vertices, [], []
    camera = case["camera"]
    rays = camera.rays(np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).astype(float))
    for mask, depth in zip(case["masks"], case["depths"], strict=True):
        chosen = np.argwhere(mask & np.isfinite(depth))[::6]
        begin = clock.process_time()
        points = camera.camera_to_world[:3, 3] + rays[tuple(chosen.T)] * depth[tuple(chosen.T)][:, None]
        if len(points) > 20:
            now = (
                DeformableRegistration(
                    X=10.0 * points, Y=10.0 * now, alpha=2.0, beta=1.0, w=0.1, max_iterations=40, tolerance=1e-4
                ).register()[0]
                / 10.0
            )
        spent.append(clock.process_time() - begin)
        found.append(now)
    return np.array(found), float(np.mean(spent[1:]))


def errors(found: np.ndarray, case: dict[str, Any], towel: Any) -> np.ndarray:
    """Return mean distances (k,) [m] of the vertices from the truth."""
    return np.linalg.norm(found - case["truth"][:, resampled_order(towel)], axis=-1).mean(axis=1)


def strip(case: dict[str, Any], found: dict[str, np.ndarray], path: Path) -> None:
    """Write a picture: the truth, and below it what trackers tell, at some instants."""
    import cv2

    world, towel = own_world(case["motion"], RADIUS[case["engine"]])
    rows, columns = [], np.linspace(4, len(case["times"]) - 1, 5).round().astype(int)
    flat = resampled_order(towel)
    for label, shapes in [("truth", case["truth"][:, flat]), *found.items()]:
        row = []
        for k in columns:
            world.set_vertices(towel, shapes[k])
            hands = [body for body in world.bodies if body.name.startswith("hand")]
            moves = case["motion"].at(case["times"][k])
            for body, start, move in zip(hands, add_starts(case["motion"], RADIUS[case["engine"]]), moves, strict=True):
                body.locate(start + move)
            image = nuno.take_picture(world, case["camera"], samples=2).color.numpy()[40:, 40:280].copy()
            text = f"{label} {case['times'][k]:.1f} s"
            cv2.putText(image, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (20, 20, 20), 1)
            row.append(image)
        rows.append(np.hstack(row))
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1])


def add_starts(hands: Motion, radius: float) -> np.ndarray:
    """Return where the hands of a sequence begin, (hands, 3) [m]."""
    return np.array([[(u - 0.5) * hands.size[0], (v - 0.5) * hands.size[1], TOP + radius] for u, v in hands.held])


def resampled_order(towel: Any) -> np.ndarray:
    """Return which row of what ``resampled`` gives each vertex of a sheet is."""
    size = np.ptp(towel.shape.mesh()[0][:, :2], axis=0)
    axes = [np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(size, OWN_CELLS, strict=True)]
    flat = np.stack(np.meshgrid(*axes), axis=-1)
    rest = towel.shape.mesh()[0][:, :2]
    return np.linalg.norm(rest[:, None] - flat.reshape(1, -1, 2), axis=-1).argmin(axis=1)


def followed(
    seed: int | None, engine: str, name: str, options: argparse.Namespace, first: bool
) -> list[dict[str, Any]]:
    """The lines of a motion, seen whole and half hidden, by each tracker; of the first a picture, if asked for."""
    logging.disable(logging.WARNING)
    rows = []
    for hidden in (False, True):
        case, shapes = seen(engine, name, hidden, seed, options.rate), {}
        towel = own_world(case["motion"], RADIUS[engine])[1]
        for tracker in options.trackers:
            given = {} if tracker in ("futures", "cpd") else {"iterations": options.iterations}
            found, spent = track(tracker, case, options.blind, options.device, **given)
            shapes[tracker] = found
            off = 1000.0 * errors(found, case, towel)
            covered = float(off[case["covered"]].mean()) if hidden else float("nan")
            row = {"engine": engine, "motion": name, "seed": seed, "hidden": hidden, "tracker": tracker}
            row |= {"mean_mm": float(off.mean()), "worst_mm": float(off.max())}
            rows.append(row | {"hidden_mm": covered, "cpu_s": spent})
        if options.strip and first and not hidden:
            strip(case, {each: shapes[each] for each in ("follow", "open loop") if each in shapes}, options.strip)
    return rows


def main() -> None:
    """Follow all sequences, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engines", nargs="+", default=list(ENGINES), choices=ENGINES)
    parser.add_argument("--motions", nargs="+", default=list(MOTIONS), choices=MOTIONS)
    parser.add_argument("--trackers", nargs="+", default=list(TRACKERS), choices=TRACKERS)
    parser.add_argument("--blind", action="store_true", help="the follower does not know of the hands")
    parser.add_argument("--device", default="cpu", help="of the follower; by the clock where it is no CPU")
    parser.add_argument("--rate", type=int, default=10, choices=(1, 2, 3, 5, 6, 10, 15, 30), help="images a second")
    parser.add_argument("--iterations", type=int, default=2, help="of each image, of all but futures")
    parser.add_argument("--unseen", nargs="+", type=int, metavar="SEED", help="other cloths, hands and cameras")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each on one core")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--strip", type=Path, help="a picture: truth, follower and open loop, of the first sequence")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    wanted = itertools.product(options.unseen or [None], options.engines, options.motions)
    parts = [(*which, options, k == 0) for k, which in enumerate(wanted)]
    print("engine   motion  seed  hidden  tracker     mean  worst  while hidden [mm]   s / image")
    for found in in_processes(followed, parts, options.jobs):
        rows += found
        for row in found:
            figures = f"{row['mean_mm']:6.1f} {row['worst_mm']:6.1f} {row['hidden_mm']:6.1f}  {row['cpu_s']:18.3f}"
            which = f"{row['engine']:8} {row['motion']:7} {row['seed']!s:5} {row['hidden']!s:7}"
            print(f"{which} {row['tracker']:10} {figures}", flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    for tracker in options.trackers:
        own = [row for row in rows if row["tracker"] == tracker]
        print(
            f"{tracker}: mean {np.mean([r['mean_mm'] for r in own]):.1f} mm, worst sequence "
            f"{max(r['mean_mm'] for r in own):.1f} mm, hidden {np.nanmean([r['hidden_mm'] for r in own]):.1f} mm"
        )


if __name__ == "__main__":
    main()
