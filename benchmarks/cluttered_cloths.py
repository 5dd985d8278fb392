"""How often a known shape is found that lies deformed among clutter of its own colour, and how well.

    python benchmarks/cluttered_cloths.py --count 100 --json out.json --pictures DIR

The scenes are Nuno's own: a towel, a mat and a T-shirt, flat, pushed, wrinkled or with a corner folded over by
simulation, turned, lit from anywhere, among boxes, cylinders and rags of the cloth's colour that lie beside, under and
on it. Every second scene is also seen without the cloth. Beside `nuno.find_shape` stands `nuno.segment_before`,
which goes by colours.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import nuno
from nuno.camera.find_shape import FOUND

REST_HEIGHT = 0.0025  # [m]
CELL = 0.02  # [m]
KINDS = ("flat", "pushed", "wrinkled", "folded corner")
GOOD = 0.8  # IoU from which a cloth counts as detected
OUTLINES = {
    "towel": np.array([[0, 0], [0.44, 0], [0.44, 0.28], [0, 0.28]]),
    "mat": np.array([[0, 0], [0.40, 0], [0.40, 0.32], [0, 0.32]]),
    "T-shirt": np.array(
        [[0.12, 0], [0.36, 0], [0.36, 0.26], [0.48, 0.26], [0.48, 0.40], [0, 0.40], [0, 0.26], [0.12, 0.26]]
    ),
}
for outline in OUTLINES.values():
    outline -= 0.5 * (outline.min(axis=0) + outline.max(axis=0))
MATERIALS = {
    "towel": nuno.Cloth(bending_rigidity=2e-5),
    "mat": nuno.Cloth(bending_rigidity=3e-4),
    "T-shirt": nuno.Cloth(bending_rigidity=1e-5),
}


@dataclass
class Scene:
    """One picture and its truth."""

    shape: str
    kind: str
    camera: nuno.Camera
    table: nuno.Table
    image: np.ndarray
    without: np.ndarray
    whole: np.ndarray
    visible: np.ndarray


def mesh_of(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares of ``CELL`` cut in two, within an outline whose sides are along the axes."""
    low = outline.min(axis=0)
    count = np.round((outline.max(axis=0) - low) / CELL).astype(int)
    middles = low + CELL * (np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1) + 0.5)
    contour = (outline[:, None] * 1e4).astype(np.float32)
    inside = np.array([cv2.pointPolygonTest(contour, (float(x), float(y)), False) > 0
                       for x, y in middles.reshape(-1, 2) * 1e4]).reshape(count)  # fmt: skip
    used, faces = {}, []
    for i, j in np.argwhere(inside):
        a, b, c, d = (used.setdefault(key, len(used)) for key in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
        faces += [[a, b, c], [a, c, d]] if (i + j) % 2 else [[a, b, d], [b, c, d]]
    points = low + CELL * np.array(list(used), dtype=float)
    return np.column_stack([points, np.full(len(points), REST_HEIGHT)]), np.array(faces)


def deformed(shape: str, rng: np.random.Generator, count: int, device: str) -> np.ndarray:
    """Simulate ``count`` of a shape, all kinds in turn: vertices (count, n, 3) on a table whose top is at z = 0."""
    vertices, faces = mesh_of(OUTLINES[shape])
    world = nuno.World(device=device)
    world.add(nuno.box((2.0, 2.0, 0.04), name="table", position=(0, 0, -0.02), friction=0.5))
    cloth = world.add(nuno.cloth_mesh(vertices, faces, name="cloth"))
    batch = world.imagine(count)
    body = batch.find(cloth.name)
    batch.attach(body, MATERIALS[shape])
    corners = [int(np.argmin(np.linalg.norm(vertices[:, :2] - c, axis=1))) for c in OUTLINES[shape]]
    centre = vertices[:, :2].mean(axis=0)
    held = np.full((count, 3), -1)
    goals = np.zeros((count, 3, 3, 3))  # worlds, grips, keys, xyz
    for k in range(count):
        kind = KINDS[k % len(KINDS)]
        rim = rng.permutation(corners)[:3]
        if kind == "pushed":  # a corner and its neighbour go inwards together
            at = int(rng.integers(len(corners)))
            pair = [corners[at], corners[(at + 1) % len(corners)]]
            inward = centre - vertices[pair, :2].mean(axis=0)
            move = rng.uniform(0.04, 0.09) * inward / np.linalg.norm(inward) + rng.normal(0, 0.01, 2)
            moves = [np.array([*move, 0.002]), np.array([*(move * rng.uniform(0.4, 1.0)), 0.002])]
            rim = np.array(pair)
        elif kind == "wrinkled":
            moves = []
            for v in rim:
                inward = centre - vertices[v, :2]
                moves.append(
                    [*(rng.uniform(0.02, 0.06) * inward / np.linalg.norm(inward) + rng.normal(0, 0.015, 2)), 0.002]
                )
        elif kind == "folded corner":
            rim = rim[:1]
            inward = centre - vertices[rim[0], :2]
            far = rng.uniform(0.10, 0.16) * inward / np.linalg.norm(inward) + rng.normal(0, 0.01, 2)
            moves = [[*far, 0.006]]
        else:
            moves, rim = [], rim[:0]
        for g, (v, move) in enumerate(zip(rim, moves, strict=True)):
            start = vertices[v]
            held[k, g] = v
            lift = 0.09 if kind == "folded corner" else 0.025
            goals[k, g] = start, start + np.array([0.5 * move[0], 0.5 * move[1], lift]), start + np.array(move)
    # the held points stay where they were brought: let go, folds as small as these spring open
    for g in range(3):
        if (held[:, g] >= 0).any():
            batch.grip(body, held[:, g : g + 1], to=nuno.Path((0.1, 0.7, 1.3), goals[:, g], None, "minimum_jerk"))
    batch.run(2.0, progress=False)
    return np.asarray(body.vertices)


def scene(shape: str, kind: str, lying: np.ndarray, rng: np.random.Generator) -> Scene:
    """Put a deformed cloth (n, 3) on a table among clutter and take pictures of it."""
    table = nuno.Table(float(rng.uniform(0.6, 0.8)), (0.45, 0.6), (0.0, 0.0))
    faces = mesh_of(OUTLINES[shape])[1]
    colour = rng.uniform(0.15, 0.9, 3)
    wood = np.clip(colour + rng.choice([-1, 1]) * rng.uniform(0.1, 0.4) + rng.normal(0, 0.05, 3), 0.05, 0.95)
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.9, 1.2, 0.04), name="table", position=(0, 0, table.height - 0.02), color=tuple(wood)))
    yaw, place = rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1, 2) * (0.12, 0.22)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    flat = lying[:, :2] @ turn.T + place
    cloth = nuno.cloth_mesh(
        np.column_stack([flat, lying[:, 2] + table.height]), faces, name="cloth", color=tuple(colour)
    )
    world.add(cloth)
    for number in range(int(rng.integers(9, 14))):
        shade = tuple(np.clip(colour + rng.normal(0, 0.02, 3), 0.02, 0.98))
        angle = rng.uniform(0, 2 * np.pi)
        quaternion = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
        at = rng.uniform(-1, 1, 2) * (0.42, 0.57)
        if number < 4:  # at the cloth's rim
            at = flat[int(rng.integers(len(flat)))]
            away = at - flat.mean(axis=0)
            at = flat.mean(axis=0) + away / np.linalg.norm(away) * (np.linalg.norm(away) + rng.uniform(0.0, 0.08))
        kind_of_thing = rng.choice(["box", "cylinder", "rag", "rag"])
        if kind_of_thing == "box":
            size = rng.uniform((0.04, 0.04, 0.01), (0.16, 0.10, 0.06))
            thing = nuno.box(size, position=(*at, table.height + size[2] / 2), quaternion=quaternion, color=shade)
        elif kind_of_thing == "cylinder":
            high = rng.uniform(0.01, 0.08)
            thing = nuno.cylinder(rng.uniform(0.02, 0.05), high, position=(*at, table.height + high / 2), color=shade)
        else:  # under the cloth or on it
            size = rng.uniform((0.08, 0.06), (0.30, 0.14))
            # it lies on what is there: 1 mm under the cloth, or over all of it that is near
            near = lying[np.linalg.norm(flat - at, axis=1) < 0.6 * np.linalg.norm(size), 2]
            over = rng.random() < 0.3 and len(near) < 0.25 * len(lying)
            z = max(near.max(initial=0.0) + 0.002, 0.004) if over else 0.0012
            thing = nuno.sheet(size, (2, 2), position=(*at, table.height + z), quaternion=quaternion, color=shade)
        world.add(thing)
    angle = rng.uniform(0, 2 * np.pi)
    eye = np.array([0.75 * np.cos(angle), 0.75 * np.sin(angle), table.height + rng.uniform(0.75, 1.0)])
    camera = nuno.Camera.look_at(eye, (0.0, 0.0, table.height), np.radians(rng.uniform(48, 60)))
    angle = rng.uniform(0, 2 * np.pi)
    lamp = nuno.Lamp((2 * np.cos(angle), 2 * np.sin(angle), table.height + rng.uniform(0.8, 2.5)))
    seed = int(rng.integers(1 << 30))
    taken = nuno.take_picture(world, camera, lamp=lamp, samples=2, noise=3.0, seed=seed)
    without = nuno.take_picture(world, camera, lamp=lamp, samples=2, noise=3.0, seed=seed + 1, without=[cloth])
    things = [body for body in world.bodies if body.name not in ("cloth", "table")]
    alone = nuno.take_picture(world, camera, lamp=lamp, without=things)
    return Scene(
        shape, kind, camera, table, taken.color.numpy(), without.color.numpy(), alone.mask("cloth"), taken.mask("cloth")
    )


