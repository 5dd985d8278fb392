"""A fold on disk: input.json with the camera, the table and the hands by frame, and the images that it names."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, read_image
from nuno.errors import InvalidInputError
from nuno.estimate.case_file import read_case_file, read_table
from nuno.estimate.fold import replay_fold
from nuno.estimate.fold_result import FoldResult
from nuno.estimate.hand_path import HandPath
from nuno.validation import checked, finite_array

NEEDED = ("camera", "table_height_m", "frames")
NEEDED_OF_A_FRAME = ("t", "hands_m", "held")
LONGEST = 600.0
"""[s] Of a fold: a replay keeps the state of every frame. Times in milliseconds are longer."""


@dataclass(frozen=True, eq=False)
class FoldCase:
    """A case as its input.json has it, with its images.

    Attributes:
        camera: The camera.
        times: (k,) float [s], of the frames.
        hands: The hands' paths.
        images: (h, w, 3) uint8 RGB by frame, those there are.
        names: By frame, what the image's name has for a number ("012" of rgb_012.jpg).
        table_height: [m].
        table_half_extents: x, y [m], or None.
        table_centre: x, y [m], or None.
        table_thickness: [m].
    """

    camera: Camera
    times: np.ndarray
    hands: tuple[HandPath, ...]
    images: dict[int, np.ndarray]
    names: dict[int, str]
    table_height: float
    table_half_extents: tuple[float, float] | None
    table_centre: tuple[float, float] | None
    table_thickness: float

    def __repr__(self) -> str:
        size = f"{self.camera.width} x {self.camera.height} px"
        return f"<FoldCase: {len(self.times)} frames, {len(self.images)} images of {size}, {len(self.hands)} hands>"

    def replay(self, **options: Any) -> FoldResult:
        """Call `nuno.replay_fold` on this case; ``options`` are that function's keyword arguments."""
        return replay_fold(
            self.images[min(self.images)], self.hands, camera=self.camera, table_height=self.table_height,
            table_half_extents=self.table_half_extents, table_centre=self.table_centre,
            table_thickness=self.table_thickness, frame_times=self.times, images=self.images, **options,
        )  # fmt: skip


@checked
def read_fold_case(folder: str | os.PathLike[str]) -> FoldCase:
    """Read input.json of a folder and the images that its frames name; nothing else there is opened.

    Args:
        folder: Of the case; docs/folds.md describes its input.json.

    Raises:
        InvalidInputError: the folder or an entry is missing or not usable.
        FileFormatError: input.json is not JSON.
        ImageError: an image cannot be read, or is not of the camera's size.
    """
    folder = FilePath(folder)
    path, data = read_case_file(folder, NEEDED)
    frames = data["frames"]
    if not isinstance(frames, list) or len(frames) < 2 or not all(isinstance(frame, dict) for frame in frames):
        raise InvalidInputError(f"frames in {path} must be a list of two or more objects")
    for k, frame in enumerate(frames):
        lacking = [name for name in NEEDED_OF_A_FRAME if name not in frame]
        if lacking:
            raise InvalidInputError(f"frame {k} in {path} lacks {', '.join(lacking)}")
    camera = Camera.from_dict(data["camera"])
    times, hands = _hands(frames, path)
    images, names = _images(frames, folder, camera)
    if 0 not in images:
        raise InvalidInputError(f"the first frame in {path} has no rgb; the cloth's model comes from it")
    return FoldCase(camera, times, hands, images, names, *read_table(path, data))


def _hands(frames: list[dict[str, Any]], path: FilePath) -> tuple[np.ndarray, tuple[HandPath, ...]]:
    times = finite_array(f"t of the frames in {path}", [frame["t"] for frame in frames], ("k",))
    if times[-1] - times[0] > LONGEST:
        raise InvalidInputError(
            f"t of the frames in {path} must be seconds, over {LONGEST:g} s at most; got {times[-1] - times[0]:g} s"
        )
    try:
        given = np.array([frame["hands_m"] for frame in frames])
        if given.dtype.kind in "SUb":
            raise ValueError("text is no number")
        positions = given.astype(float)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"hands_m in {path} must be as many positions (x, y, z) in every frame") from error
    if positions.ndim != 3 or positions.shape[1] < 1 or positions.shape[2] != 3:
        raise InvalidInputError(f"hands_m in {path} must be (hands, 3) in every frame, got {positions.shape[1:]}")
    wrong = np.flatnonzero(~np.isfinite(positions).all(axis=(1, 2)))
    if len(wrong):
        raise InvalidInputError(f"hands_m in {path} must be finite; that of frame {wrong[0]} is not")
    held = []
    for k, frame in enumerate(frames):
        value = frame["held"]
        each = value if isinstance(value, list) else [value] * positions.shape[1]
        if len(each) != positions.shape[1] or not all(isinstance(flag, bool) for flag in each):
            raise InvalidInputError(
                f"held of frame {k} in {path} must be true or false, or one of these for each hand, got {value!r}"
            )
        held.append(each)
    flags = np.array(held, dtype=bool)
    return times, tuple(HandPath(times, positions[:, h], flags[:, h]) for h in range(positions.shape[1]))


def _images(
    frames: list[dict[str, Any]], folder: FilePath, camera: Camera
) -> tuple[dict[int, np.ndarray], dict[int, str]]:
    images, names = {}, {}
    for k, frame in enumerate(frames):
        name = frame.get("rgb")
        if name is None:
            continue
        if not isinstance(name, str):
            raise InvalidInputError(f"rgb of frame {k} must be a file name, got {name!r}")
        images[k] = check_image(read_image(folder / name), camera, str(folder / name))
        numbers = re.findall(r"\d+", FilePath(name).stem)
        names[k] = numbers[-1] if numbers else f"{k:03d}"
    return images, names
