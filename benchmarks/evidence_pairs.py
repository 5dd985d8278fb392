"""Estimates of the same cases beside each other: ``python benchmarks/evidence_pairs.py BEFORE NOW [MORE ...]``.

The folders are what ``pick_evidence.py`` dumped. Only the cases that all of them came to are compared: answers, how
true their confidences are, and seconds, by how many stages the first took.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

SURE = 0.8
BINS = 5


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """The lines of a folder's evidence, by case."""
    rows = map(json.loads, (folder / "evidence.jsonl").read_text().splitlines())
    return {row["case"]: row for row in rows}


def steps(row: dict[str, Any]) -> int:
    """How far off an answer is, in steps of the grid; none counts as far."""
    off = [abs(a - b) for a, b in zip(row.get("pick", ()), row["true"], strict=False)]
    return int(max(off)) if len(off) == 2 and float(row["pick"][0]).is_integer() else 9


def answers(rows: list[dict[str, Any]]) -> str:
    """What answers are worth, as cells of a table."""
    off = np.array([steps(row) for row in rows])
    trusted = np.array([row.get("confidence", 0.0) for row in rows])
    right, sure = off == 0, trusted >= SURE
    where = np.minimum((trusted * BINS).astype(int), BINS - 1)
    error = sum(abs(float((right[where == k] - trusted[where == k]).sum())) for k in range(BINS)) / len(rows)
    score = np.log(np.clip(np.where(right, trusted, 1.0 - trusted), 1e-6, 1.0)).mean()
    brier = ((right - trusted) ** 2).mean()
    return (
        f"{right.sum()} | {(off <= 1).sum()} | {right[sure].sum()} of {sure.sum()}; {(off[sure] > 1).sum()} | "
        f"{trusted.mean():.3f} | {error:.3f} | {brier:.4f} | {score:.3f}"
    )


def main() -> None:
    """Compare folders."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    options = parser.parse_args()
    found = {folder.name: read(folder) for folder in options.folders}
    cases = sorted(set.intersection(*(set(rows) for rows in found.values())))
    first = next(iter(found.values()))
    print(f"{len(cases)} cases that all came to; " + ", ".join(f"{name} {len(rows)}" for name, rows in found.items()))
    print(
        "\n| | exact | within one | at 0.8 or more: right of; more than a step off | mean confidence | calibration "
        "error | Brier | log score |\n|---|---|---|---|---|---|---|---|"
    )
    for name, rows in found.items():
        print(f"| {name} | {answers([rows[case] for case in cases])} |")
    print("\n| stages of the first | cases | exact of each | seconds of each: mean, median, 90 %, worst |")
    print("|---" * 4 + "|")
    depth = {case: len(first[case].get("mistakes", ())) for case in cases}
    for name, low, high in (("one", 0, 1), ("two, three", 2, 3), ("four or more", 4, 99), ("all", 0, 99)):
        of = [case for case in cases if low <= depth[case] <= high]
        if not of:
            continue
        exact = ", ".join(str(sum(steps(rows[case]) == 0 for case in of)) for rows in found.values())
        times = [np.array([rows[case].get("seconds", np.nan) for case in of]) for rows in found.values()]
        told = "; ".join(
            f"{np.nanmean(t):.1f}, {np.nanmedian(t):.1f}, {np.nanpercentile(t, 90):.1f}, {np.nanmax(t):.1f}"
            for t in times
        )
        print(f"| {name} | {len(of)} | {exact} | {told} |")
    print("\n| departs | cases | exact of each |\n|---|---|---|")
    for kind in sorted({first[case]["kind"] for case in cases}):
        of = [case for case in cases if first[case]["kind"] == kind]
        exact = ", ".join(str(sum(steps(rows[case]) == 0 for case in of)) for rows in found.values())
        print(f"| {kind} | {len(of)} | {exact} |")


if __name__ == "__main__":
    main()
