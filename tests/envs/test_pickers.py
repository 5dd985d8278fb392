"""Hands that take the nearest vertex, carry it, and do not tear the cloth."""

import numpy as np

import nuno
from nuno.envs.pickers import REACH, TAUT, Pickers

LOW, HIGH = np.full(3, -0.5), np.full(3, 0.5)
BOTH = np.ones((2, 2), dtype=bool)


def held_cloth():
    """Two worlds without gravity, a cloth at z = 0, and two hands in each."""
    single = nuno.World(device="cpu", gravity=(0, 0, 0), substeps=5, frame_rate=64)
    single.attach(single.add(nuno.sheet((0.2, 0.2), (2, 2), name="cloth")))
    world = single.imagine(2)
    cloth = world.find("cloth")
    return cloth, Pickers(world, cloth, 2, LOW, HIGH)


def test_a_hand_takes_the_nearest_vertex_within_reach_and_carries_it():
    """Beyond reach it takes none; two hands take two vertices; what is let go stays."""
    cloth, pickers = held_cloth()
    far = (0.1, 0.1, 1.01 * REACH)
    near = [(-0.1, -0.1, 0.5 * REACH), (-0.099, -0.1, 0.0)]
    pickers.put(np.array([near, [far, (0.1, -0.1, 0.0)]]), np.arange(2))
    motion = np.zeros((2, 2, 3))
    motion[1, 1] = (0.0, 0.0, 0.04)
    pickers.act(motion, BOTH, 0.125, cloth.vertices)
    assert pickers.held[0, 0] == 0 and pickers.held[0, 1] == -1  # the next vertex is 10 cm away
    assert pickers.held[1].tolist() == [-1, 2]
    np.testing.assert_allclose(cloth.vertices[1, 2], (0.1, -0.1, 0.04), atol=1e-6)  # float32 on the device
    np.testing.assert_allclose(pickers.positions[1], [far, (0.1, -0.1, 0.04)], atol=1e-7)
    pickers.act(np.zeros((2, 2, 3)), ~BOTH, 0.125, cloth.vertices)
    assert (pickers.held == -1).all()


def test_two_hands_do_not_pull_the_cloth_apart():
    """They stop at the flat distance of what they hold, and a little more."""
    cloth, pickers = held_cloth()
    pickers.put(np.broadcast_to(cloth.vertices[0, [0, 2]], (2, 2, 3)), np.arange(2))
    apart = np.zeros((2, 2, 3))
    apart[0, :, 0] = (-0.05, 0.05)
    for _ in range(3):
        pickers.act(apart, BOTH, 0.125, cloth.vertices)
    width = np.linalg.norm(pickers.positions[:, 1] - pickers.positions[:, 0], axis=1)
    np.testing.assert_allclose(width, [TAUT * 0.2, 0.2], atol=1e-6)


def test_hands_stay_where_they_may_be():
    """The space in which they move is a box."""
    cloth, pickers = held_cloth()
    pickers.put(np.zeros((2, 2, 3)), np.arange(2))
    pickers.act(np.full((2, 2, 3), 9.0), ~BOTH, 0.125, cloth.vertices)
    np.testing.assert_array_equal(pickers.positions, np.full((2, 2, 3), 0.5))
