"""The result of carrying a mat in many ways: a table, files, and pictures."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.files.html_table import html_table
from nuno.files.whole_file import made_folder, replacing, write_figure, write_whole
from nuno.tasks.arm_tracks import FRAME_RATE
from nuno.tasks.carry_trials import CarryPlan, CarryTrial, carry, make_room

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.robot.humanoid import Humanoid


@dataclass(frozen=True, eq=False)
class CarryResult:
    """The result of carrying a mat in many ways.

    Attributes:
        trials: By arm distance, then offset in x, then in y.
        plan: What all trials had in common.
        robot: The robot; None where its arms' tracks were given.
        walk_of: (trials,) int, the walk that each took, which those of one arm distance share.
        substeps: Substeps a frame that were asked for, None for the solver's own choice.
        device: Where they ran.
        seconds: Wall time by stage [s].
    """

    trials: tuple[CarryTrial, ...]
    plan: CarryPlan = field(repr=False)
    robot: Humanoid | None = field(repr=False)
    walk_of: np.ndarray = field(repr=False)
    substeps: int | None
    device: str
    seconds: dict[str, float]

    def __repr__(self) -> str:
        return f"<CarryResult: {len(self.trials)} trials, the mat fell in {int(self.failed.sum())}>"

    def _repr_html_(self) -> str:
        held = [k for k in np.argsort(self.values) if not self.failed[k]]
        rows = [
            (f"{trial.arm_distance:.3f}", f"{trial.offset_x:+.3f}", f"{trial.offset_y:+.3f}", f"{1000 * value:.1f}")
            for trial, value in ((self.trials[k], self.values[k]) for k in held[:5])
        ]
        title = f"CarryResult: {len(self.trials)} trials, the mat fell in {int(self.failed.sum())}"
        columns = ("arms apart [m]", "hands ahead [m]", "aside [m]", "F [mm s]")
        return html_table(title, rows, columns=columns if rows else ())

    @property
    def values(self) -> np.ndarray:
        """(trials,) float [m s], F of each; NaN where the mat fell."""
        return np.array([np.nan if trial.value is None else trial.value for trial in self.trials])

    @property
    def failed(self) -> np.ndarray:
        """(trials,) bool, where the mat fell."""
        return np.array([trial.value is None for trial in self.trials])

    @property
    def best(self) -> int:
        """The number of the steadiest trial.

        Raises:
            InvalidInputError: the mat fell in all of them.
        """
        if self.failed.all():
            raise InvalidInputError(f"the mat fell in all {len(self.trials)} trials; none is the best")
        return int(np.nanargmin(self.values))

    def offsets(self) -> np.ndarray:
        """Return the offsets of each trial, (trials, 2) [m]."""
        return np.array([(trial.offset_x, trial.offset_y) for trial in self.trials])

    def table(self) -> str:
        """Return F [mm s] by arm distance (rows) and offsets (columns) as text; where the mat fell, when [s]."""
        distances = sorted({trial.arm_distance for trial in self.trials})
        columns = sorted({(trial.offset_x, trial.offset_y) for trial in self.trials})
        found = {(t.arm_distance, t.offset_x, t.offset_y): t for t in self.trials}
        lines = ["arms [m]  " + "".join(f"{1000 * x:+5.0f},{1000 * y:+4.0f}" for x, y in columns)]
        for distance in distances:
            cells = []
            for x, y in columns:
                trial = found.get((distance, x, y))
                shown = "" if trial is None else _shown(trial)
                cells.append(f"{shown:>10}")
            lines.append(f"{distance:8.3f}  " + "".join(cells))
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return everything that is written to result.json, as plain data."""
        best = None if self.failed.all() else self.best
        return {
            "format": 1,
            "robot": self.plan.robot,
            "hold": self.plan.hold,
            "mat": {"kind": self.plan.mat.kind, "material": _values(self.plan.material)},
            "arm_friction": self.plan.friction,
            "settle_s": self.plan.settle,
            "walk_s": self.plan.seconds,
            "unit_of_value": "m s",
            "best": best,
            "failed": int(self.failed.sum()),
            "trials": [asdict(trial) for trial in self.trials],
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }

    def replay(self, trial: int, times: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the mat's vertices at some times of a trial, which is run once more by itself.

        Args:
            trial: Its number.
            times: (k,) [s] from the start of the walk, increasing; down to -``settle``.

        Returns:
            (k, n, 3) float [m].

        Raises:
            InvalidInputError: there is no such trial, or a time outside of it.
        """
        self._check(trial)
        frames = [round((time + self.plan.settle) * FRAME_RATE) for time in times]
        if not frames or min(frames) < 0 or max(frames) > self.plan.frames:
            raise InvalidInputError(
                f"times must lie in [{-self.plan.settle:g}, {self.plan.seconds:g}], got {list(times)!r}"
            )
        found: dict[int, np.ndarray] = {}

        def watch(mat: Any, time: float) -> None:
            frame = round(time * FRAME_RATE)
            if frame in frames:
                found[frame] = mat.vertices

        chosen = slice(trial, trial + 1)
        room = make_room(self.plan, self.device, self.substeps).imagine(1)
        carry(room, self.plan, self.walk_of[chosen], self.offsets()[chosen], watch)
        return np.array([found[frame] for frame in frames])

    def strip(self, trial: int, count: int = 6) -> Figure:
        """Return a picture of a trial at ``count`` times, of a failed one around its fall.

        Raises:
            InvalidInputError: no such trial, or there is no robot to draw.
        """
        from nuno.tasks.carry_figures import carry_strip

        self._check(trial)
        if self.robot is None:
            raise InvalidInputError("strips show the robot, and of this one only the arms' tracks are known")
        return carry_strip(self, trial, count)

    def figure(self) -> Figure:
        """Return F over the three parameters; crosses are trials in which the mat fell."""
        from nuno.tasks.carry_figures import carry_plot

        return carry_plot(self)

    def save(self, folder: str | os.PathLike[str], *, pictures: bool = True) -> None:
        """Write the answer into a folder that is made if need be.

        result.json, trials.csv, table.txt; where ``pictures`` is set, plot.png, best.png and failed.png (the first
        failing trial of the walk, where there is one).

        Args:
            folder: Where.
            pictures: Whether to draw pictures, which runs two trials once more; without a robot only the plot.

        Raises:
            FileWriteError: the folder or a file in it cannot be written.
        """
        folder = made_folder(folder)
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False)
        write_whole(folder / "result.json", text + "\n")
        with replacing(folder / "trials.csv") as partial, open(partial, "w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(asdict(self.trials[0])))
            writer.writeheader()
            writer.writerows(asdict(trial) for trial in self.trials)
        write_whole(folder / "table.txt", self.table() + "\n")
        if not pictures:
            return
        write_figure(folder / "plot.png", self.figure())
        if self.robot is None:
            return
        if not self.failed.all():
            write_figure(folder / "best.png", self.strip(self.best))
        if self.failed.any():
            write_figure(folder / "failed.png", self.strip(self.telling_failure))

    @property
    def telling_failure(self) -> int:
        """The number of the trial in which the mat fell last: the one that the walk itself brought down, if any.

        Raises:
            InvalidInputError: it fell in none.
        """
        times = [-np.inf if trial.failed_at is None else trial.failed_at for trial in self.trials]
        if not self.failed.any():
            raise InvalidInputError("the mat fell in no trial")
        return int(np.argmax(times))

    def _check(self, trial: int) -> None:
        if isinstance(trial, bool) or not 0 <= trial < len(self.trials):
            raise InvalidInputError(f"trial must lie in [0, {len(self.trials) - 1}], got {trial!r}")


def _shown(trial: CarryTrial) -> str:
    if trial.value is None and trial.failed_at is None:
        return "error"
    if trial.value is None:
        return f"x {trial.failed_at:.1f} s"
    return f"{1000.0 * trial.value:.1f}"


def _values(material: Any) -> dict[str, Any]:
    return {name: np.asarray(value).tolist() for name, value in vars(material).items()}
