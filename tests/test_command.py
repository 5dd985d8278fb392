"""The command: an answer from the bundled case, and for every bad input its status and a named error."""

import json
import os
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from nuno.__main__ import main
from nuno.errors import EstimationError
from nuno.estimate.case import PickCase, read_case
from nuno.kernels.start_warp import without_lines

CASE = Path(__file__).parents[1] / "examples" / "pick-case"
TRUE = [0, 0]  # where the bundled cloth was picked, in the simulation that its images were rendered from


@pytest.fixture
def case(tmp_path):
    """A copy of the bundled case to spoil."""
    return shutil.copytree(CASE, tmp_path / "case")


def pick(case, out, *options):
    """Run the command in this process; return its status."""
    return main(["pick", str(case), "--out", str(out), "--device", "cpu", "--no-progress", *options])


def rewrite(case, **entries):
    """Change entries of a case's input.json; None takes one out."""
    path = case / "input.json"
    data = json.loads(path.read_text()) | entries
    path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))


def scene(radius=0):
    """An image (480, 640, 3) of a grey table that fills it, with a red disc of ``radius`` [px] on it."""
    image = np.full((480, 640, 3), 120.0)
    cv2.circle(image, (320, 300), radius, (40, 40, 200), -1) if radius else None
    image += np.random.default_rng(0).normal(0.0, 3.0, image.shape)  # a camera's noise
    return image.clip(0, 255).astype(np.uint8)


