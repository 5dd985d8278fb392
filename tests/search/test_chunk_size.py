"""How many worlds go into a batch."""

import os

import pytest

from nuno.search import chunk_size
from nuno.search.chunk_size import LANES, LATE, SOON, ChunkSize


class Memory:
    """A machine on which a world takes so many bytes, beside what is there before."""

    def __init__(self, each, free, before=0, earlier=0):
        self.each, self.free, self.now, self.peak = each, free, before, max(before, earlier)

    def run(self, size, seconds):
        """Run a batch of the size that is wanted; return that size."""
        wanted = size.begin()
        self.peak = max(self.peak, self.now + self.each * wanted)
        size.end(wanted, seconds)
        return wanted


@pytest.fixture
def on(monkeypatch):
    """Let a machine's memory be that of a Memory."""

    def use(memory, device="cuda:0", most=None):
        monkeypatch.setattr(chunk_size, "used_memory", lambda device: (memory.now, memory.peak))
        monkeypatch.setattr(chunk_size, "free_memory", lambda device: memory.free)
        return ChunkSize(device, most)

    return use


def test_grows_while_it_is_quick(on):
    """From 16 to what fills the device, then twice as many while a batch takes less than 15 s, and half after 60 s."""
    memory = Memory(each=10, free=10**9)
    size = on(memory)
    seconds = [1.0, 1.0, 1.0, SOON + 1.0, LATE + 1.0, SOON + 1.0]
    assert [memory.run(size, s) for s in seconds] == [16, 256, 512, 1024, 1024, 512]


def test_fits_the_memory(on):
    """No batch takes more than half of what is free."""
    memory = Memory(each=1000, free=60_000)
    size = on(memory)
    assert [memory.run(size, 0.1) for _ in range(3)] == [16, 30, 30]


def test_memory_that_something_else_took_before(on):
    """Where the peak is not the batch's own, sizes double at most."""
    memory = Memory(each=10, free=10**9, earlier=10**6)
    size = on(memory)
    assert [memory.run(size, 0.1) for _ in range(4)] == [16, 32, 64, 128]


def test_on_the_cpu(on):
    """16 worlds for each core."""
    memory = Memory(each=10, free=10**9)
    size = on(memory, "cpu")
    assert [memory.run(size, SOON + 1.0) for _ in range(3)] == [16, *[max(LANES * os.cpu_count(), 32)] * 2]


def test_a_number_is_kept(on):
    """What the caller says."""
    memory = Memory(each=1000, free=10)
    size = on(memory, most=7)
    assert [memory.run(size, 0.1) for _ in range(2)] == [7, 7]


def test_this_machine():
    """The real numbers are of a sensible size."""
    now, peak = chunk_size.used_memory("cpu")
    assert 10 * 2**20 < now <= peak * 1.1 and chunk_size.free_memory("cpu") > 10 * 2**20


@pytest.mark.cuda
def test_cuda_memory():
    """Warp's pool tells what a batch took."""
    import warp as wp

    _, before = chunk_size.used_memory("cuda:0")
    array = wp.zeros(before + 2**24, dtype=wp.uint8, device="cuda:0")
    now, peak = chunk_size.used_memory("cuda:0")
    assert peak >= now >= 2**24 and chunk_size.free_memory("cuda:0") > 2**20
    del array
