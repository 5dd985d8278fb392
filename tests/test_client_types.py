"""Programs of users pass ``mypy --strict`` by the types that the package brings (py.typed), and run."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import nuno

PROGRAMS = Path(__file__).parent / "client_programs"
SOURCE = Path(nuno.__file__).parents[1]


def check(tmp_path, *programs):
    """Return mypy's answer about programs that lie outside the project."""
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file", os.devnull]
    command += ["--cache-dir", str(tmp_path / "cache"), *map(str, programs)]
    environment = os.environ | {"MYPYPATH": str(SOURCE)}
    return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)


@pytest.mark.long
def test_client_programs_pass_mypy_strict(tmp_path):
    """No error in any of them; a program with a wrong argument has one, so that the check can fail."""
    pytest.importorskip("mypy")
    wrong = tmp_path / "wrong.py"
    wrong.write_text('import nuno\n\nnuno.Path(["now"], 3, interpolate="linear")\n', encoding="utf-8")
    answer = check(tmp_path, *sorted(PROGRAMS.glob("*.py")), wrong)
    lines = answer.stdout.splitlines()
    assert [line for line in lines if "error" in line and not line.startswith(("wrong.py", "Found"))] == []
    assert any(line.startswith("wrong.py:3: error") and "interpolate" in line for line in lines)


@pytest.mark.parametrize("name", ["first_world", "imagine_and_choose"])
def test_client_programs_run(name):
    """What type checks also runs."""
    runpy.run_path(str(PROGRAMS / f"{name}.py"))["main"]()
