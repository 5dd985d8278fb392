"""Picks simulated with Nuno's own engine, on a finer mesh and with a shorter step than any estimator uses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from generated_cases import SUBSTEPS

from nuno.estimate.futures import is_turned, table_world
from nuno.materials import Cloth
from nuno.shapes.path import Path

CELL = 0.0165  # [m] about; estimators use 0.02 and more
CELLS = 40  # along the longer side at most, so that a large cloth does not take minutes
LIFT_SECONDS = 1.5
REST = 0.1  # [s] before the lift


def simulate(scene: Any, picks: Sequence[Any], hold: float, device: str) -> tuple[np.ndarray, np.ndarray, Any]:
    """Pick one cloth in as many ways as there are picks.

    Args:
        scene: The scene (`varied_cases.Scene`).
        picks: The picks (`varied_cases.Pick`).
        hold: How long the cloth hangs before it is looked at [s].
        device: Where to simulate.

    Returns:
        Vertices before (n, 3) and after (picks, n, 3) [m], and the cells along both sides.
    """
    rectangle, count = scene.rectangle, len(picks)
    sides = np.array([rectangle.long_m, rectangle.short_m])
    cell = max(CELL, rectangle.long_m / CELLS)
    steps = 5 * np.maximum(np.round(sides / cell / 5).astype(int), 3)
    cells = (int(steps[0]), int(steps[1]))
    world, cloth = table_world(rectangle, scene.table, cells, device=device, substeps=SUBSTEPS)
    futures = world.imagine(count)
    body = futures.find(cloth.name)
    material = {name: np.array([pick.material[name] for pick in picks]) for name in picks[0].material}
    futures.find("table").friction = futures.find("floor").friction = material["friction"]
    futures.attach(body, Cloth(**material))
    ij = np.array([pick.ij for pick in picks])
    row = ij[:, 1] * cells[1] // 5
    row = cells[1] - row if is_turned(rectangle) else row
    vertex = row * (cells[0] + 1) + ij[:, 0] * cells[0] // 5
    before = np.asarray(cloth.vertices)
    keys = np.stack([pick.path for pick in picks])
    times = REST + np.linspace(0.0, LIFT_SECONDS, keys.shape[1])
    futures.grip(body, vertex[:, None], to=Path(times, keys, None, "linear"))
    futures.run(REST + LIFT_SECONDS + hold, progress=False)
    after = np.asarray(body.vertices)
    return before, after.reshape(count, -1, 3), cells
