"""A person who folds a cloth in half with two hands, and a towel on a table: what tests of folding share."""

import numpy as np

import nuno
from nuno.shapes.path import minimum_jerk
from nuno.tasks.taught_fold import TaughtFold

SIZE = (0.40, 0.30)  # [m] of the cloth that was folded
TOP = 0.70  # [m] of the table that it lay on
THICKNESS = 0.005  # [m]
RELEASE = 1.65  # [s]
CLOTH = nuno.Cloth(area_density=0.25, bending_rigidity=8e-5, stretch_stiffness=3000.0, thickness=THICKNESS)
REST = TOP + THICKNESS / 2


def hand_paths(sides=(-0.15, 0.15)):
    """Hands that carry the corners of the side at -x over to the other side in 1.5 s, and let go at 1.65 s."""
    times = np.arange(0.0, 2.0, 1 / 30)
    s = np.clip(times / 1.5, 0.0, 1.0)
    angle = np.pi * minimum_jerk(s)
    x, z = -0.2 * np.cos(angle), REST + 0.2 * np.sin(angle) + 0.006 * s
    return [nuno.HandPath(times, np.stack([x, np.full_like(x, y), z], axis=1), times < RELEASE) for y in sides]


def lesson(hands, **options):
    """What hands teach that fold a cloth of SIZE; it is coarse, so that tests are fast."""
    world = nuno.World(device="cpu", substeps=10)
    world.add(nuno.plane(position=(0.0, 0.0, TOP)))
    cloth = world.add(nuno.sheet(SIZE, cells=(12, 9), position=(0.0, 0.0, REST)))
    return TaughtFold.from_hands(world, cloth, hands, CLOTH, **{"settle": 0.5, **options})


def room(size=(0.36, 0.30), cells=(12, 10), x=0.30, top=0.74):
    """A world with a table, and a towel on it whose side nearest to a robot at the origin is at x."""
    world = nuno.World(device="cpu", substeps=10)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.8, 1.2, 0.02), name="table", position=(x + 0.37, 0.0, top - 0.01)))
    towel = nuno.sheet(size, cells=cells, name="towel", position=(x + size[0] / 2, 0.0, top + THICKNESS / 2))
    return world, world.add(towel)
