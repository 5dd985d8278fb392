"""Boxes raining into a bin: how much faster than real time, and whether any leaves.

    python benchmarks/boxes.py --json out.json
    python benchmarks/boxes.py --boxes 1000 --device cuda
    python benchmarks/boxes.py --boxes 20 --worlds 256 --device cuda

Cubes of 6 cm and 1,000 kg/m3 in a lattice turned at random, over a bin of five static boxes, 5 s. "Out" counts boxes
whose centre is outside of the bin's walls or under its floor; "deepest" is the most that a contact overlaps at the
end.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np

SECONDS, SIDE, WALL, DENSITY, SEED = 5.0, 0.06, 0.02, 1000.0, 1


def bin_of(boxes: int) -> tuple[float, float]:
    """Inner side and height [m] of a bin that the boxes fill to about a sixth."""
    side = max(4.0 * SIDE, SIDE * (1.5 * boxes) ** (1.0 / 3.0))
    return side, 4.0 * side


def make(boxes: int, worlds: int, device: str, substeps: int | None):
    """The solver, and the slots of the boxes."""
    from nuno.rigid.convex_parts import rigid_shape
    from nuno.shapes.mass_properties import mass_properties
    from nuno.shapes.shape import Box
    from nuno.solvers.rigid_solver import RigidSolver

    solver = RigidSolver(worlds, device=device, substeps=substeps)
    side, height = bin_of(boxes)
    reach = 0.5 * (side + WALL)
    for size, position in (
        ((side + 2 * WALL, side + 2 * WALL, WALL), (0.0, 0.0, -0.5 * WALL)),
        ((WALL, side + 2 * WALL, height), (reach, 0.0, 0.5 * height)),
        ((WALL, side + 2 * WALL, height), (-reach, 0.0, 0.5 * height)),
        ((side, WALL, height), (0.0, reach, 0.5 * height)),
        ((side, WALL, height), (0.0, -reach, 0.5 * height)),
    ):
        solver.add(rigid_shape(Box(size), moves=False), position=position)
    cube = Box((SIDE, SIDE, SIDE))
    weighed = mass_properties(cube)
    random = np.random.default_rng(SEED)
    each = int(side / (1.75 * SIDE))
    slots = []
    for k in range(boxes):
        layer, place = divmod(k, each * each)
        x, y = np.array(divmod(place, each)) - 0.5 * (each - 1)
        turn = random.normal(size=4)
        slots.append(
            solver.add(
                rigid_shape(cube), position=(1.75 * SIDE * x, 1.75 * SIDE * y, 0.1 + 1.75 * SIDE * layer),
                quaternion=turn / np.linalg.norm(turn), mass=DENSITY * weighed.volume,
                inertia=DENSITY * weighed.inertia,
            )
        )  # fmt: skip
    return solver, slots


def measure(boxes: int, worlds: int, device: str, substeps: int | None) -> dict:
    """Run the five seconds, half a second at a time."""
    import warp as wp

    solver, slots = make(boxes, worlds, device, substeps)
    warm, _ = make(8, worlds, device, substeps)
    warm.run(0.0, 1.0 / 60.0)  # compiles
    spent = []
    for piece in range(10):
        begin = time.perf_counter()
        solver.run(0.5 * piece, 0.5)
        wp.synchronize_device(device)
        spent.append(time.perf_counter() - begin)
    places = np.stack([solver.pose(slot)[0] for slot in slots], axis=1)
    speeds = np.stack([solver.velocity(slot)[0] for slot in slots], axis=1)
    side, _ = bin_of(boxes)
    out = (np.abs(places[..., :2]).max(axis=-1) > 0.5 * side) | (places[..., 2] < 0.0)
    return {
        "boxes": boxes, "worlds": worlds, "device": device, "substeps": solver.substeps, "wall_s": spent,
        "real_time": SECONDS / sum(spent), "real_time_falling": 1.5 / sum(spent[:3]),
        "real_time_at_rest": 0.5 / spent[-1], "out": int(out.sum()), "finite": bool(solver.finite().all()),
        "deepest_mm": 1e3 * solver.deepest(), "top_m": float(places[..., 2].max()),
        "fastest_m_s": float(np.linalg.norm(speeds, axis=-1).max()),
        "contacts": int(solver.contact_count().max()),
    }  # fmt: skip


def show(rows: list[dict]) -> None:
    """Print the table."""
    print("boxes worlds device   substeps  x real time (falling, at rest)   out  deepest mm  fastest m/s  points")
    for row in rows:
        line = f"{row['boxes']:5} {row['worlds']:6} {row['device']:8} {row['substeps']:8}  {row['real_time']:11.2f}"
        line += f" ({row['real_time_falling']:.2f}, {row['real_time_at_rest']:.2f})".ljust(21)
        line += f"{row['out']:4} {row['deepest_mm']:10.3f} {row['fastest_m_s']:12.4f} {row['contacts']:8}"
        print(line)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--boxes", type=int, nargs="+", default=None, help="default 100; on CUDA 100 and 1000")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--substeps", type=int, default=None)
    parser.add_argument("--json", help="write the figures there")
    given = parser.parse_args()
    from nuno.world.device import found_device

    device = found_device(given.device)
    boxes = given.boxes or ([100] if device == "cpu" else [100, 1000])
    rows = [measure(n, worlds, device, given.substeps) for n in boxes for worlds in given.worlds]
    show(rows)
    if given.json:
        with open(given.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