def make_scenes(count: int, seed: int, device: str = "cpu") -> Iterator[Scene]:
    """Make scenes: half of them towels, a quarter mats, a quarter T-shirts; the same seed makes the same."""
    rng = np.random.default_rng(seed)
    turns = [("towel", "mat", "towel", "T-shirt")[k % 4] for k in range(count)]
    lying = {shape: iter(deformed(shape, rng, turns.count(shape), device)) for shape in OUTLINES if shape in turns}
    done = dict.fromkeys(OUTLINES, 0)
    for shape in turns:
        kind, vertices = KINDS[done[shape] % len(KINDS)], next(lying[shape])
        done[shape] += 1
        while True:
            made = scene(shape, kind, vertices, rng)
            rim = np.concatenate([made.whole[0], made.whole[-1], made.whole[:, 0], made.whole[:, -1]])
            if made.visible.sum() >= 0.75 * made.whole.sum() and not rim.any():
                yield made
                break


def overlap(found: np.ndarray | None, true: np.ndarray) -> float:
    return 0.0 if found is None else float((found & true).sum() / max((found | true).sum(), 1))


def measure(made: Scene, with_absent: bool = True) -> dict:
    """One scene: IoU of what each way finds, and the scores with and without the cloth."""
    outline = OUTLINES[made.shape]
    row: dict = {"shape": made.shape, "kind": made.kind, "seen": float(made.visible.sum() / made.whole.sum())}
    start = time.process_time()
    best = nuno.find_shape(made.image, outline, camera=made.camera, table=made.table, min_score=0.0)
    row["cpu_s"] = time.process_time() - start
    row["score"] = best[0].score if best else 0.0
    row["support"], row["bent"] = (best[0].support, best[0].deformation) if best else (0.0, 0.0)
    row["iou"] = max(overlap(best[0].mask, true) for true in (made.whole, made.visible)) if best else 0.0
    row["polygon"] = best[0].polygon.tolist() if best else []
    if with_absent:
        absent = nuno.find_shape(made.without, outline, camera=made.camera, table=made.table, min_score=0.0)
        row["score_without"] = absent[0].score if absent else 0.0
    try:
        mask = nuno.segment_before(made.image, made.camera, made.table)
    except nuno.NunoError as error:
        mask, row["error"] = None, str(error)
    row["iou_colour"] = max(overlap(mask, true) for true in (made.whole, made.visible))
    return row


