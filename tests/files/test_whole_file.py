"""Files that appear whole or not at all."""

import os
import signal
import subprocess
import sys

import pytest

from nuno.errors import FileWriteError
from nuno.files.whole_file import made_folder, replacing, write_figure, write_whole


def test_takes_the_place_of_the_old_file(tmp_path):
    """While it is written the old file is there; then the new one is, alone."""
    path = tmp_path / "note.txt"
    path.write_text("old")
    with replacing(path) as partial:
        partial.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_a_failure_leaves_the_old_file(tmp_path):
    """What is written half is thrown away."""
    path = tmp_path / "note.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as partial:
        partial.write_text("ne")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_what_a_killed_process_left_is_removed(tmp_path):
    """Of this machine's processes that are no more; not of those that write still, nor of another machine's."""
    path = tmp_path / "note.txt"
    program = (
        "import os, signal, sys\n"
        "from nuno.files.whole_file import replacing\n"
        "with replacing(sys.argv[1]) as partial:\n"
        "    partial.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", program, str(path)], check=False).returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    assert left.read_text() == "half"
    dead = left.name.split("-")[-2]
    others = [
        left.with_name(left.name.replace(f"-{dead}-", f"-{os.getpid()}-")),
        tmp_path / ".note.txt.elsewhere-1-00000000.partial",
    ]
    for other in others:
        other.write_text("at work")
    write_whole(path, "new")
    assert sorted(tmp_path.iterdir()) == sorted([path, *others])


def test_folders_and_figures(tmp_path):
    """A folder in a file's place, and the other way round, are named."""
    (tmp_path / "file").write_text("")
    with pytest.raises(FileWriteError, match="in the place of its folder"):
        made_folder(tmp_path / "file" / "folder")
    with pytest.raises(FileWriteError, match="a folder is in its place"):
        write_whole(made_folder(tmp_path / "a" / "b"), "text")
    from matplotlib.figure import Figure

    write_figure(tmp_path / "a" / "plot.png", Figure((1, 1)))
    assert (tmp_path / "a" / "plot.png").read_bytes().startswith(b"\x89PNG")
    assert not list((tmp_path / "a" / "b").iterdir())
