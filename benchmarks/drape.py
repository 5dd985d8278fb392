"""Print drape coefficients of rectangles on a disc by bending length, for the sizes of five measured fabrics.

At rest a drape depends on the fabric's bending length c = (B / w)^(1/3) alone. The measured values are those of
towel, napkins, rag and denim of the TextileCharacterization data (ICRA 2024), whose rigidities are not known here.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "physics"))

from drape import drape_coefficients
from world_with import GRAVITY

import nuno

FABRICS = {  # sides [m], disc's diameter [m], measured
    "towel": ((0.50, 0.30), 0.18, 0.204),
    "cotton napkin": ((0.50, 0.50), 0.30, 0.040),
    "linen napkin": ((0.50, 0.50), 0.30, 0.092),
    "waffle rag": ((0.50, 0.35), 0.21, 0.218),
    "denim": ((0.25, 0.17), 0.10, 0.816),
}
LENGTHS = np.array([0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06])  # c [m]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=30, help="cells along the longer side")
    parser.add_argument("--seconds", type=float, default=6.0, help="how long they settle [s]")
    parser.add_argument("--shear", type=float, nargs="+", default=[20.0, 300.0], help="shear stiffness [N/m]")
    options = parser.parse_args()
    density = 0.2
    for shear in options.shear:
        print(f"shear {shear:g} N/m".ljust(14) + " ".join(f" {f'c={1e3 * c:g}mm':>7}" for c in LENGTHS) + "  measured")
        for name, (size, plate, measured) in FABRICS.items():
            cells = (options.cells, round(options.cells * size[1] / size[0]))
            material = nuno.Cloth(
                area_density=density, bending_rigidity=density * GRAVITY * LENGTHS**3, shear_stiffness=shear,
                thickness=1e-3, air_drag=3.0,
            )  # fmt: skip
            found = drape_coefficients(size, plate, cells, material, len(LENGTHS), seconds=options.seconds)
            print(f"{name:<14}" + " ".join(f" {c:7.3f}" for c in found) + f"  {measured:8.3f}", flush=True)


if __name__ == "__main__":
    main()
