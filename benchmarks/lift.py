"""A fine cloth lifted from a table at one point, with self-contact: times real time in successive half seconds.

    python benchmarks/lift.py [--device cuda:0] [--cells 128 256] [--plans grid large]

A cloth of 0.6 m, 0.2 kg/m2 and 5e-5 N m lies 2 mm above a table. A vertex a third of the way from a corner along both
sides is lifted by 0.4 m from 0.1 to 1.6 s. Kernels are compiled, and two frames run, before the clock starts.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import nuno

SPANS, SPAN = 3, 0.5
"""Half seconds that are timed, and their length [s]."""
LEAD = 2.0 / 60.0
"""What runs before [s]."""


def lifted(device: str, cells: int, contact: bool) -> tuple[nuno.World, nuno.Body]:
    """The cloth on its table, held."""
    world = nuno.World(device=device)
    world.add(nuno.box((1.2, 0.8, 0.04), name="table", position=(0.0, 0.0, 0.68)))
    world.add(nuno.plane(name="floor"))
    body = world.add(nuno.sheet((0.6, 0.6), cells=(cells, cells), position=(0.0, 0.0, 0.702)))
    if not contact:
        world.ignore_contact(body, body)
    world.attach(body, nuno.Cloth(area_density=0.2, bending_rigidity=5e-5, air_drag=1.5, thickness=0.004))
    vertex = np.array([(cells // 3) * (cells + 1) + cells // 3])
    start = np.asarray(body.vertices)[vertex[0]]
    ends = start + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.4]])
    path = nuno.Path(np.array([0.1, 1.6]), ends, interpolation="minimum_jerk")
    world.grip(body, vertex, to=path)
    return world, body


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--cells", type=int, nargs="+", default=[128, 256])
    parser.add_argument("--plans", nargs="+", default=["auto"])
    options = parser.parse_args()
    print("| cells | plan | self-contact | substeps | times real time, half second by half second | lists made |")
    print("|---|---|---|---|---|---|")
    for cells in options.cells:
        for plan in options.plans:
            for contact in (True, False):
                world, body = lifted(options.device, cells, contact)
                solver = body._dynamics.solver  # type: ignore[union-attr]
                if plan != "auto":
                    solver.plan = plan
                world.run(LEAD, progress=False)
                ratios, lists = [], []
                for _ in range(SPANS):
                    before, start = solver.listings, time.perf_counter()
                    world.run(SPAN, progress=False)
                    ratios.append(f"{SPAN / (time.perf_counter() - start):.2f}")
                    lists.append(str(int((solver.listings - before)[0])))
                row = (f"{cells} x {cells}", solver.plan, str(contact), str(solver.substeps))
                print(f"| {' | '.join(row)} | {', '.join(ratios)} | {', '.join(lists)} |", flush=True)


if __name__ == "__main__":
    main()
