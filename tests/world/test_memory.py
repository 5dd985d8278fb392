"""What needs more memory than there is is refused by name, before any work."""

import pytest

import nuno
from nuno import NotEnoughMemoryError


def test_more_worlds_than_fit_are_refused_at_once():
    """A hundred million worlds, with how much they need and how many fit; the world is as it was."""
    world = nuno.World(device="cpu")
    world.attach(world.add(nuno.sheet((0.2, 0.2), (6, 4), position=(0.0, 0.0, 1.0))))
    world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(1.0, 0.0, 1.0))))
    with pytest.raises(NotEnoughMemoryError, match=r"100000000 worlds would need .* worlds fit") as error:
        world.imagine(10**8)
    assert error.value.needed > error.value.free > 0 and isinstance(error.value, MemoryError)
    assert world.imagine(3).world_count == 3


def test_a_sheet_that_does_not_fit_is_refused_at_once():
    """1.6e12 vertices; a fine sheet that fits is made."""
    with pytest.raises(NotEnoughMemoryError, match=r"a sheet of .* vertices would need"):
        nuno.sheet((1.0, 1.0), (1_300_000, 1_300_000))
    assert nuno.sheet((1.0, 1.0), (1200, 1000)).shape.cells == (1200, 1000)
