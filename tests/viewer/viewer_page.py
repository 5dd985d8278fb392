"""Picture of the viewer's page for the documentation, as Chromium shows it.

Run: python docs/make_pictures.py viewer_page
"""

import argparse
from pathlib import Path

import numpy as np
from browser import Browser, save_picture

import nuno
from nuno.tasks.look_at_camera import look_at_camera

TOP = 0.4  # [m] height of the table top
SECONDS = 0.8


def viewer_page(path):
    """Write a picture of the page: a napkin coloured by strain, a picked cube, contacts, a camera and a plot."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.7, 0.7, 0.02), name="table", position=(0, 0, TOP - 0.01)))
    napkin = world.add(nuno.sheet((0.3, 0.3), cells=(16, 16), name="napkin", position=(-0.1, 0, TOP + 0.01)))
    cube = world.add(nuno.soft_box((0.12, 0.12, 0.12), cells=(4, 4, 4), name="cube", position=(0.2, 0, TOP + 0.1)))
    world.attach(napkin, nuno.Cloth.preset("napkin"))
    world.attach(cube)
    start = napkin.vertices[0]
    lift = nuno.Path([0.0, 0.7], [start, start + np.array((0.05, 0.05, 0.2))], interpolation="minimum_jerk")
    world.grip(napkin, napkin.at(0, 0), to=lift)
    with nuno.Viewer(world, contacts=True, grip_forces=True, force_scale=0.3) as viewer, Browser(1100, 700) as browser:
        viewer.draw(napkin, color_by="strain", color_range=(0.0, 0.02))
        viewer.add_camera("eye", look_at_camera((0.3, 0.6, 0.7), (0, 0, TOP), 320, 240, 300.0), depth=0.2)
        viewer.plot("height of the napkin", lambda: napkin.vertices[:, 2].max(), "m")
        viewer.pick(cube)
        viewer.look_from((0.9, -1.0, 0.95), (0, 0, TOP + 0.05))
        browser.open(viewer.url)
        for _ in range(8):
            world.run(SECONDS / 8)
            viewer.update()
        browser.wait_for(f"document.getElementById('clock').textContent === 't = {SECONDS:.2f} s'")
        save_picture(browser.picture(), path)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, required=True, help="a folder")
    viewer_page(options.parse_args().out / "viewer_page.png")
