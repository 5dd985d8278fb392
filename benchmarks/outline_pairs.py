"""Pairs of silhouettes from which `nuno.estimate.learned` was learned: ``python benchmarks/outline_pairs.py --help``.

Needs PyTorch (``pip install torch``) beside Nuno. A scene is one cloth on one table, lifted to several hands, each
seen by a camera of its own. To every hand picks of all 36 grid points are imagined, on an estimator's mesh and with
guesses of its own, from a rectangle that is measured a little wrong; and 18 real ones are made, on another mesh, with
another step and material, and with noise on the edge. All 36 are equally likely to be the true one, whatever the
hand: so nothing can be learned of how far hands go. Half of the cameras stand as in the cases, half anywhere around
the table, so that one cloth is seen from many sides. What is written is, for each real silhouette, a picture of it,
pictures of the guesses at the eight best candidates, each at its best turn, and the hand-made log likelihoods of all.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
import warp as wp
from generated_cases import HAND_RADIUS, REST_HEIGHT, looking_at
from outline_pictures import boxes_of, compare, masks, on_device, pictures, with_noise

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.coming_to_rest import REST_SPEED
from nuno.estimate.futures import LIFT_SECONDS, rest_speed, solver_of, table_world
from nuno.estimate.hypotheses import FIRM, LOOSE, SHEARING, Hypothesis, cell_counts, hypotheses_with
from nuno.estimate.learned import WIDTH, described
from nuno.estimate.outline_net import SIZE
from nuno.estimate.ranking import CONTOUR_WEIGHT, OVERLAP_WEIGHT
from nuno.estimate.rotations import TURNS, log_prior
from nuno.materials import Cloth
from nuno.shapes.path import Path as HandPath

FIRST = (FIRM[1], FIRM[8], LOOSE[3], LOOSE[6])
"""What an estimate begins with."""
OTHERS = tuple(h for h in FIRM + LOOSE + SHEARING if h not in FIRST)
DOUBLES = hypotheses_with(3000.0, 1200.0)
GRID = np.array([divmod(k, 6) for k in range(36)]) / 5
BEST, NEAR, FAR = 8, 11, 5
"""Candidates of which pictures are kept; real picks of those nearest to the hand, and of others drawn at random: with
eight hands not more of these than an H200 has processors."""
TURNED, TURN_SPREAD = 0.4, np.radians(14)  # share of the scenes whose real cloths are turned about the hand, [rad]
AROUND = 0.5  # share of the cameras that stand anywhere around the table


def rectangle(centre: np.ndarray, size: np.ndarray, yaw: float) -> ClothRectangle:
    """A cloth whose first corner is the sheet's own: labels matter to nobody here."""
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    corners = np.concatenate([centre[:2] + (signs * size) @ axes, np.full((4, 1), centre[2])], axis=1)
    return ClothRectangle(corners, float(size[0]), float(size[1]), corners.mean(axis=0), yaw, 0.0)


def lift(
    lay: ClothRectangle, table: Table, cells: np.ndarray, substeps: int, candidates: np.ndarray, hands: np.ndarray,
    values: dict[str, Any], device: str,
) -> tuple[wp.array, np.ndarray, np.ndarray, Any]:  # fmt: skip
    """Lift candidates (n,) to hands (n, 3) [m]: positions on the device, faces, which are finite, the world before."""
    world, cloth = table_world(lay, table, (int(cells[0]), int(cells[1])), device=device, substeps=substeps)
    futures = world.imagine(len(candidates))
    body = futures.find(cloth.name)
    futures.find("table").friction = futures.find("floor").friction = values["friction"]
    futures.attach(body, Cloth(**values))
    at = np.round(GRID * cells).astype(int)
    vertices = (at[:, 1] * (cells[0] + 1) + at[:, 0])[candidates]
    keys = np.stack([np.asarray(cloth.vertices)[vertices], hands], axis=1)
    path = HandPath(np.array((0.0, LIFT_SECONDS)), keys, None, "minimum_jerk")
    futures.grip(body, vertices[:, None], to=path)
    futures.run(LIFT_SECONDS, progress=False)
    for _ in range(5):
        futures.run(0.5, progress=False)
        if rest_speed(body) < REST_SPEED:
            break
    solver = solver_of(body)
    return solver.positions_on_device(), np.asarray(body.faces), np.asarray(solver.finite()), world


