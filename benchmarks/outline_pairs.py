"""Pairs of silhouettes from which `nuno.estimate.learned` was learned: ``python benchmarks/outline_pairs.py --help``.

Needs PyTorch (``pip install torch``) beside Nuno. In every scene (`outline_scenes.py`) picks of all 36 grid points are
imagined to every hand, on an estimator's meshes and with its guesses, from a rectangle that is measured a little wrong
and to a hand that is told a little wrong now and then; and some real ones are made, on another mesh, with another step
and material, or by another engine, and with noise on the edge. What is written is, for each real silhouette, a picture
of it, pictures of the guesses at the eight best candidates, each at its best turn, and the hand-made log likelihoods
of all.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import warp as wp
from generated_cases import HAND_RADIUS, REST_HEIGHT
from outline_pictures import boxes_of, compare, masks, on_device, pictures, with_noise
from outline_scenes import GRID, Layout, drawn

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.coming_to_rest import REST_SPEED
from nuno.estimate.futures import LIFT_SECONDS, rest_speed, solver_of, table_world
from nuno.estimate.hypotheses import DISCRETISATIONS, Discretisation, Hypothesis, cell_counts
from nuno.estimate.learned import WIDTH, described
from nuno.estimate.outline_net import SIZE
from nuno.estimate.ranking import CONTOUR_WEIGHT, OVERLAP_WEIGHT
from nuno.estimate.rotations import TURNS, log_prior
from nuno.materials import Cloth
from nuno.shapes.path import Path as HandPath

GUESSES = (5, 3)
"""Of a scene, on the mesh of the first stages and on that of the fourth."""
BEST, NEAR, FAR = 8, 11, 5
"""Candidates of which pictures are kept; real picks of those nearest to the hand, and of others drawn at random: with
eight hands not more of these than an H200 has processors."""
EDGE_NOISE = (0.2, 2.2)  # [px] of 640, standard deviation of the real edges' displacement
TURNED, TURN_SPREAD = 0.4, np.radians(14)  # share of the views in which real cloths are turned about the hand, [rad]


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


def guesses(rng: np.random.Generator) -> list[tuple[Discretisation, tuple[Hypothesis, ...]]]:
    """Meshes and guesses of a scene: the first stage's, and some of those that an estimate has later."""
    first, second, _, fourth, fifth, last = DISCRETISATIONS
    later = [second.hypotheses + last.hypotheses, fourth.hypotheses + fifth.hypotheses]
    plain = [[replace(h, hand=(0.0, 0.0, 0.0), mistake=0.0) for h in of] for of in later]
    coarse, fine = GUESSES
    some = [
        tuple(of[k] for k in rng.permutation(len(of))[:count])
        for of, count in zip(plain, (coarse - len(first.hypotheses), fine), strict=True)
    ]
    return [(first, first.hypotheses + some[0]), (fourth, some[1])]


def materials(rng: np.random.Generator, n: int) -> dict[str, np.ndarray]:
    """Materials of real cloths; half of them as stiff in their plane as cloth is by default."""
    default, usual = rng.uniform(size=n) < 0.5, Cloth()
    return dict(
        bending_rigidity=np.exp(rng.uniform(np.log(2e-6), np.log(5e-3), n)),
        area_density=rng.uniform(0.1, 0.4, n), friction=rng.uniform(0.2, 0.8, n),
        thickness=rng.uniform(0.002, 0.006, n), air_drag=rng.uniform(0.5, 3.0, n),
        stretch_stiffness=np.where(default, 1000.0, np.exp(rng.uniform(np.log(150), np.log(3000), n))),
        shear_stiffness=np.where(default, usual.shear_stiffness, np.exp(rng.uniform(np.log(15), np.log(1200), n))),
    )  # fmt: skip


def real_cloths(rng: np.random.Generator, lay: Layout, device: str) -> tuple[wp.array, np.ndarray, np.ndarray, Any]:
    """The real picks of a scene by Nuno's engine: as `lift`."""
    sides = np.array([lay.true.long_m, lay.true.short_m])
    mesh = 5 * np.maximum(np.round(sides / rng.uniform(0.015, 0.022) / 5).astype(int), 3)
    hands = np.repeat(lay.hands, lay.picks.shape[1], axis=0)
    return lift(
        lay.true, lay.table, mesh, int(rng.integers(18, 46)), lay.picks.ravel(), hands,
        materials(rng, lay.picks.size), device,
    )  # fmt: skip


def cloths_of(
    after: np.ndarray, cells: np.ndarray, lay: Layout, device: str
) -> tuple[wp.array, np.ndarray, np.ndarray, Any]:
    """The real picks (n, vertices, 3) [m] of another engine: as `lift`."""
    world, cloth = table_world(lay.true, lay.table, (int(cells[0]), int(cells[1])), device=device, substeps=1)
    finite = np.isfinite(after).all(axis=(1, 2))
    positions = wp.array(np.where(finite[:, None, None], after, 0.0), dtype=wp.vec3, device=device)
    return positions, np.asarray(cloth.faces), finite, world


