"""Scenes of `outline_pairs.py`, and other engines' cloths in them: ``python benchmarks/outline_scenes.py --help``.

A scene is one cloth on one table, lifted to several hands, each seen by cameras of its own. All 36 grid points are
equally likely to be picked, whatever the hand: so nothing can be learned of how far hands go. Half of the cameras
stand as in the cases, half anywhere around the table, so that one cloth is seen from many sides. MuJoCo's flexible
bodies are a processor's work and Newton's VBD a GPU's, so the real cloths of these are made beforehand, by several
processes with other seeds, and written with what draws their scenes anew.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from generated_cases import REST_HEIGHT, looking_at
from varied_cases import Pick, led_along

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table

GRID = np.array([divmod(k, 6) for k in range(36)]) / 5
NEAREST = 11
"""Candidates that are called near to a hand."""
AROUND = 0.5  # share of the cameras that stand anywhere around the table
SURE_HANDS, HAND_NOISE = 0.6, 0.007  # share of hands that are told exactly; [m] standard deviation of the others


@dataclass(frozen=True, eq=False)
class Layout:
    """What is drawn of a scene before anything is simulated.

    Attributes:
        table: The table.
        true: The cloth as it lies there.
        measured: The same as an estimator measures it.
        hands: (hands, 3) where the cloth is held in the end [m].
        told: (hands, 3) where it is told to be held [m].
        cameras: Of every hand, as many as there are views.
        picks: (hands, n) candidates that are really picked.
        weights: (hands, 36) log frequency of every candidate among the picks, beside the frequency of near ones.
        sideways: (hands, 36) how far from above every candidate the hand ends [m].
    """

    table: Table
    true: ClothRectangle
    measured: ClothRectangle
    hands: np.ndarray
    told: np.ndarray
    cameras: list[list[Camera]]
    picks: np.ndarray
    weights: np.ndarray
    sideways: np.ndarray


def rectangle(centre: np.ndarray, size: np.ndarray, yaw: float) -> ClothRectangle:
    """A cloth whose first corner is the sheet's own: labels matter to nobody here."""
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    corners = np.concatenate([centre[:2] + (signs * size) @ axes, np.full((4, 1), centre[2])], axis=1)
    return ClothRectangle(corners, float(size[0]), float(size[1]), corners.mean(axis=0), yaw, 0.0)


def points_of(lay: ClothRectangle) -> np.ndarray:
    """(36, 3) where the candidates lie [m]."""
    along, across = (lay.corners[k] - lay.corners[0] for k in (1, 3))
    return lay.corners[0] + GRID[:, :1] * along + GRID[:, 1:] * across


def drawn(rng: np.random.Generator, hands: int, views: int, near: int, far: int) -> Layout:
    """Draw a scene.

    Args:
        rng: What draws.
        hands: How many.
        views: Cameras of every hand.
        near: Real picks of every hand among the `NEAREST` candidates.
        far: Real picks among the others.
    """
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
    begin = points_of(true)
    ends, cameras = [], []
    while len(ends) < hands:
        angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.12)
        end = begin[rng.integers(36)] + (reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.25, 0.52))
        seen = [camera for _ in range(20 * views) if (camera := _camera(rng, table, true)) is not None][:views]
        if len(seen) == views:
            ends.append(end)
            cameras.append(seen)
    at = np.array(ends)
    sideways = np.linalg.norm(begin[None, :, :2] - at[:, None, :2], axis=2)
    order = np.argsort(sideways, axis=1)
    picks, weights = [], np.full((hands, 36), np.log(far * NEAREST / (near * (36 - NEAREST))))
    for k, row in enumerate(order):
        picks.append(np.concatenate([rng.permutation(row[:NEAREST])[:near], rng.permutation(row[NEAREST:])[:far]]))
        weights[k, row[:NEAREST]] = 0.0
    noise = rng.normal(0, HAND_NOISE, at.shape) * (rng.uniform(size=(hands, 1)) > SURE_HANDS)
    return Layout(table, true, measured, at, at + noise, cameras, np.array(picks), weights, sideways)


def _camera(rng: np.random.Generator, table: Table, lay: ClothRectangle) -> Camera | None:
    """A camera; None where it does not see all of the cloth."""
    eye = np.array([rng.uniform(-1.0, -0.78), rng.uniform(-0.14, 0.14), table.height + rng.uniform(0.48, 0.75)])
    target = np.array([0.1, 0.0, table.height + 0.12]) + rng.normal(0, 0.02, 3)
    about = rng.uniform(0, 2 * np.pi) if rng.uniform() < AROUND else 0.0
    turn = np.array([[np.cos(about), -np.sin(about), 0], [np.sin(about), np.cos(about), 0], [0, 0, 1]])
    middle = np.array([0.1, 0.0, 0.0])
    eye, target = (middle + turn @ (point - middle) for point in (eye, target))
    camera = looking_at(eye, target, rng.uniform(400, 600))
    pixels = camera.project(lay.corners)
    return camera if pixels.min() > 8 and (pixels < (631, 471)).all() else None


def material(rng: np.random.Generator) -> dict[str, float]:
    """A material of another engine's cloth."""
    return {
        "bending_rigidity": float(np.exp(rng.uniform(np.log(5e-6), np.log(3e-3)))),
        "area_density": float(rng.uniform(0.1, 0.4)), "friction": float(rng.uniform(0.2, 0.8)),
        "air_drag": float(rng.uniform(0.5, 3.0)),
    }  # fmt: skip


def meshes(rng: np.random.Generator, engine: str) -> dict[str, Any]:
    """How another engine makes the cloths of a scene: not always as the cases that judge are made."""
    if engine == "mujoco":
        return {
            "cells_along": int(rng.choice((15, 20, 20, 25))),
            "membrane": float(np.exp(rng.uniform(np.log(1e3), np.log(6e3)))),
            "radius": float(rng.uniform(0.002, 0.003)),
        }  # fmt: skip
    return {}


def main() -> None:
    """Make real cloths for a while and write them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="the .npz to write")
    parser.add_argument("--engine", choices=["mujoco", "newton"], default="mujoco")
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=300.0, help="after which no scene is begun")
    parser.add_argument("--scenes", type=int, default=10**6, help="no more than so many")
    parser.add_argument("--hands", type=int, default=8)
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--picks", type=int, nargs=2, default=(2, 1), help="of every hand: near and far")
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    simulate = import_module(f"{options.engine}_picks").simulate
    shape = (options.hands, options.views, *options.picks)
    kept: dict[str, np.ndarray] = {"shape": np.array(shape)}
    started, number = time.perf_counter(), 0
    while time.perf_counter() - started < options.seconds and number < options.scenes:
        seed = options.seed * 1000 + number
        lay = drawn(np.random.default_rng(seed), *shape)
        rng = np.random.default_rng((seed, 1))
        begin = points_of(lay.true)
        picks = [
            Pick("ordinary", divmod(int(c), 6), led_along(np.array([begin[c], hand])), material(rng))
            for hand, row in zip(lay.hands, lay.picks, strict=True)
            for c in row
        ]
        scene = SimpleNamespace(rectangle=lay.true, table=lay.table)
        try:
            _, after, cells = simulate(scene, picks, 2.5, "cpu", **meshes(rng, options.engine))
        except RuntimeError as error:  # it diverged
            print(error, flush=True)
        else:
            kept |= {f"{seed}.after": after.astype(np.float32), f"{seed}.cells": np.array(cells)}
        number += 1
        print(f"{number} scenes, {time.perf_counter() - started:.0f} s", flush=True)
    np.savez(options.out, **kept)


if __name__ == "__main__":
    main()