def guesses(rng: np.random.Generator) -> list[tuple[int, int, tuple[Hypothesis, ...]]]:
    """Meshes, substeps and guesses of a scene: eight in all, some of them on the finer mesh now and then."""
    if rng.uniform() < 0.35:
        return [(20, 14, FIRST), (25, 20, tuple(DOUBLES[k] for k in rng.permutation(len(DOUBLES))[:4]))]
    return [(20, 14, FIRST + tuple(OTHERS[k] for k in rng.permutation(len(OTHERS))[:4]))]


def materials(rng: np.random.Generator, n: int) -> dict[str, np.ndarray]:
    """Materials of real cloths; half of them as stiff in their plane as cloth is by default."""
    default, usual = rng.uniform(size=n) < 0.5, Cloth()
    return dict(
        bending_rigidity=np.exp(rng.uniform(np.log(1.5e-5), np.log(2.5e-3), n)),
        area_density=rng.uniform(0.1, 0.4, n), friction=rng.uniform(0.2, 0.8, n),
        thickness=rng.uniform(0.002, 0.006, n), air_drag=rng.uniform(0.5, 3.0, n),
        stretch_stiffness=np.where(default, 1000.0, np.exp(rng.uniform(np.log(150), np.log(3000), n))),
        shear_stiffness=np.where(default, usual.shear_stiffness, np.exp(rng.uniform(np.log(15), np.log(1200), n))),
    )  # fmt: skip


