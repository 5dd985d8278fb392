"""The least force with which two hands lift a soft cube, over Coulomb's m g / (2 mu), by friction and stiffness.

python benchmarks/soft_lift.py [--friction 0.2 0.3 0.5 0.8] [--young 2e4 5e4] [--json FILE]
"""

import argparse
import json
from pathlib import Path

import nuno


def main():
    """Print a table, and write it as JSON where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--friction", type=float, nargs="*", default=[0.2, 0.3, 0.5, 0.8])
    parser.add_argument("--young", type=float, nargs="*", default=[2e4, 5e4], help="[Pa]")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    print("| mu | closed form [N] | " + " | ".join(f"E = {young / 1e3:g} kPa" for young in options.young) + " |")
    print("|---" * (2 + len(options.young)) + "|")
    for friction in options.friction:
        shares = []
        for young in options.young:
            cube = nuno.Soft(density=200.0, youngs_modulus=young, poisson_ratio=0.3, friction=friction, damping=0.01)
            result = nuno.lift_soft_cube(edge=0.1, cells=4, material=cube)
            shares.append(float(result.least_force / result.closed_form))
        rows.append([friction, float(result.closed_form), *shares])
        shown = " | ".join(f"{share:.3f}" for share in shares)
        print(f"| {friction:g} | {result.closed_form:.3f} | {shown} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
