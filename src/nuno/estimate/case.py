"""A case on disk: input.json with the camera, the table and the hand, and the two images that it names."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.image import read_image
from nuno.errors import InvalidInputError
from nuno.estimate.case_file import read_case_file, read_table
from nuno.estimate.pick import estimate_pick
from nuno.estimate.pick_result import PickResult
from nuno.validation import check_fields, checked, finite_array

NEEDED = ("camera", "image_before", "image_after", "table_height_m", "hand_position_m")


@dataclass(frozen=True, eq=False)
class PickCase:
    """A case as its input.json has it, with its images.

    Attributes:
        camera: The camera of both images.
        before: (h, w, 3) uint8 RGB.
        after: (h, w, 3) uint8 RGB.
        table_height: [m].
        hand: (3,) float [m].
        table_half_extents: x, y [m], or None.
        table_centre: x, y [m], or None.
        table_thickness: [m].
    """

    camera: Camera
    before: np.ndarray
    after: np.ndarray
    table_height: float
    hand: np.ndarray
    table_half_extents: tuple[float, float] | None
    table_centre: tuple[float, float] | None
    table_thickness: float

    def __post_init__(self) -> None:
        check_fields(self)

    def __repr__(self) -> str:
        size = f"{self.camera.width} x {self.camera.height} px"
        return f"<PickCase: two images of {size}, table at {self.table_height:g} m, hand at {self.hand} m>"

    def estimate(self, **options: Any) -> PickResult:
        """Call `nuno.estimate_pick` on this case; ``options`` are that function's keyword arguments."""
        return estimate_pick(
            self.before, self.after, camera=self.camera, table_height=self.table_height, hand=self.hand,
            table_half_extents=self.table_half_extents, table_centre=self.table_centre,
            table_thickness=self.table_thickness, **options,
        )  # fmt: skip


@checked
def read_case(folder: str | os.PathLike[str]) -> PickCase:
    """Read input.json of a folder and the two images that it names; nothing else there is opened.

    Args:
        folder: Of the case; docs/picks.md describes its input.json.

    Raises:
        InvalidInputError: the folder or an entry is missing or not usable.
        FileFormatError: input.json is not JSON.
        ImageError: an image cannot be read.
    """
    folder = FilePath(folder)
    path, data = read_case_file(folder, NEEDED)
    images = []
    for name in ("image_before", "image_after"):
        if not isinstance(data[name], str):
            raise InvalidInputError(f"{name} in {path} must be a file name, got {data[name]!r}")
        images.append(read_image(folder / data[name]))
    height, extents, centre, thickness = read_table(path, data)
    hand = finite_array(f"hand_position_m in {path}", data["hand_position_m"], (3,))
    return PickCase(Camera.from_dict(data["camera"]), images[0], images[1], height, hand, extents, centre, thickness)
