"""What a body on a moving shape says it touches, after a run."""

import pytest

import nuno


@pytest.mark.parametrize("worlds", [1, 3])
@pytest.mark.parametrize("seconds", [0.25, 0.5, 1.0])
def test_a_body_on_a_shape_that_moves_has_contacts(worlds, seconds):
    """A cube that rests on a plate bears its weight on it, also where a run ends with all frames that one has."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1.0, 1.0, 0.1), name="plate", position=(0.0, 0.0, -0.05)))
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2), name="cube", position=(0.0, 0.0, 0.05)))
    world = world.imagine(worlds) if worlds > 1 else world
    world.move("plate", nuno.Path([0.0, 2.0], [(0.0, 0.0, -0.05), (0.2, 0.0, -0.05)]))
    world.attach("cube", nuno.Soft(damping=0.01))
    world.run(1.0)
    world.run(seconds)
    forces = world.contacts("cube").forces[:, 2].sum() / worlds
    assert forces == pytest.approx(200.0 * 0.1**3 * 9.81, rel=0.01)  # at rest on it, but for what is left of settling
