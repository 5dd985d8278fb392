"""What is this cloth made of? A side of it is lifted and drawn over the table before a camera.

What is seen is made here by a world with a finer mesh and step than the guesses have.

Run: python examples/fit_material.py [--out FOLDER]
"""

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import nuno
from nuno.tasks.look_at_camera import look_at_camera

SIZE = (0.3, 0.2)  # [m]
REST = 0.0025  # [m] height of the cloth's middle surface above the table
TIMES = np.arange(0.2, 2.1, 0.2)  # [s] of the images
TRUE = {"bending_rigidity": 8e-5, "friction": 0.4}  # [N m], 1
KNOWN = nuno.Cloth(area_density=0.2, thickness=2 * REST)  # the cloth was put on a balance

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

camera = look_at_camera((0, -0.75, 0.25), (0, 0, 0.09), 320, 240, 340.0)


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
begin = real.save()
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

if out:
    out.mkdir(parents=True, exist_ok=True)
    real.restore(begin)  # the cloth that was found, with the outline of what was seen
    real.attach("cloth", fit.material)
    lift_and_draw(real)
    pictures = []
    for k in (2, 5, 8):
        real.run(TIMES[k] - real.time)
        pictures.append(nuno.take_picture(real, camera, samples=3).color.numpy()[..., ::-1].copy())
        outline, _ = cv2.findContours(masks[k].astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(pictures[-1], outline, -1, (0, 128, 255), 1)
        label = f"{TIMES[k]:.1f} s: found, and the outline seen"
        cv2.putText(pictures[-1], label, (10, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA)
    cv2.imwrite(str(out / "fit_material.png"), np.hstack(pictures))