def picture_of(made: Scene, row: dict) -> np.ndarray:
    image = made.image.copy()
    rims, _ = cv2.findContours(made.whole.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, rims, -1, (255, 255, 255), 1)
    colour = (40, 220, 60) if row["iou"] >= GOOD else (230, 40, 40)
    if row["polygon"]:
        cv2.polylines(image, [np.round(row["polygon"]).astype(np.int32)], True, colour, 2, cv2.LINE_AA)
    text = (
        f"{made.shape}, {made.kind}: IoU {row['iou']:.2f} (colours {row['iou_colour']:.2f}), score {row['score']:.2f}"
    )
    cv2.rectangle(image, (0, 0), (639, 22), (0, 0, 0), -1)
    cv2.putText(image, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return image


def summary(rows: list[dict]) -> str:
    lines = [
        f"{'':22s}{'count':>7s}{'found':>8s}{'IoU>=.8':>9s}{'IoU':>7s}{'colours: IoU>=.8':>18s}{'IoU':>7s}{'CPU s':>7s}"
    ]
    groups = [("all", rows)]
    groups += [(name, [r for r in rows if r["shape"] == name]) for name in OUTLINES]
    groups += [(name, [r for r in rows if r["kind"] == name]) for name in KINDS]
    for name, own in groups:
        if own:
            good = sum(r["iou"] >= GOOD for r in own)
            told = sum(r["iou"] >= GOOD and r["score"] >= FOUND for r in own)
            colour = sum(r["iou_colour"] >= GOOD for r in own)
            lines.append(
                f"{name:22s}{len(own):7d}{told:8d}{good:9d}{np.mean([r['iou'] for r in own]):7.3f}{colour:18d}"
                f"{np.mean([r['iou_colour'] for r in own]):7.3f}{np.mean([r['cpu_s'] for r in own]):7.2f}"
            )
    limit = FOUND
    absent = np.array([r["score_without"] for r in rows if "score_without" in r])
    false = int((absent >= limit).sum())
    wrong = sum(r["score"] >= limit and r["iou"] < 0.5 for r in rows)
    lines.append(f"without the cloth: {false} of {len(absent)} said to be there (score >= {limit}); elsewhere: {wrong}")
    right = np.array([r["score"] for r in rows if r["iou"] >= GOOD])
    if len(right) and len(absent):
        area = float((right[:, None] > absent).mean())
        lines.append(
            f"scores: right {np.quantile(right, [0.05, 0.5])}, absent {np.quantile(absent, [0.5, 0.95])}, ROC area "
            f"{area:.3f}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu", help="of the simulations")
    parser.add_argument("--json", type=Path, help="write the rows here")
    parser.add_argument("--pictures", type=Path, help="write a picture of each scene here")
    options = parser.parse_args()
    rows = []
    for number, made in enumerate(make_scenes(options.count, options.seed, options.device)):
        rows.append(measure(made, number % 2 == 0))
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            picture = picture_of(made, rows[-1])
            cv2.imwrite(str(options.pictures / f"{number:03d}.png"), picture[..., ::-1])
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))
    print(summary(rows))


if __name__ == "__main__":
    main()
