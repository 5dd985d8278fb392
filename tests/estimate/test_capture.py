"""The whole way: images of a known camera, a case made of them, and the case as `nuno pick` reads it."""

import json
import sys
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

import nuno
from nuno.__main__ import main

sys.path.insert(0, str(Path(__file__).parents[1] / "camera"))
from board_views import BOARD, LENS, board_views, exposed, quads, room

HEIGHT, AT = 0.72, (0.1, -0.05)
HAND, MARKER, SIDE = np.array([0.0, 0.1, 0.95]), 7, 0.06
CAMERA = nuno.Camera(
    640, 480, LENS.fx, LENS.fy, LENS.cx, LENS.cy,
    nuno.Camera.look_at((-0.55, 0.0, 1.32), (0.05, 0.0, 0.75), 1.0).camera_to_world, LENS.distortion,
)  # fmt: skip
TOLERANCE = (
    0.006  # [m] the lens is known to 0.2 %, of some 0.8 m 2 mm, and the principal point to 1 px, which is 1.4 mm
)


def rectangle(centre, right, down):
    """Upper left, upper right and lower left corner of a rectangle by its middle and its sides, (3,) each."""
    return centre + np.array([-(right + down), right - down, down - right]) / 2


@cache
def images():
    """The board's views, the board on the table, the cloth on the table, and the cloth in a hand with a marker."""
    empty = room(CAMERA, 1)
    width, depth = BOARD.size
    lying = rectangle(np.array([*AT, HEIGHT]), np.array([width, 0, 0]), np.array([0, -depth, 0]))
    table = exposed(quads(CAMERA, empty, lying, 0.82 * BOARD.picture(100) + 20))
    towel = np.full((60, 80), 50.0)
    spread = rectangle(np.array([0.1, 0.0, HEIGHT]), np.array([0.2, 0.0, 0]), np.array([0, -0.3, 0]))
    before = exposed(quads(CAMERA, empty, spread, towel, 0))
    hangs = rectangle(HAND - (0, 0, 0.11), np.array([0.0, -0.12, 0.0]), np.array([0.0, 0.0, -0.16]))
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = cv2.aruco.generateImageMarker(known, MARKER, 300) * 0.8 + 20
    right, up = np.array([0.0, -1.0, 0.0]), np.array([np.sin(0.6), 0.0, np.cos(0.6)])
    marked = quads(CAMERA, quads(CAMERA, empty, hangs, towel, 0), rectangle(HAND, SIDE * right, -SIDE * up), picture)
    return board_views(), table, before, exposed(marked)


@cache
def calibration():
    """The lens by its views."""
    return nuno.calibrate_camera(images()[0], BOARD)


def capture(folder, **options):
    """Make the case with the lens that was found; ``options`` take the place of what is given."""
    _, table, before, after = images()
    given = {"before": before, "after": after, "board_on_table": table, "camera": calibration().camera, "hand": HAND,
             "table_height": HEIGHT, "board_at": AT}  # fmt: skip
    return nuno.capture_case(folder, **(given | options))


@pytest.mark.long
def test_the_whole_way_by_files(tmp_path, capsys):
    """The command makes a case of image files, and `read_case` reads the true camera, table and hand from it."""
    views, table, before, after = images()
    for k, view in enumerate(views):
        cv2.imwrite(str(tmp_path / f"view{k}.png"), view[..., ::-1])
    for name, image in (("table", table), ("before", before), ("after", after)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image[..., ::-1])
    arguments = ["capture", "--out", str(tmp_path / "case"), "--board-images",
                 *(str(tmp_path / f"view{k}.png") for k in range(len(views))),
                 "--board-on-table", str(tmp_path / "table.png"), "--before", str(tmp_path / "before.png"),
                 "--after", str(tmp_path / "after.png"), "--marker", str(MARKER), "--marker-size", str(SIDE),
                 "--table-height", str(HEIGHT), "--table-size", "0.8", "1.2", "--board-at", *map(str, AT)]  # fmt: skip
    assert main(arguments) == 0
    assert "preview.png" in capsys.readouterr().out
    case = nuno.read_case(tmp_path / "case")
    np.testing.assert_allclose(case.camera.camera_to_world[:3, 3], CAMERA.camera_to_world[:3, 3], atol=TOLERANCE)
    np.testing.assert_allclose(case.camera.camera_to_world[:3, :3], CAMERA.camera_to_world[:3, :3], atol=0.005)
    np.testing.assert_allclose(case.hand, HAND, atol=2 * TOLERANCE)
    assert case.table_height == HEIGHT and case.table_half_extents == (0.4, 0.6) and case.table_centre == (0.0, 0.0)
    np.testing.assert_array_equal(case.before, before)
    np.testing.assert_array_equal(case.after, after)
    assert json.loads((tmp_path / "case" / "input.json").read_text())["warnings"] == []
    lens = nuno.Camera.from_dict(json.loads((tmp_path / "case" / "camera.json").read_text()))
    assert lens.fx == case.camera.fx
    grid = np.stack(np.meshgrid(np.linspace(-0.1, 0.3, 5), np.linspace(-0.2, 0.2, 5)), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.full(25, HEIGHT)])
    # where the table is in the image is right to half a pixel, as camera and lens were fitted to it there
    assert np.linalg.norm(case.camera.project(points) - CAMERA.project(points), axis=1).max() < 0.8


