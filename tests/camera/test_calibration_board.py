"""The board: its print, and finding it."""

import cv2
import numpy as np
import pytest
from board_views import BOARD, LENS, board_view

import nuno


def test_the_corners_are_where_the_print_has_them():
    """Each inner corner of the picture is found at its number's place: between whole squares, to a fifth of a pixel."""
    side = 60
    picture = cv2.copyMakeBorder(BOARD.picture(side), 30, 30, 30, 30, cv2.BORDER_CONSTANT, value=255)
    numbers, pixels = BOARD.find(picture)
    assert len(numbers) == BOARD.corner_count == 24
    middle = np.array([BOARD.columns, BOARD.rows]) * side / 2 + 30 - 0.5  # pixel centres are whole numbers
    expected = middle + BOARD.corners[numbers][:, :2] * (1.0, -1.0) * side / BOARD.square
    np.testing.assert_allclose(pixels, expected, atol=0.2)  # a marker's cells have no whole number of pixels here


@pytest.mark.parametrize("paper", ["A4", "letter"])
def test_the_image_prints_in_its_size(tmp_path, paper):
    """At 300 dots an inch a square of 35 mm has 413.4 dots."""
    BOARD.save(tmp_path / "board.png", paper)
    numbers, pixels = BOARD.find(cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE))
    along = np.linalg.norm(pixels[numbers == 5][0] - pixels[numbers == 0][0]) / 5
    assert along == pytest.approx(0.035 * 300 / 0.0254, abs=0.5)  # a dot of rounding over five squares, and finding


def test_the_pdf_has_the_papers_size(tmp_path):
    """A4 is 842 x 595 points, of 1/72 inch; the board is one image on it."""
    BOARD.save(tmp_path / "board.pdf")
    text = (tmp_path / "board.pdf").read_bytes()
    assert text.startswith(b"%PDF")
    box = text.split(b"/MediaBox [")[1].split(b"]")[0].split()
    np.testing.assert_allclose([float(number) for number in box], [0, 0, 841.89, 595.28], atol=0.02)


def test_boards_that_cannot_be(tmp_path):
    """A board too large for its paper, with more markers than there are, or a marker as large as its square."""
    with pytest.raises(nuno.InvalidInputError, match="does not fit on A4"):
        nuno.CalibrationBoard(square=0.05).save(tmp_path / "board.pdf")
    with pytest.raises(nuno.InvalidInputError, match="more markers than"):
        nuno.CalibrationBoard(12, 12, dictionary="4X4_50")
    with pytest.raises(nuno.InvalidInputError, match=r"0\.4 to 0\.9"):
        nuno.CalibrationBoard(marker=0.035)
    with pytest.raises(nuno.InvalidInputError, match=r"\.pdf, \.png"):
        BOARD.save(tmp_path / "board.doc")
    with pytest.raises(nuno.FileWriteError, match="no such folder"):
        BOARD.save(tmp_path / "none" / "board.pdf")


def test_another_board_is_not_found():
    """An image of a board with other markers is an image without the board, and says how to tell which it is."""
    image = board_view(LENS, np.array([0.0, 0.0, 0.5]), (0.2, 0.0, 0.0))
    with pytest.raises(nuno.BoardNotFoundError, match=r"0 of the board's 24 inner corners .* which board it is"):
        nuno.CalibrationBoard(dictionary="6X6_50").find(image)
