"""Talos walks a metre, turns on the spot, and stops in the middle of a third walk.

Run: python examples/talos_walk.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import nuno
from nuno.robot.walking import plan_walk, stop_walk

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

robot = nuno.Humanoid("talos")
sole = robot.description.frames["left_foot"].size


def walk_it(walk):
    """Bring the robot to where the walk ends."""
    robot.take_configuration(walk.configurations[-1])
    own = walk.measures
    print(f"{len(walk.footsteps):2d} steps in {walk.duration:4.1f} s: {1000 * own.margin:.0f} mm to the soles' edges, "
          f"{own.velocity_share:.0%} of a joint's velocity, {own.torque_share:.0%} of a joint's torque")  # fmt: skip
    assert own.margin > 0.02, "what is asked of Talos"
    return walk


ahead = walk_it(plan_walk(robot, 1.0, 0.0, 0.0))
middle = np.mean([robot.frame_pose(foot).position for foot in robot.feet], axis=0)
assert np.allclose(middle, (1.0, 0.0, 0.0), atol=1e-3), "the feet end around the goal"

turn = walk_it(plan_walk(robot, 0.0, 0.0, np.pi / 2))
facing = robot.frame_pose("left_foot").rotation[:, 0]
assert np.allclose(facing, (0.0, 1.0, 0.0), atol=1e-3), "a quarter turn to the left"

third = plan_walk(robot, 1.0, 0.3, 0.5)
stopped = walk_it(stop_walk(third, 3.3))
assert stopped.times[-1] < 3.3 + 2.0 + 1.8, "two steps at most, and coming to rest"
assert robot.self_collisions() == []

if out:
    out.mkdir(parents=True, exist_ok=True)
    figure = Figure((10, 3.2), layout="constrained")
    walks = {"a metre ahead": ahead, "a turn on the spot": turn, "stopped on its way": stopped}
    for axes, (title, walk) in zip(figure.subplots(1, 3, width_ratios=(2.6, 1, 1)), walks.items(), strict=True):
        for foot, (side, colour) in enumerate({"left": "tab:blue", "right": "tab:red"}.items()):
            axes.plot([], [], color=colour, linewidth=0.7, label=f"{side} sole on the floor")
            for x, y, _, yaw in np.unique(walk.feet[walk.support == 0][:, foot].round(6), axis=0):
                c, s = np.cos(yaw), np.sin(yaw)
                corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]) * sole / 2
                axes.plot(*(corners @ [[c, s], [-s, c]] + (x, y)).T, color=colour, linewidth=0.7)
        axes.plot(*walk.zmp.T, color="black", linewidth=0.8, label="zero moment point")
        axes.plot(*walk.centre[:, :2].T, color="tab:green", label="centre of mass")
        axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=title)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(out / "talos_walk.png", dpi=100)