def test_the_cloth_is_measured(tmp_path):
    """The towel of 0.2 x 0.3 m that is drawn in the image before is measured to 2 % by the case's camera."""
    made = capture(tmp_path, table_size=(0.8, 1.2))
    case = nuno.read_case(tmp_path)
    mask = nuno.segment_before(
        case.before, case.camera, nuno.Table(HEIGHT, (0.4, 0.6)), hint=tuple(CAMERA.project([0.1, 0.0, HEIGHT]))
    )
    from nuno.camera.rectangle import fit_rectangle

    found = fit_rectangle(mask, case.before, case.camera, HEIGHT)
    np.testing.assert_allclose((found.long_m, found.short_m), (0.3, 0.2), rtol=0.02)
    assert made.preview.shape == (480 + 26, 1280, 3)


def test_a_camera_that_moved_is_told(tmp_path):
    """An image before that is 5 px off the others is told by name and number, and the case is made."""
    _, _, before, _ = images()
    moved = np.roll(before, 5, axis=1)
    warnings = capture(tmp_path, before=moved).warnings
    assert len(warnings) == 1 and "moved by 5." in warnings[0] and "the image before" in warnings[0]
    assert capture(tmp_path).warnings == ()


def test_bad_images(tmp_path):
    """Files that are none, images without the board, blurred or overexposed: named errors, and no case."""
    _, table, before, _ = images()
    goal = tmp_path / "case"
    (tmp_path / "text.png").write_text("no image")
    for options, error, words in (
        ({"before": tmp_path / "none.png"}, nuno.ImageError, "no image file"),
        ({"before": tmp_path / "text.png"}, nuno.ImageError, "holds no image"),
        ({"board_on_table": before}, nuno.BoardNotFoundError, "show all of the board"),
        (
            {"before": cv2.GaussianBlur(before, (0, 0), 5.0)},
            nuno.ImageQualityError,
            "the image before is blurred .* focus",
        ),
        ({"board_on_table": cv2.GaussianBlur(table, (0, 0), 3.0)}, nuno.ImageQualityError, "blurred"),
        ({"before": np.full_like(before, 255)}, nuno.ImageQualityError, "overexposed"),
        ({"before": before[:240]}, nuno.ImageError, "fit its camera"),
        ({"camera": None}, nuno.InvalidInputError, "board_images, or from camera"),
        ({"camera": None, "board_images": images()[0][:3]}, nuno.CalibrationError, "6 are needed"),
        ({"hand": None}, nuno.InvalidInputError, "hand, or from marker"),
        ({"hand": None, "marker": 9, "marker_size": SIDE}, nuno.BoardNotFoundError, r"shows \[7\]"),
        ({"hand": (0.0, 0.0, 0.5)}, nuno.InvalidInputError, "not above the table"),
        ({"hand": (0.0, 3.0, 0.9)}, nuno.InvalidInputError, "would not be in the image"),
        ({"table_size": (0.0, 1.0)}, nuno.InvalidInputError, "two positive lengths"),
    ):
        with pytest.raises(error, match=words):
            capture(goal, **options)
    assert not goal.exists()


class Replay:
    """A camera that gives images in turn."""

    def __init__(self, given):
        self.given = list(given)

    def take(self):
        """Return the next one."""
        return self.given.pop(0)


