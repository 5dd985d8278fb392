"""How well the cloth is seen: masks, corners and seconds, on recorded cases and on synthetic images.

    python benchmarks/seeing.py --cases DIR --synthetic 64 --json out.json

A case is a folder with input.json, before.png, after.png, truth.json, mask_before.png and mask_after.png.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.image import read_image
from nuno.camera.rectangle import fit_rectangle
from nuno.camera.segmentation import segment_after, segment_before
from nuno.camera.table import Table
from nuno.errors import NunoError

REST_HEIGHT = 0.0025  # [m]


def overlap(found: np.ndarray, true: np.ndarray) -> float:
    return float((found & true).sum() / max((found | true).sum(), 1))


def measure(name, camera, table, before, after, hand, truth) -> dict:
    """One pair of images against truth: masks, corners (4, 3) and sides."""
    row = {"case": name}
    start = time.perf_counter()
    try:
        mask = segment_before(before, camera, table)
        row["before_s"] = time.perf_counter() - start
        row["iou_before"] = overlap(mask, truth["mask_before"])
        start = time.perf_counter()
        cloth = fit_rectangle(mask, before, camera, table.height + REST_HEIGHT)
        row["rectangle_s"] = time.perf_counter() - start
        away = 1e3 * np.linalg.norm(cloth.corners[:, None] - truth["corners"][None], axis=-1)
        # With labels where the truth has them, else to whichever corner is nearest.
        away = np.diagonal(away) if truth["labelled"] else away.min(axis=1)
        row["corner_mean_mm"], row["corner_max_mm"] = float(away.mean()), float(away.max())
        row["sides_percent"] = 100 * max(
            abs(cloth.long_m / truth["size"][0] - 1), abs(cloth.short_m / truth["size"][1] - 1)
        )
        row["warnings"] = list(cloth.warnings)
        start = time.perf_counter()
        after_mask = segment_after(after, camera, table, before, mask, hand)
        row["after_s"] = time.perf_counter() - start
        row["iou_after"] = overlap(after_mask, truth["mask_after"])
    except NunoError as error:
        row["error"] = f"{type(error).__name__}: {error}"
    return row


def recorded(folder: Path, known: bool):
    """Measure every case of a folder."""
    for path in sorted(folder.glob("*/input.json")):
        case = path.parent
        data, truth = json.loads(path.read_text()), json.loads((case / "truth.json").read_text())
        table = Table(
            data["table_height_m"],
            tuple(data["table_half_extents_xy_m"]) if known else None,
            tuple(data["table_centre_xy_m"]) if known else None,
        )
        c00, ci, cj = (np.array(truth[key]) for key in ("C00", "CI", "CJ"))
        true = {
            "mask_before": read_image(case / "mask_before.png")[..., 0] > 127,
            "mask_after": read_image(case / "mask_after.png")[..., 0] > 127,
            "corners": np.array([c00, ci, ci + cj - c00, cj]),
            "size": (truth["long_side_m"], truth["short_side_m"]),
            "labelled": True,
        }
        images = read_image(case / data["image_before"]), read_image(case / data["image_after"])
        yield measure(case.name, Camera.from_dict(data["camera"]), table, *images, data["hand_position_m"], true)


def synthetic(count: int, seed: int, known: bool):
    """Measure synthetic pairs, over all looks in turn."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "camera"))
    from synthetic import LOOKS, make_pair

    for number in range(count):
        look = LOOKS[number % len(LOOKS)]
        pair = make_pair(look, seed + number)
        table = pair.table if known else Table(pair.table.height)
        true = {
            "mask_before": pair.mask_before, "mask_after": pair.mask_after,
            "corners": pair.corners, "size": pair.size, "labelled": False,
        }  # fmt: skip
        yield measure(look.name, pair.camera, table, pair.before, pair.after, pair.hand, true)


COLUMNS = (
    "iou_before",
    "iou_after",
    "corner_mean_mm",
    "corner_max_mm",
    "sides_percent",
    "before_s",
    "rectangle_s",
    "after_s",
)


def table_of(rows: list[dict]) -> str:
    """The rows as text, with the worst and the mean below."""
    lines = [f"{'case':32s}" + "".join(f"{name:>15s}" for name in COLUMNS)]
    for row in rows:
        cells = "".join(f"{row[name]:15.4f}" if name in row else f"{'-':>15s}" for name in COLUMNS)
        lines.append(f"{row['case']:32s}{cells}  {row.get('error', '')}")
    for label, pick in (("worst", None), ("mean", np.mean)):
        cells = ""
        for name in COLUMNS:
            values = [row[name] for row in rows if name in row]
            worst = min if name.startswith("iou") else max
            cells += f"{(pick or worst)(values):15.4f}" if values else f"{'-':>15s}"
        lines.append(f"{label:32s}{cells}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=Path, help="folder of recorded cases")
    parser.add_argument("--synthetic", type=int, default=32, help="how many synthetic pairs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--unknown-table", action="store_true", help="do not tell the table's extents")
    parser.add_argument("--json", type=Path, help="write the rows here")
    options = parser.parse_args()
    results = {}
    if options.cases is None or not options.cases.is_dir():
        print(f"no recorded cases at {options.cases}: skipped")
    else:
        results["recorded"] = list(recorded(options.cases, not options.unknown_table))
    if options.synthetic:
        results["synthetic"] = list(synthetic(options.synthetic, options.seed, not options.unknown_table))
    for name, rows in results.items():
        print(f"\n{name}\n{table_of(rows)}" if rows else f"\n{name}: no cases found")
    text = json.dumps(results, indent=1)
    if options.json:
        options.json.write_text(text)
    else:
        print(text)


if __name__ == "__main__":
    main()
