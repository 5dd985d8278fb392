"""Talos takes a towel on a table by two corners, inverse kinematics tick by tick, and lifts it.

Run: python examples/talos_reach.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

TABLE = 0.72  # [m] height of its top
CORNERS = {"left": np.array((0.45, 0.2, TABLE)), "right": np.array((0.45, -0.2, TABLE))}
ABOVE = 0.04  # [m] of the middle of the fingertips above the corners: the fingers are 0.03 m longer
LIFT = 0.25  # [m]
DOWN = nuno.Coordinates(quaternion=(0, 1, 0, 0))  # of a hand: z down, x ahead
TICK = 1 / 60  # [s]

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

world = nuno.World(device="cpu")
world.add(nuno.box((0.7, 1.2, 0.02), name="table", position=(0.75, 0, TABLE - 0.01)))
towel = world.add(nuno.sheet((0.3, 0.4), cells=(12, 16), position=(0.6, 0, TABLE + 0.002)))
world.attach(towel, nuno.Cloth.preset("towel"))

robot = nuno.Humanoid("talos")
links = robot.enter(world)


def go(height, seconds):
    """Move both hands so high above where the corners lay, in so many seconds, and return the largest error [m]."""
    start = {side: robot.frame_pose(f"{side}_hand") for side in CORNERS}
    ticks, worst = round(seconds / TICK), 0.0
    for k in range(1, ticks + 1):
        s = k / ticks
        s = s**3 * (10 - 15 * s + 6 * s**2)  # minimum jerk
        targets = {}
        for side, corner in CORNERS.items():
            goal = corner + np.array((0, 0, height))
            turn = (1 - s) * start[side].quaternion + s * DOWN.quaternion * np.sign(start[side].quaternion[1])
            targets[f"{side}_hand"] = nuno.Coordinates((1 - s) * start[side].position + s * goal, turn)
        reached = robot.reach(targets)
        assert reached, reached.reason
        worst = max(worst, *reached.position_errors.values())
        links.follow(TICK)
        world.step()
    return worst


errors = [go(0.2, 1.5), go(ABOVE, 0.7)]
for side, corner in CORNERS.items():
    world.grip(towel, towel.closest(corner), to=world.find(f"talos/gripper_{side}_base_link"))
errors.append(go(ABOVE + LIFT, 1.2))
world.run(0.5)

height = towel.vertices[:, 2].max() - TABLE
support = robot.support_polygon()
print(f"the hands kept within {1000 * max(errors):.2f} mm of their way; the towel's corners are {height:.3f} m up")
low, high = support[:, 0].min(), support[:, 0].max()
print(f"centre of mass at x = {robot.centre_of_mass[0]:.3f} m, soles from {low:.3f} to {high:.3f}")
assert max(errors) < 0.0005, "the tolerance of reach"
assert abs(height - LIFT) < 0.005, "the gripped corners go as far up as the hands"
for side in CORNERS:
    gap = np.linalg.norm(towel.vertices - robot.frame_pose(f"{side}_hand").position, axis=1).min()
    assert gap < ABOVE + 0.005, "a corner is at each hand"
assert robot.self_collisions() == []

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at((1.9, -1.5, 1.6), (0.3, 0, 0.86), fov=0.82)
    nuno.HeadCameras(links, samples=2).look_from(camera).save(out / "talos_reach.png")
