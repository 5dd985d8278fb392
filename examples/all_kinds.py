"""Cloth, a soft cube and rigid bodies touch each other: a towel carries two things, a napkin falls over a stack.

Run: python examples/all_kinds.py [--out FOLDER [--film]]
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

import nuno
from nuno.tasks.look_at_camera import look_at_camera

RATE = 15  # [1/s] of the film
LAMP = nuno.Lamp(position=(-0.8, -1.2, 3.0), strength=0.75, sky=0.4, radius=0.35)

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
options.add_argument("--film", action="store_true", help="write a film, too")
asked = options.parse_args()

world = nuno.World(device="cpu")
world.add(nuno.box((1.2, 0.8, 0.02), name="table", position=(0.2, 0, -0.01), color="#b08050"))
towel = world.add(nuno.sheet((0.45, 0.45), cells=(20, 20), position=(-0.1, 0, 0.32), color="#c03030"))
box = world.add(nuno.box((0.1, 0.1, 0.05), name="box", position=(-0.18, 0.02, 0.36), color="#4080c0"))
cube = world.add(nuno.soft_box((0.09, 0.09, 0.09), cells=(3, 3, 3), position=(0, -0.02, 0.38), color="#50a050"))
ball = world.add(nuno.sphere(0.05, position=(0.3, 0.2, 0.05), color="#e0a030"))
stack = [world.add(nuno.box((0.11, 0.11, 0.11), position=(0.45, 0, 0.056 + 0.111 * k))) for k in range(3)]
for k, each in enumerate(stack):
    each.rotate(0.25 * k, "z").color = "#8070b0"
napkin = world.add(nuno.sheet((0.36, 0.36), cells=(20, 20), position=(0.43, 0.02, 0.42), color="#f0f0f0"))

camera, film = look_at_camera((0.0, -1.5, 0.85), (0.18, 0.0, 0.19), 640, 360, 730.0), []


def look(scale=1.5, samples=3):
    """Return a picture of the room."""
    return nuno.take_picture(world, camera.scaled(scale), lamp=LAMP, background="#d3dde6", samples=samples)


def run(seconds):
    """Let time pass, a film's frame after another where one is asked for."""
    for _ in range(round(seconds * RATE)):
        world.run(1 / RATE)
        if asked.film:
            film.append(look(1, 2).color.numpy())


world.attach(towel, nuno.Cloth(area_density=0.25, air_drag=3.0))
for corner in np.flatnonzero((np.abs(np.abs(towel.vertices[:, :2] - (-0.1, 0)) - 0.225) < 1e-6).all(axis=1)):
    start = towel.vertices[corner]
    near = start + 0.14 * ((-0.1, 0, 0.32) - start)
    world.grip(towel, [corner], to=nuno.Path([0.0, 0.6], [start, near], interpolation="minimum_jerk"))
run(1.0)
world.attach(box, nuno.Rigid(mass=0.12))
world.attach(cube, nuno.Soft(density=150.0, youngs_modulus=8e3, damping=0.01))
for each in (ball, *stack):
    world.attach(each, nuno.Rigid(density=500.0))
run(0.5)
world.attach(napkin, nuno.Cloth(area_density=0.2, air_drag=3.0))
run(2.0)

print(f"box and cube lie {box.position[2]:.3f} and {cube.position[2]:.3f} m above the table, in the towel")
assert min(box.position[2], cube.position[2]) > 0.15, "the towel carries them"
assert all(abs(each.position[2] - 0.055 - 0.11 * k) < 1e-3 for k, each in enumerate(stack)), "the stack stands"
assert 0.33 < napkin.vertices[:, 2].max() < 0.345, "the napkin lies on it"

if asked.out:
    asked.out.mkdir(parents=True, exist_ok=True)
    look().save(asked.out / "all_kinds.png")
if asked.out and asked.film:
    first, *others = [Image.fromarray(image) for image in film]
    more = {"duration": 1000 // RATE, "loop": 0, "quality": 60, "method": 6}
    first.save(asked.out / "all_kinds.webp", save_all=True, append_images=others, **more)
