"""Modules loaded on other threads: whoever needs a module's source, or the module itself, waits for just that."""

import threading

import pytest
import warp as wp
from warp._src import context

from nuno.camera import extent
from nuno.kernels.module_loads import load_ahead, wait_for_load, wait_for_source


def test_the_source_is_there_before_the_module(monkeypatch):
    """The wait for the source ends when Warp asks for the compiler's headers, while the compiler still has to begin."""
    module, may_end, ended = wp.get_module(extent.__name__), threading.Event(), threading.Event()

    def load(*_):
        context.runtime.get_clang_pch_dir()
        assert may_end.wait(60.0)
        ended.set()

    monkeypatch.setattr(wp, "load_module", load)
    load_ahead([(module, None)], "cpu", 1)
    wait_for_source(module, "cpu")
    assert not ended.is_set()
    may_end.set()
    wait_for_load(module, "cpu")
    assert ended.is_set()


def test_the_wait_for_a_source_ends_where_none_is_written(monkeypatch):
    """A module that is in the cache, one that cannot be loaded, and one that nobody loads."""

    def fail(*_):
        raise RuntimeError("no compiler")

    module = wp.get_module(extent.__name__)
    for load in (lambda *_: None, fail):
        monkeypatch.setattr(wp, "load_module", load)
        load_ahead([(module, None)], "cpu", 1)
        wait_for_source(module, "cpu")
    with pytest.raises(RuntimeError, match="no compiler"):
        wait_for_load(module, "cpu")
    wait_for_source(module, "cuda:0")
