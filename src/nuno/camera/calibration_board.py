"""A ChArUco board: printed on paper, it tells what a camera's lens does, and where a table is."""

from __future__ import annotations

import os
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.image import check_any_size
from nuno.errors import BoardNotFoundError, InvalidInputError
from nuno.files.whole_file import file_path, replacing, write_whole
from nuno.validation import check_fields, checked, choice, count, number

DICTIONARIES = ("4X4_50", "4X4_100", "5X5_50", "5X5_100", "6X6_50", "6X6_100")
"""OpenCV's dictionaries of markers, by name without DICT_."""
FEWEST_CORNERS = 8
"""Inner corners that an image must show to count as one of the board."""
_PAPERS = {"A4": (0.297, 0.210), "letter": (0.2794, 0.2159), "A3": (0.420, 0.297)}  # [m], landscape
_EDGE = 0.006  # [m] printers leave so much white
_DOTS = 300 / 0.0254  # per metre, in pictures


@dataclass(frozen=True)
class CalibrationBoard:
    """A chessboard with a marker in every white square; the default fits on A4 and letter paper.

    Attributes:
        columns: Squares along its longer side.
        rows: Squares along the other.
        square: Side of a square [m]. Measure it on the print: printers scale.
        marker: Side of a marker [m]; None is 3/4 of a square's.
        dictionary: Of the markers, one of `DICTIONARIES`.
    """

    columns: int = 7
    rows: int = 5
    square: float = 0.035
    marker: float | None = None
    dictionary: str = "5X5_100"

    def __post_init__(self) -> None:
        check_fields(self)
        columns, rows = count("columns", self.columns, low=3, high=40), count("rows", self.rows, low=3, high=40)
        square = number("square [m]", self.square, low=0.002, high=1.0)
        if self.marker is not None and not 0.4 * square <= number("marker [m]", self.marker) <= 0.9 * square:
            raise InvalidInputError(
                f"a marker's side must be 0.4 to 0.9 of a square's, {square:g} m, got {self.marker!r}"
            )
        known = int(choice("dictionary", self.dictionary, DICTIONARIES).split("_")[1])
        if columns * rows // 2 > known:
            raise InvalidInputError(
                f"a board of {columns} x {rows} squares has more markers than {self.dictionary} has"
            )

    @property
    def size(self) -> tuple[float, float]:
        """Its sides [m]."""
        return self.columns * self.square, self.rows * self.square

    @property
    def corner_count(self) -> int:
        """The number of its inner corners."""
        return (self.columns - 1) * (self.rows - 1)

    @property
    def corners(self) -> np.ndarray:
        """(n, 3) float, its inner corners [m] by number: from its middle, x along the longer side, y up the page."""
        points = np.asarray(self._made().getChessboardCorners(), dtype=float)
        return (points - (0.5 * self.size[0], 0.5 * self.size[1], 0.0)) * (1.0, -1.0, 1.0)

    def picture(self, pixels: int = 100) -> np.ndarray:
        """Return the board as an image (h, w) uint8, without a rim, so many pixels to a square.

        Raises:
            InvalidInputError: fewer than 20 pixels or more than 2000.
        """
        side = count("pixels", pixels, low=20, high=2000)
        return np.asarray(self._made().generateImage((self.columns * side, self.rows * side), marginSize=0))

    @checked
    def save(self, path: str | os.PathLike[str], paper: str = "A4") -> None:
        """Write the board for a printer: .pdf in its true size, or an image at 300 dots an inch.

        Args:
            path: Ends in .pdf, .png or another ending that OpenCV writes.
            paper: "A4", "letter" or "A3", landscape.

        Raises:
            InvalidInputError: the board is larger than the paper, or an ending of no known kind.
            FileWriteError: the file cannot be written.
        """
        goal = file_path(path)
        width, height = _PAPERS[choice("paper", paper, tuple(_PAPERS))]
        if self.size[0] + 2 * _EDGE > width or self.size[1] + 2 * _EDGE > height:
            raise InvalidInputError(
                f"a board of {self.size[0]:.3f} x {self.size[1]:.3f} m does not fit on {paper} ({width:g} x {height:g} "
                "m)"
            )
        text = (
            f"Nuno: {self.columns} x {self.rows} squares of {1e3 * self.square:g} mm, markers {self.dictionary}. "
            "Print at 100 %, measure a square, glue onto something flat."
        )
        if goal.suffix.lower() == ".pdf":
            self._save_pdf(goal, (width, height), text)
            return
        page = np.full((round(height * _DOTS), round(width * _DOTS)), 255, dtype=np.uint8)
        size = (round(self.size[0] * _DOTS), round(self.size[1] * _DOTS))
        board = cv2.resize(self.picture(400), size, interpolation=cv2.INTER_AREA)
        top, left = (page.shape[0] - size[1]) // 2, (page.shape[1] - size[0]) // 2
        page[top : top + size[1], left : left + size[0]] = board
        cv2.putText(page, text, (left, top + size[1] + 50), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 0, 2, cv2.LINE_AA)
        try:
            _, packed = cv2.imencode(goal.suffix, page)
        except cv2.error as error:
            raise InvalidInputError(f"a board's file ends in .pdf, .png or the like, got {str(path)!r}") from error
        write_whole(goal, packed.tobytes())

    def _save_pdf(self, goal: os.PathLike[str], paper: tuple[float, float], text: str) -> None:
        from matplotlib.backends.backend_pdf import FigureCanvasPdf
        from matplotlib.figure import Figure

        figure = Figure(figsize=(paper[0] / 0.0254, paper[1] / 0.0254))
        share = self.size[0] / paper[0], self.size[1] / paper[1]
        axes = figure.add_axes((0.5 - 0.5 * share[0], 0.5 - 0.5 * share[1], *share))
        axes.imshow(self.picture(200), cmap="gray", vmin=0, vmax=255, interpolation="none", aspect="auto")
        axes.set_axis_off()
        figure.text(0.5, 0.5 - 0.5 * share[1] - 0.02, text, ha="center", va="top", fontsize=7)
        with replacing(goal) as partial, partial.open("wb") as file:
            FigureCanvasPdf(figure).print_pdf(file)

    @checked
    def find(self, image: ArrayLike, name: str = "the image") -> tuple[np.ndarray, np.ndarray]:
        """Find the board's inner corners in an image.

        Args:
            image: (h, w, 3) uint8 RGB, or (h, w) uint8.
            name: What to call it in a message.

        Returns:
            The corners' numbers (k,) int, and their pixels (k, 2) float.

        Raises:
            ImageError: not an image.
            BoardNotFoundError: it shows fewer than `FEWEST_CORNERS` of its corners.
        """
        array = check_any_size(image, name)
        grey = cv2.cvtColor(array, cv2.COLOR_RGB2GRAY) if array.ndim == 3 else np.ascontiguousarray(array)
        detector = cv2.aruco.CharucoDetector(self._made())
        corners, numbers, _, markers = detector.detectBoard(grey)
        found = 0 if numbers is None else len(numbers)
        fewest = min(FEWEST_CORNERS, self.corner_count)
        if found < fewest:
            seen = 0 if markers is None else len(markers)
            raise BoardNotFoundError(
                f"{name} shows {found} of the board's {self.corner_count} inner corners ({seen} markers), and {fewest} "
                f"are needed: show all of the board of {self.columns} x {self.rows} squares with markers "
                f"{self.dictionary}, larger, sharper and evenly lit; or say which board it is"
            )
        return np.ravel(numbers).astype(int), np.asarray(corners, dtype=float).reshape(-1, 2)

    def _made(self) -> cv2.aruco.CharucoBoard:
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        marker = 0.75 * self.square if self.marker is None else self.marker
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, marker, markers)
