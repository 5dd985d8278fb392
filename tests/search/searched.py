"""Trials that tests search over, at the top of a module so that other processes can import them."""

import os
import signal
import time
from pathlib import Path

import numpy as np

import nuno


def square(world, params):
    """A batch of sums, without a world."""
    return {"y": params["x"] ** 2 + params.get("z", 0.0)}


def single_square(world, params):
    """One sum."""
    assert world is None
    return {"y": params["x"] ** 2}


def slow_square(world, params):
    """One sum that takes a while, and that leaves a mark of each run of it."""
    _mark(params)
    return {"y": params["x"] ** 2}


def slow_squares(world, params):
    """The same for a batch of one, which is run twice, and marked once."""
    _mark({name: column[0] for name, column in params.items()})
    return {"y": params["x"] ** 2}


def _mark(params):
    with open(params["marks"], "ab", buffering=0) as file:
        file.write(f"{int(params['x'])}\n".encode())
    if int(params["x"]) >= float(os.environ.get("HELD_FROM", "inf")):
        time.sleep(3600.0)  # until it is killed or interrupted, however long that takes on a busy machine
    time.sleep(float(params["seconds"]))


def deadly_square(world, params):
    """One sum; number 3 kills its process, always or until ``once`` is there."""
    if params["x"] == 3:
        once = params.get("once")
        if once is None or not Path(once).exists():
            if once is not None:
                Path(once).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return {"y": params["x"] ** 2, "pid": os.getpid()}


def failing_square(world, params):
    """A batch that raises as a whole where one x is 3."""
    if (params["x"] == 3).any():
        raise ValueError("three is not allowed")
    return {"y": params["x"] ** 2}


def table_with_towel():
    """A small towel over a ball, static."""
    world = nuno.World(device="cpu", substeps=10)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 0.05)))
    world.add(nuno.sheet((0.2, 0.15), cells=(8, 6), name="towel", position=(0.02, 0.01, 0.12)))
    return world


def drape(world, params):
    """Let towels fall on the ball: where their vertices are, a mean, and whether the ball is touched."""
    world.attach("towel", nuno.Cloth(bending_rigidity=params["bending"], friction=params["friction"]))
    world.run(0.25)
    vertices = world.find("towel").vertices
    assert vertices.ndim == 3, "a trial of batches always gets a batch"
    return {"vertices": vertices, "height": vertices[..., 2].mean(axis=1)}


def single_drape(world, params):
    """The same for one world."""
    world.attach("towel", nuno.Cloth(bending_rigidity=params["bending"], friction=params["friction"]))
    world.run(0.25)
    vertices = world.find("towel").vertices
    return {"vertices": vertices, "height": vertices[..., 2].mean()}


def pushed_towel(world, params):
    """Towels that are pushed so hard that some are thrown out of all numbers."""
    world.attach("towel", nuno.Cloth())
    world.push("towel", np.stack([np.zeros_like(params["force"])] * 2 + [params["force"]], axis=-1))
    world.run(0.2)
    return {"height": world.find("towel").vertices[..., 2].mean(axis=1)}


def broken_room():
    """A world that cannot be made."""
    raise RuntimeError("no room")
