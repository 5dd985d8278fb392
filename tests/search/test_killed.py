"""Sweeps that are killed, interrupted or torn go on where they stopped."""

import json
import math
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import searched

import nuno.search as search
from interrupts import obey_interrupts
from nuno.errors import FileWriteError, ResultsInUseError
from nuno.search.parameters import make_parameters
from nuno.search.results_file import ResultsFile, make_header

PROGRAM = Path(__file__).with_name("sweep_program.py")
PATIENCE = 500.0  # [s] for a process to start on a busy machine, less than what ends a test


def begin(results, marks, trials, seconds, way, held_from=math.inf):
    """Start the program that sweeps, as the head of a group of processes; trials from a number on do not end."""
    command = [sys.executable, str(PROGRAM), str(results), str(marks), str(trials), str(seconds), way]
    return subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=obey_interrupts,
        env=os.environ | {"HELD_FROM": str(held_from)},
    )  # fmt: skip


def wait_for_lines(path, count):
    """Wait until a file has so many lines; return what it holds."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        data = path.read_bytes() if path.exists() else b""
        if data.count(b"\n") >= count:
            return data
        time.sleep(0.01)
    raise AssertionError(f"{path} has not got {count} lines in {PATIENCE} s")


def alive_after(group, seconds):
    """Whether a group of processes is still there after so many seconds [s]."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.05)
    return True


def recorded(path):
    """The trials of the whole lines of a results file."""
    lines = path.read_bytes().split(b"\n")[1:-1]
    return [json.loads(line)["trial"] for line in lines]


def killed_again_and_again(tmp_path, way, *, trials, seconds, kills, in_flight):
    """Kill a sweep at random moments, let it finish, and compare what it recorded with what it ran."""
    results, marks = tmp_path / "results.jsonl", tmp_path / "marks"
    moments = []
    known = []
    for _ in range(kills):
        program = begin(results, marks, trials, seconds, way, held_from=trials - 2)  # not all is done by then
        wait_for_lines(results, min(len(known) + 3, trials - 2))  # it has begun to record
        time.sleep(random.uniform(0.0, 3.0 * seconds))
        program.kill()
        program.wait()
        program.stderr.close()
        assert not alive_after(program.pid, PATIENCE), "workers end with the process that started them"
        known = recorded(results)
        moments.append((known, len(marks.read_text().split())))
        assert len(known) < trials, "it was killed before its end"
    program = begin(results, marks, trials, seconds, way)
    _, errors = program.communicate(timeout=PATIENCE + 2 * trials * seconds)
    assert program.returncode == 0, errors
    assert sorted(recorded(results)) == list(range(trials)), "each is recorded once"
    assert search.read_sweep(results).values("y").tolist() == [x * x for x in range(trials)]
    ran = [int(line) for line in marks.read_text().split()]
    for known, count in moments:
        assert not set(ran[count:]) & set(known), "none that was recorded ran again"
    assert len(ran) - trials <= kills * in_flight, "only those in flight ran again"


def test_killed_and_started_again(tmp_path):
    """A real SIGKILL at a random moment: nothing is lost, recorded twice, or run again that was recorded."""
    killed_again_and_again(tmp_path, "batch", trials=24, seconds=0.05, kills=1, in_flight=1)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["batch", "spawn", "fork"])
def test_killed_many_times(tmp_path, way):
    """Several kills, also where workers of a pool outlive the process that held the file."""
    killed_again_and_again(
        tmp_path, way, trials=80, seconds=0.1, kills=4, in_flight=1 if way == "batch" else 3
    )  # two workers, one task ahead


def test_interrupted(tmp_path):
    """Ctrl-C ends the sweep with KeyboardInterrupt and leaves a file that the next one goes on from."""
    results, marks = tmp_path / "results.jsonl", tmp_path / "marks"
    program = begin(results, marks, 20, 0.1, "batch", held_from=18)
    wait_for_lines(results, 4)
    program.send_signal(signal.SIGINT)
    _, errors = program.communicate(timeout=PATIENCE)
    assert program.returncode != 0 and "KeyboardInterrupt" in errors
    known = recorded(results)
    assert 3 <= len(known) < 20 and results.read_bytes().endswith(b"\n")
    marks.unlink()
    grid = {"x": range(20), "marks": [str(marks)], "seconds": [0.1]}
    done = search.sweep(searched.slow_squares, grid, results=results, batch=False)
    assert done.is_complete and sorted(recorded(results)) == list(range(20))
    assert len(marks.read_text().split()) == 20 - len(known)


