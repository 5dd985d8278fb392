"""One saved world on several engines: where they agree by a closed form, what is told of those that cannot run it."""

import json

import numpy as np
import pytest

import nuno
from nuno.__main__ import main

pytest.importorskip("mujoco")
GRAVITY = 9.81  # [m/s2]


def saved(path=None, friction=0.3):
    """Return a saved world in which a box slides down an incline of 30 degrees and a ball falls."""
    world = nuno.World(device="cpu")
    slope = np.radians(30.0)
    world.add(nuno.box((2.0, 0.6, 0.1), name="ramp", friction=friction).rotate(slope, "y"))
    normal, down = np.array([np.sin(slope), 0, np.cos(slope)]), np.array([np.cos(slope), 0, -np.sin(slope)])
    box = nuno.box((0.1, 0.1, 0.04), name="box", position=0.07 * normal - 0.5 * down)
    world.attach(world.add(box.rotate(slope, "y")), nuno.Rigid(friction=friction))
    world.attach(world.add(nuno.sphere(0.05, name="ball", position=(0, 1, 2))))
    return world.save(path)


def test_engines_agree_where_a_closed_form_says_so():
    """A ball falls by g t^2 / 2 on either, and their boxes slide by as much within 3 % of the way."""
    found = nuno.compare_engines(saved(), ("nuno", "mujoco"), 0.4)
    assert found.engines == ("nuno", "mujoco") and found.moving == ("box", "ball") and not found.failures
    for engine in found.engines:
        ball = found.recordings[engine]["ball"].vertices
        # an explicit step of dt falls by g t dt / 2 too far or too short, with steps of at most 4 ms by 8 mm
        assert (ball[0] - ball[-1])[:, 2] == pytest.approx(0.5 * GRAVITY * 0.16, abs=0.008)
    last = [row for row in found.differences() if row["body"] == "box"][-1]
    way = 0.5 * GRAVITY * (np.sin(np.radians(30)) - 0.3 * np.cos(np.radians(30))) * 0.16
    assert last["time"] == pytest.approx(0.4) and last["centre"] < 0.03 * way + 0.008  # the steps' error besides
    first = [row for row in found.differences() if row["time"] == 0.0]
    assert all(row["largest"] < 1e-6 for row in first), "they begin in the same place, to a float's digits"
    film = found.film()
    assert [text for text, _, _ in film.labels] == ["nuno", "mujoco"]
    left, right = (np.array(at) for _, at, _ in film.labels)
    # the ramp is what is widest: columns are 1.25 of its 2 m cos 30 deg + 0.1 m sin 30 deg apart
    assert right[0] - left[0] == pytest.approx(1.25 * (2.0 * np.cos(np.radians(30)) + 0.05), abs=1e-3)
    assert min(left[2], right[2]) > 2.05, "above the ball, where that begins"


def test_the_command_writes_a_film_and_the_differences(tmp_path, capsys):
    """Nuno compare SCENE: a table on standard output, film.html, differences.json and differences.txt."""
    saved(tmp_path / "scene.npz")
    out = tmp_path / "out"
    status = main(
        ["compare", str(tmp_path / "scene.npz"), "--engines", "nuno", "mujoco", "--seconds", "0.1", "--out", str(out)]
    )
    assert status == 0
    text = capsys.readouterr().out
    assert "box: mujoco from nuno / mm" in text and "CPU seconds: nuno" in text
    content = json.loads((out / "differences.json").read_text())
    assert content["engines"] == ["nuno", "mujoco"] and content["failures"] == {}
    assert {row["body"] for row in content["differences"]} == {"box", "ball"}
    assert "nuno | mujoco" in (out / "film.html").read_text(encoding="utf-8")
    assert (out / "differences.txt").read_text().startswith("t / s")


def test_an_engine_that_cannot_is_left_out_and_told(monkeypatch):
    """What is not installed is named, and the others are compared all the same."""
    import nuno.engines.newton.newton_engine as module

    monkeypatch.setattr(module, "find_spec", lambda name: None)
    found = nuno.compare_engines(saved(), ("nuno", "mujoco", "newton"), 0.1)
    assert found.engines == ("nuno", "mujoco")
    assert "newton" in found.failures["newton"] and "not installed" in found.failures["newton"]
    assert "newton did not run" in found.table(2)
    with pytest.raises(nuno.MissingPackageError, match="newton"):
        nuno.compare_engines(saved(), ("nuno", "newton"), 0.1)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"engines": ("nuno",)}, nuno.InvalidInputError, "two or more"),
        ({"engines": ("nuno", "ode")}, nuno.UnknownNameError, "ode"),
        ({"seconds": 0.0}, nuno.InvalidInputError, "seconds"),
        ({"seconds": 1e38}, nuno.InvalidInputError, "too many"),
        ({"scene": "nowhere.npz"}, nuno.FileFormatError, "nowhere"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, error, words):
    """Before anything runs."""
    with pytest.raises(error, match=words):
        nuno.compare_engines(**{"scene": saved(), "engines": ("nuno", "mujoco"), "seconds": 0.1} | arguments)


def test_what_cannot_be_compared_is_refused():
    """A batch has no one place for a body; a world in which nothing moves has no differences."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 1)))
    with pytest.raises(nuno.InvalidInputError, match="dynamic"):
        nuno.compare_engines(world.save(), ("nuno", "mujoco"))
    with pytest.raises(nuno.InvalidInputError, match="batch of 2"):
        nuno.compare_engines(world.imagine(2).save(), ("nuno", "mujoco"))
