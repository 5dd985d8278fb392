"""A T-shirt is held up by a point that nobody saw being taken: which one is it? From one image, and from two.

Run: python examples/hold_garment.py [--out FOLDER]

The shirt that is seen has other cells, another material and other steps than those that are imagined, and was lifted
from a table, which the imagined ones are not.
"""

import argparse
import logging
from pathlib import Path

import numpy as np

import nuno

HAND = np.array((0.0, 0.0, 0.95))  # [m]
PLACE = (0.24, -0.33)  # [m] the left corner of the hem, from the flat shirt's middle
NEAR = 0.12  # [m] on the cloth: candidates are about so far from each other

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out
logging.getLogger("nuno").setLevel(logging.ERROR)  # coarse shirts and few steps are softer than their material

# what the cameras see
seen = nuno.garment("t-shirt", cell=0.045, length=0.69)
world = nuno.World(device="cpu", substeps=20)
world.add(nuno.plane(name="table", color="#d8d2c8"))
shirt = world.add(seen.body(color="#b5502f", position=(0, 0, 0.01)))
cameras = [
    nuno.Camera.look_at((1.9 * np.cos(yaw), 1.9 * np.sin(yaw), 0.8), (0, 0, 0.55), fov=0.65) for yaw in (0.5, 2.1)
]
world.attach(shirt, nuno.Cloth(bending_rigidity=8e-5, area_density=0.16, friction=0.4, air_drag=2.0, thickness=0.003))
held = seen.nearest(PLACE, "both")
start = shirt.vertices[held]
world.grip(shirt, [held], to=nuno.Path([0.0, 1.5], [start, HAND], interpolation="minimum_jerk"))
world.run(3.5)
images = [nuno.take_picture(world, camera).color.numpy() for camera in cameras]
backgrounds = [nuno.take_picture(world, camera, without=[shirt]).color.numpy() for camera in cameras]

# what is asked: the same kind of shirt, held by every candidate
shirt_model = nuno.garment("t-shirt", cell=0.06)
guesses = [nuno.HoldGuess(2e-5, friction=0.3), nuno.HoldGuess(2e-4, friction=0.5)]
holds = nuno.imagine_holds(shirt_model, spacing=0.15, guesses=guesses, device="cpu", progress=False)
true = shirt_model.nearest(PLACE, "both")
for count in (1, 2):
    result = nuno.estimate_hold(
        shirt_model, images[:count], cameras[:count], HAND, backgrounds=backgrounds[:count], holds=holds
    )
    off, like = result.distance(true), result.distance(true, up_to_symmetry=True)
    x, y, layer = result.best
    print(f"{count} image(s): held at ({x:.2f}, {y:.2f}) m, {layer}; {100 * off:.0f} cm from the truth on the cloth,")
    print(f"  {100 * like:.0f} cm up to symmetry; confidence {result.confidence_up_to_symmetry:.2f} {result.warnings}")

if out:
    out.mkdir(parents=True, exist_ok=True)
    result.figure().savefig(out / "hold_garment.png", dpi=100)
assert like <= NEAR, "a corner of the hem is told, left and right up to the shirt's symmetry"
