"""Talos finds a towel on a table, picks it at a point, and tells from its own images alone at which one it holds it.

Run: python examples/closed_loop.py [i j [picture.png]]

Two worlds: that in the robot's head, and the one that it moves and looks in, whose towel is of another cloth.
"""

import sys

import numpy as np

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.tasks.look_at_camera import look_at_camera
from nuno.tasks.pick_towel import TowelPicker
from nuno.tasks.towel_room import TABLE, make_room

POINT = (int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else (0, 5)
QUICK = [Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])]  # without it: two finer meshes, a minute

room = make_room(nuno.Cloth.preset("denim"), device="cpu")  # what is real
talos = TowelPicker(room.driver, room.look, table=TABLE, device="cpu")  # and who knows nothing else of it

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

if len(sys.argv) > 3:
    import matplotlib.pyplot as plt

    camera = look_at_camera((1.75, 1.0, 1.5), (0.45, 0.0, 0.95), 640, 480, 640.0)
    figure, axes = plt.subplots(2, 2, figsize=(11, 8.6), layout="constrained")
    imagined = talos.world.masks(talos.cameras.camera("head_left"), towel).numpy()
    for ax, title, image in (
        (axes[0, 0], "real", room.cameras.look_from(camera).color.numpy()),
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
    figure.savefig(sys.argv[3], dpi=90)
