"""Warp as commands start it: garbage collection while kernels are imported, and Warp's start on a thread."""

import gc

import pytest
import warp as wp

from nuno.kernels import kernel_cache, precompiled_headers, start_warp
from nuno.kernels.start_warp import begin_to_start_warp, importing_kernels


def test_no_garbage_is_looked_for_while_kernels_are_imported():
    """Collection is off within and on again after, and what is there then is not looked at any more."""
    gc.unfreeze()
    try:
        with importing_kernels():
            assert not gc.isenabled()
            imported = [[] for _ in range(1000)]
        assert gc.isenabled()
        assert gc.get_freeze_count() > len(imported)
        assert not any(each is imported for each in gc.get_objects())
    finally:
        gc.unfreeze()


def test_collection_stays_off_where_it_was():
    """A program that has switched collection off keeps it so."""
    gc.disable()
    try:
        with importing_kernels():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
        gc.unfreeze()


def test_what_goes_wrong_on_the_thread_is_raised(monkeypatch):
    """Whoever waits for Warp's start gets its error."""

    def fail():
        raise RuntimeError("no driver")

    monkeypatch.setattr(start_warp, "start_warp", fail)
    with pytest.raises(RuntimeError, match="no driver"):
        begin_to_start_warp().result()


@pytest.mark.parametrize(("devices", "cached", "begins"), [(0, False, True), (0, True, False), (1, False, False)])
def test_headers_are_read_where_the_cpu_has_to_compile(monkeypatch, devices, cached, begins):
    """Not where its kernels are in the cache, nor where a device may be what runs them."""
    begun = []
    monkeypatch.setattr(wp, "get_cuda_device_count", lambda: devices)
    monkeypatch.setattr(kernel_cache, "is_cached", lambda *_: cached)
    monkeypatch.setattr(precompiled_headers, "begin_to_read_headers", lambda: begun.append(True))
    start_warp._read_headers_for("nuno.plans.run_lanes")
    assert bool(begun) == begins
