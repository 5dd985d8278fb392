"""Two hands take a towel by the corners of one side, carry them over to the other side, and let go: a fold in half.

Run: python examples/fold_towel.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

SIZE = (0.4, 0.3)  # [m]
THICKNESS = 0.004  # [m]
RISE = 0.15  # [m] of the hands over the table half way
CARRY, REST = 2.0, 1.5  # [s]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.box((0.8, 0.8, 0.02), name="table", position=(0, 0, -0.01), color="#b08050"))
towel = world.add(nuno.sheet(SIZE, cells=(20, 15), name="towel", position=(0, 0, THICKNESS / 2)))
world.attach(towel, nuno.Cloth(area_density=0.25, thickness=THICKNESS, friction=0.6, air_drag=1.0))

hands = []
for v in (0.0, 1.0):
    start, goal = towel.at([1.0, 0.0], v).positions(towel.vertices, towel.faces)
    goal = goal + np.array((0, 0, THICKNESS))  # on top of the lower layer
    above = (start + goal) / 2 + np.array((0, 0, RISE))
    path = nuno.Path([0.0, CARRY / 2, CARRY], [start, above, goal], interpolation="minimum_jerk")
    hands.append(world.grip(towel, towel.at(1.0, v), to=path))
world.run(CARRY)
for hand in hands:
    hand.release()
world.run(REST)

carried, covered = (towel.at(u, [0.0, 1.0]).positions(towel.vertices, towel.faces) for u in (1.0, 0.0))
miss = np.linalg.norm((carried - covered)[:, :2], axis=1).max()
length, height = np.ptp(towel.vertices[:, 0]), towel.vertices[:, 2].max()
print(f"the carried corners lie {1000 * miss:.1f} mm beside those that they cover")
print(f"the towel is {length:.3f} m long now, and {1000 * height:.0f} mm high at its fold")

grid = towel.vertices.reshape(16, 21, 3)  # rows along y, columns along x
apart = (grid[:, 12:] - grid[:, 8::-1])[..., 2]  # of the points that lie on each other, but for those near the fold
print(f"its layers are {1000 * apart.mean():.1f} mm apart")

assert miss < SIZE[0] / 20, "the corners lie within a cell of where they were to go"
assert abs(length - SIZE[0] / 2) < 0.01 and height < 0.03, "it is folded in half, and lies flat but for its bend"
assert apart.min() > 0.8 * THICKNESS, "two layers, one on the other: cloth touches itself"

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((0.35, 0.6, 0.45), (-0.08, 0, 0.0), fov=0.52)
    nuno.take_picture(world, camera, samples=3).save(out / "fold_towel.png")
