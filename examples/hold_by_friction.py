"""Two fingers press a cube, a towel's edge and a mat's corner, and lift them: how hard must they press?

By Coulomb's law what is between two fingers stays there as long as 2 mu F > m (g + a). Each thing is lifted twice, with
1.2 and with 0.8 times that force.

Run: python examples/hold_by_friction.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

import nuno

MU, G = 0.5, 9.81
FAR, SPAN = 0.5, 1.0  # [m], [s] of the lift
PEAK = 10.0 / np.sqrt(3.0) * FAR / SPAN**2  # [m/s2] of a minimum-jerk way
UPRIGHT, CORNER = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0), (np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0)

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out


def thing(kind, x):
    """Return a body that hangs at x [m] from between two fingers, its material, mass [kg] and half thickness [m]."""
    if kind == "cube":
        cube = nuno.box((0.05,) * 3, position=(x, 0, 0.45), color="#c05030")
        return cube, nuno.Rigid(mass=0.5, friction=MU), 0.5, 0.025
    if kind == "towel":  # by its upper edge
        sheet = nuno.sheet((0.2, 0.3), (10, 15), position=(x, 0, 0.32), quaternion=UPRIGHT, color="#3070b0")
        return sheet, nuno.Cloth(area_density=0.4, friction=MU, damping=0.02), 0.024, 0.002
    mat = nuno.soft_box((0.2, 0.02, 0.2), (6, 2, 6), position=(x, 0, 0.339), quaternion=CORNER, color="#40a060")
    return mat, nuno.Soft(youngs_modulus=1e5, poisson_ratio=0.3, density=200.0, friction=MU, damping=0.05), 0.16, 0.01


world = nuno.World(device="cpu")
world.add(nuno.plane(name="floor"))
tries, x = [], -0.75
for kind in ("cube", "towel", "mat"):
    for share in (1.2, 0.8):
        body, material, mass, half = thing(kind, x)
        world.attach(world.add(body), material)
        palm = world.add(nuno.box((0.04, 0.2, 0.02), position=(x, 0, 0.55), color="#707070"))
        force = share * mass * (G + PEAK) / (2.0 * MU)
        for side in (-1, 1):
            finger = world.add(nuno.box((0.03, 0.01, 0.12), position=(x, side * (half + 0.005), 0.49), color="#909090"))
            world.attach(finger, nuno.Rigid(mass=0.05, friction=MU))
            press = nuno.Motor(velocity=0.05, max_effort=force) if side > 0 else nuno.Motor(velocity=0.0)
            nuno.slider(finger, palm, axis=(0, -side, 0), motor=press)
        rest = world.add(nuno.box((0.2, 0.2, 0.01), position=(x, 0, body.vertices[:, 2].min() - 0.005)))
        tries.append((kind, share, force, body, palm, rest))
        x += 0.3
world.run(0.3)  # the fingers close
start = {}
for _, _, _, body, palm, rest in tries:
    world.remove(rest)
    start[body] = body.vertices[:, 2].max() - palm.position[2]
    way = [palm.position, palm.position + np.array([0.0, 0.0, FAR])]
    world.move(palm, nuno.Path(world.time + np.array([0.0, SPAN]), way, interpolation="minimum_jerk"))
world.run(SPAN)
for kind, share, force, body, palm, _ in tries:
    slip = start[body] - (body.vertices[:, 2].max() - palm.position[2])
    print(f"{kind:6s} {force:5.2f} N, {share} of what the lift takes: slid by {1000 * slip:7.2f} mm")
    # a path's velocity steps from frame to frame, and what is held lags behind at each step
    assert slip < 5e-3 if share > 1.0 else slip > 0.05

if out:
    out.mkdir(parents=True, exist_ok=True)
    camera = nuno.Camera.look_at(eye=(0.5, 2.3, 0.95), target=(0.0, 0.0, 0.52), fov=0.45, width=800, height=480)
    nuno.take_picture(world, camera).save(out / "hold_by_friction.png")
