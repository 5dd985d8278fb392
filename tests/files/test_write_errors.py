"""Files that cannot be written: a full disk, a read-only folder, none at all; what was there stays whole."""

import os
import resource
from contextlib import contextmanager

import numpy as np
import pytest

import nuno

CAMERA = nuno.Camera(8, 6, 8.0, 8.0, 3.5, 2.5)


@pytest.fixture(scope="module")
def scene():
    """A world, a recording, a film and a sweep's result, of a size beyond what the full disk takes."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.sheet((1.0, 1.0), (20, 20), name="towel"))
    recording = nuno.Recording(world)
    recording.add()
    trials = [nuno.Trial(k, {"y": np.array(float(k))}) for k in range(200)]
    result = nuno.SweepResult({"x": np.arange(200.0)}, trials)
    return world, body, recording, nuno.Film.of(recording), result


def trial(world, params):
    """Return more than fits into a line."""
    return {"y": np.ones((len(params["x"]), 300))}


WRITERS = {
    "saved.npz": lambda scene, path: scene[0].save(path),
    "body.obj": lambda scene, path: scene[1].export(path),
    "body.ply": lambda scene, path: scene[1].export(path),
    "body.glb": lambda scene, path: nuno.export_body(path, scene[1]),
    "frames.npz": lambda scene, path: scene[2].save(path),
    "frames.glb": lambda scene, path: scene[2].export(path),
    "film.html": lambda scene, path: scene[3].save(path),
    "table.csv": lambda scene, path: scene[4].save_csv(path),
    "results.jsonl": lambda scene, path: nuno.sweep(trial, {"x": [1.0, 2.0]}, results=path, progress=False),
}


@contextmanager
def full_disk(most=1000):
    """Let no file grow beyond some bytes: the system refuses the rest as it does on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextmanager
def read_only(folder):
    """Let a folder not be written to; root, who may write everywhere, is somebody else meanwhile."""
    folder.chmod(0o555)
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)
        folder.chmod(0o755)


@pytest.fixture(params=WRITERS)
def writer(request, scene, tmp_path):
    """Write a file once, so that all that it needs is loaded; then give how, where, and what there was."""
    path = tmp_path / "there" / request.param
    path.parent.mkdir()

    def write(goal=path):
        WRITERS[request.param](scene, goal)

    write()
    return write, path, {entry: entry.read_bytes() for entry in path.parent.iterdir() if entry.is_file()}


def test_a_full_disk(writer):
    """The error is named, the old file is whole, and nothing half written stays."""
    write, path, before = writer
    if path.suffix == ".jsonl":
        path.unlink()  # of a finished sweep nothing is written
        before = {}
    with full_disk(100), pytest.raises(nuno.FileWriteError, match="cannot write") as raised:
        write()
    assert raised.value.errno is not None or "disk full" in str(raised.value)
    found = {entry: entry.read_bytes() for entry in path.parent.iterdir() if entry.is_file() and entry.stat().st_size}
    assert found == before


def test_a_read_only_folder(writer):
    """The error says so, and the old file is whole."""
    write, path, before = writer
    if path.suffix == ".jsonl":
        path.unlink()
        before = {}
    with read_only(path.parent), pytest.raises(nuno.FileWriteError, match="may not be written to"):
        write()
    assert {entry: entry.read_bytes() for entry in path.parent.iterdir() if entry.is_file()} == before


def test_no_folder(writer, tmp_path):
    """Nor is there a traceback of a partial file's name where the folder is missing."""
    write, path, _ = writer
    with pytest.raises(nuno.NunoError, match="there is no"):
        write(tmp_path / "nowhere" / path.name)


def test_no_path(writer):
    """Numbers and nothing are no paths."""
    write, _, _ = writer
    for wrong in (3, b"\xff", object()):
        with pytest.raises(nuno.InvalidInputError):
            write(wrong)


def test_a_picture_on_a_full_disk(scene, tmp_path):
    """As other files."""
    picture = nuno.take_picture(scene[0], nuno.Camera(64, 48, 60.0, 60.0, 32.0, 24.0))
    picture.save(tmp_path / "seen.png")
    with full_disk(20), pytest.raises(nuno.FileWriteError):
        picture.save(tmp_path / "seen.png")
    assert (tmp_path / "seen.png").stat().st_size > 20 and len(list(tmp_path.iterdir())) == 1


def test_a_sweep_goes_on_where_the_disk_was_full(tmp_path):
    """What was recorded before stays, and the same call with room finishes."""
    path = tmp_path / "results.jsonl"

    def sweep():
        return nuno.sweep(trial, {"x": np.arange(8.0)}, results=path, batch=1, progress=False)

    with full_disk(8000), pytest.raises(nuno.FileWriteError):
        sweep()
    done = nuno.read_sweep(path)
    assert 0 < len(done) < 8 and done.planned == 8 and not done.is_complete
    assert sweep().is_complete
