"""A person has folded a cloth before a camera; Talos folds a towel of another size likewise, and squarer.

Run: python examples/talos_fold.py [--out FOLDER]

--out writes pictures: the fold step by step, and which layers lie where.
"""

import argparse
from pathlib import Path

import numpy as np

import nuno
from nuno.tasks.fold_pictures import FoldPictures
from nuno.tasks.improve_fold import improve_fold
from nuno.tasks.play_fold import play_fold
from nuno.tasks.taught_fold import TaughtFold

TABLE = 0.74  # [m] height of its top
SIZE = (0.36, 0.30)  # [m] of the towel; the one in the video is 0.5 x 0.4 m
THICKNESS = 0.005  # [m]
READY = {"left_hand": (0.30, 0.25, TABLE + 0.2), "right_hand": (0.30, -0.25, TABLE + 0.2)}
HIPS = (-0.05, 0.0, -0.02)  # [m] they go back, so that Talos keeps its balance with both arms ahead

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for pictures")
asked = options.parse_args()

case = nuno.read_fold_case(Path(__file__).parent / "fold-case")
taught = TaughtFold.from_replay(case.replay(materials=["canvas"], device="cpu", progress=False))

world = nuno.World(device="cpu", substeps=12)
world.add(nuno.plane(name="floor"))
world.add(nuno.box((0.8, 1.2, 0.02), name="table", position=(0.67, 0, TABLE - 0.01), color="#c8a878"))
place = (0.3 + SIZE[0] / 2, 0, TABLE + THICKNESS / 2)
towel = world.add(nuno.sheet(SIZE, cells=(20, 16), name="towel", position=place, color="#4d85cc"))
world.attach(towel, nuno.Cloth(area_density=0.25, bending_rigidity=3e-5, stretch_stiffness=3e3, thickness=THICKNESS))

talos = nuno.Humanoid("talos")
hips = talos.frame_pose("base_link")
hips.translate(HIPS, wrt="world")
assert talos.reach({"base_link": hips, **READY})
robot = nuno.SimulatedRobot(talos, world)

as_taught = taught.on(towel, forward=(1, 0))
better = improve_fold(as_taught, towel, generations=1, population=5, progress=False)

look = FoldPictures(robot, towel)
played = play_fold(robot, towel, better.motion, watch=look if asked.out else None)

mm = 1000 * np.array([better.taught_errors, better.errors, played.errors])
print("corners beside those that they cover [mm], left and right:")
for name, row in zip(("as taught, imagined", "improved, imagined", "improved, by Talos"), mm, strict=True):
    print(f"  {name}: {row[0]:.1f}, {row[1]:.1f}")
end = played.comparison
print(
    f"the towel lies {1000 * end.distance:.1f} mm ({end.share:.1%} of its longer side) from how it was taught to lie; "
    f"{end.doubled:.1%} of it in two layers, as taught {end.taught_doubled:.1%}"
)
if asked.out:
    asked.out.mkdir(parents=True, exist_ok=True)
    look.figure().savefig(asked.out / "talos-fold.png", dpi=110)
    end.layers.figure().savefig(asked.out / "talos-fold-layers.png", dpi=90)

assert mm[0].max() > 10 > max(mm[1].max(), mm[2].max()), "the search makes the fold square to 1 cm, and Talos too"
assert talos.self_collisions() == robot.actual.self_collisions() == []
assert abs(end.doubled - 0.5) < 0.02, "a square fold has half of the cloth on the other half"
