"""A world is saved while a napkin falls over a ball, goes on, and is taken back: twice the same, to the bit.

Run: python examples/save_and_restore.py [--out FOLDER]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import nuno

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for the file and a picture")
out = options.parse_args().out
if out:
    out.mkdir(parents=True, exist_ok=True)

world = nuno.World(device="cpu")
world.add(nuno.plane(name="floor"))
world.add(nuno.sphere(0.08, name="ball", position=(0, 0, 0.08)))
napkin = world.add(nuno.sheet((0.3, 0.3), cells=(24, 24), name="napkin", position=(0.02, 0, 0.2)))
world.attach(napkin, nuno.Cloth.preset("napkin"))
world.run(0.3)  # it lies on the ball, and its corners are falling

with tempfile.TemporaryDirectory() as folder:
    path = (out or Path(folder)) / "room.npz"
    saved = world.save(path)
    world.run(0.5)
    first = napkin.vertices

    world.restore(saved)  # from memory: `napkin` is the same object, back where it was
    when, speed = world.time, np.linalg.norm(napkin.velocities, axis=1).max()
    print(f"back at t = {when:.2f} s, where the napkin moves at up to {speed:.2f} m/s")
    world.run(0.5)
    again = napkin.vertices

    world.restore(saved)
    world.remove("ball")  # what if it had not been there?
    world.run(0.5)
    without = napkin.vertices

    other = nuno.World(device="cpu")  # as in another process: a file holds all bodies, dynamics, grips and paths
    other.restore(path)
    other.run(0.5)
    read = other.find("napkin").vertices

lower = again[:, 2].max() - without[:, 2].max()
print(f"half a second later its highest point is {100 * lower:.1f} cm lower without the ball")
assert abs(when - 0.3) < 1e-9 and speed > 0.1, "in the middle of a motion"
np.testing.assert_array_equal(again, first)
np.testing.assert_array_equal(read, first)
assert again[:, 2].max() > 0.16 and lower > 0.05, "it lies on the ball, and falls where there is none"

if out:
    camera = nuno.Camera.look_at((0.5, 0.6, 0.45), (0, 0, 0.08), fov=0.47)
    nuno.take_picture(other, camera, samples=3).save(out / "save_and_restore.png")
