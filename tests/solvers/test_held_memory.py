"""Memory of forgotten worlds: Python's collector has its turn by what they hold, not by how many objects there are."""

import gc

import pytest

import nuno
from nuno.solvers import held_memory
from nuno.solvers.held_memory import HeldMemory


class Owner:
    """Something that refers to itself, as a world and its bodies do to each other."""

    def __init__(self):
        self.own = self


@pytest.fixture
def alone():
    """Leave nothing to Python's own turns."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def test_what_was_forgotten_is_freed_before_more_is_held_than_the_limit(alone):
    """Of owners of 4 bytes each, none of which is kept, two at most are held with a limit of 10."""
    memory = HeldMemory(10)
    for _ in range(20):
        memory.hold(Owner(), 4)
        assert memory.held <= 8
    assert memory.limit == 10
    gc.collect()
    assert memory.held == 0


def test_what_is_in_use_raises_the_limit(alone):
    """Else each further owner would have all objects looked through: twice what is held then, 12 bytes."""
    memory, kept = HeldMemory(10), []
    for _ in range(5):
        kept.append(Owner())
        memory.hold(kept[-1], 4)
    assert memory.held == 20 and memory.limit == 24
    kept.clear()
    for _ in range(5):
        memory.hold(Owner(), 8)
        assert memory.held <= 24
    assert memory.limit <= 24


def test_batches_that_are_imagined_one_after_the_other_hold_the_memory_of_a_few(alone, monkeypatch):
    """They refer to their bodies and these to them, so that none of ten was freed before."""
    world = nuno.World()
    world.attach(world.add(nuno.sheet((0.2, 0.2), (4, 4), name="cloth")))
    batch = world.imagine(32)
    each = batch.find("cloth")._dynamics.solver.memory_bytes
    memory = HeldMemory(int(3.5 * each))
    monkeypatch.setitem(held_memory._devices, "cpu", memory)
    for _ in range(10):
        batch = world.imagine(32)
        assert 0.9 * each < memory.held <= 4.0 * each  # twice what is in use while another is made
    assert batch.find("cloth").vertices.shape == (32, 25, 3)