def scene(rng: np.random.Generator, count: int, device: str, generator: Any) -> list[dict[str, Any]]:
    """One cloth lifted to ``count`` hands: an example for every real pick."""
    table = Table(
        rng.uniform(0.70, 0.76), (rng.uniform(0.36, 0.48), rng.uniform(0.56, 0.66)), (rng.uniform(0.08, 0.13), 0.0)
    )
    long_m = rng.uniform(0.38, 0.80)
    size = np.array([long_m, rng.uniform(max(0.33, 0.55 * long_m), min(0.98 * long_m, 0.62))])
    yaw = rng.uniform(0, 2 * np.pi)
    centre = np.array([rng.uniform(0.0, 0.1), rng.uniform(-0.06, 0.06), table.height + REST_HEIGHT])
    true = rectangle(centre, size, yaw)
    off = np.append(rng.normal(0, 0.0008, 2), 0.0)
    measured = rectangle(centre + off, size * (1 + rng.normal(0, 0.002, 2)), yaw + rng.normal(0, 0.003))
    along, across = (true.corners[k] - true.corners[0] for k in (1, 3))
    begin = true.corners[0] + GRID[:, :1] * along + GRID[:, 1:] * across
    hands, cameras = [], []
    while len(hands) < count:
        angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.12)
        hand = begin[rng.integers(36)] + (reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.28, 0.52))
        eye = np.array([rng.uniform(-1.0, -0.78), rng.uniform(-0.14, 0.14), table.height + rng.uniform(0.48, 0.75)])
        target = np.array([0.1, 0.0, table.height + 0.12]) + rng.normal(0, 0.02, 3)
        about = rng.uniform(0, 2 * np.pi) if rng.uniform() < AROUND else 0.0
        turn = np.array([[np.cos(about), -np.sin(about), 0], [np.sin(about), np.cos(about), 0], [0, 0, 1]])
        middle = np.array([0.1, 0.0, 0.0])
        eye, target = (middle + turn @ (point - middle) for point in (eye, target))
        camera = looking_at(eye, target, rng.uniform(400, 600))
        pixels = camera.project(true.corners)
        if pixels.min() > 8 and (pixels < (631, 471)).all():
            hands.append(hand)
            cameras.append(camera)
    imagined = []
    spreads = guesses(rng)
    kinds = np.concatenate([described(spread_, cells) for cells, _, spread_ in spreads]).astype(np.float16)
    for cells, substeps, spread_ in spreads:
        each = {
            name: np.tile(np.repeat([getattr(h, name) for h in spread_], 36), count)
            for name in (
                "area_density", "bending_rigidity", "stretch_stiffness", "shear_stiffness", "friction", "air_drag",
            )
        }  # fmt: skip
        each["thickness"] = np.full(len(each["friction"]), 2 * REST_HEIGHT)
        mesh = np.array(cell_counts(measured.long_m, measured.short_m, cells, (6, 6)))
        candidates = np.tile(np.arange(36), len(spread_) * count)
        to = np.repeat(hands, len(spread_) * 36, axis=0)
        imagined.append((lift(measured, table, mesh, substeps, candidates, to, each, device), len(spread_)))
    picks, weights = [], []
    for hand in hands:
        order = np.argsort(np.linalg.norm(begin[:, :2] - hand[:2], axis=1))
        picks.append(np.concatenate([order[:NEAR], rng.permutation(order[NEAR:])[:FAR]]))
        weight = np.full(36, np.log(FAR / (36 - NEAR)))
        weight[order[:NEAR]] = 0.0
        weights.append(weight)
    mesh = 5 * np.maximum(np.round(size / rng.uniform(0.015, 0.022) / 5).astype(int), 3)
    n = NEAR + FAR
    real = lift(
        true, table, mesh, int(rng.integers(18, 46)), np.concatenate(picks), np.repeat(hands, n, axis=0),
        materials(rng, n * count), device,
    )  # fmt: skip
    turned = rng.uniform() < TURNED
    examples: list[dict[str, Any]] = []
    for k in range(count):
        turn = float(rng.normal(0, TURN_SPREAD)) if turned else 0.0
        part = [tuple(a[k * g * 36 : (k + 1) * g * 36] for a in (of[0], of[2])) for of, g in imagined]
        found = _examples(
            cameras[k], hands[k], real[0][k * n : (k + 1) * n], real[1], turn, part, [of[1] for of, _ in imagined],
            real[3], generator,
        )  # fmt: skip
        good = found.pop("good") & real[2][k * n : (k + 1) * n]
        for q in np.nonzero(good)[0]:
            example = {name: value[q] for name, value in found.items()}
            true_at = int(picks[k][q])
            sideways = np.float16(np.linalg.norm(begin[true_at, :2] - hands[k][:2]))
            examples.append(
                example | {
                    "true": true_at, "weight": weights[k].astype(np.float16), "sideways": sideways, "guess": kinds,
                }
            )  # fmt: skip
    return examples