def test_a_small_grid_end_to_end(tmp_path):
    """``python -m nuno pick`` in a process of its own: status 0, one line, both files; without Matplotlib."""
    out = tmp_path / "new" / "out"
    python = [sys.executable, "-X", "importtime"]
    command = [*python, "-m", "nuno", "pick", str(CASE), "--out", str(out), "--device", "cpu", "--candidates", "2x2"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("picked at (0, 0), confidence ") and done.stdout.count("\n") == 1
    imported, said = [], []
    for line in done.stderr.splitlines():
        (imported if line.startswith("import time:") else said).append(line)
    assert [line for line in said if " kernels of nuno." not in line] == [], "but that it waits where none are kept"
    assert any(line.endswith(" warp") for line in imported)
    assert not any(line.split("|")[-1].strip().startswith("matplotlib") for line in imported)
    check_result(json.loads((out / "result.json").read_text()), 2, 2)
    picture = cv2.imread(str(out / "result.png"))
    assert picture is not None and min(picture.shape[:2]) > 400


def check_result(result, n, m):
    """Check the fields of a result.json, and its answer."""
    assert result["format"] == 1 and result["pick"] == TRUE
    assert sorted(entry[:2] for entry in result["ranking"]) == [[i, j] for i in range(n) for j in range(m)]
    scores = [score for _, _, score in result["ranking"]]
    assert scores == sorted(scores, reverse=True) and result["ranking"][0][:2] == result["pick"]
    assert result["score_name"] == "log_evidence_with_pattern"
    assert len(result["eq1"]) == n * m and all(0.0 <= value <= 1.0 for value in result["eq1"])
    assert 0.0 <= result["confidence"] <= 1.0 and result["warnings"] == []
    cloth = result["cloth"]
    corners = np.array(cloth["corners"])
    assert corners.shape == (4, 3) and cloth["long_m"] > cloth["short_m"]
    sides = np.linalg.norm(corners[[1, 3]] - corners[0], axis=1)
    np.testing.assert_allclose(sides, (cloth["long_m"], cloth["short_m"]), rtol=1e-6)
    assert set(result["seconds"]) == {"read", "see", "compile", "imagine", "compare", "total"}


@pytest.mark.slow
def test_the_full_grid(tmp_path):
    """All 36 candidates: the answer is the point that was picked. An example has all of them, of fewer guesses."""
    assert pick(CASE, tmp_path) == 0
    check_result(json.loads((tmp_path / "result.json").read_text()), 6, 6)


def text(content):
    """Return what writes ``content`` as a case's input.json."""
    return lambda case: (case / "input.json").write_bytes(content)


def entry(**entries):
    """Return what changes entries of a case's input.json."""
    return lambda case: rewrite(case, **entries)


def image(name, content):
    """Return what writes an image (an array, or bytes) into a case."""
    encoded = content if isinstance(content, bytes) else cv2.imencode(".png", content)[1].tobytes()
    return lambda case: (case / name).write_bytes(encoded)


def camera(**entries):
    """Return what changes entries of a case's camera."""
    return lambda case: rewrite(case, camera=json.loads((case / "input.json").read_text())["camera"] | entries)


def pose(change):
    """Return what changes the matrix camera_to_world (4, 4) of a case."""

    def spoil(case):
        old = json.loads((case / "input.json").read_text())["camera"]["camera_to_world"]
        camera(camera_to_world=change(np.array(old)).tolist())(case)

    return spoil


def chunk(kind, data):
    """Return one chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


# What a PNG of 100,000 x 100,000 pixels begins with: more than OpenCV opens
HUGE = (
    b"\x89PNG\r\n\x1a\n"
    + chunk(b"IHDR", struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0))
    + chunk(b"IDAT", b"")
    + chunk(b"IEND", b"")
)
INVALID, FORMAT = "InvalidInputError", "FileFormatError"
BAD = {
    "missing folder": (shutil.rmtree, INVALID, "input.json"),
    "no input.json": (lambda case: (case / "input.json").unlink(), INVALID, "input.json"),
    "not JSON": (text(b"{oops"), FORMAT, "not JSON"),
    "no text": (text(b"\xff\xfe\x00"), FORMAT, "not JSON"),
    "a list": (text(b"[]"), FORMAT, "list"),
    "endless nesting": (text(b"[" * 100_000), FORMAT, "not JSON"),
    "endless number": (text(b'{"camera": ' + b"9" * 5000 + b"}"), FORMAT, "not JSON"),
    "missing key": (entry(hand_position_m=None), INVALID, "hand_position_m"),
    "missing camera key": (entry(camera={"width": 640}), INVALID, "height"),
    "camera reflected": (pose(lambda p: p @ np.diag([-1.0, 1.0, 1.0, 1.0])), INVALID, "reflection"),
    "camera skewed": (pose(lambda p: p + 0.1 * np.eye(4, k=1)), INVALID, "rotation"),
    "camera transposed": (pose(np.transpose), INVALID, "transposed"),
    "camera (3, 4)": (pose(lambda p: p[:3]), INVALID, "camera_to_world must have shape (4, 4)"),
    "half a pixel": (camera(width=640.5), INVALID, "width"),
    "endless pixels": (camera(width=float("inf")), INVALID, "width"),
    "focal length as text": (camera(fx="490"), INVALID, "fx"),
    "three coefficients": (camera(distortion=[0, 0, 0]), INVALID, "distortion"),
    "height as text": (entry(table_height_m="0.71"), INVALID, "table_height_m"),
    "height true": (entry(table_height_m=True), INVALID, "table_height_m"),
    "height no number": (entry(table_height_m="high"), INVALID, "table_height"),
    "hand of two": (entry(hand_position_m=[0, 1]), INVALID, "hand"),
    "hand of nan": (entry(hand_position_m=[0, 1, float("nan")]), INVALID, "finite"),
    "hand of text": (entry(hand_position_m=["0", "0", "1"]), INVALID, "hand_position_m"),
    "hand under the table": (entry(hand_position_m=[0.3, 0.1, 0.5]), INVALID, "below the table"),
    "hand behind the camera": (entry(hand_position_m=[-3.0, 0.08, 1.33]), INVALID, "behind the camera"),
    "hand out of the image": (entry(hand_position_m=[0.3, 9.0, 1.1]), INVALID, "outside"),
    "negative table": (entry(table_half_extents_xy_m=[-1, 1]), INVALID, "half_extents"),
    "one extent": (entry(table_half_extents_xy_m=[0.4]), INVALID, "table_half_extents_xy_m"),
    "the same image twice": (entry(image_after="before.png"), INVALID, "nothing was picked up"),
    "no image": (lambda case: (case / "after.png").unlink(), "ImageError", "after.png"),
    "image name too long": (entry(image_before="a" * 5000), "ImageError", "cannot be read"),
    "image name no text": (entry(image_before=3), INVALID, "image_before"),
    "unreadable image": (image("before.png", b"\x89PNG nothing"), "ImageError", "before.png"),
    "an image of 10 Gpx": (image("before.png", HUGE), "ImageError", "cannot be decoded"),
    "empty image": (image("before.png", b""), "ImageError", "before.png"),
    "wrong image size": (image("after.png", scene()[:100]), "ImageError", "(480, 640, 3)"),
    "no cloth before": (image("before.png", scene()), "ClothNotFoundError", "no cloth"),
    "no cloth after": (image("after.png", scene()), "ClothNotFoundError", "no cloth"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_case_is_status_2(name, case, tmp_path, capsys):
    """One line on standard error with the error's name and what is wrong; nothing is written."""
    spoil, error, words = BAD[name]
    spoil(case)
    assert pick(case, tmp_path / "out", "--candidates", "2x2") == 2
    check_failure(capsys.readouterr(), error, words)
    assert not (tmp_path / "out").exists()


def check_failure(said, error, words):
    """Check that nothing but one named error was said."""
    assert said.out == "" and "Traceback" not in said.err
    assert said.err.startswith(f"nuno: {error}: ") and words in said.err, said.err


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([], {"sideways": 0.5, "hand_std": 0.01}), (["--sideways", "0.25"], {"sideways": 0.25}),
        (["--sideways", "None"], {"sideways": None}), (["--hand-std", "0.03"], {"hand_std": 0.03}),
    ],
)  # fmt: skip
def test_what_is_known_of_the_hand_is_passed_on(given, expected, tmp_path, monkeypatch):
    """As the estimate takes it: 0.5 sideways and 1 cm unless given, none for any way."""
    asked = {}

    def estimate(case, **options):
        asked.update(options)
        raise EstimationError("enough")

    monkeypatch.setattr(PickCase, "estimate", estimate)
    assert pick(CASE, tmp_path / "out", *given) == 1
    assert asked.items() >= expected.items()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--sideways", "far"], "--sideways"),
        (["--sideways", "0"], "sideways"),
        (["--hand-std", "-1"], "hand_std"),
        (["--candidates", "six"], "--candidates"),
        (["--candidates", "6"], "--candidates"),
        (["--candidates", "6x-1"], "--candidates"),
        (["--candidates", "²x6"], "--candidates"),
        (["--candidates", "1x6"], "at least 2 x 2"),
        (["--candidates", "99x99"], "at most 1024"),
        (["--device", "gpu"], "device"),
        (["--device", "cuda:x"], "device"),
        (["--device", "cuda:99"], "cuda:99"),
    ],
)
def test_a_bad_option_is_status_2(options, words, tmp_path, capsys):
    """Options that mean nothing, or a device that is not there."""
    assert pick(CASE, tmp_path / "out", *options) == 2
    check_failure(capsys.readouterr(), "InvalidInputError", words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", ["", "fold", "pick", "pick x", "pick x --out y --fast"])
def test_a_bad_command_line_is_status_2(arguments, capsys):
    """A missing or unknown argument prints the usage."""
    with pytest.raises(SystemExit) as stopped:
        main(arguments.split())
    assert stopped.value.code == 2 and "usage: nuno" in capsys.readouterr().err


@pytest.mark.parametrize("out", ["file", "file/below", "link", "", "a\0b"])
def test_a_folder_that_cannot_be_made_is_status_2(out, tmp_path, capsys):
    """A file in the way, a link to nowhere, a name that is none; that shows before the work is done."""
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    assert main(["pick", str(CASE), "--out", out and f"{tmp_path}/{out}"]) == 2
    check_failure(capsys.readouterr(), "InvalidInputError", "--out")


def test_a_folder_that_may_not_be_written_to_is_status_2(tmp_path, capsys, monkeypatch):
    """Where nothing can be written, as on a disk that is read only; that shows before the work is done."""

    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("nuno.files.out_folder.tempfile.TemporaryFile", refuse)
    assert pick(CASE, tmp_path / "out") == 2
    check_failure(capsys.readouterr(), "InvalidInputError", "Permission denied")


def test_a_byte_order_mark_is_read_over(case):
    """Some editors begin a file with one."""
    path = case / "input.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_case(case).table_height > 0.0


def test_only_warps_line_about_the_driver_is_kept_back(capfd):
    """What else is written to standard error meanwhile comes through, also from a library's own code."""
    with without_lines(b"Warp CUDA warning"):
        os.write(2, b"one\nWarp CUDA warning: no driver\n")
        os.write(2, b"two\n")
    os.write(2, b"three\n")
    assert capfd.readouterr().err == "one\ntwo\nthree\n"


def test_a_round_cloth_is_status_1_where_a_rectangle_is_asked_for(case, tmp_path, capsys):
    """Valid input without an answer: what lies on the table is no rectangle."""
    cv2.imwrite(str(case / "before.png"), scene(radius=90))
    assert pick(case, tmp_path / "out", "--shape", "rectangle") == 1
    check_failure(capsys.readouterr(), "EstimationError", "not a rectangle")


def test_in_a_process_of_its_own_without_a_traceback(tmp_path):
    """The statuses reach the shell."""
    nothing, out = str(tmp_path / "nothing"), str(tmp_path / "out")
    command = [sys.executable, "-m", "nuno", "pick", nothing, "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 2 and done.stdout == ""
    assert "InvalidInputError" in done.stderr and "Traceback" not in done.stderr
