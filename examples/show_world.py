"""A napkin is lifted off a table beside a soft cube, looked at in a browser and filmed as one HTML file.

Run: python examples/show_world.py [--out FOLDER]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import nuno

TOP = 0.4  # [m] height of the table top
LIFT = 0.2  # [m]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for the film and a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.plane(name="floor", color="#d8d4cc"))
world.add(nuno.box((0.7, 0.7, 0.02), name="table", color="#a07040", position=(0, 0, TOP - 0.01)))
napkin = world.add(nuno.sheet((0.3, 0.3), cells=(16, 16), name="napkin", color="#3b7dd8"))
napkin.locate((-0.1, 0, TOP + 0.01))
cube = world.add(nuno.soft_box((0.12, 0.12, 0.12), cells=(4, 4, 4), name="cube", color="#e0b030"))
cube.locate((0.2, 0, TOP + 0.1))
world.attach(napkin, nuno.Cloth.preset("napkin"))
world.attach(cube)

corner = napkin.at(0, 0)
start = napkin.vertices[0]
way = nuno.Path([0.3, 1.0], [start, start + np.array((0.05, 0.05, LIFT))], interpolation="minimum_jerk")
world.grip(napkin, corner, to=way)

with nuno.Viewer(world) as viewer:
    viewer.draw(cube, "tetrahedra", explode=1.2)
    viewer.look_from((0.9, -1.0, 0.95), (0, 0, 0.45))
    viewer.show()  # opens a browser where there is a screen
    with viewer.record() as film:
        world.run(1.5)
    print(f"{viewer.url} showed {len(film)} frames of {film.duration:.2f} s")

with tempfile.TemporaryDirectory() as folder:
    path = (out or Path(folder)) / "film.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    film.save(path)
    size = path.stat().st_size / 1e6
    print(f"the film is one file of {size:.2f} MB")

assert len(film) == 46, "30 frames a second, the first and the last"
assert np.allclose(np.diff(film.times), 1 / 30, atol=1e-9), "at even times, however fast the world ran"
assert size < 2.0, "meshcat's page is 0.9 MB"
assert napkin.vertices[:, 2].max() > TOP + 0.9 * LIFT, "the napkin hangs from its corner"

if out:
    camera = nuno.Camera.look_at((0.9, -1.0, 0.95), (0, 0, 0.47), fov=0.58)
    nuno.take_picture(world, camera, samples=3).save(out / "show_world.png")
