"""Warp's headers read once: threads that compile take them, others are left alone, and the machine code is the same."""

import subprocess
import sys
import threading
from concurrent.futures import Future

import pytest
import warp as wp
from warp._src import context

from nuno.kernels import precompiled_headers
from nuno.kernels.precompiled_headers import begin_to_read_headers, compiling

NAME = "headers.pch"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder that Warp gives to every thread; its function is put back afterwards."""
    wp.init()
    kept = tmp_path / "thread"
    kept.mkdir()
    monkeypatch.setattr(context.runtime, "get_clang_pch_dir", lambda: str(kept))
    return kept


@pytest.fixture
def made(tmp_path, monkeypatch):
    """The future of headers that are being read."""
    future = Future()
    monkeypatch.setattr(precompiled_headers, "_made", future)
    return future


def read(made, tmp_path):
    """End the reading of headers, with a file."""
    (tmp_path / NAME).write_bytes(b"read")
    made.set_result([tmp_path / NAME])


def test_this_version_of_warp_has_a_folder_for_each_thread():
    """Else every thread would read the headers itself, in silence."""
    wp.init()
    assert precompiled_headers._own_folder() is not None
    assert precompiled_headers._take_headers()


def test_a_thread_that_compiles_takes_the_headers(folder, made, tmp_path):
    """Within `compiling` a copy lies in the folder that Warp asks for; outside of it the folder is as it was."""
    read(made, tmp_path)
    written = threading.Event()
    with compiling(written):
        assert not written.is_set()
    assert written.is_set()  # at the end at the latest
    context.runtime.get_clang_pch_dir()
    assert list(folder.iterdir()) == []
    written.clear()
    with compiling(written):
        assert context.runtime.get_clang_pch_dir() == str(folder)
        assert written.is_set()
    assert (folder / NAME).read_bytes() == b"read"


def test_what_a_thread_has_stays(folder, made, tmp_path):
    """Headers that the thread made before are not written over."""
    read(made, tmp_path)
    (folder / NAME).write_bytes(b"own")
    with compiling(threading.Event()):
        context.runtime.get_clang_pch_dir()
    assert (folder / NAME).read_bytes() == b"own"


def test_a_thread_reads_them_itself_where_reading_ahead_failed(folder, made):
    """What went wrong there is not this thread's error: the compiler says it, if it is one."""
    made.set_exception(RuntimeError("no compiler"))
    with compiling(threading.Event()):
        assert context.runtime.get_clang_pch_dir() == str(folder)
    assert list(folder.iterdir()) == []


def test_a_thread_reads_them_itself_where_reading_ahead_does_not_end(folder, made, monkeypatch):
    """As in a process that was forked meanwhile: its thread is not there."""
    monkeypatch.setattr(precompiled_headers, "PATIENCE", 0.01)
    with compiling(threading.Event()):
        assert context.runtime.get_clang_pch_dir() == str(folder)
    assert not made.done() and list(folder.iterdir()) == []


def test_a_copy_is_whole_or_not_there(folder, made, tmp_path, monkeypatch):
    """Where the disk is full halfway, the thread reads the headers itself."""

    def fail(_, to):
        to.write_bytes(b"half")
        raise OSError("no space left on device")

    read(made, tmp_path)
    monkeypatch.setattr(precompiled_headers.shutil, "copyfile", fail)
    with compiling(threading.Event()):
        assert context.runtime.get_clang_pch_dir() == str(folder)
    assert not (folder / NAME).exists()


def test_they_are_read_once(monkeypatch):
    """Who asks later gets the same files."""
    reads = []
    monkeypatch.setattr(precompiled_headers, "_made", None)
    monkeypatch.setattr(precompiled_headers, "_read", lambda: reads.append(True) or [])
    assert begin_to_read_headers() is begin_to_read_headers()
    assert begin_to_read_headers().result() == [] and len(reads) == 1


def test_a_warp_of_another_form_is_left(monkeypatch):
    """Nothing is changed where there is no such function."""
    wp.init()
    monkeypatch.setattr(context.runtime, "get_clang_pch_dir", None, raising=False)
    assert not precompiled_headers._take_headers()
    with compiling(threading.Event()):
        pass


@pytest.mark.long
def test_the_machine_code_is_the_same(tmp_path):
    """To the byte, with headers read ahead and without; and the headers' own module is not left in the cache."""
    program = """
import sys
import warp as wp
wp.config.log_level = wp.LOG_ERROR
wp.config.kernel_cache_dir = sys.argv[1]
wp.init()
from nuno.camera import extent
from nuno.kernels.module_loads import load_ahead, wait_for_load
from nuno.kernels.precompiled_headers import begin_to_read_headers
if sys.argv[2] == "ahead":
    assert begin_to_read_headers().result()
module = wp.get_module(extent.__name__)
load_ahead([(module, None)], "cpu", 1)
wait_for_load(module, "cpu")
"""
    for kind in ("ahead", "itself"):
        subprocess.run([sys.executable, "-c", program, str(tmp_path / kind), kind], check=True, timeout=300)
    found = [{path.name: path.read_bytes() for path in (tmp_path / kind).rglob("*.o")} for kind in ("ahead", "itself")]
    assert len(found[0]) == 1 and found[0] == found[1]
