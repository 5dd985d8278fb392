"""The command: an answer from the bundled case, and for every bad input its status and a named error."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from nuno.__main__ import main

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
    """``python -m nuno pick`` in a process of its own: status 0, one line, result.json and result.png."""
    out = tmp_path / "new" / "out"
    command = [sys.executable, "-m", "nuno", "pick", str(CASE), "--out", str(out), "--device", "cpu"]
    done = subprocess.run([*command, "--candidates", "2x2"], capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("picked at (0, 0), confidence ") and done.stdout.count("\n") == 1
    assert "Traceback" not in done.stderr
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
    assert set(result["seconds"]) == {"read", "see", "imagine", "compare", "total"}


def test_the_full_grid(tmp_path):
    """All 36 candidates: the answer is the point that was picked."""
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


INVALID, FORMAT = "InvalidInputError", "FileFormatError"
BAD = {
    "missing folder": (shutil.rmtree, INVALID, "input.json"),
    "no input.json": (lambda case: (case / "input.json").unlink(), INVALID, "input.json"),
    "not JSON": (text(b"{oops"), FORMAT, "not JSON"),
    "no text": (text(b"\xff\xfe\x00"), FORMAT, "not JSON"),
    "a list": (text(b"[]"), FORMAT, "list"),
    "missing key": (entry(hand_position_m=None), INVALID, "hand_position_m"),
    "missing camera key": (entry(camera={"width": 640}), INVALID, "height"),
    "height no number": (entry(table_height_m="high"), INVALID, "table_height"),
    "hand of two": (entry(hand_position_m=[0, 1]), INVALID, "hand"),
    "hand of nan": (entry(hand_position_m=[0, 1, float("nan")]), INVALID, "finite"),
    "hand behind the camera": (entry(hand_position_m=[-3.0, 0.08, 1.33]), INVALID, "behind the camera"),
    "hand out of the image": (entry(hand_position_m=[0.3, 9.0, 1.1]), INVALID, "outside"),
    "negative table": (entry(table_half_extents_xy_m=[-1, 1]), INVALID, "half_extents"),
    "no image": (lambda case: (case / "after.png").unlink(), "ImageError", "after.png"),
    "image name no text": (entry(image_before=3), INVALID, "image_before"),
    "unreadable image": (image("before.png", b"\x89PNG nothing"), "ImageError", "before.png"),
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
    assert pick(case, tmp_path / "out") == 2
    check_failure(capsys.readouterr(), error, words)
    assert not (tmp_path / "out").exists()


def check_failure(said, error, words):
    """Check that nothing but one named error was said."""
    assert said.out == "" and "Traceback" not in said.err
    assert said.err.startswith(f"nuno: {error}: ") and words in said.err, said.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--candidates", "six"], "--candidates"),
        (["--candidates", "6"], "--candidates"),
        (["--candidates", "6x-1"], "--candidates"),
        (["--candidates", "²x6"], "--candidates"),
        (["--candidates", "1x6"], "at least 2 x 2"),
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


def test_a_file_in_the_way_is_status_2(tmp_path, capsys):
    """The folder for the results cannot be made; that shows before the work is done."""
    (tmp_path / "out").write_text("")
    assert pick(CASE, tmp_path / "out") == 2
    check_failure(capsys.readouterr(), "InvalidInputError", "--out")


def test_a_round_cloth_is_status_1(case, tmp_path, capsys):
    """Valid input without an answer: what lies on the table is no rectangle."""
    cv2.imwrite(str(case / "before.png"), scene(radius=90))
    assert pick(case, tmp_path / "out") == 1
    check_failure(capsys.readouterr(), "EstimationError", "not a rectangle")


def test_in_a_process_of_its_own_without_a_traceback(tmp_path):
    """The statuses reach the shell."""
    nothing, out = str(tmp_path / "nothing"), str(tmp_path / "out")
    command = [sys.executable, "-m", "nuno", "pick", nothing, "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 2 and done.stdout == ""
    assert "InvalidInputError" in done.stderr and "Traceback" not in done.stderr
