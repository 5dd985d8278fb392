"""CPU seconds of the tests, from an empty cache of kernels: compiling, collecting, and each test.

    python benchmarks/time_tests.py [--json FILE] [--warm] [PYTEST'S ARGUMENTS ...]

It runs `nuno compile` with WARP_CACHE_PATH in a temporary folder, then pytest in this process (README's command without
-n), and counts the seconds of the processor that they and their children take, which other work on the machine changes
less than the clock's. `--warm` leaves the cache as it is and compiles nothing. The table has the dearest test files and
tests.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROWS = 25


def cpu() -> float:
    """Seconds that this process and its children that ended have taken."""
    own = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in own)


class Meter:
    """A plugin of pytest that notes what each test takes, fixtures included."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Generator[None, object, object]:
        """Time a test."""
        start = cpu()
        result = yield
        self.seconds[item.nodeid] = cpu() - start
        return result


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--json", type=Path, help="where to write all seconds")
    options.add_argument("--warm", action="store_true", help="compile nothing ahead, and use the cache that there is")
    asked, arguments = options.parse_known_args()
    os.chdir(ROOT)
    meter, compiled = Meter(), 0.0
    with tempfile.TemporaryDirectory() as cache:
        if not asked.warm:
            os.environ["WARP_CACHE_PATH"] = cache
            start = cpu()
            subprocess.run([sys.executable, "-m", "nuno", "compile"], check=True)
            compiled = cpu() - start
        start = cpu()
        status = pytest.main(["-q", "-p", "no:cacheprovider", *arguments], plugins=[meter])
        whole = cpu() - start
    tests = sum(meter.seconds.values())
    print(f"\nCPU s: compiling {compiled:.0f}, collecting and the rest {whole - tests:.0f}, {len(meter.seconds)} tests "
          f"{tests:.0f}; together {(compiled + whole) / 60:.1f} min")  # fmt: skip
    files: Counter[str] = Counter()
    for name, seconds in meter.seconds.items():
        files[name.partition("::")[0]] += seconds  # type: ignore[assignment]
    for title, found in (("file", files), ("test", Counter(meter.seconds))):  # type: ignore[arg-type]
        print(f"\n| {title} | CPU s |\n|---|---|")
        for name, seconds in found.most_common(ROWS):
            print(f"| {name} | {seconds:.1f} |")
    if asked.json:
        told = {"compile": compiled, "pytest": whole, "tests": meter.seconds}
        asked.json.write_text(json.dumps(told, indent=1), encoding="utf-8")
    sys.exit(status)


if __name__ == "__main__":
    main()
