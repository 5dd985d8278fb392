"""Every example runs headless and passes its own check."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(path, tmp_path):
    """In a process of its own, in an empty folder, without a display."""
    headless = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    command = [sys.executable, str(path)]
    done = subprocess.run(command, cwd=tmp_path, env=headless, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not list(tmp_path.iterdir()), "an example leaves nothing behind that was not asked for"


def test_there_are_examples():
    """The folder was found."""
    assert len(EXAMPLES) >= 4
