"""Random worlds on MuJoCo: bodies, grips, welds and joints of all kinds, together."""

import numpy as np
import pytest

import nuno
from random_worlds import RandomWorld, add, attach, differences, run, state_of

pytest.importorskip("mujoco", minversion="4.0")


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_a_random_world_stays_finite_and_is_restored_to_the_bit(seed):
    """Whatever happens is done or refused by name; a snapshot goes on to the same bits, a batch to 1e-6 m."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    scene = RandomWorld(seed, world=world).do(add, add, add, attach, attach, run).happen(14)
    world = scene.world
    world.run(0.1)
    saved, futures = world.save(), world.imagine(2)
    for each in (world, futures):
        each.run(0.1)
    expected = state_of(world)
    assert all(np.isfinite(values).all() for values in expected.values())
    assert all(np.isfinite(part).all() for grip in scene.grips() for part in grip.wrench)
    for k in range(2):  # bodies may have come there in another order
        for body in world.bodies:
            found = next(other for other in futures.bodies if other.key == body.key)
            vertices = np.broadcast_to(found.vertices, (2, *body.vertices.shape))[k]
            np.testing.assert_allclose(vertices, body.vertices, atol=1e-6)
    world.restore(saved)
    world.run(0.1)
    assert not differences(state_of(world), expected)
