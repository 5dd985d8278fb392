"""Bars of soft material against closed forms, by cells across, and a pressed cube's stresses layer by layer.

The bars are those of `tests/physics/test_soft_bars.py`, whose assertions bound the same numbers.

    python benchmarks/soft_bars.py [--across 2 4 6 8] [--json FILE]
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import nuno

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "physics")]

from test_soft_bars import bend, twist  # noqa: E402

SIDE, CELLS, PRESSED = 0.1, 5, 0.9  # of the cube [m]; of its height


def pressed_cube(substeps, poisson):
    """Return mean stress times area over the floor's force, and the same of the layers at a plate, next and between."""
    world = nuno.World(gravity=(0.0, 0.0, 0.0), device="cpu", substeps=substeps)
    world.add(nuno.plane(name="floor"))
    cube = world.add(nuno.soft_box((SIDE,) * 3, cells=(CELLS,) * 3, position=(0.0, 0.0, 0.5 * SIDE)))
    lid = world.add(nuno.box((0.3, 0.3, 0.02), name="lid", position=(0.0, 0.0, SIDE + 0.01)))
    level = np.floor(cube.vertices[cube.shape.tetrahedra().tets, 2].mean(axis=1) / (SIDE / CELLS)).astype(int)
    world.attach(cube, nuno.Soft(200.0, 5e4, poisson, friction=0.0, damping=0.01, air_drag=8.0))
    pressed = (0.0, 0.0, PRESSED * SIDE + 0.01)
    world.move(lid, nuno.Path([0.0, 0.4], [lid.position, pressed], interpolation="minimum_jerk"))
    world.run(1.0)
    found, inside = world.contacts(cube), nuno.elements(cube)
    force = sum(f[2] for f, other in zip(found.forces, found.others, strict=True) if other == "floor")
    share = -inside.stresses[:, 2, 2] * inside.volumes.sum() / np.ptp(cube.vertices[:, 2]) / force
    layers = [(level == k) | (level == CELLS - 1 - k) for k in (0, 1, CELLS // 2)]
    means = [float(np.average(share[own], weights=inside.volumes[own])) for own in layers]
    return cube.resolution.substeps, float(np.average(share, weights=inside.volumes)), means


def main():
    """Print both tables, and write them as JSON where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--across", type=int, nargs="*", default=[2, 4, 6, 8])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    told = {"bars": [], "cube": []}
    print("| cells across | deflection | torque | by energy | linear | `mean_strain`: deflection | torque |")
    print("|---|---|---|---|---|---|---|")
    for across in options.across:
        plain, shared = ((bend(across, mean)[1], *twist(across, mean_strain=mean)) for mean in (False, True))
        numbers = [plain[0], plain[1], plain[3], plain[4], shared[0], shared[1]]
        told["bars"].append([across, *map(float, numbers)])
        print(f"| {across} | " + " | ".join(f"{value:.2f}" for value in numbers) + " |", flush=True)
    print("\n| substeps | Poisson's ratio | mean stress x cross-section / force | layer at the plate / next / middle |")
    print("|---|---|---|---|")
    for substeps, poisson in ((None, 0.3), (120, 0.3), (240, 0.3), (None, 0.45), (None, 0.49)):
        count, mean, layers = pressed_cube(substeps, poisson)
        told["cube"].append([count, poisson, mean, *layers])
        print(f"| {count} | {poisson} | {mean:.3f} | " + " / ".join(f"{v:.2f}" for v in layers) + " |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
