"""Talos moves a towel that it holds by a corner, and a world in its head keeps step by joint angles and depth images.

The real world is another one here: its towel is heavier, stiffer and finer. The head reads the robot's joint angles
ten times a second, leads its own robot's links there, and corrects its towel by what a camera across the table sees.

Run: python examples/follow_in_hand.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

import nuno

TOP, CORNER = 0.72, np.array((0.45, 0.2, 0.722))  # [m] the table, and the corner that the left hand takes
DOWN = nuno.Coordinates(quaternion=(0, 1, 0, 0))  # of a hand: z down, x ahead
WAY = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.22), (0.05, -0.12, 0.26), (0.05, 0.1, 0.22), (0.0, 0.0, 0.2)])  # [m]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out
camera = nuno.Camera.look_at((1.35, -0.3, 1.4), (0.55, 0.1, TOP + 0.1), 0.75, width=320, height=240)


def over(way):
    """Return where the hand is that holds the corner so far from where it lay."""
    return nuno.Coordinates(CORNER + way + (0, 0, 0.04), DOWN.quaternion)


def room(cells, material, shift):
    """A table with a towel, and Talos whose left hand holds it by a corner."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.7, 1.2, 0.02), name="table", position=(0.75, 0, TOP - 0.01)))
    towel = world.add(nuno.sheet((0.3, 0.4), cells, name="towel", position=(0.6 + shift[0], shift[1], TOP + 0.002)))
    world.attach(towel, material)
    robot = nuno.Humanoid("talos")
    assert robot.reach({"left_hand": over(np.zeros(3))})
    links = robot.enter(world)
    world.grip(towel, towel.closest(CORNER), to=world.find("talos/gripper_left_base_link"))
    return world, towel, robot, links


real, cloth, talos, talos_links = room((18, 24), nuno.Cloth(area_density=0.35, bending_rigidity=3e-4), (0, 0))
head, towel, ghost, ghost_links = room((12, 16), nuno.Cloth(), (0.012, -0.01))
alone, blind, other, other_links = room((12, 16), nuno.Cloth(), (0.012, -0.01))
follower = nuno.follow(head, towel, camera)

noise, rows, off = np.random.default_rng(0), [], []
uv = np.stack(np.meshgrid(np.linspace(0, 1, 13), np.linspace(0, 1, 17)), axis=-1).reshape(-1, 2).T
for k in range(1, 31):
    s = np.clip(k / 28, 0, 1) * (len(WAY) - 1)
    way = np.array([np.interp(s, range(len(WAY)), WAY[:, axis]) for axis in range(3)])
    reached = talos.reach({"left_hand": over(way)})
    assert reached, reached.reason
    for links, own in ((ghost_links, ghost), (other_links, other)):
        own.take_configuration(talos.configuration())  # as the encoders tell
        links.follow(0.1)
    talos_links.follow(0.1)
    real.run(0.1, progress=False)
    alone.run(0.1, progress=False)
    depth = real.depth(camera).numpy() + 0.002 * noise.standard_normal((240, 320))
    told = follower.update(real.time, real.masks(camera, cloth), depth)
    truth, *guesses = (b.at(*uv).positions(b.vertices, b.faces) for b in (cloth, towel, blind))
    off.append([1000 * np.linalg.norm(guess - truth, axis=1).mean() for guess in guesses])
    if k in (8, 15, 22, 30):
        print(f"{told}; truly {off[-1][0]:.1f} mm, without images {off[-1][1]:.1f} mm")
        rows.append(np.vstack([nuno.take_picture(w, camera, samples=2).color.numpy() for w in (real, head, alone)]))

mean = np.mean(off, axis=0)
print(f"mean over all images: {mean[0]:.1f} mm followed, {mean[1]:.1f} mm without images")
assert np.allclose(ghost.frame_pose("left_hand").position, talos.frame_pose("left_hand").position)
assert mean[0] < 15.0 and mean[0] < mean[1], "images draw the towel in the head to the one in the hand"

if out:
    out.mkdir(parents=True, exist_ok=True)
    strip = np.hstack(rows)
    for row, label in enumerate(("seen", "in the head", "without images")):
        cv2.putText(strip, label, (8, 240 * row + 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (20, 20, 20), 1, cv2.LINE_AA)
    cv2.imwrite(str(out / "follow_in_hand.png"), strip[..., ::-1])
