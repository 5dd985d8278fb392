"""Mutations: single faults in the package, and whether the tests that should see them do.

Each is made in a copy of the package and the tests, and the named test files run on it, long tests included. A mutation
that no test sees has survived. What runs out of time is listed as such, and counts neither way.

    python benchmarks/mutations.py --out out/mutations [--only constraints rigid] [--numbers 0 7] [--seconds 900]
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from mutation_list import MUTATIONS

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Found:
    """What became of a mutation: "killed", "survived", "timeout", "not run" or "stale" (its text is not there)."""

    area: str
    file: str
    old: str
    new: str
    tests: str
    fate: str
    seconds: float
    by: str = ""


def try_mutation(copy, area, file, old, new, tests, limit):
    """Make a mutation in the copy, run its tests, and put the file back."""
    path = copy / "src" / "nuno" / file
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        return Found(area, file, old, new, tests, "stale", 0.0)
    path.write_text(text.replace(old, new), encoding="utf-8")
    clock = time.perf_counter()
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", "0", "-q", "-x", "-m", "not slow"]
    environment = {**os.environ, "PYTHONPATH": str(copy / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        ran = subprocess.run(
            [*command, *(f"tests/{name}" for name in tests.split())], cwd=copy, env=environment, timeout=limit,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        lines = [line for line in ran.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        fate = {0: "survived", 1: "killed", 2: "killed"}.get(ran.returncode, "broken")
        by = lines[0].split(" - ")[0] if lines else ran.stdout[-200:] if fate == "broken" else ""
    except subprocess.TimeoutExpired:
        fate, by = "timeout", ""
    finally:
        path.write_text(text, encoding="utf-8")
    return Found(area, file, old, new, tests, fate, round(time.perf_counter() - clock, 1), by)


def main():
    """Try as many mutations as there is time for, and write a table and JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--only", nargs="*", default=None, help="areas")
    parser.add_argument("--numbers", nargs="*", type=int, default=None, help="places in the list, from 0")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for all of them")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for each")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    listed = MUTATIONS if options.numbers is None else [MUTATIONS[number] for number in options.numbers]
    chosen = [each for each in listed if options.only is None or each[0] in options.only]
    begin, found = time.perf_counter(), []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("src", "tests", "examples", "docs"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        for each in chosen:
            if time.perf_counter() - begin > options.seconds:
                found.append(Found(*each, "not run", 0.0))
                continue
            found.append(try_mutation(copy, *each, options.limit))
            last = found[-1]
            sys.stdout.write(f"{last.fate:9} {last.seconds:6.1f} s  {last.file}: {last.new.strip()[:60]}  {last.by}\n")
            sys.stdout.flush()
            (options.out / "mutations.json").write_text(json.dumps([asdict(one) for one in found], indent=1))
    fates = [one.fate for one in found]
    killed, survived = fates.count("killed"), fates.count("survived")
    ended = f"{killed + survived} of {len(found)} run to an end, {survived} survived"
    sys.stdout.write(f"{ended}, score {killed / max(killed + survived, 1):.2f}\n")


if __name__ == "__main__":
    main()
