"""Who goes together in a frame is asked in each world by itself: a world of a batch is what it is alone."""

import numpy as np
import pytest

import nuno
from nuno.world.islands import find_islands

WORLDS = 4
BODIES = ("towel", "cube", "box", "ball", "scarf")
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]


def places():
    """Return where bodies start in each world (worlds, 3) [m]: some meet at once, some later, some never."""
    far = np.array([0.0, 1.0, 2.0, 0.0])[:, None] * [0.5, 0.0, 0.0]
    return {
        "cube": np.array([0.02, 0.01, 0.46]) + far,
        "box": np.array([-0.05, 0.02, 0.55]) + far[::-1] * [-1.0, 0.0, 0.0],
        "ball": np.array([-0.05, 0.03, 0.75]) + far[[1, 0, 0, 3]] * [0.0, 0.0, 0.3],
        "scarf": np.array([0.0, 0.0, 0.5]) + far[[2, 1, 0, 2]] * [0.0, 1.0, 0.0],
    }


def room(k=None, device="cpu"):
    """Return a batch, or world k of it alone: a towel held at its corners, and what falls on it or beside it."""
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.sheet((0.2, 0.2), (6, 6), position=(0.0, 0.0, 0.4), name="towel"))
    world.add(nuno.soft_box((0.05, 0.05, 0.05), (2, 2, 2), name="cube"))
    world.add(nuno.box((0.04, 0.04, 0.04), name="box"))
    world.add(nuno.sphere(0.02, name="ball"))
    world.add(nuno.sheet((0.1, 0.1), (4, 4), name="scarf"))
    if k is None:
        world = world.imagine(WORLDS)
    thickness = np.linspace(0.001, 0.005, WORLDS)
    for name, place in places().items():
        world.find(name).locate(place if k is None else place[k])
    world.attach("towel", nuno.Cloth(area_density=0.3, thickness=thickness if k is None else thickness[k]))
    world.attach("cube", nuno.Soft(density=300.0, damping=0.05))
    world.attach("box", nuno.Rigid(mass=0.05))
    world.attach("ball", nuno.Rigid(mass=0.02))
    world.attach("scarf", nuno.Cloth(area_density=0.2))
    corners = world.find("towel").vertices.reshape(-1, 49, 3)[0, [0, 6, 42, 48]]
    for vertex, corner in zip((0, 6, 42, 48), corners, strict=True):
        world.grip("towel", [vertex], to=corner)
    # the scarf hangs on the box by a corner, in the first two worlds
    held = np.where(np.arange(WORLDS)[:, None] < 2, [[0]], [[-1]])
    world.grip("scarf", held if k is None else held[k : k + 1], to=world.find("box"))
    return world


def told(world, k=0):
    """Return what a world of a batch tells of its bodies, their grips and their contacts."""
    found = {}
    for name in BODIES:
        body = world.find(name)
        vertices, velocities = body.vertices, body.velocities
        found[name] = vertices if vertices.ndim == 2 else vertices[k]
        found[name, "velocity"] = velocities if velocities.ndim == 2 else velocities[k]
        for number, grip in enumerate(body._dynamics.grips):
            found[name, number] = np.concatenate([part.reshape(-1, 3)[k] for part in grip.wrench])
        contacts = world.contacts(body)
        own = contacts.worlds == k if world.world_count > 1 else slice(None)
        found[name, "points"], found[name, "forces"] = contacts.points[own], contacts.forces[own]
    return found


@pytest.mark.long
@pytest.mark.parametrize("device", DEVICES)
def test_a_world_of_a_batch_is_itself_alone_bit_for_bit(device):
    """Promise: whoever is near whom in the other worlds, and however many substeps that takes."""
    batch, alone = room(None, device), [room(k, device) for k in range(WORLDS)]
    mixed = 0
    for _ in range(4):
        moving = [batch.find(name) for name in BODIES]
        mixed += np.ptp(find_islands(batch, moving, 1 / 60).substeps, axis=1).any()
        batch.run(0.075)
        for k, world in enumerate(alone):
            world.run(0.075)
            own = told(batch, k)
            for key, value in told(world).items():
                np.testing.assert_array_equal(own[key], value, err_msg=f"{key} in world {k} at {world.time:.2f} s")
    assert mixed > 1  # else this would test nothing


def test_islands_are_those_that_meet_through_others():
    """Exact: by boxes that meet in a world, with the most substeps that any of them needs."""
    world = nuno.World(device="cpu")
    for name in ("a", "b", "c"):
        world.add(nuno.box((0.1, 0.1, 0.1), name=name))
    world.add(nuno.sheet((0.1, 0.1), (10, 10), name="cloth"))
    world = world.imagine(3)
    at = {"a": (0.0, 0.2, 0.0), "b": (0.16, 5.0, 0.16), "c": (0.32, 0.62, 5.0), "cloth": (0.48, 0.74, 0.48)}
    for name, x in at.items():
        world.find(name).locate(np.stack([x, np.zeros(3), np.zeros(3)], axis=1))
        world.attach(name)
    moving = [world.find(name) for name in at]
    islands = find_islands(world, moving, 1 / 60)
    np.testing.assert_array_equal(islands.first, [[0, 0, 0], [0, 1, 0], [0, 2, 2], [0, 2, 3]])
    few, many = (world.find(name)._dynamics.substeps for name in ("a", "cloth"))
    assert few < many
    expected = [[many, few, few], [many, few, few], [many, many, few], [many, many, many]]
    np.testing.assert_array_equal(islands.substeps, expected)
    np.testing.assert_array_equal(islands.at(few), [[0, 0, 0], [1, 1, 0], [2, 2, 2], [3, 3, 3]])


@pytest.mark.long
@pytest.mark.parametrize("device", DEVICES)
def test_a_span_in_pieces_is_the_span(device):
    """Promise: where runs begin and end changes no bit, also where worlds go through frames with other substeps."""
    whole, parts = room(None, device), room(None, device)
    whole.run(0.2)
    for _ in range(2):
        parts.run(0.1)
    for name in BODIES:
        np.testing.assert_array_equal(parts.find(name).vertices, whole.find(name).vertices, err_msg=name)
        np.testing.assert_array_equal(parts.find(name).velocities, whole.find(name).velocities, err_msg=name)
