"""A soft cube is set above a table, falls, and is taken out of the simulation where it came to rest.

Run: python examples/soft_cube.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

SIZE = 0.2  # [m]
CELLS = 6
FOAM = nuno.Soft(density=1000.0, youngs_modulus=5e4, poisson_ratio=0.3, friction=0.0, damping=0.005)
SAG = 1000.0 * 9.81 * SIZE**2 / (2 * 5e4)  # [m] of a column under its own weight: rho g h^2 / 2E

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.box((1.2, 0.8, 0.02), name="table", position=(0.6, 0, 0.70), color="#b08050"))
cube = world.add(nuno.soft_box((SIZE, SIZE, SIZE), cells=(CELLS, CELLS, CELLS), color="#50a050"))
cube.locate((0.6, 0, 0.95))  # still a rigid, motionless shape
world.run(0.2)  # nothing moves, nothing is computed
world.attach(cube, FOAM)
world.run(3.0)

height = np.ptp(cube.vertices[:, 2])
state = nuno.elements(cube)
volume = state.volumes.sum() / SIZE**3
print(f"the cube is {1000 * (SIZE - height):.2f} mm lower; a column would be {1000 * SAG:.2f} mm")
print(f"its volume is {volume:.4f} of what it was; the pressure goes up to {-state.stresses[:, 2, 2].min():.0f} Pa")

world.detach(cube)  # static again, in the shape that it has now
before = cube.vertices
world.run(0.5)
assert np.array_equal(cube.vertices, before)
assert abs(SIZE - height - SAG) < 0.15 * SAG, "six cells are a little stiffer than the column"
assert 0.985 < volume < 0.995, "1 - (1 - 2 nu) rho g h / 2E, a little less where it cannot widen"

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((1.1, 0.8, 1.15), (0.6, 0, 0.79), fov=0.52)
    nuno.take_picture(world, camera, samples=3).save(out / "soft_cube.png")
