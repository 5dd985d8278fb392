"""Imagine 36 futures at once: a towel picked at each point of a grid. Which of them does the camera see?

What is seen is made here by a world with another mesh, another step and another towel than the one imagined. One
guess at the towel tells picks at its rim; ``nuno.estimate_pick`` takes many, for they tell more.

Run: python examples/imagine_futures.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

import nuno
from nuno.tasks.look_at_camera import look_at_camera

SIZE = (0.5, 0.35)  # [m]
TOP = 0.7  # [m] height of the table top
GRID = 6  # candidates along either side
TRUE = (5, 2)  # the grid point that is really picked
HAND = (0.15, 0.1, TOP + 0.4)  # [m] where the hand takes it
LIFT, SETTLE = 1.5, 1.5  # [s]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

camera = look_at_camera((-1.0, 0.0, TOP + 0.5), (0.0, 0.0, TOP + 0.034), 320, 240, 250.0)


def towel_on_table(cells: tuple[int, int], substeps: int) -> tuple[nuno.World, nuno.Body]:
    """A world with a table and a towel flat on it, static."""
    world = nuno.World(device="cpu", substeps=substeps)
    world.add(nuno.box((1.0, 1.2, 0.04), name="table", position=(0.1, 0, TOP - 0.02)))
    towel = world.add(nuno.sheet(SIZE, cells=cells, name="towel", position=(0, 0, TOP + 0.002)))
    return world, towel


def pick(world: nuno.World, towel: nuno.Body, points: nuno.SurfacePoints, starts: np.ndarray) -> None:
    """Grip a point in each world, move it to the hand and let the towel come to rest."""
    path = np.stack([starts, np.broadcast_to(HAND, starts.shape)], axis=-2)
    world.grip(towel, points, to=nuno.Path([0.0, LIFT], path, interpolation="minimum_jerk"))
    world.run(LIFT + SETTLE)


real, towel = towel_on_table(cells=(20, 15), substeps=20)
real.attach(towel, nuno.Cloth(area_density=0.3, bending_rigidity=2e-4, friction=0.6))
point = towel.at(*np.array(TRUE) / (GRID - 1))
pick(real, towel, point, point.positions(towel.vertices, towel.faces)[0])
seen = real.masks(camera, towel).numpy()

world, towel = towel_on_table(cells=(15, 10), substeps=12)
futures = world.imagine(GRID * GRID)
futures.attach(towel, nuno.Cloth(bending_rigidity=1e-4))
ij = np.stack(np.meshgrid(np.arange(GRID), np.arange(GRID), indexing="ij"), axis=-1).reshape(-1, 2)
points = towel.at(*ij.T / (GRID - 1))
pick(futures, towel, points.per_world(), points.positions(towel.vertices, towel.faces))
masks = futures.masks(camera, towel)  # (36, 240, 320), on the device

eq1 = nuno.similarity(masks, seen)  # the share of pixels that agree: high for all, as most are empty
distance = nuno.similarity(masks, seen, "chamfer")  # [px] between the outlines: tells them apart
best = int(distance.argmin())
world.adopt(futures, best)  # the best future becomes now

for k in np.argsort(distance)[:3]:
    print(f"picked at {tuple(ij[k].tolist())}: outline {distance[k]:.2f} px off, eq. (1) {eq1[k]:.4f}")
assert tuple(ij[best]) == TRUE, f"the camera saw {TRUE}"
np.testing.assert_array_equal(towel.vertices, futures.find("towel").vertices[best])
assert towel.is_dynamic and world.time == LIFT + SETTLE

if out:
    out.mkdir(parents=True, exist_ok=True)
    each = nuno.take_picture(futures, camera.scaled(0.5), samples=2).color.numpy()  # (36, 120, 160, 3)
    cv2.rectangle(each[best], (1, 1), (158, 118), (192, 32, 32), 3)  # what the camera saw
    rows = each.reshape(GRID, GRID, 120, 160, 3).swapaxes(1, 2).reshape(GRID * 120, GRID * 160, 3)
    cv2.imwrite(str(out / "imagine_futures.png"), rows[..., ::-1])
