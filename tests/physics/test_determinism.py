"""The same input gives the same bits: again, in any place of a batch, and after a restore."""

import numpy as np
import pytest

import nuno

WORLDS = 20
SECONDS = 0.5


def materials():
    """Return 20 different materials as one batch, and the grip's goals (worlds, 2, 3)."""
    random = np.random.default_rng(5)

    def some(low, high):
        return random.uniform(low, high, WORLDS).astype(np.float32)

    cloth = nuno.Cloth(
        area_density=some(0.1, 0.4), stretch_stiffness=(some(300, 1500), some(300, 1500)),
        shear_stiffness=some(50, 400), bending_rigidity=(some(1e-5, 1e-4), some(1e-5, 1e-4)),
        thickness=some(0.002, 0.005), friction=some(0.1, 0.9), damping=some(0.0, 0.002),
        air_drag=some(0.5, 3.0),
    )  # fmt: skip
    goals = random.uniform(-0.1, 0.1, (WORLDS, 2, 3)) + np.array([0, 0, 0.15])
    return cloth, goals


def room():
    """A table, a ball on it, and a folded-over path for a sheet that lies on them."""
    world = nuno.World(device="cpu", substeps=12)
    world.add(nuno.box((1, 1, 0.02), name="table", position=(0, 0, -0.01), friction=0.4))
    world.add(nuno.sphere(0.03, name="ball", position=(0.05, 0.02, 0.02)))
    world.add(nuno.sheet((0.3, 0.24), cells=(10, 8), name="cloth", position=(0, 0, 0.06)))
    return world


def act(world, cloth, goals):
    """Attach the cloth and lead two of its points, one of them between vertices."""
    body = world.attach("cloth", cloth)
    begin = np.array([-0.15, -0.12, 0.06])
    keys = np.stack([np.broadcast_to(begin, goals[..., 0, :].shape), goals[..., 0, :], goals[..., 1, :]], axis=-2)
    world.grip(body, 0, to=nuno.Path([0.0, 0.3, 0.7], keys, interpolation="minimum_jerk"))
    world.grip(body, body.at(0.9, 0.1), to=(0.1, 0.0, 0.08))
    return body


@pytest.fixture(scope="module")
def batch():
    """Positions and velocities of 20 different worlds that ran together, and their self-contact pairs."""
    cloth, goals = materials()
    world = room().imagine(WORLDS)
    body = act(world, cloth, goals)
    world.run(SECONDS)
    return body.vertices, body.velocities, body._dynamics.solver.pair_counts


@pytest.mark.long
def test_the_worlds_of_a_batch_differ_and_touch_themselves(batch):
    """What makes the tests below worth their name."""
    x, _, pairs = batch
    assert np.abs(x[1:] - x[:-1]).max(axis=(1, 2)).min() > 1e-3
    assert (pairs.sum(axis=1) > 0).mean() > 0.5


@pytest.mark.parametrize("k", [0, 3, 15, 16, 19])
def test_a_world_of_a_batch_is_itself_alone_bit_for_bit(batch, k):
    """Promise: world k of a batch, in its lane or in another group of lanes, is what it is alone."""
    cloth, goals = materials()
    world = room()
    body = act(world, cloth.of_world(k, WORLDS), goals[k])
    world.run(SECONDS)
    np.testing.assert_array_equal(body.vertices, batch[0][k])
    np.testing.assert_array_equal(body.velocities, batch[1][k])


def test_a_run_repeats_bit_for_bit(batch):
    """Promise: same input, same device, same bits."""
    cloth, goals = materials()
    world = room().imagine(WORLDS)
    body = act(world, cloth, goals)
    world.run(SECONDS)
    np.testing.assert_array_equal(body.vertices, batch[0])
    np.testing.assert_array_equal(body.velocities, batch[1])


@pytest.mark.parametrize("after", [0.25, 0.5])
def test_a_restored_run_goes_on_bit_for_bit(tmp_path, after):
    """Promise: saving in mid-run and going on from the file, in a new world, changes no bit."""
    cloth, goals = materials()
    world = room()
    body = act(world, cloth.of_world(7, WORLDS), goals[7])
    world.run(after)
    saved = world.save(tmp_path / "middle.npz")
    world.run(0.3)
    expected = body.vertices
    world.restore(saved)
    world.run(0.3)
    np.testing.assert_array_equal(body.vertices, expected)
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "middle.npz")
    other.run(0.3)
    np.testing.assert_array_equal(other.find("cloth").vertices, expected)