def header_and_parameters():
    """What goes with `searched.square` over four values."""
    parameters = make_parameters({"x": [0, 1, 2, 3]})
    return make_header("searched:square", None, parameters), parameters


@pytest.mark.slow
def test_interrupted_with_its_workers(tmp_path):
    """Ctrl-C in a terminal reaches all processes; the file goes on being good, and nobody is left."""
    results, marks = tmp_path / "results.jsonl", tmp_path / "marks"
    program = begin(results, marks, 100, 0.1, "spawn", held_from=98)
    wait_for_lines(results, 6)
    os.killpg(program.pid, signal.SIGINT)
    program.communicate(timeout=PATIENCE)
    assert program.returncode != 0
    known = recorded(results)
    assert 5 <= len(known) < 100 and len(set(known)) == len(known) and results.read_bytes().endswith(b"\n")
    assert not alive_after(program.pid, PATIENCE)


def test_disk_full(tmp_path, monkeypatch):
    """A line that could not be made safe is taken back, and the error is seen."""
    results = tmp_path / "results.jsonl"
    calls = []
    fsync = os.fsync

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) > 3:  # the header, its folder, and the first trial
            raise OSError(28, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FileWriteError, match="the disk is full"):
        search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results, batch=False)
    monkeypatch.setattr(os, "fsync", fsync)
    assert recorded(results) == [0] and results.read_bytes().count(b"\n") == 2
    assert search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results).is_complete


@pytest.mark.parametrize("cut", [1, 5, 40])
def test_torn_last_line(tmp_path, cut):
    """A last line that was not written to its end is run again; the others stay."""
    results = tmp_path / "results.jsonl"
    search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results)
    whole = results.read_bytes()
    results.write_bytes(whole[:-cut])
    assert len(search.read_sweep(results)) == 3
    again = search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results)
    assert again.values("y").tolist() == [0, 1, 4, 9]
    assert results.read_bytes() == whole


@pytest.mark.parametrize("length", [0, 1, 30])
def test_torn_header(tmp_path, length):
    """A file whose header was not written to its end begins anew."""
    results = tmp_path / "results.jsonl"
    search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results)
    whole = results.read_bytes()
    results.write_bytes(whole[:length])
    search.sweep(searched.square, {"x": [0, 1, 2, 3]}, results=results)
    assert results.read_bytes() == whole


def test_two_sweeps_on_one_file(tmp_path):
    """The second is refused, in another process and in the same, and may go on when the first has ended."""
    results, marks = tmp_path / "results.jsonl", tmp_path / "marks"
    program = begin(results, marks, 100, 0.2, "batch")
    wait_for_lines(results, 2)
    grid = {"x": range(100), "marks": [str(marks)], "seconds": [0.2]}
    with pytest.raises(ResultsInUseError, match="another sweep is writing"):
        search.sweep(searched.slow_squares, grid, results=results, batch=False)
    size = results.stat().st_size
    program.kill()
    program.wait()
    program.stderr.close()
    assert results.stat().st_size >= size
    header, _ = header_and_parameters()
    other = tmp_path / "other.jsonl"
    with ResultsFile(other, header):
        with pytest.raises(ResultsInUseError):
            ResultsFile(other, header)
    ResultsFile(other, header).close()


def test_lock_ends_with_its_process_not_with_its_children(tmp_path):
    """A forked child that outlives the killed sweep does not keep the file locked."""
    header, _ = header_and_parameters()
    code = f"""
import os, sys, time
from nuno.search.results_file import ResultsFile
file = ResultsFile({str(tmp_path / "results.jsonl")!r}, {header!r})
child = os.fork()
if child == 0:
    print(os.getpid(), flush=True)
time.sleep(60)
os._exit(0)
"""
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    child = int(holder.stdout.readline())
    try:
        with pytest.raises(ResultsInUseError):
            ResultsFile(tmp_path / "results.jsonl", header)
        holder.kill()
        holder.wait()
        holder.stdout.close()
        os.kill(child, 0)  # it lives
        ResultsFile(tmp_path / "results.jsonl", header).close()
    finally:
        os.kill(child, signal.SIGKILL)
