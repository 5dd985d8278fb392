"""The same bits in a batch, over processes and over Dask; workers that die, and trials that kill them."""

import os
import subprocess
import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

import numpy as np
import pytest
import searched

import nuno.search as search
from nuno.errors import InvalidInputError, WorkerLostError
from nuno.search import device_share

GRID = {"bending": [1e-5, 1e-3], "friction": [0.1, 0.5, 0.9]}
NAMES = ("vertices", "height")


@pytest.fixture(scope="module")
def in_a_batch():
    """The sweep that all others must agree with to the bit."""
    return search.sweep(searched.drape, GRID, world=searched.table_with_towel)


@pytest.fixture(scope="module")
def pool():
    """Two processes that import everything anew, as on another machine."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        yield executor


@pytest.fixture(scope="module")
def cluster():
    """A Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(2, threads_per_worker=1, processes=True, dashboard_address=None) as own:
        with distributed.Client(own) as client:
            yield client


def assert_same_bits(a, b):
    """Every value of two sweeps is the same, bit for bit."""
    assert a.is_complete and b.is_complete and not a.failures and not b.failures
    for name in NAMES:
        np.testing.assert_array_equal(a.values(name), b.values(name))


def test_chunks_do_not_matter(in_a_batch):
    """In batches of 4, and one by one, trials give the same bits; they differ from each other."""
    assert len(np.unique(in_a_batch.values("height"))) == 6
    for batch in (4, False):
        assert_same_bits(in_a_batch, search.sweep(searched.drape, GRID, world=searched.table_with_towel, batch=batch))


def test_processes(in_a_batch, pool, tmp_path):
    """Batches and single worlds over processes, and a world that was made here and sent there."""
    over = {"executor": pool, "results": tmp_path / "batch.jsonl", "batch": 4}
    assert_same_bits(in_a_batch, search.sweep(searched.drape, GRID, world=searched.table_with_towel, **over))
    world = searched.table_with_towel()
    single = search.each(searched.single_drape)
    assert_same_bits(in_a_batch, search.sweep(single, GRID, world=world, executor=pool))
    again = search.sweep(searched.drape, GRID, world=searched.table_with_towel, **over)  # from the file
    assert_same_bits(in_a_batch, again)


def test_threads(in_a_batch):
    """Threads take turns; what they run need not be importable."""
    with ThreadPoolExecutor(2) as executor:
        found = search.sweep(
            lambda world, params: searched.drape(world, params), GRID, world=searched.table_with_towel,
            executor=executor, batch=3,
        )  # fmt: skip
    assert_same_bits(in_a_batch, found)


def test_dask(in_a_batch, cluster):
    """Over a Dask client's executor."""
    found = search.sweep(
        searched.drape, GRID, world=searched.table_with_towel, executor=cluster.get_executor(), batch=3
    )
    assert_same_bits(in_a_batch, found)


@pytest.mark.long
def test_dask_worker_dies(cluster, tmp_path):
    """A Dask worker that is killed in the middle of a trial: the trial runs again elsewhere."""
    once = tmp_path / "once"
    grid = {"x": range(6), "once": [str(once)]}
    results = tmp_path / "results.jsonl"
    trial = search.each(searched.deadly_square)
    found = search.sweep(trial, grid, executor=cluster.get_executor(), results=results)
    assert once.exists(), "the worker was killed"
    assert not found.failures and found.values("y").tolist() == [0, 1, 4, 9, 16, 25]
    assert results.read_bytes().count(b"\n") == 7


@pytest.mark.slow
def test_dask_worker_dies_always(cluster):
    """A trial that kills every Dask worker it gets fails in the end, and the others are not lost."""
    found = search.sweep(
        search.each(searched.deadly_square), {"x": range(6)}, executor=cluster.get_executor(), repeats=0
    )
    assert list(found.failures) == [3] and "KilledWorker" in found.failures[3]
    np.testing.assert_array_equal(found.values("y"), [0, 1, 4, np.nan, 16, 25])


def test_process_dies(tmp_path):
    """A pool that breaks is made anew; the trial that killed its worker once runs again."""
    grid = {"x": range(6), "once": [str(tmp_path / "once")]}
    trial = search.each(searched.deadly_square)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        found = search.sweep(trial, grid, executor=executor)
    assert (tmp_path / "once").exists()
    assert not found.failures and found.values("y").tolist() == [0, 1, 4, 9, 16, 25]


def test_process_dies_always(tmp_path):
    """A trial that kills its worker each time fails after as many repeats as are allowed; batches go on without it."""
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as executor:
        found = search.sweep(
            deadly_squares, {"x": range(6), "marks": [str(tmp_path / "marks")]}, executor=executor, batch=4, repeats=1
        )
    assert list(found.failures) == [3]
    assert found.failures[3].startswith("WorkerLostError: its worker was lost 3 times; last BrokenProcessPool")
    np.testing.assert_array_equal(found.values("y"), [0, 1, 4, np.nan, 16, 25])
    assert len((tmp_path / "marks").read_text().split()) == 3, "with the others, twice, and then alone"


def deadly_squares(world, params):
    """A batch that kills its process where 3 is in it."""
    if (params["x"] == 3).any():
        with open(params["marks"][0], "a") as file:
            file.write("dead\n")
        os._exit(1)
    return {"y": params["x"] ** 2}


class BrokenSomewhere(Executor):
    """An executor that is broken, and that nobody here knows how to make."""

    def submit(self, function, /, *args, **kwargs):
        """Return a future of a worker that died."""
        future = Future()
        future.set_exception(BrokenProcessPool("gone"))
        return future


def test_broken_executor_of_another_kind():
    """It is named, with what to do."""
    with pytest.raises(WorkerLostError, match=r"BrokenSomewhere is broken.*goes on with another executor"):
        search.sweep(search.each(searched.single_square), {"x": [1, 2]}, executor=BrokenSomewhere())


@pytest.mark.long
def test_world_that_cannot_be_made(pool):
    """The world's function raises in a worker: an error here, and no trial that failed."""
    with pytest.raises(InvalidInputError, match="broken_room raised RuntimeError: no room"):
        search.sweep(searched.square, {"x": [1.0]}, world=searched.broken_room, executor=pool)


@pytest.mark.long
def test_one_device_a_process(monkeypatch, tmp_path):
    """Where there are two CUDA devices, two processes take one each, and get it back when they end."""
    code = """
import sys
from nuno.search import device_share
device_share._cuda_devices = lambda: 2
print(device_share.own_device(), device_share.own_device(), flush=True)
sys.stdin.read()
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}

    def process():
        return subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    first = process()
    assert first.stdout.readline() == "cuda:0 cuda:0\n"
    second = process()
    assert second.stdout.readline() == "cuda:1 cuda:1\n"
    first.kill()
    first.communicate()
    third = process()
    assert third.stdout.readline() == "cuda:0 cuda:0\n"
    for each in (second, third):
        each.communicate()
    monkeypatch.setattr(device_share, "_cuda_devices", lambda: 1)
    assert device_share.own_device() is None
