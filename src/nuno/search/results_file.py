"""The results file of a sweep: JSON lines, one for each finished trial, written by one process at a time."""

from __future__ import annotations

import json
import os
import weakref
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any, BinaryIO

import numpy as np

from nuno.errors import FileFormatError, InvalidInputError, ResultsInUseError, ResultsMismatchError
from nuno.files.whole_file import file_path, made_folder, naming, replacing
from nuno.search.parameters import Parameters
from nuno.search.trial import Trial
from nuno.search.values import as_json, from_json

FORMAT, VERSION = "nuno sweep", 1
LARGE = 1000
"""Arrays of more numbers than this go into an .npz file of the trial's own, beside the results file."""

_open: weakref.WeakSet[ResultsFile] = weakref.WeakSet()


class ResultsFile:
    """A results file that is open, and locked against other sweeps until it is closed or its process ends.

    The first line says whose results these are; every other one is a trial. Lines are appended whole, in one write,
    and are on the disk when `append` returns (``fsync``): what is killed, or loses its power, loses no finished trial.
    A last line that was torn nevertheless is cut off as the file is opened.

    Args:
        path: The file; it is made where there is none.
        header: What `make_header` returns.

    Attributes:
        finished: The trials that it held when it was opened.

    Raises:
        InvalidInputError: no folder for the file, or a folder in its place.
        FileWriteError: a read-only folder, a full disk; also ``append``, after which the file is as it was before.
        ResultsInUseError: another sweep writes to the file.
        ResultsMismatchError: it holds another sweep's results.
        FileFormatError: it is no results file, of a newer format, or damaged.
    """

    def __init__(self, path: str | os.PathLike[str], header: dict[str, Any]) -> None:
        self.path = file_path(path, "results")
        with naming(self.path):
            if not self.path.parent.is_dir():
                raise InvalidInputError(f"there is no folder {self.path.parent} for the results")
            if self.path.is_dir():
                raise InvalidInputError(f"{self.path} is a folder; results need a file")
            self._file: BinaryIO | None = open(self.path, "a+b", buffering=0)  # close() closes it
        try:
            _lock(self._file, self.path)
            _open.add(self)
            self.finished = self._read(header)
        except BaseException:
            self.close()
            raise

    def append(self, trials: Sequence[Trial], parameters: Parameters) -> None:
        """Write finished trials; when this returns, they are on the disk."""
        assert self._file is not None
        lines = [self._line(trial, parameters.row(trial.index)) for trial in trials]
        self._write(b"".join(lines))

    def close(self) -> None:
        """Close the file, and unlock it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> ResultsFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self, data: bytes) -> None:
        assert self._file is not None
        before = os.fstat(self._file.fileno()).st_size
        with naming(self.path):
            try:
                if self._file.write(data) != len(data):
                    raise OSError("it could not be written in one piece")
                os.fsync(self._file.fileno())
            except OSError:
                os.ftruncate(self._file.fileno(), before)
                raise

    def _line(self, trial: Trial, row: dict[str, Any]) -> bytes:
        entry: dict[str, Any] = {"trial": trial.index, "params": row}
        if trial.error is not None:
            entry["error"] = trial.error
        else:
            large = {k: v for k, v in trial.values.items() if v.size > LARGE or v.size == 0}
            entry["values"] = {k: as_json(v) for k, v in trial.values.items() if k not in large}
            if large:
                entry["arrays"] = self._save_arrays(trial.index, large)
        return json.dumps(entry, allow_nan=False).encode() + b"\n"

    def _save_arrays(self, index: int, arrays: dict[str, np.ndarray]) -> str:
        folder = made_folder(arrays_folder(self.path))
        name = f"{index:06d}.npz"
        with replacing(folder / name) as partial:
            with open(partial, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
                file.flush()
                os.fsync(file.fileno())
        return name

    def _read(self, header: dict[str, Any]) -> list[Trial]:
        assert self._file is not None
        self._file.seek(0)
        data = self._file.read()
        first = json.dumps(header, allow_nan=False).encode() + b"\n"
        if b"\n" not in data:
            if not first.startswith(data):
                raise FileFormatError(f"{self.path} is no results file of a sweep; its first line is not one's header")
            os.ftruncate(self._file.fileno(), 0)  # new, or killed as the header was written
            self._write(first)
            _sync_folder(self.path.parent)
            return []
        found = read_header(data, self.path)
        for name, wanted in header.items():
            if found.get(name) != wanted:
                raise ResultsMismatchError(
                    f"{self.path} holds the results of another sweep: its {name} is {found.get(name)!r}, this one's "
                    f"{wanted!r}; give this sweep another file"
                )
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.ftruncate(self._file.fileno(), whole)  # torn as its process was killed
        return read_trials(data[:whole], self.path)


def make_header(trial: str, world: str | None, parameters: Parameters) -> dict[str, Any]:
    """Return what the first line of a results file says.

    Args:
        trial: Name of the trial.
        world: Name of the function that makes the world, or None.
        parameters: Of all trials.
    """
    return {
        "format": FORMAT, "version": VERSION, "trial": trial, "world": world, "trials": parameters.trial_count,
        "parameters": parameters.digest(),
    }  # fmt: skip


def read_header(data: bytes, path: FilePath) -> dict[str, Any]:
    """Return the first line of a results file.

    Raises:
        FileFormatError: it is none, or of a newer format.
    """
    try:
        header = json.loads(data.split(b"\n", 1)[0])
    except ValueError:
        header = None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise FileFormatError(f"{path} is no results file of a sweep; its first line is not one's header")
    if header.get("version") != VERSION:
        raise FileFormatError(f"{path} is of version {header.get('version')!r}; this version of Nuno reads {VERSION}")
    return header


def read_trials(data: bytes, path: FilePath) -> list[Trial]:
    """Return the trials of a results file's whole lines.

    Raises:
        FileFormatError: a line that is no trial, a trial that is there twice, or an array's file that is missing.
    """
    return [trial for trial, _ in read_entries(data, path)]


def read_entries(data: bytes, path: FilePath) -> list[tuple[Trial, dict[str, Any]]]:
    """Return the trials of a results file's whole lines, each with its parameters.

    Raises:
        FileFormatError: a line that is damaged, or a trial that is there twice.
    """
    entries: list[tuple[Trial, dict[str, Any]]] = []
    seen: set[int] = set()
    for number, line in enumerate(data.split(b"\n")[1:-1], start=2):
        try:
            entry = json.loads(line)
            index, params, error = int(entry["trial"]), dict(entry["params"]), entry.get("error")
            values = {name: from_json(value) for name, value in entry.get("values", {}).items()}
            if "arrays" in entry:
                with np.load(arrays_folder(path) / entry["arrays"], allow_pickle=False) as arrays:
                    values |= dict(arrays)
        except (ValueError, KeyError, TypeError, AttributeError, OSError) as problem:
            raise FileFormatError(f"line {number} of {path} is no trial's result, or lacks its arrays") from problem
        if index in seen:
            raise FileFormatError(f"trial {index} stands in {path} twice, again in line {number}")
        seen.add(index)
        entries.append((Trial(index, values, error), params))
    return entries


def arrays_folder(path: FilePath) -> FilePath:
    """Return the folder of the large arrays of a results file."""
    return path.with_name(path.name + ".arrays")


def _lock(file: BinaryIO, path: FilePath) -> None:
    # flock: it goes with the process, also one that is killed, and two sweeps of one process exclude each other too
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as problem:
        raise ResultsInUseError(f"another sweep is writing to {path}; give this one a file of its own") from problem


def _sync_folder(folder: FilePath) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _close_in_child() -> None:
    """A forked worker must not keep the lock of a parent that died."""
    for each in list(_open):
        each.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_in_child)