def test_taking_images_one_after_another(tmp_path):
    """Who takes images is told what to do next, and of a blurred one to take it again; all are kept."""
    views, table, before, after = images()
    said = []
    blurred = cv2.GaussianBlur(before, (0, 0), 6.0)
    source = Replay([*views, table, blurred, before, after])
    made = nuno.take_capture(tmp_path, source, said.append, views=8, hand=HAND, table_height=HEIGHT, board_at=AT)
    assert (
        len(said) == 8 + 4 and said[10].startswith("the image is blurred") and "Again: take the board away" in said[10]
    )
    assert sorted(path.name for path in (tmp_path / "raw").iterdir()) == sorted(
        [*(f"board_{k:02d}.png" for k in range(8)), "board_on_table.png", "before.png", "after.png"]
    )
    np.testing.assert_allclose(made.camera.camera_to_world[:3, 3], CAMERA.camera_to_world[:3, 3], atol=TOLERANCE)
    with pytest.raises(nuno.BoardNotFoundError, match="show all of the board"):
        nuno.take_capture(tmp_path, Replay([before] * 5), said.append, hand=HAND)


def test_the_command_without_a_camera(tmp_path, capsys):
    """A USB camera that is not there, and arguments that do not fit: status 2 and a named error."""
    assert main(["capture", "--out", str(tmp_path / "case"), "--usb", "63", "--hand", "0", "0", "1"]) == 2
    assert "ImageError: camera 63 cannot be opened" in capsys.readouterr().err
    assert main(["capture", "--out", str(tmp_path / "case"), "--hand", "0", "0", "1"]) == 2
    assert "--before" in capsys.readouterr().err
    assert main(["capture"]) == 2
    assert "--out" in capsys.readouterr().err


def test_the_command_prints_a_board(tmp_path, capsys):
    """``nuno capture --board`` writes the board, and says to measure a square of it."""
    board = tmp_path / "out" / "board.png"  # in a folder that is not there yet
    assert main(["capture", "--board", str(board), "--paper", "letter"]) == 0
    assert "measure" in capsys.readouterr().out
    assert len(BOARD.find(nuno.camera.image.read_image(board))[0]) == 24


@pytest.mark.long
def test_a_captured_case_is_picked(tmp_path):
    """Files of a camera that saw a towel lifted by a corner of it: `nuno pick` on what `nuno capture` made names it.

    What is lifted is a finer cloth than the estimator's, of another material; the corner's place is known exactly.
    """
    views, table, before, _ = images()
    world = nuno.World(device="cpu", substeps=45)
    world.add(nuno.box((0.8, 1.2, 0.04), position=(0.0, 0.0, HEIGHT - 0.02)))
    towel = world.add(nuno.sheet((0.2, 0.3), (14, 21), position=(0.1, 0.0, HEIGHT + 0.0025)))
    corner = towel.vertices[0].copy()
    hand = corner + np.array([0.02, 0.03, 0.25])
    world.attach(towel, nuno.Cloth(bending_rigidity=1e-4, area_density=0.25))
    world.grip(towel, [0], to=nuno.Path([0.1, 1.6], [corner, hand], interpolation="minimum_jerk"))
    world.run(4.0)
    after = room(CAMERA, 1)
    after[world.masks(CAMERA, towel).numpy()] = 50.0
    for name, image in (("table", table), ("before", before), ("after", exposed(after)),
                        *((f"view{k}", view) for k, view in enumerate(views))):  # fmt: skip
        cv2.imwrite(str(tmp_path / f"{name}.png"), image[..., ::-1])
    arguments = ["capture", "--out", str(tmp_path / "case"), "--board-images",
                 *(str(tmp_path / f"view{k}.png") for k in range(len(views))),
                 *(f"--{name}={tmp_path / part}.png" for name, part in (
                     ("board-on-table", "table"), ("before", "before"), ("after", "after"))),
                 "--hand", *map(str, hand), "--table-height", str(HEIGHT), "--table-size", "0.8", "1.2",
                 "--board-at", *map(str, AT)]  # fmt: skip
    assert main(arguments) == 0
    assert main(["pick", str(tmp_path / "case"), "--out", str(tmp_path), "--device", "cpu"]) == 0
    told = json.loads((tmp_path / "result.json").read_text())
    # C00 is the corner at the image's upper left, (0.2, 0.15) m; the lifted one is the other end of both sides
    assert told["pick"] == [5, 5]
    assert told["confidence"] > 0.8, "a corner that hangs free is a clear pick"
