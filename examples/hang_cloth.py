"""A towel is held by two corners of one side and swings down until it hangs between them.

Run: python examples/hang_cloth.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

SIZE = (0.4, 0.3)  # [m]
CELLS = (12, 9)
HEIGHT = 1.0  # [m]
SPAN = 0.3  # [m] between the held corners, less than the side's length: the side sags
SUBSTEPS = 40  # a frame; the default leaves the two corner cells, which carry all the weight, more stretch

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu", substeps=SUBSTEPS)
towel = world.add(nuno.sheet(SIZE, cells=CELLS, name="towel", color="#4080c0", position=(0, 0, HEIGHT)))
world.attach(towel, nuno.Cloth(area_density=0.25, bending_rigidity=5e-5, air_drag=2.0))

for u, side in ((0.0, -1.0), (1.0, 1.0)):
    corner = towel.at(u, 1.0)
    start = corner.positions(towel.vertices, towel.faces)[0]
    end = (side * SPAN / 2, start[1], HEIGHT)
    world.grip(towel, corner, to=nuno.Path([0.0, 0.5], [start, end], interpolation="minimum_jerk"))
world.run(4.0)

vertices = towel.vertices.reshape(CELLS[1] + 1, CELLS[0] + 1, 3)
warp = np.linalg.norm(np.diff(vertices, axis=1), axis=2) / (SIZE[0] / CELLS[0]) - 1.0
weft = np.linalg.norm(np.diff(vertices, axis=0), axis=2) / (SIZE[1] / CELLS[1]) - 1.0
lowest = HEIGHT - vertices[..., 2].min()
speed = np.linalg.norm(towel.velocities, axis=1).max()
print(f"t = {world.time:.2f} s: the lowest point is {lowest * 100:.1f} cm below the hands,")
print(f"the largest strain {max(warp.max(), weft.max()):.2%}, the largest speed {speed * 100:.1f} cm/s")

np.testing.assert_allclose(vertices[-1, [0, -1], 0], (-SPAN / 2, SPAN / 2), atol=1e-4)  # the hands hold
assert SIZE[1] < lowest < SIZE[1] + SIZE[0] / 2, "it hangs by its width and at most half the slack side more"
# Half the weight, 0.15 N, on half a cell of 1000 N/m x 17 mm: 1.8 %, and at most as much again from the steps
assert max(warp.max(), weft.max()) < 0.04, "cloth hardly stretches under its own weight"
assert speed < 0.1, "after 4 s it is nearly at rest"

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((0.5, 1.0, 1.15), (0, 0.15, 0.85), fov=0.52)
    nuno.take_picture(world, camera, samples=3).save(out / "hang_cloth.png")
