"""At which point was this cloth, cut as a T-shirt's front, picked up? Images before and after, and no rectangle.

Run: python examples/pick_outline.py [--out FOLDER]

The images are drawn by Nuno of a cloth with other triangles and another material than those that are imagined. One mesh
and a few guesses at the material answer in seconds; without ``discretisations`` the estimate takes more of both.
"""

import argparse
import logging
from pathlib import Path

import numpy as np

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation

TOP = 0.7  # [m] the table's height
HALF = (0.45, 0.6)  # [m] of the table
SPACING = 0.09  # [m] between candidates

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for result.json and result.png")
out = options.parse_args().out
logging.getLogger("nuno").setLevel(logging.ERROR)  # few steps are softer than their material

# what the camera sees
pattern = nuno.garment("t-shirt", length=0.52, width=0.4, sleeve=0.13, cell=0.028)
used, number = np.unique(pattern.faces[pattern.face_layer == 0], return_inverse=True)
flat = pattern.rest[used] * (1.0, 1.0, 0.0) + (0.0, 0.0, TOP + 0.0025)
camera = nuno.Camera.look_at((-0.85, 0.1, TOP + 0.7), (0.05, 0.0, TOP + 0.1), fov=0.8)
world = nuno.World(device="cpu", substeps=20)
world.add(nuno.box((2 * HALF[0], 2 * HALF[1], 0.04), position=(0, 0, TOP - 0.02), color="#b9a88f"))
cloth = world.add(nuno.cloth_mesh(flat, number.reshape(-1, 3), color="#2f6fb0")).rotate(0.4, "z", wrt="world")
before = nuno.take_picture(world, camera, noise=2.0).color.numpy()
world.attach(cloth, nuno.Cloth(bending_rigidity=1e-4, area_density=0.18, thickness=0.005))
held = int(flat[:, :2].sum(axis=1).argmax())  # the upper end of the left sleeve
start = cloth.vertices[held]
hand = start + np.array((-0.02, 0.03, 0.38))
world.grip(cloth, [held], to=nuno.Path([0.0, 1.5], [start, hand], interpolation="minimum_jerk"))
world.run(3.0)
after = nuno.take_picture(world, camera, noise=2.0, seed=1).color.numpy()

result = nuno.estimate_pick(
    before, after, camera=camera, table_height=TOP, table_half_extents=HALF, hand=hand, spacing=SPACING,
    discretisations=[Discretisation(15, 12, HYPOTHESES[1::4])], device="cpu", progress=False,
)  # fmt: skip
shape = result.rectangle
print(f"an outline of {len(shape.outline)} corners, {shape.area:.4f} m2")
places = shape.world_positions(result.fractions)
for k in result.order[:3]:
    (x, y), off = 100 * result.labels[k], 100 * np.linalg.norm(places[k] - start)
    print(f"({x:.0f}, {y:.0f}) cm: log evidence {result.scores[k]:.1f}, {off:.1f} cm from the truth")
print(f"confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s; {'; '.join(result.warnings)}")
if out:
    result.save(out)

assert np.linalg.norm(places[result.order[0]] - start) < SPACING
