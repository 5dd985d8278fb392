"""What is this cloth made of? A side of it is lifted and drawn over the table before a camera.

What is seen is made here by a world with a finer mesh and step than the guesses have.

Run: python examples/fit_material.py
"""

from dataclasses import replace

import numpy as np

import nuno

SIZE = (0.3, 0.2)  # [m]
REST = 0.0025  # [m] height of the cloth's middle surface above the table
TIMES = np.arange(0.2, 2.1, 0.2)  # [s] of the images
TRUE = {"bending_rigidity": 8e-5, "friction": 0.4}  # [N m], 1
KNOWN = nuno.Cloth(area_density=0.2, thickness=2 * REST)  # the cloth was put on a balance

down = np.deg2rad(12.0)  # the camera looks along y, 0.75 m away
pose = np.eye(4)
pose[:3, :3] = [[1, 0, 0], [0, -np.sin(down), np.cos(down)], [0, -np.cos(down), -np.sin(down)]]
pose[:3, 3] = (0.0, -0.75, 0.25)
camera = nuno.Camera(320, 240, 340.0, 340.0, 159.5, 119.5, pose)


def room(cells: tuple[int, int], substeps: int) -> nuno.World:
    """A cloth flat on an endless table."""
    world = nuno.World(device="cpu", substeps=substeps)
    world.add(nuno.plane(name="table"))
    world.add(nuno.sheet(SIZE, cells=cells, name="cloth", position=(0, 0, REST)))
    return world


def lift_and_draw(world: nuno.World) -> None:
    """Two hands lift the corners at -x, wait, and draw the cloth over the table."""
    cloth = world.find("cloth")
    flat = np.reshape(cloth.vertices, (world.world_count, -1, 3))[0]
    for side in (1, -1):
        corner = int((flat[:, :2] @ (-1, side)).argmax())
        begin = flat[corner]
        up = begin + np.array((0.03, 0.0, 0.16))
        way = np.stack([begin, up, up, up - (0.1, 0.0, 0.0)])
        world.grip(cloth, [corner], to=nuno.Path([0.0, 0.6, 0.9, 1.4], way, interpolation="minimum_jerk"))


real = room((27, 18), 40)
real.attach("cloth", replace(KNOWN, **TRUE))
lift_and_draw(real)
masks = []
for time in TIMES:
    real.run(time - real.time)
    masks.append(real.masks(camera, "cloth").numpy())

bounds = {"bending_rigidity": (1e-6, 2e-3), "friction": (0.05, 1.5)}
footage = nuno.Footage(room((18, 12), 20), "cloth", lift_and_draw, camera, TIMES, masks, drawn_thickness=0.0)
fit = nuno.fit_material(footage, bounds=bounds, known=KNOWN, generations=10)

for name, value in fit.params.items():
    low, high = fit.ranges[name]
    print(f"{name}: {value:.3g} (true: {TRUE[name]:g}); {low:.3g} to {high:.3g} explain the images about as well")
print(f"like {fit.name}; outlines {fit.distance:.2f} px off, overlap {fit.overlap:.3f}")
assert abs(fit.params["bending_rigidity"] / TRUE["bending_rigidity"] - 1.0) < 0.15
assert abs(fit.params["friction"] / TRUE["friction"] - 1.0) < 0.15
