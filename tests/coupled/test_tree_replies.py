"""How a body in a tree of joints goes for a force on it, beside the inverse inertia of all that its joints hold."""

import numpy as np
import pytest

import nuno
from nuno.world import coupled_bodies

SIZES = ((0.2, 0.1, 0.1), (0.3, 0.08, 0.06), (0.16, 0.12, 0.04))
"""[m] Of three boxes side by side, of which the last one lies on the floor."""
MASSES = (1.0, 2.0, 3.0)
HINGES = (((0.2, 0.0, 0.05), (0.0, 1.0, 0.0)), ((0.5, 0.0, 0.04), (0.0, 0.6, 0.8)), ((0.0, 0.0, 0.05), (1.0, 0.0, 0.0)))
"""Points [m] and axes: of the first two boxes, of the last two, and of the first one and the world."""


def crossed(v):
    """The matrix of the cross product v x."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def held_together(places, hinges):
    """The inverse inertia (18, 18) of the boxes under their hinges' rows G: M^-1 - M^-1 G^T (G M^-1 G^T)^-1 G M^-1."""
    inverse, rows = np.zeros((18, 18)), []
    for k, (size, mass) in enumerate(zip(np.square(SIZES), MASSES, strict=True)):
        inertia = mass / 12.0 * (size.sum() - size)
        inverse[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = np.diag(1.0 / np.concatenate([3 * [mass], inertia]))
    for k, (point, axis) in enumerate(HINGES[:hinges]):
        shift, turn = np.zeros((3, 18)), np.zeros((2, 18))
        across = np.linalg.svd(np.array(axis)[None])[2][1:]
        for body, sign in ((k, 1.0), (k + 1, -1.0)) if k < 2 else ((0, 1.0),):
            shift[:, 6 * body : 6 * body + 3] = sign * np.eye(3)
            shift[:, 6 * body + 3 : 6 * body + 6] = -sign * crossed(np.array(point) - places[body])
            turn[:, 6 * body + 3 : 6 * body + 6] = sign * across
        rows += [shift, turn]
    g = np.concatenate(rows)
    return inverse - inverse @ g.T @ np.linalg.solve(g @ inverse @ g.T, g @ inverse)


@pytest.mark.parametrize("hinges", [2, 3], ids=["a free chain", "a chain that the world carries"])
def test_a_reply_is_the_inverse_inertia_of_all_that_hangs_together(monkeypatch, hinges):
    """Closed form: Gauss's principle; to the digits of floats, and of 1e-6 m that the boxes move in a frame."""
    made, init = [], coupled_bodies.CoupledBodies.__init__

    def keep(own, *arguments):
        init(own, *arguments)
        made.append(own)

    monkeypatch.setattr(coupled_bodies.CoupledBodies, "__init__", keep)
    world = nuno.World(gravity=(0.0, 0.0, -0.005))
    world.add(nuno.plane(name="floor"))
    places = np.array([(0.1, 0.0, 0.07), (0.35, 0.0, 0.05), (0.58, 0.0, 0.02)])
    boxes = [world.add(nuno.box(s, position=p)) for s, p in zip(SIZES, places, strict=True)]
    for box, mass in zip(boxes, MASSES, strict=True):
        world.attach(box, nuno.Rigid(mass=mass))
    pairs = ((boxes[0], boxes[1]), (boxes[1], boxes[2]), (boxes[0], None))
    for (a, b), (point, axis) in zip(pairs[:hinges], HINGES, strict=False):
        nuno.hinge(a, b, point=point, axis=axis)
    world.run(1.0 / 60.0, progress=False)
    trees = made[-1]._joints.trees
    node = trees.node_of.numpy()[boxes[2]._dynamics.slot]
    assert trees.asked.numpy()[node]  # by its contacts with the floor
    own = trees.reply.numpy()[node]
    found = np.block([[own["a"], own["b"]], [own["b"].T, own["c"]]])
    expected = held_together(places, hinges)[12:, 12:]
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.abs(found - expected) / scale).max() < 2e-4
    lone = np.linalg.inv(np.diag(3 * [MASSES[2]]))
    assert np.abs(found[:3, :3] - lone).max() > 0.05  # what goes by the box's own mass is far from it
