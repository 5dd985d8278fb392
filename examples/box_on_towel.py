"""Four hands hold a towel by its corners; a box is set on it and carried; the hands feel what both weigh.

Run: python examples/box_on_towel.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

LIFT = np.array([0.0, 0.0, 0.15])  # [m]
BOX_MASS = 0.15  # [kg]
TOWEL = nuno.Cloth(area_density=0.3, air_drag=3.0)
WEIGHT = 9.81 * (BOX_MASS + 0.3 * 0.4 * 0.4)  # [N]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.plane(name="floor"))
towel = world.add(nuno.sheet((0.4, 0.4), cells=(16, 16), name="towel", position=(0, 0, 0.5)))
world.attach(towel, TOWEL)
corners = np.flatnonzero((np.abs(np.abs(towel.vertices[:, :2]) - 0.2) < 1e-6).all(axis=1))
hands = []
for corner in corners:
    # together a little, so that the towel sags, and then up
    apart = towel.vertices[corner]
    near = apart * (0.9, 0.9, 1.0)
    path = nuno.Path([0.0, 0.5, 1.5, 2.5], [apart, near, near, near + LIFT], interpolation="minimum_jerk")
    hands.append(world.grip(towel, [corner], to=path))
world.run(1.0)

box = world.add(nuno.box((0.08, 0.08, 0.04), name="box"))
box.locate((0, 0, towel.vertices[:, 2].min() + 0.03))
world.attach(box, nuno.Rigid(mass=BOX_MASS))
world.run(2.0)

loads = []
for _ in range(120):  # it still swings: the mean over two seconds
    world.step()
    loads.append(sum(hand.wrench[0] for hand in hands))
load = -np.mean(loads, axis=0)[2]
contacts = world.contacts(box)
print(f"the box is at {box.position.round(3)} m and touches the towel at {len(contacts)} points")
print(f"the hands bear {load:.3f} N; box and towel weigh {WEIGHT:.3f} N")

assert set(contacts.others) == {"towel"}
assert box.position[2] > 0.5, "it went up with the hands"
assert abs(load - WEIGHT) < 0.03 * WEIGHT, "the mean over some swings"

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((0.55, 0.7, 0.95), (0, 0, 0.58), fov=0.52)
    nuno.take_picture(world, camera, samples=3).save(out / "box_on_towel.png")
