"""How a taut grid line may be solved: stability, pitch and damping of one line of point masses, in NumPy.

    python benchmarks/taut_line.py

A line of 24 edges, 10 mm and 0.2 kg/m2 times a unit of width, hangs between a fixed end and one that is pulled by T.
As in `nuno.constraints.membrane` all its edges are solved at once, for the predicted directions; the ways differ in
what they do about the directions having turned by then. s is the largest (omega dt)^2, 4 T dt^2 / (rho h^2).
"""

from __future__ import annotations

import argparse
import json

import numpy as np
from scipy.linalg import solveh_banded

H, RHO, EDGES, STEP = 0.01, 0.2, 24, 1.0 / (60 * 65)


def solve(x: np.ndarray, w: np.ndarray, rest: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the multipliers of all edges (m,), negative where they pull, and the directions (m, 2)."""
    edge = x[:-1] - x[1:]
    length = np.linalg.norm(edge, axis=1)
    unit = edge / length[:, None]
    band = np.zeros((2, len(rest)))
    band[1] = w[:-1] + w[1:] + alpha
    band[0, 1:] = -w[1:-1] * (unit[1:] * unit[:-1]).sum(axis=1)
    return solveh_banded(band, rest - length), unit


def moved(x: np.ndarray, w: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Positions after each edge has pulled its two ends by ``force`` (m, 2)."""
    out = x.copy()
    out[:-1] += w[:-1, None] * force
    out[1:] -= w[1:, None] * force
    return out


def units(x: np.ndarray) -> np.ndarray:
    """The edges' directions."""
    edge = x[:-1] - x[1:]
    return edge / np.linalg.norm(edge, axis=1)[:, None]


def project(x: np.ndarray, start: np.ndarray, w: np.ndarray, rest: np.ndarray, alpha: float, way: str) -> np.ndarray:
    """One substep's solution of the line: ``x`` predicted, ``start`` where the substep began."""
    pull, unit = solve(x, w, rest, alpha)
    if way == "start":  # SHAKE: along the directions at the start
        return moved(x, w, pull[:, None] * units(start))
    if way == "mean":
        return moved(x, w, 0.5 * pull[:, None] * (units(start) + unit))
    if way.startswith("shared"):  # a part of the multiplier in each of several passes
        count = int(way[6:])
        for _ in range(count):
            x = moved(x, w, pull[:, None] / count * units(x))
        return x
    first = moved(x, w, pull[:, None] * unit)
    if way == "predicted":
        return first
    if way == "anew":  # Newton's second iteration: all of it along the directions that the first has turned
        return moved(x, w, pull[:, None] * units(first))
    if way == "implicit":  # transverse stiffness T / h in the matrix: backward Euler of the string
        m = len(x)
        k = -pull / rest
        matrix = np.diag(1.0 / np.maximum(w, 1e-12))
        for i, stiff in enumerate(k):
            matrix[i : i + 2, i : i + 2] += stiff * np.array([[1.0, -1.0], [-1.0, 1.0]])
        free = np.flatnonzero(w)
        fixed = np.setdiff1d(np.arange(m), free)
        side = x[free, 1] / w[free] - matrix[np.ix_(free, fixed)] @ x[fixed, 1]
        first[free, 1] = np.linalg.solve(matrix[np.ix_(free, free)], side)
        return first
    share, rule = way.split()  # the share of the multiplier that pulls along the new directions, by line or by edge
    taut = -pull * (w[:-1] + w[1:]) * 2.0 / rest
    taken = np.where((taut if rule == "edge" else taut.max()) > 0.8, float(share), 0.0)
    return moved(first, w, (taken * pull)[:, None] * (units(first) - unit))


def line(tension: float, stiffness: float, way: str, seconds: float, *, kick: float, mode: int = 0, heavy: float = 0.0):
    """Run a line that is pulled by ``tension``; return whether it stood, its strain and the mode's amplitudes."""
    n = EDGES + 1
    w = np.full(n, 1.0 / (RHO * H))
    w[0] = 0.0
    end = n - 1
    x = np.zeros((n, 2))
    x[:, 0] = np.arange(n) * H * (1.0 + tension / stiffness)
    rng = np.random.default_rng(0)
    k = np.arange(n)
    shape = np.sin(np.pi * mode * k / (n - 1)) if mode else rng.normal(size=n)
    shape[[0, end]] = 0.0
    x[:, 1] = kick * shape
    v = np.zeros_like(x)
    rest = np.full(EDGES, H)
    alpha = H / (stiffness * STEP**2)
    amplitude, most = [], 0.0
    for _ in range(round(seconds / STEP)):
        start = x.copy()
        v[1:, 0] += heavy * STEP
        v[end, 0] += STEP * tension * w[end]
        x = x + STEP * v
        x[0] = start[0]
        x[end, 1] = 0.0
        x = project(x, start, w, rest, alpha, way)
        x[end, 1] = 0.0
        v = (x - start) / STEP
        amplitude.append(2.0 * (x[:, 1] * shape).sum() / (n - 1) if mode else np.abs(x[:, 1]).max())
        most = max(most, np.abs(x[:, 1]).max())
        if not np.isfinite(most) or most > 10.0 * H:
            return False, np.nan, np.array(amplitude)
    strain = (x[-1, 0] - x[0, 0]) / (EDGES * H) - 1.0
    return np.abs(x[:, 1]).max() < kick, strain, np.array(amplitude)


WAYS = ("predicted", "start", "mean", "anew", "0.1875 line", "0.2 line", "0.25 line", "0.25 edge", "shared2",
        "shared3", "implicit")  # fmt: skip


def limit(way: str, **options) -> float:
    """The largest s of a line that still calms down after a kick, by steps of 5 %."""
    s, last = 0.5, 0.0
    while s < 12.0:
        tension = s * RHO * H**2 / (4.0 * STEP**2)
        if not line(tension, 10.0 * tension, way, 0.3, kick=1e-5, **options)[0]:
            break
        last, s = s, 1.05 * s
    return last


def pitch(way: str, s: float, mode: int) -> tuple[float, float]:
    """Frequency of a mode over the string's, and its damping ratio."""
    tension = s * RHO * H**2 / (4.0 * STEP**2)
    omega = 2.0 / H * np.sqrt(tension / RHO) * np.sin(0.5 * np.pi * mode / EDGES)
    amplitude = line(tension, 10.0 * tension, way, 4.2 * 2 * np.pi / omega, kick=1e-5, mode=mode)[2]
    sign = np.flatnonzero(np.diff(np.sign(amplitude)))
    if len(sign) < 4:
        return np.nan, np.nan
    cross = sign + amplitude[sign] / (amplitude[sign] - amplitude[sign + 1])
    half = np.diff(cross).mean() * STEP
    peaks = [np.abs(amplitude[a:b]).max() for a, b in zip(sign[:-1] + 1, sign[1:] + 1, strict=True)]
    return np.pi / half / omega, float(-np.mean(np.diff(np.log(peaks))) / np.pi)


def main() -> None:
    """Print the table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", help="JSON file")
    out = parser.parse_args().out
    rows = []
    print(f"{'way':14}{'s':>7}{'T N/m':>8} | pitch and damping ratio of mode 1, 4 at s = 0.5; mode 1 at s = 2")
    for way in WAYS:
        s = limit(way)
        row = {"way": way, "s": s, "tension": s * RHO * H**2 / (4 * STEP**2)}
        kinds = ((0.5, 1), (0.5, 4), (2.0, 1))
        row["pitch"] = [pitch(way, at, mode) if at < s else (np.nan, np.nan) for at, mode in kinds]
        rows.append(row)
        found = "  ".join(f"{f:6.4f} {d:7.4f}" for f, d in row["pitch"])
        print(f"{way:14}{s:7.2f}{row['tension']:8.0f} | {found}", flush=True)
    if out:
        with open(out, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
