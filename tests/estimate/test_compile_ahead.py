"""Kernels compiled ahead: all that an estimate launches on the CPU, and what goes wrong comes to light."""

import subprocess
import sys
import threading

import numpy as np
import pytest
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate import compile_ahead
from nuno.estimate.futures import imagine_picks
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.estimate.pick_sight import score_futures
from nuno.estimate.similarity import Silhouette
from nuno.kernels import compile_watch
from nuno.kernels.module_loads import wait_for_load
from nuno.plans.block_plan import FEW_THREADS, MANY_THREADS

BATCHES = (("nuno.plans.run_blocks_shared", FEW_THREADS), ("nuno.plans.run_blocks_small", MANY_THREADS))


@pytest.fixture
def asked(monkeypatch):
    """The names of modules that were asked for, instead of loading them."""
    names = []
    monkeypatch.setattr(wp, "load_module", lambda module, device, **options: names.append((module.name, options)))
    return names


def test_what_an_estimate_launches_is_asked_for(asked, monkeypatch):
    """Every kernel of a small batch that is imagined, drawn and scored is in a module that is compiled ahead."""
    compile_ahead.compile_ahead("cpu")()
    ahead, launched, launch = {name for name, _ in asked}, set(), wp.launch

    def watch(kernel, *arguments, **options):
        launched.add(kernel.module.name)
        return launch(kernel, *arguments, **options)

    monkeypatch.undo()
    monkeypatch.setattr(wp, "launch", watch)
    corners = np.array([(-0.1, -0.1, 0.002), (0.1, -0.1, 0.002), (0.1, 0.1, 0.002), (-0.1, 0.1, 0.002)])
    rectangle = ClothRectangle(corners, 0.2, 0.2, corners.mean(axis=0), 0.0, 0.0)
    futures = imagine_picks(
        rectangle, np.array([(0.0, 0.0), (1.0, 1.0)]), (2, 2), Discretisation(4, 8, HYPOTHESES[:1]), table=Table(0.0),
        hand=np.array((0.0, 0.0, 0.3)), rest_height=0.002, device="cpu", lift_seconds=0.1,
    )  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag((1.0, -1.0, -1.0)), (0.0, 0.0, 1.0)
    camera = Camera(80, 60, 60.0, 60.0, 39.5, 29.5, pose)
    score_futures(futures, camera, Silhouette(np.ones((60, 80), bool)), Table(0.0))
    assert launched >= {"nuno.plans.run_lanes", raster.__name__}
    assert launched <= ahead


def test_what_goes_wrong_is_raised_by_the_wait(monkeypatch):
    """An error of the compiler is not lost on its thread."""

    def fail(module, device, **options):
        raise RuntimeError(f"no compiler for {module.name}")

    monkeypatch.setattr(wp, "load_module", fail)
    wait = compile_ahead.compile_ahead("cpu")
    with pytest.raises(RuntimeError, match="no compiler"):
        wait()


def test_none_waits_for_another_by_its_flags(asked):
    """LLVM's options are the process's: the modules that are compiled at once on the CPU have the same."""
    compile_ahead.compile_ahead("cpu")()
    flags = {wp.get_module(name).options["cpu_compiler_flags"] for name, _ in asked}
    assert len(asked) == 6 and len(flags) == 1
    assert flags.pop().count("-mllvm=") == 1  # none of Warp's


@pytest.mark.parametrize("cached", [False, True])
def test_an_empty_cache_has_headers_read_and_the_longest_written_first(monkeypatch, cached):
    """Before the estimate goes on; of a full cache nothing is waited for."""
    begun, may_end = [], threading.Event()

    def load(module, device, **options):
        if module.name == "nuno.plans.run_lanes" and not cached:
            begun.append("written")
        elif cached:
            assert may_end.wait(60.0)

    monkeypatch.setattr(wp, "load_module", load)
    monkeypatch.setattr(compile_ahead, "is_cached", lambda *_: cached)
    monkeypatch.setattr(compile_ahead, "begin_to_read_headers", lambda: begun.append("headers"))
    wait = compile_ahead.compile_ahead("cpu")
    assert begun == ([] if cached else ["headers", "written"])
    may_end.set()
    wait()


@pytest.mark.parametrize("cached", [False, True])
def test_both_sizes_of_batches_are_compiled_on_cuda(asked, monkeypatch, caplog, cached):
    """By blocks as they are launched, told by name before anything waits; of what is in the cache nothing is loaded."""
    monkeypatch.setattr(compile_ahead, "is_cached", lambda *_: cached)
    compile_ahead.compile_ahead("cuda:0")()
    for module, block in BATCHES:
        wait_for_load(wp.get_module(module), "cuda:0", block)
        assert ((module, {"block_dim": block}) in asked) != cached
        assert (module in caplog.text) != cached
    assert {"nuno.state.pack", "nuno.state.finite", raster.__name__} <= {name for name, _ in asked}
    assert "nuno.plans.run_lanes" not in {name for name, _ in asked}


def test_a_batch_waits_for_its_kernels(monkeypatch, caplog):
    """The wait of an estimate ends without those of batches; a launch waits, and tells for what and how long."""
    compiled = threading.Event()

    def load(module, device, **options):
        if module.name == BATCHES[1][0]:
            assert compiled.wait(60.0)

    monkeypatch.setattr(wp, "load_module", load)
    monkeypatch.setattr(compile_ahead, "is_cached", lambda *_: False)
    monkeypatch.setattr(compile_watch, "LOGGED_AFTER", 0.0)
    compile_ahead.compile_ahead("cuda:0")()
    caplog.clear()
    threading.Timer(0.05, compiled.set).start()
    module, block = BATCHES[1]
    with compile_watch.compiling_watched():
        stages = compile_watch.Stages("compile", "imagine")
        wait_for_load(wp.get_module(module), "cuda:0", block)
        stages.end("imagine")
    assert compiled.is_set() and stages.seconds["compile"] > 0.0
    assert len(caplog.messages) == 1 and module in caplog.text and "waited" in caplog.text


@pytest.mark.long
def test_hashes_do_not_hang_on_what_is_imported_meanwhile():
    """A module has the same hash, and so is found in the cache, also while all other kernels are being declared."""
    program = """
import threading
from importlib import import_module
import warp as wp
wp.config.log_level = wp.LOG_ERROR
wp.init()
from nuno.camera import extent, raster
from nuno.estimate import compile_ahead, pattern, similarity
from nuno.kernels.kernel_modules import kernel_sources
from nuno.plans.cloth_worlds import run_lanes
from nuno.state import pack
modules = [run_lanes.module, *(wp.get_module(part.__name__) for part in (pack, extent, raster, similarity, pattern))]
found, done = [], threading.Event()
def hash_again():
    while True:
        over = done.is_set()
        for module in modules:
            module.hashers.clear()
        found.append(tuple(module.get_module_hash(1) for module in modules))
        if over:
            return
thread = threading.Thread(target=hash_again)
thread.start()
for source in kernel_sources():
    import_module(source)
done.set()
thread.join()
print(len(found), len(set(found)))
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300)
    times, different = map(int, run.stdout.split())
    assert times >= 2 and different == 1  # at least one while others were declared, and the last after all
