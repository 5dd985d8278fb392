"""A hash of what a dozen scenes come to in a second, by which two versions are compared to the bit.

    python benchmarks/hash_scenes.py [cpu | cuda:0] [--scenes hang boxes ...]

Run it with the src folder of either version in PYTHONPATH and compare the lines: name, plans, hash of the bodies'
vertices and velocities. The same version must give the same hashes twice.
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np

import nuno

Scene = tuple[Any, list[Any]]
CLOTH = nuno.Cloth(area_density=0.2, bending_rigidity=5e-5, air_drag=1.5)


def room(device: str, **settings: Any) -> Any:
    """A world with a table and a floor."""
    world = nuno.World(device=device, **settings)
    world.add(nuno.box((1.2, 0.8, 0.04), name="table", position=(0, 0, 0.68)))
    world.add(nuno.plane(name="floor"))
    return world


def add(world: Any, body: Any, material: Any) -> Any:
    """Add a body with dynamics."""
    world.attach(world.add(body), material)
    return body


def cloth_over_edge(device: str) -> Scene:
    """A cloth at default substeps, in doubles, that slides over an edge of the table."""
    world = room(device)
    return world, [add(world, nuno.sheet((0.5, 0.4), cells=(20, 16), position=(0.4, 0.2, 0.75)), CLOTH)]


def cloth_in_floats(device: str) -> Scene:
    """The same with substeps that are given, in floats."""
    world = room(device, substeps=12)
    return world, [add(world, nuno.sheet((0.5, 0.5), cells=(20, 20), position=(0.3, 0, 0.75)), CLOTH)]


def hang(device: str, cells: int = 24, substeps: int | None = None) -> Scene:
    """A cloth by two corners."""
    world = nuno.World(device=device, substeps=substeps)
    rail = world.add(nuno.box((0.02, 0.02, 0.02), position=(0, 0, 2.6)))
    cloth = add(world, nuno.sheet((1.0, 1.0), cells=(cells, cells), position=(0, 0, 2.0)), CLOTH)
    world.grip(cloth, [0, cells], to=rail)
    return world, [cloth]


def hang_long_lines(device: str) -> Scene:
    """A cloth whose grid lines have 60 edges."""
    return hang(device, 60)


def hang_large(device: str) -> Scene:
    """A cloth of 5,041 particles, which is beyond a block on CUDA, in doubles."""
    return hang(device, 70)


def hang_large_in_floats(device: str) -> Scene:
    """The same in floats."""
    return hang(device, 70, substeps=20)


def soft_cube(device: str, cells: int = 6, substeps: int | None = None) -> Scene:
    """A soft cube that falls on a floor."""
    world = nuno.World(device=device, substeps=substeps)
    world.add(nuno.plane())
    cube = nuno.soft_box((0.1, 0.1, 0.1), cells=(cells, cells, cells), position=(0, 0, 0.12))
    return world, [add(world, cube, nuno.Soft(youngs_modulus=5e4, density=1000.0))]


def soft_cube_large(device: str) -> Scene:
    """A soft cube of 3,375 particles."""
    return soft_cube(device, 14)


def soft_cube_large_in_floats(device: str) -> Scene:
    """The same in floats."""
    return soft_cube(device, 14, substeps=20)


def soft_cubes(device: str) -> Scene:
    """A batch of 20 soft cubes of different stiffness."""
    world = nuno.World(device=device, substeps=10)
    world.add(nuno.plane())
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(4, 4, 4), position=(0, 0, 0.12), name="cube"))
    futures = world.imagine(20)
    cube = futures.find("cube")
    futures.attach(cube, nuno.Soft(youngs_modulus=np.linspace(2e4, 8e4, 20), density=1000.0))
    return futures, [cube]


def box_on_towel(device: str) -> Scene:
    """A box of 1 kg on a towel."""
    world = room(device)
    towel = add(world, nuno.sheet((0.4, 0.4), cells=(14, 14), position=(0, 0, 0.702)), CLOTH)
    return world, [towel, add(world, nuno.box((0.1, 0.1, 0.1), position=(0, 0, 0.756)), nuno.Rigid(mass=1.0))]


def two_cloths(device: str) -> Scene:
    """A cloth that falls on another."""
    world = room(device)
    below = add(world, nuno.sheet((0.3, 0.3), cells=(10, 10), position=(0, 0, 0.71)), CLOTH)
    return world, [below, add(world, nuno.sheet((0.2, 0.2), cells=(8, 8), position=(0.02, 0.01, 0.75)), CLOTH)]


def soft_on_cloth(device: str) -> Scene:
    """A soft cube on a towel."""
    world = room(device)
    towel = add(world, nuno.sheet((0.3, 0.3), cells=(10, 10), position=(0, 0, 0.702)), CLOTH)
    cube = nuno.soft_box((0.06, 0.06, 0.06), cells=(3, 3, 3), position=(0, 0, 0.75))
    return world, [towel, add(world, cube, nuno.Soft(youngs_modulus=5e4, density=500.0))]


def picks(device: str, substeps: int | None = 12) -> Scene:
    """A batch of 20 picks of a cloth, in floats."""
    world = room(device, substeps=substeps)
    world.add(nuno.sheet((0.4, 0.4), cells=(16, 16), name="cloth", position=(0, 0, 0.702)))
    futures = world.imagine(20)
    cloth = futures.find("cloth")
    futures.attach(cloth, CLOTH)
    line = np.linspace(0, 16, 5).round().astype(int)
    vertices = np.array([j * 17 + i for j in line for i in line])[:20]
    start = np.asarray(cloth.vertices)[0][vertices]
    keys = np.stack([start, start + np.array([0, 0, 0.3])], axis=1)
    futures.grip(cloth, vertices[:, None], to=nuno.Path((0.1, 0.8), keys, None, "minimum_jerk"))
    return futures, [cloth]


def picks_in_doubles(device: str) -> Scene:
    """The same at default substeps."""
    return picks(device, None)


def boxes(device: str) -> Scene:
    """Twelve rigid boxes that fall in stacks."""
    world = nuno.World(device=device)
    world.add(nuno.plane())
    places = [(0.13 * (k % 2), 0.13 * (k // 2 % 2), 0.1 + 0.12 * (k // 4)) for k in range(12)]
    return world, [add(world, nuno.box((0.1, 0.1, 0.1), position=p), nuno.Rigid(mass=1.0)) for p in places]


def on_sharp_shapes(device: str) -> Scene:
    """A cloth over a box and a ball."""
    world = nuno.World(device=device)
    world.add(nuno.plane())
    world.add(nuno.box((0.1, 0.1, 0.1), position=(0, 0, 0.05)))
    world.add(nuno.sphere(0.05, position=(0.15, 0.1, 0.05)))
    return world, [add(world, nuno.sheet((0.4, 0.4), cells=(12, 12), position=(0, 0, 0.14)), CLOTH)]


def led_box(device: str) -> Scene:
    """A box that follows a path under a cloth."""
    world = room(device)
    box = world.add(nuno.box((0.08, 0.08, 0.08), position=(0.3, 0, 0.76)))
    cloth = add(world, nuno.sheet((0.3, 0.3), cells=(12, 12), position=(0.2, 0, 0.81)), CLOTH)
    world.move(box, nuno.Path((0.0, 0.5), np.array([[0.3, 0, 0.76], [0.1, 0, 0.80]]), None, "minimum_jerk"))
    return world, [cloth]


SCENES: dict[str, Callable[[str], Scene]] = {
    made.__name__: made
    for made in (
        cloth_over_edge, cloth_in_floats, hang, hang_long_lines, soft_cube, soft_cubes, box_on_towel, two_cloths,
        soft_on_cloth, picks, picks_in_doubles, boxes, on_sharp_shapes, led_box, hang_large, hang_large_in_floats,
        soft_cube_large, soft_cube_large_in_floats,
    )
}  # fmt: skip


def digest(bodies: list[Any]) -> str:
    """A hash of bodies' vertices and velocities."""
    found = hashlib.sha256()
    for body in bodies:
        for array in (body.vertices, body.velocities):
            found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def main() -> None:
    """Print a line a scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("device", nargs="?", default="cpu")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), help="all on CUDA, the small on the CPU")
    options = parser.parse_args()
    small = [name for name in SCENES if options.device != "cpu" or "large" not in name]
    for name in options.scenes or small:
        world, bodies = SCENES[name](options.device)
        world.run(1.0, progress=False)
        plans = {getattr(getattr(body._dynamics, "solver", None), "plan", "rigid") for body in bodies}
        print(f"{name:26}{' '.join(sorted(plans)):16}{digest(bodies)}", flush=True)


if __name__ == "__main__":
    main()
