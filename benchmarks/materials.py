"""Materials of cloths by their images: of simulated cloths, whose materials are known, and of the bundled cases.

The scene is that of `examples/fit_material.py`.

    python benchmarks/materials.py [--seeds 0 1] [--json FILE]
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import nuno
from nuno.tasks.look_at_camera import look_at_camera

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SIZE, REST = (0.3, 0.2), 0.0025  # [m], and the height of the cloth's middle surface above the table
TIMES = np.arange(0.2, 2.1, 0.2)  # [s] of the images
TRUE = ((8e-5, 800.0, 0.4), (3e-4, 1500.0, 0.25))
NAMES = ("bending_rigidity", "stretch_stiffness", "friction")
KNOWN = {"area_density": 0.2, "thickness": 2 * REST}


def room(cells, substeps):
    """Return a cloth flat on an endless table."""
    world = nuno.World(device="cpu", substeps=substeps)
    world.add(nuno.plane(name="table"))
    world.add(nuno.sheet(SIZE, cells=cells, name="cloth", position=(0, 0, REST)))
    return world


def lift_and_draw(world):
    """Lift the corners at -x, wait, and draw the cloth over the table."""
    cloth = world.find("cloth")
    flat = np.reshape(cloth.vertices, (world.world_count, -1, 3))[0]
    for side in (1, -1):
        corner = int((flat[:, :2] @ (-1, side)).argmax())
        begin = flat[corner]
        up = begin + np.array((0.03, 0.0, 0.16))
        way = np.stack([begin, up, up, up - (0.1, 0.0, 0.0)])
        world.grip(cloth, [corner], to=nuno.Path([0.0, 0.6, 0.9, 1.4], way, interpolation="minimum_jerk"))


def simulated(true, seeds):
    """Return what was found over what is true, a row a seed, the range of bending, and the seconds of a fit."""
    camera = look_at_camera((0, -0.75, 0.25), (0, 0, 0.09), 320, 240, 340.0)
    real = room((27, 18), 40)
    real.attach("cloth", nuno.Cloth(**KNOWN, **dict(zip(NAMES, true, strict=True))))
    lift_and_draw(real)
    masks = []
    for moment in TIMES:
        real.run(moment - real.time)
        masks.append(real.masks(camera, "cloth").numpy())
    rows, ranges, seconds = [], [], []
    for seed in seeds:
        footage = nuno.Footage(room((18, 12), 20), "cloth", lift_and_draw, camera, TIMES, masks, drawn_thickness=0.0)
        begin = time.process_time()
        fit = nuno.fit_material(footage, known=nuno.Cloth(**KNOWN), seed=seed, progress=False)
        seconds.append(time.process_time() - begin)
        rows.append([float(fit.params[name] / value) for name, value in zip(NAMES, true, strict=True)])
        ranges.append([float(value) for value in fit.ranges["bending_rigidity"]])
    return rows, ranges, seconds


def main():
    """Print both tables, and write them as JSON where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    told = {"simulated": [], "bundled": {}}
    print("| true bending, stretch, friction | found, by the true ones | range of bending | CPU seconds |")
    print("|---|---|---|---|")
    for true in TRUE:
        rows, ranges, seconds = simulated(true, options.seeds)
        told["simulated"].append({"true": true, "found": rows, "ranges": ranges, "seconds": seconds})
        parts = [" to ".join(f"{value:.2f}" for value in sorted(column)) for column in np.transpose(rows)]
        low, high = np.min(ranges, axis=0)[0], np.max(ranges, axis=0)[1]
        print(
            f"| {true[0]:g} N m, {true[1]:g} N/m, {true[2]:g} | {', '.join(parts)} | {low:.1e} to {high:.1e} | "
            f"{np.mean(seconds):.0f} |", flush=True,
        )  # fmt: skip
    for name, case in (("pick", nuno.read_case), ("fold", nuno.read_fold_case)):
        fit = nuno.fit_material(case(EXAMPLES / f"{name}-case"), generations=10, device="cpu", progress=False)
        told["bundled"][name] = {"params": fit.params, "ranges": fit.ranges, "like": fit.name, "overlap": fit.overlap}
        values = "; ".join(
            f"{key} {value:.2g}, of {fit.ranges[key][0]:.2g} to {fit.ranges[key][1]:.2g}"
            for key, value in fit.params.items()
        )
        print(f"\n{name}: {values}; like {fit.name}; overlap {fit.overlap:.3f}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(told, indent=1, default=float))


if __name__ == "__main__":
    main()