def _examples(
    full: Camera, hand: np.ndarray, positions: wp.array, faces: np.ndarray, turn: float, imagined: list[Any],
    meshes: list[np.ndarray], world: Any, generator: Any,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Everything of one hand, by its real picks: what `outline_training.py` reads."""
    scale = WIDTH / 640
    camera, device = full.scaled(scale), positions.device
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    tip = camera.project(hand)
    radius = HAND_RADIUS * camera.fx / camera.depth_of(hand) + 2 * scale
    hidden = torch.tensor((u - tip[0]) ** 2 + (v - tip[1]) ** 2 <= radius**2, device=wp.device_to_torch(device))
    sharp = masks(positions, on_device(faces, device), camera, hand, turn, world)
    rim = sharp[:, 0].any(1) | sharp[:, -1].any(1) | sharp[:, :, 0].any(1) | sharp[:, :, -1].any(1)
    good = ~rim & (sharp.flatten(1).sum(1) > 60)
    share = with_noise(sharp, 1 / scale, generator) * ~hidden
    real = share > 0.5
    finite = torch.tensor(np.concatenate([f for _, f in imagined]), device=real.device)
    stack, contours, overlaps, errors = [], [], [], []
    for angle, prior in zip(TURNS, log_prior(TURNS), strict=True):
        drawn = [
            masks(x, on_device(mesh, device), camera, hand, angle, world)
            for (x, _), mesh in zip(imagined, meshes, strict=True)
        ]
        stack.append(torch.cat(drawn) & ~hidden)
        contour, overlap = compare(real, stack[-1], hidden, 1 / scale)
        contours.append(contour)
        overlaps.append(overlap)
        error = CONTOUR_WEIGHT * torch.log1p(contour) + OVERLAP_WEIGHT * (1 - overlap) - prior
        errors.append(torch.where(finite, error, 60.0))
    error = torch.stack(errors)  # turns, reals, futures
    best = error.argmin(0)
    n = len(real)
    likelihood = torch.logsumexp(-error, 0).view(n, -1, 36)
    candidates = torch.logsumexp(likelihood, 1).topk(BEST, dim=1).indices
    future = torch.arange(likelihood.shape[1], device=real.device) * 36 + candidates[:, :, None]
    at = torch.gather(best, 1, future.flatten(1))

    def there(values: list[Any]) -> Any:
        by_turn = torch.stack(values).permute(1, 2, 0).flatten(1)
        return torch.gather(by_turn, 1, future.flatten(1) * len(TURNS) + at).view(future.shape)

    boxes = boxes_of(real)
    cut = torch.stack(stack)[at.flatten(), future.flatten()]
    squares = boxes.repeat_interleave(future[0].numel(), 0)
    turns = torch.tensor(TURNS, dtype=torch.float32, device=real.device)[at].view(future.shape).abs()
    pair = torch.stack([torch.log1p(there(contours)), there(overlaps), turns], dim=-1)
    middle, side = boxes[:, :2].cpu().numpy(), boxes[:, 2].cpu().numpy()
    pixel = side / SIZE
    place = np.column_stack([
        (tip - middle) / side[:, None], 50 * pixel * float(camera.depth_of(hand)) / camera.fx, pixel / scale / 5,
    ])  # fmt: skip
    return {
        "good": good.cpu().numpy(), "real": pictures(share, boxes),
        "imagined": pictures(cut, squares).reshape(*future.shape, -1),
        "likelihood": likelihood.transpose(1, 2).half().cpu().numpy(),
        "candidates": candidates.to(torch.uint8).cpu().numpy(), "pair": pair.half().cpu().numpy(),
        "place": place.astype(np.float16),
    }  # fmt: skip


def main() -> None:
    """Make scenes for a while and write what they teach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the .npz to write; several processes make one each, by other seeds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=150.0)
    parser.add_argument("--scenes", type=int, default=10**6, help="no more than so many")
    parser.add_argument("--hands", type=int, default=8, help="of one scene")
    parser.add_argument("--device", default="cuda:0")
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    wp.init()
    cuda = options.device != "cpu"
    if cuda:  # both libraries' launches in one order
        stream = torch.cuda.Stream(options.device)
        torch.cuda.set_stream(stream)
        wp.set_stream(wp.stream_from_torch(stream), options.device)
    generator = torch.Generator("cuda" if cuda else "cpu")
    generator.manual_seed(options.seed)
    examples: list[dict[str, Any]] = []
    started, number = time.perf_counter(), 0
    while time.perf_counter() - started < options.seconds and number < options.scenes:
        rng = np.random.default_rng(options.seed * 100003 + number)
        made = scene(rng, options.hands, options.device, generator)
        examples += [example | {"scene": options.seed * 1000 + number} for example in made]
        number += 1
        print(f"{number} scenes, {len(examples)} examples, {time.perf_counter() - started:.0f} s", flush=True)
    np.savez(options.out, **{name: np.stack([e[name] for e in examples]) for name in examples[0]})


if __name__ == "__main__":
    main()
