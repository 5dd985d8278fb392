"""Load every scene file that installed packages bring, and say of each what there is or what is missing.

Run: python benchmarks/scene_files.py [--packages NAME ...] [--seconds S] [--json FILE]

A table by package and file: bodies and joints, how many kinds of things were left out or approximated (the JSON names
them), or the error; and whether the world was still finite after a run of S seconds (default 0.1; 0 leaves that out).
"""

import argparse
import json
import logging
import re
import sys
import time
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from tqdm import tqdm

import nuno

PACKAGES = ("example-robot-data", "mujoco", "mujoco-core", "newton", "gymnasium", "warp-lang", "robot_descriptions")
ENDINGS = (".urdf", ".xml", ".mjcf", ".usd", ".usda", ".usdc")


def files_of(package):
    """Return the scene files that a package brings; of XML those that are MJCF."""
    try:
        files = distribution(package).files or []
    except PackageNotFoundError:
        return None
    paths = {Path(file.locate()).resolve() for file in files if file.suffix.lower() in ENDINGS}
    return sorted(path for path in paths if path.is_file() and (path.suffix != ".xml" or is_mjcf(path)))


def is_mjcf(path):
    """Return True if an XML file's root is MuJoCo's."""
    text = re.sub(r"<!--.*?-->|<\?.*?\?>", "", path.read_text(errors="replace"), flags=re.S).lstrip()
    return text.startswith("<mujoco")


def load(path, seconds):
    """Return a row: what there is, or the error."""
    start = time.process_time()
    row = {"file": path.name}
    try:
        scene = nuno.load_scene(path, nuno.World(device="cpu"))
    except nuno.NunoError as error:
        return row | {"loaded": False, "error": f"{type(error).__name__}: {error}".replace(str(path.parent), "...")}
    notes = {what: list(names) for what, names in scene.report.notes.items()}
    row |= {"loaded": True, "bodies": dict(scene.report.bodies), "joints": dict(scene.report.joints), "notes": notes}
    row["cpu_s"] = round(time.process_time() - start, 2)
    if seconds:
        try:
            scene.world.run(seconds)
            row["runs"] = True
        except nuno.NunoError as error:
            row["runs"], row["error"] = False, f"{type(error).__name__}: {error}"
    return row


def line(package, row):
    """Return a row of the table."""
    if not row["loaded"]:
        return f"| {package} | {row['file']} | no | | | {row['error'][:160]} |"
    counts = [", ".join(f"{n} {kind}" for kind, n in row[what].items()) for what in ("bodies", "joints")]
    ran = {True: "", False: f"; {row.get('error', '')[:80]}"}[row.get("runs", True)]
    return f"| {package} | {row['file']} | yes | {counts[0]} | {counts[1]} | {len(row['notes'])} notes{ran} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packages", nargs="+", default=PACKAGES, metavar="NAME")
    parser.add_argument("--seconds", type=float, default=0.1, help="how long each world runs (default 0.1)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where all of it goes")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    found = {package: files_of(package) for package in options.packages}
    table = {}
    print("| package | file | loaded | bodies | joints | left out or approximated |\n|---|---|---|---|---|---|")
    with tqdm(total=sum(len(files or ()) for files in found.values()), disable=not sys.stderr.isatty()) as bar:
        for package, files in found.items():
            if files is None:
                print(f"{package} is not installed")
                continue
            table[package] = []
            for path in files:
                row = load(path, options.seconds)
                table[package].append(row)
                print(line(package, row), flush=True)
                bar.update()
    for package, rows in table.items():
        ran = sum(row.get("runs", False) for row in rows)
        print(f"{package}: {sum(row['loaded'] for row in rows)} of {len(rows)} loaded, {ran} ran")
    if options.json:
        options.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
