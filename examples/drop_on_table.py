"""A napkin falls onto a table, a third of it beyond the edge: friction holds it, and the free end hangs down.

Run: python examples/drop_on_table.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

TABLE = (0.6, 0.6, 0.02)  # [m]
TOP = 0.7  # [m] height of the table top
SIZE = (0.3, 0.2)  # [m]
OVERHANG = 0.1  # [m]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.plane(name="floor"))
world.add(nuno.box(TABLE, name="table", color="#a07040", position=(0, 0, TOP - TABLE[2] / 2)))
napkin = world.add(nuno.sheet(SIZE, cells=(24, 16), name="napkin", color="white"))
napkin.locate((TABLE[0] / 2 + OVERHANG - SIZE[0] / 2, 0, TOP + 0.02))
world.run(1.0)  # still a static shape: nothing moves, nothing is computed
assert np.ptp(napkin.vertices[:, 2]) == 0.0 and world.time == 1.0

cloth = nuno.Cloth(area_density=0.15, bending_rigidity=8e-6, thickness=0.003, friction=0.6, air_drag=1.0)
world.attach(napkin, cloth)
world.set_friction(napkin, "table", 0.6)
world.run(2.5)
before = napkin.vertices
world.run(0.5)
crept = np.linalg.norm(napkin.vertices - before, axis=1)
world.detach(napkin)  # static again, in the shape that it has now

x, _, z = napkin.vertices.T
on_table = x < TABLE[0] / 2 - 0.02
drop = TOP - z.min()
print(f"t = {world.time:.2f} s: {on_table.mean():.0%} of the napkin lies on the table, {drop * 100:.1f} cm hang down")
print(f"in the last half second its points moved {crept.mean() * 1e3:.2f} mm on average")

gap = z[on_table] - (TOP + cloth.thickness / 2)
assert np.abs(gap).max() < 2e-3, "half its thickness above the top, but for small folds"
assert 0.55 < on_table.mean() < 0.72, "friction holds it: about two thirds stay on the table"
assert 0.6 * OVERHANG < drop < 1.15 * OVERHANG, "a limp end hangs down"
assert crept.mean() < 2e-3, "nearly at rest"
assert not napkin.is_dynamic and napkin.is_deformed

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((0.85, 0.65, 1.05), (0.24, 0, 0.66), fov=0.52)
    nuno.take_picture(world, camera, samples=3).save(out / "drop_on_table.png")
