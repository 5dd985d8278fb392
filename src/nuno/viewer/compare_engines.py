"""One saved world on several engines: how far they come apart, and a film of them side by side."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from nuno.engines.engine_registry import engine_class
from nuno.errors import (
    EngineCapabilityError,
    FileWriteError,
    InvalidInputError,
    MissingPackageError,
    SimulationDiverged,
)
from nuno.files.whole_file import file_path, write_whole
from nuno.validation import checked, count, number
from nuno.viewer.film import Film
from nuno.viewer.side_by_side import heads_of_columns, side_by_side
from nuno.world.recording import Recording
from nuno.world.snapshot import Snapshot
from nuno.world.world import World

AHEAD = np.array([0.0, -1.0, 0.4])
"""From where a film of columns is seen, which stand beside each other along x."""
LETTERS = 0.12
"""Height of an engine's name, over the way from one column to the next."""
PICTURE_LIMIT = 100_000
"""Of a film; more are a slip of the keyboard."""


@dataclass(frozen=True, eq=False)
class EngineComparison:
    """One world as several engines moved it; ``compare_engines`` returns it.

    Attributes:
        engines: The names of those that ran, in the order that was asked for; differences are from the first.
        recordings: By engine, where the vertices were.
        moving: The names of the bodies that are dynamic.
        cpu_seconds: By engine [s], what its frames took but for the first, which may compile.
        failures: By engine, why it did not run.
    """

    engines: tuple[str, ...]
    recordings: dict[str, Recording]
    moving: tuple[str, ...]
    cpu_seconds: dict[str, float]
    failures: dict[str, str] = field(default_factory=dict)

    def differences(self) -> list[dict[str, Any]]:
        """Return a row for each time, moving body and engine but the first.

        Keys: "time" [s]; "body"; "engine"; "mean", "largest": distances [m] of the body's vertices from where the first
        engine has them; "centre": of their means [m].
        """
        first = self.recordings[self.engines[0]]
        rows = []
        for engine in self.engines[1:]:
            other = self.recordings[engine]
            for body in self.moving:
                here, there = first[body].vertices, other[body].vertices
                for k, instant in enumerate(first.times):
                    a, b = (v[min(k, len(v) - 1)] for v in (here, there))
                    apart = np.linalg.norm(b - a, axis=-1)
                    rows.append(
                        {
                            "time": float(instant), "body": body, "engine": engine, "mean": float(apart.mean()),
                            "largest": float(apart.max()),
                            "centre": float(np.linalg.norm(b.mean(axis=-2) - a.mean(axis=-2))),
                        }
                    )  # fmt: skip
        return rows

    @checked
    def table(self, rows: int = 11) -> str:
        """Return a table of differences over time, as text: mean (largest) distance of each body's vertices [mm].

        Args:
            rows: How many times it has, the first and the last among them.

        Raises:
            InvalidInputError: fewer than two rows.
        """
        count("rows", rows, low=2)
        found = {(row["body"], row["engine"], row["time"]): row for row in self.differences()}
        times = self.recordings[self.engines[0]].times
        chosen = times[np.unique(np.linspace(0, len(times) - 1, rows).round().astype(int))]
        columns = [(body, engine) for body in self.moving for engine in self.engines[1:]]
        titles = ["t / s", *(f"{body}: {engine} from {self.engines[0]} / mm" for body, engine in columns)]
        lines = [titles]
        for instant in chosen.tolist():
            cells = [found[body, engine, instant] for body, engine in columns]
            lines.append(
                [f"{instant:.2f}", *(f"{1e3 * cell['mean']:.2f} ({1e3 * cell['largest']:.2f})" for cell in cells)]
            )
        widths = [max(len(line[k]) for line in lines) for k in range(len(titles))]
        text = ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
        took = ", ".join(f"{engine} {self.cpu_seconds[engine]:.2f}" for engine in self.engines)
        text.append(f"CPU seconds: {took}")
        return "\n".join([*text, *(f"{engine} did not run: {why}" for engine, why in self.failures.items())])

    def film(self) -> Film:
        """Return a film with one column an engine, from left to right, under the engines' names."""
        recordings = [self.recordings[engine] for engine in self.engines]
        film, heads = Film.of(side_by_side(recordings, self.engines)), heads_of_columns(recordings)
        high = LETTERS * float(np.ptp(heads[:, 0])) / (len(heads) - 1)
        above = np.array([0.0, 0.0, high])
        film.labels = [(engine, head + above, high) for engine, head in zip(self.engines, heads, strict=True)]
        film.direction = AHEAD
        return film

    @checked
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``film.html``, ``differences.json`` and ``differences.txt`` into a folder, which is made if need be.

        Raises:
            FileWriteError: no such folder can be made, or written to.
        """
        goal = Path(file_path(folder))
        try:
            goal.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileWriteError(f"cannot make the folder {os.fspath(folder)!r}: {error}") from error
        self.film().save(goal / "film.html", title=" | ".join(self.engines))
        content = {
            "engines": list(self.engines), "cpu_seconds": self.cpu_seconds, "failures": self.failures,
            "differences": self.differences(),
        }  # fmt: skip
        write_whole(goal / "differences.json", (json.dumps(content, indent=1) + "\n").encode())
        write_whole(goal / "differences.txt", (self.table() + "\n").encode())


@checked
def compare_engines(
    scene: Snapshot | str | os.PathLike[str], engines: Sequence[str] = ("nuno", "mujoco", "newton"),
    seconds: float = 2.0, *, device: str = "cpu", rate: float = 30.0, progress: bool | None = False,
) -> EngineComparison:  # fmt: skip
    """Run a saved world on several engines, and return where each of them took it.

    An engine that lacks something that the world needs, or is not installed, or diverges, is left out; its reason is
    kept.

    Args:
        scene: What ``World.save`` returned, or its file (.npz): a single world.
        engines: Two or more of "nuno", "mujoco", "newton"; the first is what the others are compared with.
        seconds: How long it runs [s].
        device: Where, as of ``World``.
        rate: Frames of the film per simulated second [1/s].
        progress: Whether there is a progress bar; None on a terminal only.

    Raises:
        FileFormatError: the file cannot be read.
        UnknownNameError: there is no such engine.
        InvalidInputError: fewer than two engines, a batch, nothing that moves, no time, or more than 100,000 pictures.
        EngineCapabilityError: fewer than two engines can run it; the reason of the first that cannot.
    """
    if isinstance(engines, str) or not isinstance(engines, Sequence) or len(set(engines)) < 2:
        raise InvalidInputError(f"engines must be two or more names, got {engines!r}")
    for engine in engines:
        engine_class(engine)
    span, each = number("seconds", seconds, above=0.0), number("rate", rate, above=0.0)
    if span * each > PICTURE_LIMIT:
        raise InvalidInputError(f"{span:g} s at {each:g} pictures a second are too many: at most {PICTURE_LIMIT}")
    saved = scene
    if isinstance(saved, str | os.PathLike):
        from nuno.world.snapshot_file import read_snapshot

        saved = read_snapshot(saved)
    if not isinstance(saved, Snapshot):
        raise InvalidInputError(f"scene must be what save returned, or a path, got {type(scene).__name__}")
    if saved.world_count != 1:
        raise InvalidInputError(f"scene must be a single world, got a batch of {saved.world_count}")
    moving = tuple(body.name for body in saved.bodies if body.dynamics is not None)
    if not moving:
        raise InvalidInputError("nothing in the scene is dynamic; attach a body before it is saved")
    recordings: dict[str, Recording] = {}
    spent: dict[str, float] = {}
    failures: dict[str, Exception] = {}
    frames = max(1, round(span * each))
    names = list(dict.fromkeys(engines))
    with tqdm(total=len(names) * frames, disable=None if progress is None else not progress, leave=False) as bar:
        for name in names:
            try:
                recordings[name], spent[name] = _run(saved, name, device, span, frames, bar)
            except (EngineCapabilityError, MissingPackageError, SimulationDiverged) as error:
                failures[name] = error
    if len(recordings) < 2:
        raise next(iter(failures.values()))
    return EngineComparison(
        tuple(recordings), recordings, moving, spent, {name: str(error) for name, error in failures.items()}
    )


def _run(saved: Snapshot, engine: str, device: str, span: float, frames: int, bar: Any) -> tuple[Recording, float]:
    world = World(device=device, engine=engine)
    world.restore(saved)
    recording, spent = Recording(world), 0.0
    recording.add()
    begin = world.time
    for frame in range(1, frames + 1):
        now = time.process_time()
        world.run(begin + span * frame / frames - world.time)
        spent += time.process_time() - now if frame > 1 else 0.0
        recording.add()
        bar.update()
    return recording, spent
