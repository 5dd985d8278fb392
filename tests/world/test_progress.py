"""Bars and clocks on standard error: where they were asked for, and nowhere else."""

import time

from nuno.world import progress
from nuno.world.progress import with_bar, with_clock


def test_a_bar_counts(capsys):
    """What is gone through comes out, and is counted where a bar was asked for."""
    assert list(with_bar([1, 2, 3], "counting", True)) == [1, 2, 3]
    assert "counting" in capsys.readouterr().err
    assert list(with_bar([1, 2, 3], "counting", False)) == [1, 2, 3]
    assert list(with_bar([1, 2, 3], "counting", None)) == [1, 2, 3]  # no terminal here
    assert capsys.readouterr().err == ""


def test_a_clock_tells_what_is_waited_for(capsys, monkeypatch):
    """It shows after a while, where it was asked for."""
    monkeypatch.setattr(progress, "SHOWN_AFTER", 0.05)
    said = ""
    with with_clock("compiling", True):
        while "compiling: 0" not in said:
            time.sleep(0.01)
            said += capsys.readouterr().err
    capsys.readouterr()
    for asked in (False, None):  # there is no terminal here
        with with_clock("compiling", asked):
            time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_what_is_quick_shows_no_clock(capsys):
    """Nothing is said of what is done at once, and errors pass."""
    try:
        with with_clock("compiling", True):
            raise KeyError("no")
    except KeyError:
        pass
    assert capsys.readouterr().err == ""
