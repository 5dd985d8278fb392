"""Files that appear whole or not at all."""

import pytest

from nuno.files.whole_file import replacing


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