def scene(
    rng: np.random.Generator, lay: Layout, real: tuple[wp.array, np.ndarray, np.ndarray, Any], device: str,
    generator: Any,
) -> list[dict[str, Any]]:  # fmt: skip
    """One cloth lifted to some hands: an example for every real pick in every view."""
    imagined = []
    spreads = guesses(rng)
    kinds = np.concatenate([described(spread_, mesh.cells) for mesh, spread_ in spreads]).astype(np.float16)
    count, n = lay.picks.shape
    for mesh, spread_ in spreads:
        each = {
            name: np.tile(np.repeat([getattr(h, name) for h in spread_], 36), count)
            for name in (
                "area_density", "bending_rigidity", "stretch_stiffness", "shear_stiffness", "friction", "air_drag",
            )
        }  # fmt: skip
        each["thickness"] = np.full(len(each["friction"]), 2 * REST_HEIGHT)
        cells = np.array(cell_counts(lay.measured.long_m, lay.measured.short_m, mesh.cells, (6, 6)))
        candidates = np.tile(np.arange(36), len(spread_) * count)
        to = np.repeat(lay.told, len(spread_) * 36, axis=0)
        futures = lift(lay.measured, lay.table, cells, mesh.substeps, candidates, to, each, device)
        imagined.append((futures, len(spread_)))
    examples: list[dict[str, Any]] = []
    for k in range(count):
        part = [tuple(a[k * g * 36 : (k + 1) * g * 36] for a in (of[0], of[2])) for of, g in imagined]
        for camera in lay.cameras[k]:
            turn = float(rng.normal(0, TURN_SPREAD)) if rng.uniform() < TURNED else 0.0
            found = _examples(
                camera, lay.told[k], real[0][k * n : (k + 1) * n], real[1], turn, part, [of[1] for of, _ in imagined],
                real[3], float(rng.uniform(*EDGE_NOISE)), generator,
            )  # fmt: skip
            good = found.pop("good") & real[2][k * n : (k + 1) * n]
            for q in np.nonzero(good)[0]:
                example = {name: value[q] for name, value in found.items()}
                true_at = int(lay.picks[k][q])
                examples.append(
                    example | {
                        "true": true_at, "weight": lay.weights[k].astype(np.float16),
                        "sideways": np.float16(lay.sideways[k, true_at]), "guess": kinds,
                    }
                )  # fmt: skip
    return examples


def _examples(
    full: Camera, hand: np.ndarray, positions: wp.array, faces: np.ndarray, turn: float, imagined: list[Any],
    meshes: list[np.ndarray], world: Any, noise_px: float, generator: Any,
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
    share = with_noise(sharp, noise_px, 1 / scale, generator) * ~hidden
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


def scenes(options: argparse.Namespace) -> Iterator[tuple[int, Layout, Any]]:
    """Numbers, layouts and real cloths of scenes."""
    if options.real is None:
        for number in range(options.scenes):
            seed = options.seed * 1000 + number
            rng = np.random.default_rng(seed)
            lay = drawn(rng, options.hands, options.views, NEAR, FAR)
            yield seed, lay, real_cloths(rng, lay, options.device)
        return
    for path in options.real:
        with np.load(path) as made:
            for name in made.files:
                if name.endswith(".after"):
                    seed = int(name.removesuffix(".after"))
                    lay = drawn(np.random.default_rng(seed), *made["shape"].tolist())
                    yield seed, lay, cloths_of(made[name], made[f"{seed}.cells"], lay, options.device)


def main() -> None:
    """Make scenes for a while and write what they teach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the .npz to write; several processes make one each, by other seeds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=150.0)
    parser.add_argument("--scenes", type=int, default=10**6, help="no more than so many")
    parser.add_argument("--hands", type=int, default=8, help="of one scene")
    parser.add_argument("--views", type=int, default=2, help="of one hand")
    parser.add_argument("--real", type=Path, nargs="+", help="real cloths that outline_scenes.py made, not Nuno's own")
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
    for seed, lay, real in scenes(options):
        if time.perf_counter() - started > options.seconds or number == options.scenes:
            break
        made = scene(np.random.default_rng((seed, 2)), lay, real, options.device, generator)
        examples += [example | {"scene": seed} for example in made]
        number += 1
        print(f"{number} scenes, {len(examples)} examples, {time.perf_counter() - started:.0f} s", flush=True)
    np.savez(options.out, **{name: np.stack([e[name] for e in examples]) for name in examples[0]})


if __name__ == "__main__":
    main()
