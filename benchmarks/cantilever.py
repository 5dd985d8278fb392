"""Print effective over nominal bending rigidity of strips under their own weight, by mesh size and G.

The rigidity is the B whose elastica has the measured drop over reach; see tests/physics/elastica.py.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "physics"))

from elastica import cantilever, rigidity_ratio
from triangles import KINDS

LOADS = [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0]  # G = w L^3 / B


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[5, 10, 20, 40], help="cells along the strip")
    parser.add_argument("--across", type=int, default=1, help="cells across the strip")
    parser.add_argument("--length", type=float, default=0.2, help="free length [m]")
    parser.add_argument("--along", choices=["warp", "weft"], default="warp")
    parser.add_argument("--substeps", type=int, nargs="+", default=[0], help="substeps a frame; 0 is the default rule")
    parser.add_argument("--kind", choices=["sheet", *KINDS], default="sheet", help="a sheet, or triangles of a kind")
    options = parser.parse_args()
    print(f"{'cells':>5} {'substeps':>8}  " + " ".join(f"G={g:<5g}" for g in LOADS) + "  worst")
    for cells in options.cells:
        for substeps in options.substeps:
            measured, felt, used = cantilever(
                LOADS, cells, length=options.length, across=options.across, along=options.along,
                substeps=substeps or None, kind=options.kind,
            )  # fmt: skip
            ratios = [rigidity_ratio(g, r) for g, r in zip(felt, measured, strict=True)]
            worst = np.abs(np.array(ratios) - 1).max()
            print(f"{cells:5d} {used:8d}  " + " ".join(f"{r:7.3f}" for r in ratios) + f"  {worst:.1%}")


if __name__ == "__main__":
    main()
