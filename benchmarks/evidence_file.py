"""Cases that ``pick_evidence.py`` dumped, as the estimator saw them."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.estimate.lift_prior import SIDEWAYS, log_priors_of_ways
from nuno.estimate.ranking import Comparison

COUNT = 36


@dataclass(frozen=True)
class _Corners:
    corners: np.ndarray


@dataclass
class Evidence:
    """One case.

    Attributes:
        row: Its line of evidence.jsonl.
        arrays: Its arrays by name.
    """

    row: dict[str, Any]
    arrays: dict[str, np.ndarray]

    @property
    def true(self) -> int:
        """The true candidate's number."""
        i, j = self.row["true"]
        return 6 * i + j

    @property
    def seed(self) -> int:
        """The number of the round that it is of: cases of one scene belong together."""
        return int(self.row["round"])

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """Of all stages; mistakes of the hand are weighed in them, as in the estimate that they are of."""
        ways: list[Any] = self.row.get("up_first") or [None] * len(self.row["mistakes"])
        return [
            replace(self.comparison(f"stage{k}"), up_first=None if way is None else np.array(way))
            for k, way in enumerate(ways)
        ]

    def reflected(self, stages: int) -> list[Comparison]:
        """Of the first stages, what their futures tell of other candidates once they are reflected."""
        found = []
        for k in range(stages):
            names = {key.split(".", 1)[0] for key in self.arrays if key.startswith(f"mirror{k}-")}
            found += [replace(self.comparison(n), up_first=self.comparisons[k].up_first) for n in sorted(names)]
        return found

    def comparison(self, name: str) -> Comparison:
        """A comparison as it was dumped."""
        value = {key[len(name) + 1 :]: array for key, array in self.arrays.items() if key.startswith(name + ".")}
        chamfer = value["chamfer"].astype(float)
        pattern, added = (value[n].astype(float) if n in value else None for n in ("pattern", "correction"))
        return Comparison(
            value["candidates"].astype(int), value["turns"], chamfer, value["iou"].astype(float),
            np.zeros(chamfer.shape), value["finite"], pattern, added, log_priors=value["log_priors"],
            weights=value.get("weights"),
        )  # fmt: skip

    @cached_property
    def prior(self) -> np.ndarray:
        """(2, 36) float, logarithms of the prior of the lift, of hands that went straight and up first."""
        rectangle: Any = _Corners(np.asarray(self.row["rectangle"]))
        grid = np.stack(np.meshgrid(np.arange(6), np.arange(6), indexing="ij"), axis=-1).reshape(-1, 2)
        return log_priors_of_ways(rectangle, grid / 5.0, self.row["hand"], SIDEWAYS)

    @property
    def camera(self) -> Camera:
        """As it was told."""
        return Camera.from_dict(self.row["camera"])

    def mask(self, name: str) -> np.ndarray:
        """(h, w) bool: "before" or "after"."""
        camera = self.camera
        flat = np.unpackbits(self.arrays[f"mask_{name}"])[: camera.width * camera.height]
        return flat.reshape(camera.height, camera.width).astype(bool)


def read_evidence(folder: Path) -> tuple[list[Evidence], list[dict[str, Any]]]:
    """The cases of a folder that were taken for rectangles, and the lines of all others."""
    arrays: dict[str, dict[str, np.ndarray]] = {}
    for path in sorted(folder.glob("evidence-*.npz")):
        with np.load(path) as file:
            for name in file.files:
                case, part = name.split(".", 1)
                arrays.setdefault(case, {})[part] = file[name]
    rows = [json.loads(line) for line in (folder / "evidence.jsonl").read_text().splitlines()]
    good = [r for r in rows if "scores" in r and not r["by_outline"] and r["case"] in arrays]
    names = {r["case"] for r in good}
    return [Evidence(r, arrays[r["case"]]) for r in good], [r for r in rows if r["case"] not in names]
