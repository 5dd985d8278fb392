"""A scene of MuJoCo is loaded, run, saved as USD in the middle of its motion, and goes on alike from there.

Run: python examples/load_scene.py [--out FOLDER]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import nuno

SCENE = """<mujoco>
<option gravity="0 0 -9.81"/>
<worldbody>
  <geom name="floor" type="plane" size="2 2 0.1" rgba="0.85 0.83 0.8 1"/>
  <body name="frame" pos="-0.02 0 0.3"><geom type="box" size="0.02 0.02 0.3" rgba="0.35 0.3 0.25 1"/></body>
  <body name="door" pos="0.22 0 0.3">
    <joint name="hinge" axis="0 0 1" pos="-0.22 0 0" range="-100 100" damping="0.02"/>
    <geom type="box" size="0.2 0.012 0.28" density="300" rgba="0.63 0.44 0.25 1"/>
    <geom type="sphere" size="0.015" pos="0.17 -0.03 0" density="2000" rgba="0.9 0.8 0.3 1"/>
  </body>
  <body name="rail" pos="0.5 0.3 0.4">
    <geom type="capsule" size="0.015 0.2" euler="90 0 0" rgba="0.5 0.5 0.55 1"/></body>
  <flexcomp name="towel" type="grid" dim="2" count="19 13 1" spacing="0.02 0.02 0.02" pos="0.51 0.3 0.43" mass="0.016"
            radius="0.002" rgba="0.25 0.5 0.8 1">
    <elasticity young="1e6" poisson="0.3" thickness="0.001" elastic2d="both"/><contact friction="0.9"/>
  </flexcomp>
  <body name="ball" pos="0.3 -0.4 0.06"><freejoint/>
    <geom type="sphere" size="0.06" density="500" rgba="0.8 0.3 0.25 1"/></body>
</worldbody>
<keyframe><key name="thrown" qvel="0 {still} 0.2 2.4 0 0 0 0"/></keyframe>
</mujoco>"""

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for the files and a picture")
out = options.parse_args().out

with tempfile.TemporaryDirectory() as folder:
    place = out or Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    (place / "room.xml").write_text(SCENE.format(still="0 " * (19 * 13 * 3 - 1) + "0"))
    scene = nuno.load_scene(place / "room.xml", nuno.World(device="cpu"), keyframe="thrown")
    print(scene.report)
    scene.world.run(0.3)  # the ball hits the door, the towel falls onto the rail

    print(nuno.save_scene(scene.world, place / "room.usda", joints=scene.joints))
    other = nuno.load_scene(place / "room.usda", nuno.World(device="cpu"))

first = scene.joints["hinge"].position
for world in (scene.world, other.world):
    world.run(0.2)
angles = [loaded.joints["hinge"].position for loaded in (scene, other)]
print(f"the door went from {first:.3f} rad to {angles[0]:.3f} rad, and to {angles[1]:.3f} rad from the file")
apart = {name: float(np.abs(body.vertices - other.bodies[name].vertices).max()) for name, body in scene.bodies.items()}
print({name: f"{1000 * far:.2f} mm" for name, far in apart.items()})

assert scene.bodies["towel"].is_dynamic and isinstance(scene.bodies["towel"].material, nuno.Cloth)
assert abs(scene.bodies["door"].mass - (300 * 0.4 * 0.024 * 0.56 + 2000 * 4 / 3 * np.pi * 0.015**3)) < 1e-5, (
    "as MuJoCo's"
)
assert angles[0] > first + 0.02, "the ball pushed it open"
assert abs(angles[1] - angles[0]) < 0.01
assert apart["ball"] < 0.005 and apart["towel"] < 0.02, "contacts begin anew in the loaded world"

if out:
    camera = nuno.Camera.look_at((1.25, -1.15, 0.95), (0.3, 0.12, 0.28), fov=0.6)
    nuno.take_picture(other.world, camera, samples=3).save(out / "load_scene.png")
