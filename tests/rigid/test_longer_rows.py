"""Rows of pairs that become too short in one world of a batch: the others go on as they would alone, to the bit."""

import numpy as np
import pytest

import nuno
from nuno.rigid import rigid_arrays


def box_on_floor(joined):
    """A box on a floor before a corner of two walls; perhaps a lid is hinged to it."""
    world = nuno.World(device="cpu", substeps=8)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.1, 1.0, 0.4), name="wall", position=(0.5, 0.0, 0.2)))
    world.add(nuno.box((1.0, 0.1, 0.4), name="other wall", position=(0.0, 0.5, 0.2)))
    box = world.add(nuno.box((0.1, 0.1, 0.1), name="box", position=(0.3, 0.3, 0.05)))
    world.attach(box, nuno.Rigid(mass=1.0, friction=0.3))
    if joined:
        lid = world.add(nuno.box((0.1, 0.1, 0.02), name="lid", position=(0.3, 0.3, 0.112)))
        world.attach(lid, nuno.Rigid(mass=0.2))
        nuno.hinge(lid, box, point=(0.25, 0.3, 0.1), axis=(0.0, 1.0, 0.0), limits=(-1.5, 1.5))
    world.run(0.1, progress=False)
    return world


def ends(world, velocities):
    """Return where bodies are in the last world after 0.5 s of copies that set off so, and how long rows were, and are.

    The last one slides over the floor, round and round, away from the walls.
    """
    futures = world.imagine(len(velocities))
    before = futures._rigid.solver.manifolds.row
    futures.set_velocity("box", np.array(velocities), np.full((len(velocities), 3), (0.0, 0.0, 3.0)))
    futures.run(0.5, progress=False)
    vertices = {body.name: body.vertices.reshape(-1, 8, 3)[-1] for body in futures.bodies if body.is_dynamic}
    return vertices, before, futures._rigid.solver.manifolds.row


@pytest.mark.parametrize("joined", [False, True], ids=["apart", "joined"])
def test_other_worlds_go_on_as_alone(joined, monkeypatch):
    """In the world where nothing overflows no contact is missed, nor are pairs listed at another time."""
    monkeypatch.setattr(rigid_arrays, "ROW", 2)
    world = box_on_floor(joined)
    away = (-1.0, -0.4, 0.0)
    together, _, grown = ends(world, [(1.5, 1.5, 0.0), away])
    alone, before, room = ends(world, [away])
    assert grown > before == room == 2, "rows were too short in the other world, which came to the floor and both walls"
    for name, vertices in alone.items():
        assert np.array_equal(together[name], vertices), name
