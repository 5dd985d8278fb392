"""Follow a cloth through depth images: a world in the head keeps step with a towel that a hand lifts.

What is seen is made here by a world with another towel, mesh and step, with noise, every tenth of a second. Amidst it
a board, which the follower does not know, hides half of the towel. Beside it goes the same physics without images.

Run: python examples/follow_cloth.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

import nuno

SIZE = (0.4, 0.3)  # [m]
TOP = 0.7  # [m] height of the table top
WAY = (0.15, 0.08, 0.28)  # [m] of the hand, within 2 s

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out
camera = nuno.Camera.look_at((-0.15, -0.7, TOP + 0.75), (0.0, 0.0, TOP + 0.1), 0.75, width=320, height=240)


def room(cells: tuple[int, int], material: nuno.Cloth, shift: tuple[float, float], board: bool = False):
    """A towel on a table, its corner in a hand that lifts it; perhaps with a board in the way for a while."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1.2, 1.2, 0.04), name="table", position=(0, 0, TOP - 0.02)))
    towel = world.add(nuno.sheet(SIZE, cells, name="towel", position=(*shift, TOP + 0.002)))
    world.attach(towel, material)
    corner = np.array([-0.5 * SIZE[0], -0.5 * SIZE[1], TOP + 0.002])
    path = nuno.Path([0.0, 2.0], [corner, corner + WAY], interpolation="minimum_jerk")
    world.grip(towel, towel.closest(corner), to=path)
    if board:
        lid = world.add(nuno.box((0.3, 0.01, 0.3), name="board", color="#805030", position=(0, 0, -5)))
        places = [(0, 0, -5), (0, 0, -5), (0.15, -0.25, TOP + 0.3), (0.15, -0.25, TOP + 0.3), (0, 0, -5)]
        world.move(lid, nuno.Path([0.0, 0.999, 1.0, 1.6, 1.601], places))
    return world, towel


real, cloth = room((21, 16), nuno.Cloth(area_density=0.35, bending_rigidity=3e-4, friction=0.3), (0, 0), board=True)
world, towel = room((14, 10), nuno.Cloth(), (0.015, -0.012))  # where it lies is known to 2 cm
alone, open_loop = room((14, 10), nuno.Cloth(), (0.015, -0.012))
follower = nuno.follow(world, towel, camera)

noise, rows, off = np.random.default_rng(0), [], []
uv = np.stack(np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 11)), axis=-1).reshape(-1, 2).T
for k in range(1, 31):
    real.run(0.1, progress=False)
    alone.run(0.1, progress=False)
    depth = real.depth(camera).numpy() + 0.002 * noise.standard_normal((240, 320))
    told = follower.update(real.time, real.masks(camera, cloth), depth)
    truth, *guesses = (b.at(*uv).positions(b.vertices, b.faces) for b in (cloth, towel, open_loop))
    off.append([1000 * np.linalg.norm(guess - truth, axis=1).mean() for guess in guesses])
    if k in (8, 13, 20, 30):
        print(f"{told}; truly {off[-1][0]:.1f} mm, without images {off[-1][1]:.1f} mm")
        each = [nuno.take_picture(w, camera, samples=2).color.numpy()[40:] for w in (real, world, alone)]
        rows.append(np.vstack(each))

mean = np.mean(off, axis=0)
print(f"mean over all images: {mean[0]:.1f} mm followed, {mean[1]:.1f} mm without images")
assert mean[0] < 15.0 and mean[0] < 0.8 * mean[1], "images draw the cloth to where it is"
assert off[14][0] < 30.0, "and it is kept while the board hides half of it"

if out:
    out.mkdir(parents=True, exist_ok=True)
    strip = np.hstack(rows)
    for row, label in enumerate(("seen", "followed", "without images")):
        cv2.putText(strip, label, (8, 200 * row + 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (20, 20, 20), 1, cv2.LINE_AA)
    cv2.imwrite(str(out / "follow_cloth.png"), strip[..., ::-1])
