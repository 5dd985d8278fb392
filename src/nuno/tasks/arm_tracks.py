"""Tracks of a robot's arms along several motions: all that carrying needs to know of a robot, and a file of it."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nuno.errors import FileFormatError, InvalidInputError, NunoError
from nuno.files.whole_file import replacing
from nuno.shapes.shape import Box, Hull, Shape

FORMAT = 1
FRAME_RATE = 60.0
"""[1/s] Of trials; poses are known twice a frame."""
BY_WALK = ("distances", "positions", "quaternions", "base", "hands", "configurations")
BY_SHAPE = ("positions", "quaternions")


@dataclass(frozen=True, eq=False)
class ArmTracks:
    """Poses of the shapes of a robot's arms along walks, one for each distance between the hands.

    Attributes:
        robot: Its name.
        parts: The shapes, boxes or hulls.
        sides: (shapes,) int, 0 left arm, 1 right arm, -1 trunk.
        distances: (walks,) [m], between the hands.
        positions: (walks, shapes, keys, 3) [m], where the parts are, two keys a frame.
        quaternions: (walks, shapes, keys, 4).
        base: (walks, keys, 3) [m], where the humanoid is.
        hands: (walks, keys, 2, 3) [m], where its hands are, left and right.
        configurations: (walks, keys, nq), of the whole robot.
        settle: Seconds before the walk begins.
        seconds: Seconds from then on.
    """

    robot: str
    parts: tuple[Shape, ...]
    sides: np.ndarray
    distances: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    base: np.ndarray
    hands: np.ndarray
    configurations: np.ndarray
    settle: float
    seconds: float

    def configuration(self, walk: int, time: float) -> np.ndarray:
        """Return the robot's configuration (nq,) at a time [s] from the start of a walk."""
        key = round(2.0 * FRAME_RATE * (time + self.settle))
        return np.array(self.configurations[walk, np.clip(key, 0, self.configurations.shape[1] - 1)])

    @property
    def times(self) -> np.ndarray:
        """(keys,) [s], two a frame."""
        return np.arange(self.positions.shape[2]) * (0.5 / FRAME_RATE)

    @property
    def frames(self) -> int:
        """Whole frames of a trial."""
        return (self.positions.shape[2] - 1) // 2

    def of_walks(self, chosen: Sequence[int] | slice) -> ArmTracks:
        """Return the tracks of some of the walks."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in BY_WALK})

    def of_shapes(self, chosen: Sequence[int]) -> ArmTracks:
        """Return the tracks of some of the shapes."""
        return replace(
            self, parts=tuple(self.parts[k] for k in chosen), sides=self.sides[list(chosen)],
            **{name: getattr(self, name)[:, list(chosen)] for name in BY_SHAPE},
        )  # fmt: skip

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file (npz) from which ``load`` makes the same tracks, to the bit, where there is no robot model.

        Raises:
            InvalidInputError: arms of shapes other than boxes and hulls.
        """
        arrays = {name: getattr(self, name) for name in (*BY_WALK, "sides")}
        kinds = []
        for k, part in enumerate(self.parts):
            if isinstance(part, Box):
                kinds.append("box")
                arrays[f"size_{k}"] = np.array(part.size)
            elif isinstance(part, Hull):
                kinds.append("hull")
                arrays[f"vertices_{k}"], arrays[f"faces_{k}"] = part.vertices, part.faces
            else:
                raise InvalidInputError(f"tracks with a {part.kind} are not written to files; boxes and hulls are")
        about = {
            "format": FORMAT, "robot": self.robot, "settle": self.settle, "seconds": self.seconds, "parts": kinds,
        }  # fmt: skip
        with replacing(path) as partial, open(partial, "wb") as stream:
            np.savez_compressed(stream, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ArmTracks:
        """Read a file that ``save`` wrote.

        Raises:
            FileFormatError: another file, or a damaged one.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                about = json.loads(str(stored["about"]))
                if about["format"] != FORMAT:
                    raise FileFormatError(f"{os.fspath(path)!r} has format {about['format']!r}; {FORMAT} is readable")
                parts: list[Shape] = [
                    Box(tuple(stored[f"size_{k}"])) if kind == "box"
                    else Hull(stored[f"vertices_{k}"], stored[f"faces_{k}"])
                    for k, kind in enumerate(about["parts"])
                ]  # fmt: skip
                arrays = {name: stored[name] for name in (*BY_WALK, "sides")}
            return cls(
                robot=str(about["robot"]), parts=tuple(parts), settle=float(about["settle"]),
                seconds=float(about["seconds"]), **arrays,
            )  # fmt: skip
        except FileFormatError:
            raise
        except (OSError, KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile, NunoError) as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise FileFormatError(f"{os.fspath(path)!r} holds no tracks of arms: {error}") from error
