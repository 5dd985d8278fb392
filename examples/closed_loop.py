"""Talos finds a towel on a table, picks it at a point, and tells from its own images alone at which one it holds it.

Run: python examples/closed_loop.py [--point I J] [--out FOLDER]

Two worlds: that in the robot's head, and the one that it moves and looks in, whose towel is of another cloth.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.tasks.look_at_camera import look_at_camera
from nuno.tasks.pick_towel import TowelPicker
from nuno.tasks.towel_room import TABLE, make_room

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--point", type=int, nargs=2, default=(0, 5), metavar=("I", "J"), help="of the grid, 0 to 5")
options.add_argument("--out", type=Path, help="a folder for a picture")
asked = options.parse_args()
POINT, out = tuple(asked.point), asked.out
QUICK = [Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])]  # without it: two finer meshes, a minute

room = make_room(nuno.Cloth.preset("denim"), device="cpu")  # what is real
talos = TowelPicker(room.driver, table=TABLE, device="cpu")  # and who knows nothing else of it

talos.look_down()
towel = talos.find_towel()
width, depth = talos.rectangle.long_m, talos.rectangle.short_m
print(f"a towel of {100 * width:.1f} x {100 * depth:.1f} cm at {towel.position.round(3)}; it lies still")
hand = talos.pick(talos.point(*POINT))
answer = talos.answer(discretisations=QUICK, progress=False)
talos.believe(answer)
print(f"the {hand} holds it at {answer.pick}, says the robot (confidence {answer.result.confidence:.2f})")

true = talos.rectangle.fractions(room.held()) * 5  # from here on a judge looks at what is real
apart = np.linalg.norm(towel.vertices[:, None] - room.towel.vertices, axis=-1).min(axis=1)
miss = np.linalg.norm(answer.held - room.held_at())
print(f"truly at ({true[0]:.2f}, {true[1]:.2f}); by stereo the hand is {1000 * miss:.1f} mm from where it holds it")
print(
    f"the towel in its head hangs {1000 * apart.mean():.0f} mm from the real one, at most {1000 * apart.max():.0f} mm"
)
assert answer.pick == POINT == tuple(np.rint(true).astype(int))
assert miss < 0.01 and apart.mean() < 0.03, "half of a step of the grid"

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = look_at_camera((1.75, 1.0, 1.5), (0.45, 0.0, 0.95), 640, 480, 640.0)
    figure = Figure(figsize=(11, 8.6), layout="constrained")
    axes = figure.subplots(2, 2)
    imagined = talos.world.masks(talos.cameras.camera("head_left"), towel).numpy()
    for ax, title, image in (
        (axes[0, 0], "the room that it moves in, also simulated", room.cameras.look_from(camera).color.numpy()),
        (axes[0, 1], "in the robot's head", talos.cameras.look_from(camera).color.numpy()),
        (axes[1, 0], "its left eye before", answer.before.images["head_left"]),
        (
            axes[1, 1],
            f"after, and the outline of the towel in its head: {answer.pick}",
            answer.after.images["head_left"],
        ),
    ):
        ax.imshow(image)
        ax.set_title(title)
        ax.axis("off")
    axes[1, 1].contour(imagined, [0.5], colors="red")
    figure.savefig(out / "closed_loop.png", dpi=90)
