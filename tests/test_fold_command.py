"""The fold command: an answer from the bundled case, and for every bad input its status and a named error."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import nuno
from nuno.__main__ import main

CASE = Path(__file__).parents[1] / "examples" / "fold-case"


@pytest.fixture
def case(tmp_path):
    """A copy of the bundled case to spoil."""
    return shutil.copytree(CASE, tmp_path / "case")


def fold(case, out, *options):
    """Run the command in this process; return its status."""
    return main(["fold", str(case), "--out", str(out), "--device", "cpu", "--no-progress", *options])


@pytest.mark.long
def test_the_bundled_case_end_to_end(tmp_path):
    """``python -m nuno fold`` in a process of its own: status 0, one line, and every file that is promised."""
    out = tmp_path / "new" / "out"
    command = [sys.executable, "-m", "nuno", "fold", str(CASE), "--out", str(out), "--device", "cpu"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("replayed 113 frames as ") and done.stdout.count("\n") == 1
    assert "Traceback" not in done.stderr
    frames = json.loads((CASE / "input.json").read_text())["frames"]
    named = sorted(frame["rgb"][4:7] for frame in frames if "rgb" in frame)
    assert sorted(path.name for path in out.glob("mask_*.png")) == [f"mask_{name}.png" for name in named]
    for path in out.glob("mask_*.png"):
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert mask.shape == (240, 320) and set(np.unique(mask)) == {0, 255}
    final = np.load(out / "final.npz")
    assert final["vertices"].shape[1:] == (3,) and final["faces"].max() < len(final["vertices"])
    result = json.loads((out / "result.json").read_text())
    assert result["format"] == 1 and result["warnings"] == []
    assert set(result["seconds"]) == {"read", "see", "compile", "imagine", "segment", "compare", "total"}
    assert result["material"]["name"] in result["scores"] and len(result["frames"]) == 113
    # against the cloth as it is found in the images, which is itself right to 0.98
    assert result["agreement"]["mean"] > 0.93 and result["agreement"]["last"] > 0.95
    assert result["layers"]["most"] >= 2
    replay = nuno.Recording.load(out / "replay.npz")
    assert len(replay) == 113 and {body.name for body in replay.bodies} == {"cloth", "hands", "table"}
    np.testing.assert_array_equal(replay["cloth"].vertices[-1], final["vertices"])
    for name in ("replay.glb", "strip.png", "layers.png", "hands.png"):
        assert (out / name).stat().st_size > 1000


def change(edit):
    """Return what edits a case's input.json."""

    def spoil(case):
        path = case / "input.json"
        data = json.loads(path.read_text())
        edit(data)
        path.write_text(json.dumps(data))

    return spoil


def every(**entries):
    """Return what sets entries of every frame."""
    return change(lambda data: [frame.update(entries) for frame in data["frames"]])


def lift(data):
    """Raise the hands by half a metre."""
    for frame in data["frames"]:
        frame["hands_m"] = [[x, y, z + 0.5] for x, y, z in frame["hands_m"]]


def blank(case):
    """Make the first image one of a bare table."""
    noise = np.random.default_rng(0).normal(120.0, 3.0, (240, 320, 3))
    cv2.imwrite(str(case / "rgb_000.jpg"), noise.clip(0, 255).astype(np.uint8))


INVALID, IMAGE = "InvalidInputError", "ImageError"
BAD = {
    "missing folder": (shutil.rmtree, INVALID, "input.json"),
    "not JSON": (lambda case: (case / "input.json").write_text("{"), "FileFormatError", "not JSON"),
    "no frames": (change(lambda data: data.pop("frames")), INVALID, "frames"),
    "one frame": (change(lambda data: data.update(frames=data["frames"][:1])), INVALID, "two or more"),
    "no hands": (change(lambda data: data["frames"][7].pop("hands_m")), INVALID, "frame 7"),
    "hands of two numbers": (every(hands_m=[[0.0, 0.0]]), INVALID, "hands_m"),
    "hands that come and go": (change(lambda data: data["frames"][7]["hands_m"].pop()), INVALID, "hands_m"),
    "NaN": (change(lambda data: data["frames"][7]["hands_m"][0].__setitem__(1, float("nan"))), INVALID, "frame 7"),
    "times": (change(lambda data: data["frames"][7].update(t=0.0)), INVALID, "increase"),
    "held": (change(lambda data: data["frames"][7].update(held=3)), INVALID, "held of frame 7"),
    "held as text": (change(lambda data: data["frames"][7].update(held="true")), INVALID, "held of frame 7"),
    "hands as text": (every(hands_m=[["0", "0", "1"]]), INVALID, "hands_m"),
    "a time as text": (change(lambda data: data["frames"][7].update(t="0.3")), INVALID, "t of the frames"),
    "times in milliseconds": (
        change(lambda data: [frame.update(t=1000 * frame["t"]) for frame in data["frames"]]),
        INVALID,
        "seconds",
    ),
    "an image's name no text": (change(lambda data: data["frames"][7].update(rgb=3)), INVALID, "rgb of frame 7"),
    "table as text": (change(lambda data: data.update(table_height_m="0.74")), INVALID, "table_height_m"),
    "never held": (every(held=False), INVALID, "held is never true"),
    "hands that never touch": (change(lift), INVALID, "never touch the cloth"),
    "no first image": (change(lambda data: data["frames"][0].pop("rgb")), INVALID, "first frame"),
    "missing image": (lambda case: (case / "rgb_009.jpg").unlink(), IMAGE, "rgb_009.jpg"),
    "unreadable image": (lambda case: (case / "rgb_009.jpg").write_bytes(b"\xff\xd8 no"), IMAGE, "rgb_009.jpg"),
    "no cloth": (blank, "ClothNotFoundError", "no cloth"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_case_is_status_2(name, case, tmp_path, capsys):
    """One line on standard error with the error's name and what is wrong; nothing is written."""
    spoil, error, words = BAD[name]
    spoil(case)
    assert fold(case, tmp_path / "out") == 2
    said = capsys.readouterr()
    assert said.out == "" and "Traceback" not in said.err
    assert said.err.startswith(f"nuno: {error}: ") and words in said.err, said.err
    assert not (tmp_path / "out").exists()


def test_a_round_cloth_is_status_1(case, tmp_path, capsys):
    """Valid input without an answer: what lies on the table is no rectangle."""
    noise = np.random.default_rng(0).normal(120.0, 3.0, (240, 320, 3)).clip(0, 255).astype(np.uint8)
    cv2.circle(noise, (160, 150), 45, (40, 40, 200), -1)
    cv2.imwrite(str(case / "rgb_000.jpg"), noise)
    assert fold(case, tmp_path / "out") == 1
    assert capsys.readouterr().err.startswith("nuno: EstimationError: ")


def test_a_file_in_the_way_is_status_2(tmp_path, capsys):
    """The folder for the results cannot be made; that shows before the work is done."""
    (tmp_path / "out").write_text("")
    assert fold(CASE, tmp_path / "out") == 2
    assert "--out" in capsys.readouterr().err
